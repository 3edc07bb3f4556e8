"""Offsets between receivers on different base stations, and the distances between antennas.

Each pair of receivers moves as a rigid rod, so the differences of their recorded positions lie
on a sphere: its centre is the difference of the two offsets, its radius the distance of the
antennas (Blanco 2009, Eq. 6-9). The spheres of all pairs are fitted together, in closed form:
no start value is needed. Noise in the differences would pretend to be rotation of the vehicle;
its known part is taken out of the equations, so that what the drive does not determine shows as
undetermined and not as a wrong number with a small sigma.
"""

from dataclasses import dataclass

import numpy as np
from scipy import special

from rtk_gt.offsets.noise import LEAST_SPREAD, pair_incidence
from rtk_gt.offsets.prior import OffsetPrior, posterior
from rtk_gt.offsets.robust import (
    autocorrelation_time,
    expected_weighted_square,
    redescending_weights,
)
from rtk_gt.receivers.assumptions import ETA, FEWEST_STEPS
from rtk_gt.receivers.steps import Steps, pair_differences, receiver_pairs
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.earth_frames import FrameVectors
from validation.shown import Shown

SIGNIFICANT = 4.0
"""Rotation counts as such beyond so many standard deviations of what noise alone would show: noise
passes that once in 30,000 directions."""
_ROUNDS = 40
"""At most: a judgement."""
_ROUGH_SIGMA = 0.01
"""Before the residuals say how large the noise is, in metres: what makers state of RTK."""
_SMALLEST_SIGMA = 1e-6
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
    def distance_sigmas(self) -> Array:
        """(p,) standard deviations of the distances, metres."""
        k = 3 * (len(self.receivers) - 1)
        return np.sqrt(np.diagonal(self.covariance)[k:])


@dataclass(frozen=True)
class _Equations:
    """Linear conditions a = B_offsets (offsets) + kappa of every step and pair.

    ``a`` (t, p) and ``design`` (t, p, m) come from the recorded differences; ``shared`` (p, p)
    says how the noise of two pairs is related and ``signs`` (p, r - 1) which offset enters.
    """

    differences: Array
    a: Array
    design: Array
    shared: Array
    signs: Array
    unit: Array


