"""Offsets between receivers on different base stations, and the distances between antennas.

Each pair of receivers moves as a rigid rod, so the differences of their recorded positions lie
on a sphere: its centre is the difference of the two offsets, its radius the distance of the
antennas (Blanco 2009, Eq. 6-9). The spheres of all pairs are fitted together, in closed form:
no start value is needed. Noise in the differences would pretend to be rotation of the vehicle;
its known part is taken out of the equations, so that what the drive does not determine shows as
undetermined and not as a wrong number with a small sigma.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from rtk_gt.offsets.equations import (
    Equations,
    Normal,
    equations_of,
    normal_of,
    residuals_at,
    signal_of,
)
from rtk_gt.offsets.moments import Geometry, posterior_moments
from rtk_gt.offsets.prior import OffsetPrior, posterior
from rtk_gt.offsets.robust import (
    autocorrelation_time,
    expected_weighted_square,
    redescending_weights,
)
from rtk_gt.offsets.slow_errors import ErrorModel, summed_covariance
from rtk_gt.receivers.assumptions import ETA, FEWEST_STEPS
from rtk_gt.receivers.steps import Steps, pair_differences, receiver_pairs
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.earth_frames import FrameVectors
from validation.shown import Shown

Bent = Literal["always", "if sure", "never"]
_ROUNDS = 40
"""At most: a judgement."""
BENDS = 0.25
"""Share of the narrowest sigma from which on a bend counts: at three sigmas of the widest direction
it is nine times as large, two of the narrowest."""
_ROUGH_SIGMA = 0.01
"""Before the residuals say how large the noise is, in metres: what makers state of RTK."""
OPEN = 0.3
"""Metres of sigma above which distances are open, and of distances below which they are noise."""
SMALLEST_SIGMA = 1e-6
"""Data without noise are weighted as if they had this much, metres: far below any receiver."""


@dataclass(frozen=True, repr=False)
class Offsets(Shown):
    """Offsets and distances with what is known of them.

    Parameters
    ----------
    receivers : tuple of str
        r names; the first has offset 0 by definition.
    offsets : FrameVectors
        (r, 3) to be added to the recorded positions, metres.
    distances : (p,) array
        Between the antennas of each pair, metres, in the order of `receiver_pairs`.
    covariance : (3 (r - 1) + p, 3 (r - 1) + p) array
        Of the offsets of all but the first receiver, then the distances, m^2.
    sigma : float
        sigma_0: horizontal standard deviation of one receiver, from the residuals, metres.
    eta : float
        Ratio of vertical to horizontal sigma that was assumed.
    weights : (t,) array
        Weight of each step, 1 unless it was taken as false.
    residuals : (t, p) array
        Distance minus the constant one of each step and pair, metres.
    signal : (3 (r - 1),) array
        Information of the drive alone on the directions, 1/m^2; 0 where it is none.
    directions : (3 (r - 1), 3 (r - 1)) array
        Those directions in the space of the offsets, one a column.
    correlation_time : float
        How many steps one independent step is worth.
    steps : int
        Number of steps used.
    squares : (t,) array
        Squared residuals of each step's distances, normalised for a sigma_0 of 1 m, in m^2.
    against : float
        What is known beforehand against the offsets and distances: squared normalised differences.
    """

    receivers: tuple[str, ...]
    offsets: FrameVectors
    distances: Array
    covariance: Array
    sigma: float
    eta: float
    weights: Array
    residuals: Array
    signal: Array
    directions: Array
    correlation_time: float
    steps: int
    squares: Array
    against: float

    @property
    def offset_covariance(self) -> Array:
        """Covariance of the offsets of all receivers but the first, m^2."""
        k = 3 * (len(self.receivers) - 1)
        return self.covariance[:k, :k]

    @property
    def offset_sigmas(self) -> Array:
        """(r, 3) standard deviations of the offsets, metres; 0 for the first."""
        sigmas = np.sqrt(np.diagonal(self.offset_covariance)).reshape(-1, 3)
        return np.vstack([np.zeros(3), sigmas])

    @property
    def known(self) -> bool:
        """Whether the antennas are seen: apart, at distances that are not open."""
        return bool(self.distance_sigmas.max() < OPEN and self.distances.min() > OPEN)

    @property
    def distance_sigmas(self) -> Array:
        """(p,) standard deviations of the distances, metres."""
        k = 3 * (len(self.receivers) - 1)
        return np.sqrt(np.diagonal(self.covariance)[k:])


def estimate_offsets(
    steps: Steps,
    *,
    eta: float = ETA,
    robust: bool = True,
    prior: OffsetPrior | None = None,
    start: Array | None = None,
    bent: Bent = "always",
    model: ErrorModel | None = None,
) -> Offsets:
    """Offsets and distances from the steps at which all receivers are RTK-fixed.

    Parameters
    ----------
    steps : Steps
        As recorded, without offsets added.
    eta : float
        Ratio of the vertical to the horizontal sigma of a position.
    robust : bool
        Take out steps that the others contradict (false fixes).
    prior : OffsetPrior, optional
        What is known beforehand. Without it the only knowledge is that all antennas are on one
        vehicle; directions that the drive does not determine then have sigmas of metres.
    start : (r, 3) array, optional
        Offsets to begin with: the nearest minimum is found (`minima` tries many). Without it the
        closed form finds the one of a drive that turns.
    bent : {"always", "if sure", "never"}
        Sample what is possible where distances bend it; only where the sample is large enough; or
        not, for a quick look.
    model : ErrorModel, optional
        White and slow errors of the receivers, for the covariance; without it errors are white, or
        as correlated as the residuals seem.

    Raises
    ------
    GtvalError
        If there are fewer than two receivers or ten complete steps.

    Notes
    -----
    With D the recorded difference of a pair, c the difference of its offsets and d its
    distance, |D - c| = d is linear in (c, kappa) as |D|^2 / 2 = c D + kappa with
    kappa = (d^2 - |c|^2) / 2. Weights are those of the first-order covariance of all pairs
    together; the moments are freed from the noise covariance (adjusted least squares: Kukush,
    Markovsky and Van Huffel 2004). Covariances are of the sandwich form, with the model's memory or
    times the autocorrelation time of the residuals.
    """
    used = steps.select(steps.complete)
    if len(used.receivers) < 2:
        raise GtvalError("offsets are between receivers: at least two are needed")
    if len(used) < FEWEST_STEPS:
        raise GtvalError(
            f"all receivers are RTK-fixed together at {len(used)} times only; at least "
            f"{FEWEST_STEPS} are needed to find their offsets"
        )
    # Work near zero: recorded differences may be hundreds of metres, antennas are metres apart.
    shift = np.median(used.positions[:, :1] - used.positions, axis=0)
    prior = prior or OffsetPrior()
    equations = equations_of(used.positions + shift, eta)
    begin = None if start is None else (start - start[0] - shift)[1:].ravel()
    timed = None if model is None else (used.times, model)
    estimate = _iterate(equations, prior.shifted(shift), begin, timed, robust=robust, bent=bent)
    mean, covariance, distances, signal, directions, sigma, weights, tau, costs = estimate
    offsets = shift + np.vstack([np.zeros(3), mean.reshape(-1, 3)])
    corrected = pair_differences(used.positions + offsets)
    return Offsets(
        receivers=used.receivers,
        offsets=FrameVectors(used.frame, offsets),
        distances=distances,
        covariance=covariance,
        sigma=sigma,
        eta=eta,
        weights=weights,
        residuals=np.linalg.norm(corrected, axis=-1) - distances,
        signal=signal,
        directions=directions,
        correlation_time=tau,
        steps=len(used),
        squares=costs[0],
        against=costs[1],
    )


def _iterate(
    equations: Equations,
    prior: OffsetPrior,
    start: Array | None,
    timed: tuple[Array, ErrorModel] | None,
    *,
    robust: bool,
    bent: Bent,
) -> tuple[Array, Array, Array, Array, Array, float, Array, float, tuple[Array, float]]:
    """Offsets, joint covariance, distances, signal, directions, sigma_0, weights, tau, costs."""
    t, p, m = equations.design.shape
    weights, sigma, offsets = np.ones(t), 0.0, np.zeros(m)
    whitening = np.eye(p) / _ROUGH_SIGMA**2
    if start is not None:
        offsets = start
        kappa = (equations.a - equations.design @ start).mean(0)
        there = residuals_at(equations, equations.a, (start, kappa), weights, robust=robust)
        sigma = max(there.sigma, SMALLEST_SIGMA)
        whitening = there.weight / sigma**2
    least = 1.0 if timed is None else timed[1].worth(timed[0])
    tau, widen = least, 8.0 if robust else 1.0
    for _ in range(_ROUNDS):
        before = offsets
        normal = normal_of(equations, weights, whitening, sigma)
        signal, directions, score_free = signal_of(normal, t / tau)
        offsets, curvature, prior_part, against = posterior(
            (signal, directions, score_free), normal.kappa_of, equations.signs, prior,
            prior.of_offsets(normal.mean, start), None if start is None else before,
        )  # fmt: skip
        kappa = normal.kappa_of(offsets)
        found = residuals_at(equations, normal.a, (offsets, kappa), weights, robust=robust)
        squares, dof = found.squares, found.dof
        floor = max(found.sigma, SMALLEST_SIGMA)
        whitening = found.weight / floor**2
        if robust:
            weights = redescending_weights(squares / floor**2, dof, widen)
        settled = np.abs(offsets - before).max() < 1e-6 and abs(found.sigma - sigma) < 1e-3 * floor
        sigma = found.sigma
        if widen == 1.0:
            tau = max(autocorrelation_time(found.residual * weights[:, None]), least)
            if settled:
                break
        widen = max(widen / 2, 1.0)
    # What was fitted takes its share of the scatter, like n - 1 in a sample's variance.
    total = dof * weights.sum()
    fitted = dof + np.count_nonzero(signal)
    loss = float(total / max(total - fitted, 1.0))
    sigma = float(np.sqrt(weights @ squares / total * loss))
    if robust:
        sigma /= np.sqrt(expected_weighted_square(dof))
    if timed is not None:
        sigma = timed[1].sigma
    covariance, distances, meat = _covariance(
        equations, normal, weights, (found.rods, max(sigma, SMALLEST_SIGMA)), whitening,
        (offsets, kappa, found.centres), (signal, directions, curvature, prior_part), tau, timed,
    )  # fmt: skip
    if (
        bent != "never"
        and len(prior.heights)
        and (
            np.isfinite(prior.distances).any() or not signal.all() or _bends(covariance, distances)
        )
    ):
        drive = _information((signal, directions, score_free), meat)
        belief = prior.of_offsets(normal.mean, start)
        offsets, distances, covariance = _bent(
            (offsets, distances, covariance), drive, belief, prior, normal, equations.signs,
            blunt=bent == "always",
        )  # fmt: skip
    costs = squares, against
    return offsets, covariance, distances, signal, directions, sigma, weights, tau, costs


def _covariance(
    equations: Equations,
    normal: Normal,
    weights: Array,
    noise: tuple[Array, float],
    W: Array,
    place: tuple[Array, Array, Array],
    curvature: tuple[Array, Array, Array, Array],
    tau: float,
    timed: tuple[Array, ErrorModel] | None,
) -> tuple[Array, Array, Array]:
    """Covariance of (offsets, distances), the distances, and what the drive's scores vary by.

    Of the sandwich form: weights are those of the average step, its noise is that of each step.
    The scatter of the scores themselves would be the more tolerant filling, but five receivers
    have 22 unknowns, and a covariance of 22 numbers from a hundred steps is too small along some
    of their combinations.
    """
    _, kappa, centres = place
    signal, directions, hessian, prior_part = curvature
    elimination = np.linalg.solve(normal.kappa, normal.cross.T)
    rods, sigma = noise
    design = equations.design - elimination
    known = directions * (signal > 0)
    projector = known @ directions.T
    both = _score_covariance(equations, rods, weights, W, design, (sigma, tau, timed))
    m = design.shape[2]
    meat = projector @ both[:m, :m] @ projector.T
    inverse = np.linalg.inv(hessian)
    offsets_cov = inverse @ (meat + prior_part) @ inverse
    kappa_inverse = np.linalg.inv(normal.kappa)
    kappa_cov = kappa_inverse @ both[m:, m:] @ kappa_inverse
    between = inverse @ projector @ both[:m, m:] @ kappa_inverse
    # What the squares of noise lift |D|^2 by is known as well as sigma_0 is.
    lift = np.diagonal(equations.shared) * np.trace(equations.unit) / 2 * sigma**2
    kappa_cov = kappa_cov + np.outer(lift, lift) * tau * 2 / (weights.sum() * min(3, len(kappa)))
    distances = np.sqrt(np.maximum(2 * kappa + np.square(centres).sum(1), 1e-12))
    toward = -(equations.signs[:, :, None] * centres[:, None, :]).reshape(len(kappa), -1)
    slope = (toward - elimination) / distances[:, None]
    own = kappa_cov / np.outer(distances, distances)
    # Antennas in one plane leave a combination of distances to the second order.
    pairs = (
        np.kron(equations.signs, np.eye(3)) @ offsets_cov @ np.kron(equations.signs.T, np.eye(3))
    )
    blocks = pairs.reshape(len(kappa), 3, len(kappa), 3)
    second = np.einsum("paqb,paqb->pq", blocks, blocks) / 2
    own = own + second / np.outer(distances, distances)
    between = between / distances
    cross = offsets_cov @ slope.T + between
    twice = slope @ between
    joint = np.block(
        [[offsets_cov, cross], [cross.T, slope @ offsets_cov @ slope.T + own + twice + twice.T]]
    )
    return joint, distances, meat


def _score_covariance(
    equations: Equations,
    rods: Array,
    weights: Array,
    W: Array,
    design: Array,
    noise: tuple[float, float, tuple[Array, ErrorModel] | None],
) -> Array:
    """Covariance (m + p, m + p) of the summed scores of the offsets and of the constants."""
    sigma, tau, timed = noise
    m, p = design.shape[2], len(W)
    white = tau * sigma**2 if timed is None else timed[1].white ** 2
    spread = equations.shared * (rods @ equations.unit @ np.swapaxes(rods, 1, 2))
    # What the scores W r of each step vary by.
    filling = (white * weights**2)[:, None, None] * (W @ spread @ W)
    found = np.zeros((m + p, m + p))
    found[:m, :m] = np.tensordot(design, filling @ design, ((0, 1), (0, 1)))
    found[m:, m:] = filling.sum(0)
    if timed is None:
        return found
    incidence = equations.incidence
    errors = incidence[None, :, :, None] * (rods @ np.sqrt(equations.unit))[:, :, None, :]
    scored = weights[:, None, None] * (W @ errors.reshape(len(rods), p, -1))
    scores = np.concatenate([np.swapaxes(design, 1, 2) @ scored, scored], axis=1)
    return np.asarray(found + summed_covariance(timed[0], scores, timed[1]))


def _information(drive: tuple[Array, Array, Array], meat: Array) -> tuple[Array, Array]:
    """What the drive alone says: information (m, m) where it says anything, and the offsets (m,).

    The sandwich's, so that the correlation of the errors counts.
    """
    signal, directions, right = drive
    known = signal > 0
    V = directions[:, known]
    spread = (V.T @ meat @ V) / np.outer(signal[known], signal[known])
    return V @ np.linalg.inv(spread) @ V.T, V @ (right[known] / signal[known])


def _bends(covariance: Array, distances: Array) -> bool:
    """Whether the widest direction bends by as much as the narrowest is known to.

    Seen from the end of a distance d, one that is open by s goes off its line by some s^2 / 2 d.
    """
    values = np.linalg.eigvalsh(covariance)
    return bool(values[-1] / (2 * distances.min()) > BENDS * np.sqrt(max(values[0], 0.0)))


def _bent(
    linear: tuple[Array, Array, Array],
    drive: tuple[Array, Array],
    belief: tuple[Array, Array],
    prior: OffsetPrior,
    normal: Normal,
    signs: Array,
    *,
    blunt: bool,
) -> tuple[Array, Array, Array]:
    """Offsets, distances and their covariance where distances bend what is possible."""
    offsets, _, covariance = linear
    m = len(offsets)
    zero = normal.kappa_of(np.zeros(m))
    moves = np.stack([normal.kappa_of(unit) - zero for unit in np.eye(m)], axis=1)
    geometry = Geometry(zero, moves, signs)
    # What the noise of the conditions' constants leaves of the distances for given offsets.
    slope = geometry.distances(offsets)[1]
    own = covariance[m:, m:] - slope @ covariance[:m, :m] @ slope.T
    found = posterior_moments(drive, belief, prior, geometry, offsets, own, blunt=blunt)
    if found is None:
        return linear
    return found.mean[:m], found.mean[m:], found.covariance


def distance_names(receivers: tuple[str, ...]) -> list[str]:
    """'a - b' for each pair, in the order of the distances."""
    return [f"{receivers[i]} - {receivers[j]}" for i, j in receiver_pairs(len(receivers))]
