"""Local matching: a sweep is moved until its points lie on the lines of another.

Point-to-line alignment by Gauss-Newton steps from many starts at once. Associations come from a
look-up table, outliers are weighed down by Tukey's biweight with a width that shrinks from the
uncertainty of the guess to the noise, and points whose surfaces face differently are not paired.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from laser_gt.planar import rotation
from laser_gt.scans import Flags, Indices
from laser_gt.surfaces import Surface
from validation.angles import Array, wrap

MAX_STEPS = 40
TUKEY = 6.0
"""Width of the biweight in standard deviations: 98 % efficient for normal noise."""
FACING = 0.7
"""Least cosine between the normals of paired points (45 degrees)."""
SMALL_STEP = 2e-5
"""A step below this, in metres and radians, ends the iteration."""
SHRINK = 0.4
"""Factor on the width for outliers from step to step."""
MIN_PAIRS = 10
MOSTLY_FAKE = 0.5
"""No step is made in a direction in which more than this share of the information is fake."""


@dataclass(frozen=True)
class Alignment:
    """Where a sweep lies in the frame of another, from each start.

    Parameters
    ----------
    pose : (k, 3) array
        Moving frame in the reference frame.
    covariance : (k, 3, 3) array
        Of the pose, from the noise of both sweeps; infinite where nothing was determined.
    information : (k, 3, 3) array
        Hessian without the part that scattering normals fake.
    fake : (k, 3, 3) array
        That part.
    pairs : (k,) int array
        Number of paired points that kept weight.
    scale : (k,) array
        Root mean square residual over its expectation; 1 for a perfect model.
    converged : (k,) bool array
        Whether the last step was small. Says nothing about being right.
    steps : int
        Steps done.
    """

    pose: Array
    covariance: Array
    information: Array
    fake: Array
    pairs: Indices
    scale: Array
    converged: Flags
    steps: int


@dataclass(frozen=True)
class Pairing:
    """Moving points paired with lines of the reference, k starts by n points.

    Parameters
    ----------
    index : (k, n) int array
        Point of the reference whose line is used.
    residual : (k, n) array
        Distance from the line in metres.
    weight : (k, n) array
        Inverse variance times the outlier weight; 0 for no pair.
    variance : (k, n) array
        Of the residual, from both sweeps.
    jacobian : (k, 3, n) array
        Derivative of the residual by the pose.
    tangent : (k, 3, n) array
        Derivative of the coordinate along the line by the pose.
    """

    index: Indices
    residual: Array
    weight: Array
    variance: Array
    jacobian: Array
    tangent: Array


def align(
    reference: Surface,
    moving: Surface,
    guess: npt.ArrayLike,
    *,
    reach: float = 0.5,
    stride: int = 1,
    max_steps: int = MAX_STEPS,
) -> Alignment:
    """Poses of the moving sweep in the frame of the reference, one for each guess.

    Parameters
    ----------
    reference, moving : Surface
        The two sweeps.
    guess : (3,) or (k, 3) array_like
        Starts.
    reach : float
        Points further than this from the reference are not paired at first, in metres: how far
        off the guess may be.
    stride : int
        Only every so many points of the moving sweep are used.
    max_steps : int
        Bound on the number of steps.

    Notes
    -----
    The basin is that of any local matcher: for guesses off by more than some 0.2 m or 10 degrees
    use `laser_gt.judgement.match`, which adds a search.

    Point-to-line metric as in Censi, "An ICP variant using a point-to-line metric" (2008), with
    lines fitted over windows instead of through two points. Each point weighs by its variance
    across the surface, sigma^2 cos^2 of the incidence (at least a tenth), which is what makes the
    estimate efficient: a point seen at a grazing angle says much about where the wall is.
    """
    pose = np.array(np.atleast_2d(np.asarray(guess, dtype=float)))
    source = _Source.of(moving, stride)
    target = _Target.of(reference)
    noise = float(np.sqrt(np.median(moving.normal_variances) * 1.1))
    gate = max(reach, 8 * noise)
    converged = np.zeros(len(pose), dtype=bool)
    steps = 0
    for steps in range(1, max_steps + 1):  # noqa: B007  (wanted after the loop)
        pairing = _pair(target, source, pose, gate)
        change = _gauss_newton(target, pairing)
        pose += change
        settled = gate <= 8 * noise
        gate = max(gate * SHRINK, 8 * noise)
        if settled:
            converged = np.abs(change).max(-1) < SMALL_STEP
            if converged.all():
                break
    pairing = _pair(target, source, pose, gate)
    return _alignment(reference, pose, pairing, converged, steps)


@dataclass(frozen=True)
class _Source:
    """Points that are moved, and behind them their normals: (2, 2n); (n,) variances."""

    packed: Array
    variances: Array

    @classmethod
    def of(cls, moving: Surface, stride: int) -> "_Source":
        """Every so many of the points that have a line."""
        chosen = np.flatnonzero(moving.flat)[::stride]
        packed = np.concatenate([moving.points[chosen], moving.normals[chosen]]).T
        return cls(np.ascontiguousarray(packed), moving.normal_variances[chosen])


@dataclass(frozen=True)
class _Target:
    """Lines that points are moved to.

    ``packed`` has a column for each point of the reference: its normal (zero where it has no
    line, so that nothing faces it), distance of the line from the origin, the line's variance.
    """

    surface: Surface
    packed: Array

    @classmethod
    def of(cls, reference: Surface) -> "_Target":
        """The lines of a surface."""
        normals = np.where(reference.flat, reference.normals.T, 0.0)
        offset = np.einsum("in,ni->n", normals, reference.centres)
        variances = reference.normal_variances / _count(reference)
        return cls(reference, np.stack([*normals, offset, variances]))


def _pair(target: _Target, source: _Source, pose: Array, gate: float) -> Pairing:
    """Each moved point with the line of the nearest point of the reference."""
    grid = target.surface.grid
    turned = rotation(pose[:, 2]) @ source.packed
    n = len(source.variances)
    arm_x, arm_y = turned[:, 0, :n], turned[:, 1, :n]
    x, y = arm_x + pose[:, :1], arm_y + pose[:, 1:2]
    index = grid.index(x, y)
    normal_x, normal_y, offset, line_variance = target.packed.take(index, axis=1)
    residual = normal_x * x + normal_y * y - offset
    facing = normal_x * turned[:, 0, n:] + normal_y * turned[:, 1, n:]
    squared = (x - grid.x.take(index)) ** 2 + (y - grid.y.take(index)) ** 2
    variance = line_variance + source.variances
    width = np.maximum(TUKEY**2 * variance, gate**2 / 4)
    tukey = np.maximum(1 - residual * residual / width, 0.0)
    weight = tukey * tukey / variance * ((squared < gate**2) & (facing > FACING))
    jacobian = np.stack([normal_x, normal_y, normal_y * arm_x - normal_x * arm_y], axis=1)
    tangent = np.stack([-normal_y, normal_x, normal_x * arm_x + normal_y * arm_y], axis=1)
    return Pairing(index, residual, weight, variance, jacobian, tangent)


def _gauss_newton(target: _Target, pairing: Pairing) -> Array:
    """(k, 3) steps; none where too few points are paired, nor along what is not determined.

    In coordinates in which the Hessian is the identity, directions whose information is mostly
    fake (`_fake_information`) are left out, so that along a corridor the guess stays where it is
    instead of drifting with the noise.
    """
    weighted = pairing.jacobian * pairing.weight[:, None]
    hessian = weighted @ np.swapaxes(pairing.jacobian, -1, -2)
    gradient = weighted @ pairing.residual[..., None]
    enough = np.count_nonzero(pairing.weight, axis=-1) >= MIN_PAIRS
    damping = 1e-9 * np.trace(hessian, axis1=-2, axis2=-1) + 1e-9
    hessian += damping[:, None, None] * np.eye(3)
    whitener = np.linalg.inv(np.linalg.cholesky(hessian))
    whitener_t = np.swapaxes(whitener, -1, -2)
    fake = whitener @ _fake_information(target.surface, pairing) @ whitener_t
    share, axes = np.linalg.eigh(fake)
    along = np.swapaxes(axes, -1, -2) @ (whitener @ gradient)
    along *= (share < MOSTLY_FAKE)[..., None]
    change = -(whitener_t @ (axes @ along))[..., 0]
    return np.maximum(np.minimum(np.where(enough[:, None], change, 0.0), 0.5), -0.5)


def _alignment(
    reference: Surface, pose: Array, pairing: Pairing, converged: Flags, steps: int
) -> Alignment:
    """Covariance and counts of the final pairing."""
    used = pairing.weight > 0
    pairs = used.sum(-1)
    jacobian = pairing.jacobian
    information = (jacobian * pairing.weight[:, None]) @ np.swapaxes(jacobian, -1, -2)
    fake = _fake_information(reference, pairing)
    squared = np.where(used, pairing.residual**2 / pairing.variance, 0.0).sum(-1)
    scale = np.sqrt(squared / np.maximum(pairs - 3, 1))
    gradient = _gradient_covariance(reference, pairing, np.maximum(scale, 0.7))
    covariance = _sandwich(information, fake, gradient)
    covariance[pairs < MIN_PAIRS] = np.inf
    pose = np.column_stack([pose[:, :2], wrap(pose[:, 2])])
    return Alignment(pose, covariance, information - fake, fake, pairs, scale, converged, steps)


def _fake_information(reference: Surface, pairing: Pairing) -> Array:
    """(k, 3, 3) what the scatter of the normals adds to the Hessian.

    A normal off by s adds s times the tangent; squared and summed it looks like information
    along the wall.
    """
    scatter = pairing.weight * reference.normal_sigmas.take(pairing.index) ** 2
    tangent = pairing.tangent
    return np.asarray((tangent * scatter[:, None]) @ np.swapaxes(tangent, -1, -2))


def _gradient_covariance(reference: Surface, pairing: Pairing, scale: Array) -> Array:
    """(k, 3, 3) covariance of the gradient from the noise of both sweeps.

    The moving points' noise is independent from pair to pair, and taken from the residuals
    themselves (White's estimator). That of the reference is not: a
    point of it takes part in all the lines whose windows hold it. Its share in the gradient is
    the sum over those lines of weight times Jacobian over window length, found for all points
    at once as a running sum over window starts and ends.
    """
    lines = _count(reference)
    terms = pairing.jacobian * (pairing.weight * pairing.residual)[:, None]
    total = terms @ np.swapaxes(terms, -1, -2)
    share = pairing.jacobian * (pairing.weight / lines.take(pairing.index))[:, None]
    size = len(reference) + 1
    for row, index in enumerate(pairing.index):
        start, stop = reference.first[index], reference.last[index] + 1
        parts = np.stack(
            [np.bincount(start, part, size) - np.bincount(stop, part, size) for part in share[row]]
        ).cumsum(1)[:, :-1]
        total[row] += scale[row] ** 2 * (parts * reference.normal_variances) @ parts.T
    return np.asarray(total)


def _count(reference: Surface) -> Array:
    """(n,) number of points of each line."""
    return (reference.last - reference.first + 1).astype(float)


def _sandwich(information: Array, fake: Array, gradient: Array) -> Array:
    """(k, 3, 3) covariance H^-1 G H^-1 with the fake part taken out of H.

    A direction in which less than half the information is real is not determined: its
    information is taken as what is real, but no less than a hundredth of the fake, so that the
    standard deviation becomes large and stays finite.
    """
    values, vectors = np.linalg.eigh(information)
    total = np.maximum(values, 1e-12)
    faked = np.einsum("kji,kjl,kli->ki", vectors, fake, vectors)
    real = np.maximum(total - faked, 0.01 * faked + 1e-6)
    inverse = np.einsum("kij,kj,klj->kil", vectors, 1 / real, vectors)
    return np.asarray(inverse @ gradient @ inverse)