def estimate_offsets(
    steps: Steps, *, eta: float = ETA, robust: bool = True, prior: OffsetPrior | None = None
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

    Raises
    ------
    GtvalError
        If there are fewer than three receivers or ten complete steps.

    Notes
    -----
    With D the recorded difference of a pair, c the difference of its offsets and d its
    distance, |D - c| = d is linear in (c, kappa) as |D|^2 / 2 = c D + kappa with
    kappa = (d^2 - |c|^2) / 2. Weights are those of the first-order covariance of all pairs
    together; the moments are freed from the noise covariance (adjusted least squares: Kukush,
    Markovsky and Van Huffel 2004). Covariances are of the sandwich form, times the
    autocorrelation time of the residuals.
    """
    used = steps.select(steps.complete)
    if len(used.receivers) < 3:
        raise GtvalError("at least three receivers are needed for a pose in space")
    if len(used) < FEWEST_STEPS:
        raise GtvalError(
            f"all receivers are RTK-fixed together at {len(used)} times only; at least "
            f"{FEWEST_STEPS} are needed to find their offsets"
        )
    # Work near zero: recorded differences may be hundreds of metres, antennas are metres apart.
    shift = np.median(used.positions[:, :1] - used.positions, axis=0)
    prior = prior or OffsetPrior()
    equations = _equations(used.positions + shift, eta)
    estimate = _iterate(equations, prior.shifted(shift), robust=robust)
    mean, covariance, distances, signal, directions, sigma, weights, tau = estimate
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
    )


def _equations(positions: Array, eta: float) -> _Equations:
    receivers = positions.shape[1]
    differences = pair_differences(positions)
    incidence = pair_incidence(receivers)
    signs = incidence[:, 1:]
    t, p = differences.shape[:2]
    # c = offset of first minus offset of second receiver of the pair, hence the minus.
    design = -(signs[None, :, :, None] * differences[:, :, None, :]).reshape(t, p, -1)
    unit = np.diag([1.0, 1.0, eta**2])
    half_squares = np.square(differences).sum(-1) / 2
    return _Equations(differences, half_squares, design, incidence @ incidence.T, signs, unit)


def _iterate(
    equations: _Equations, prior: OffsetPrior, *, robust: bool
) -> tuple[Array, Array, Array, Array, Array, float, Array, float]:
    """Offsets, joint covariance, distances, signal, directions, sigma_0, weights, tau."""
    t, p, m = equations.design.shape
    dof = float(p)
    weights, sigma, offsets = np.ones(t), 0.0, np.zeros(m)
    whitening = np.eye(p) / _ROUGH_SIGMA**2
    tau, widen = 1.0, 8.0 if robust else 1.0
    for _ in range(_ROUNDS):
        before = offsets
        normal = _normal(equations, weights, whitening, sigma)
        signal, directions, score_free = _signal(normal, t / tau)
        offsets, curvature, prior_part = posterior(
            signal, directions, score_free, normal.kappa_of, equations.signs, prior
        )
        kappa = normal.kappa_of(offsets)
        centres = -(equations.signs @ offsets.reshape(-1, 3))
        residual = normal.a - equations.design @ offsets - kappa
        rods = equations.differences - centres
        spread = _residual_covariance(rods, equations, weights)
        unit_weight = _inverse(spread)
        # Combinations of distances that noise does not change are no degrees of freedom.
        dof = round(float(np.trace(unit_weight @ spread)), 3)
        squares = ((residual @ unit_weight) * residual).sum(1)
        if robust:
            new_sigma = float(np.sqrt(np.median(squares) / special.chdtri(dof, 0.5)))
        else:
            new_sigma = float(np.sqrt(squares.mean() / dof))
        floor = max(new_sigma, _SMALLEST_SIGMA)
        whitening = unit_weight / floor**2
        if robust:
            weights = redescending_weights(squares / floor**2, dof, widen)
        settled = np.abs(offsets - before).max() < 1e-6 and abs(new_sigma - sigma) < 1e-3 * floor
        sigma = new_sigma
        if widen == 1.0:
            tau = autocorrelation_time(residual * weights[:, None])
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
    covariance, distances = _covariance(
        equations, normal, weights, (rods, max(sigma, _SMALLEST_SIGMA)), whitening,
        (offsets, kappa, centres), (signal, directions, curvature, prior_part), tau,
    )  # fmt: skip
    return offsets, covariance, distances, signal, directions, sigma, weights, tau


@dataclass(frozen=True)
class _Normal:
    """Weighted moments: information on offsets and kappa, freed from noise."""

    a: Array
    offsets: Array
    cross: Array
    kappa: Array
    right_offsets: Array
    right_kappa: Array
    noise: Array
    """Noise part of the offsets' information, already taken out."""

    def kappa_of(self, offsets: Array) -> Array:
        """(p,) best kappa for given offsets."""
        return np.asarray(
            np.linalg.solve(self.kappa, self.right_kappa - self.cross.T @ offsets), dtype=float
        )


def _normal(equations: _Equations, weights: Array, W: Array, sigma: float) -> _Normal:
    """Moments of the conditions, with the expected part of the noise subtracted."""
    C = sigma**2 * equations.unit
    # |D|^2 is too large by the trace of its noise on average.
    a = equations.a - np.diagonal(equations.shared) * np.trace(C) / 2
    m = equations.design.shape[2]
    weighted = weights[:, None, None] * (W @ equations.design)
    flat = weighted.reshape(-1, m)
    total = weights.sum()
    shared = W * equations.shared
    noise = total * np.kron(equations.signs.T @ shared @ equations.signs, C)
    mean = np.tensordot(weights, equations.differences, 1)
    noise_right = -(equations.signs.T @ shared @ mean @ C).ravel()
    return _Normal(
        a=a,
        offsets=flat.T @ equations.design.reshape(-1, m) - noise,
        cross=weighted.sum(0).T,
        kappa=total * W,
        right_offsets=flat.T @ a.reshape(-1) - noise_right,
        right_kappa=W @ (weights @ a),
        noise=noise,
    )


def _signal(normal: _Normal, effective: float) -> tuple[Array, Array, Array]:
    """Information on each direction of the offsets, the directions, and their right-hand side.

    What does not stand out of the noise is set to 0: there the drive says nothing.
    """
    elimination = np.linalg.solve(normal.kappa, normal.cross.T)
    information = normal.offsets - normal.cross @ elimination
    right = normal.right_offsets - elimination.T @ normal.right_kappa
    values, directions = np.linalg.eigh((information + information.T) / 2)
    noise = np.diagonal(directions.T @ normal.noise @ directions)
    by_chance = np.sqrt((2 * noise**2 + 4 * noise * np.maximum(values, 0)) / effective)
    good = (values > SIGNIFICANT * by_chance) & (values > 1e-9 * values.max())
    return np.where(good, values, 0.0), directions, np.where(good, directions.T @ right, 0.0)


def _residual_covariance(rods: Array, equations: _Equations, weights: Array) -> Array:
    """Covariance (p, p) of the conditions for sigma_0 = 1, averaged over the good steps."""
    weighted = weights[:, None, None] * (rods @ equations.unit)
    moments = np.tensordot(weighted, rods, ((0, 2), (0, 2)))
    return np.asarray(equations.shared * moments / weights.sum())


def _inverse(matrix: Array) -> Array:
    """Inverse of a covariance, with the smallest eigenvalues lifted.

    Four and more antennas in one plane have a combination of distances that noise changes in
    second order only; its variance of nearly 0 must not decide everything.
    """
    values, vectors = np.linalg.eigh(matrix)
    lifted = np.maximum(values, LEAST_SPREAD * values.max())
    inverse: Array = np.asarray((vectors / lifted) @ vectors.T, dtype=float)
    return inverse


def _covariance(
    equations: _Equations,
    normal: _Normal,
    weights: Array,
    noise: tuple[Array, float],
    W: Array,
    place: tuple[Array, Array, Array],
    curvature: tuple[Array, Array, Array, Array],
    tau: float,
) -> tuple[Array, Array]:
    """Covariance of (offsets, distances), and the distances.

    Of the sandwich form: weights are those of the average step, its noise is that of each step.
    The scatter of the scores themselves would be the more tolerant filling, but five receivers
    have 22 unknowns, and a covariance of 22 numbers from a hundred steps is too small along some
    of their combinations.
    """
    _, kappa, centres = place
    signal, directions, hessian, prior_part = curvature
    elimination = np.linalg.solve(normal.kappa, normal.cross.T)
    rods, sigma = noise
    spread = equations.shared * (rods @ equations.unit @ np.swapaxes(rods, 1, 2))
    # What the scores W r of each step vary by.
    filling = (tau * sigma**2 * weights**2)[:, None, None] * (W @ spread @ W)
    design = equations.design - elimination
    known = directions * (signal > 0)
    projector = known @ directions.T
    meat = np.tensordot(design, filling @ design, ((0, 1), (0, 1)))
    meat = projector @ meat @ projector.T
    inverse = np.linalg.inv(hessian)
    offsets_cov = inverse @ (meat + prior_part) @ inverse
    kappa_inverse = np.linalg.inv(normal.kappa)
    kappa_cov = kappa_inverse @ filling.sum(0) @ kappa_inverse
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
    cross = offsets_cov @ slope.T
    return np.block(
        [[offsets_cov, cross], [cross.T, slope @ offsets_cov @ slope.T + own]]
    ), distances


def distance_names(receivers: tuple[str, ...]) -> list[str]:
    """'a - b' for each pair, in the order of the distances."""
    return [f"{receivers[i]} - {receivers[j]}" for i, j in receiver_pairs(len(receivers))]
