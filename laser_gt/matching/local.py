"""Local matching: a sweep is moved until its points lie on the lines of another.

Point-to-line alignment by Gauss-Newton steps from many starts at once. Associations come from a
look-up table, outliers are weighed down by Tukey's biweight with a width that shrinks from the
uncertainty of the guess to the noise, and points whose surfaces face differently are not paired.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from laser_gt.scans.noise import Residuals
from laser_gt.scans.planar import rotation, wrapped
from laser_gt.scans.scan import Flags, Indices
from laser_gt.scans.surfaces import Surface
from validation.poses.angles import Array

MAX_STEPS = 40
"""Bound on the steps. A judgement: with the width for outliers at the noise after four or
five, a start that has not ended after forty goes to and fro between pairings."""
LAST_STEPS = 12
"""The same from a start a few millimetres off. Measured: three are enough in the median; of 340
matches one was not at its end after twelve, nor after forty."""
TUKEY = 6.0
"""Width of the biweight in standard deviations: 98 % efficient for normal noise."""
FACING = 0.7
"""Least cosine between the normals of paired points (45 degrees): halfway between the two walls of
a right-angled corner."""
SMALL_STEP = 2e-5
"""A step below this, in metres and radians, ends the iteration. Measured: matches in a simulated
room have standard deviations from 0.26 mm and 0.086 mrad on, more than four times as much."""
FINEST = 8.4
"""Least distance within which points are paired, in standard deviations of a point across its
surface. A judgement: half of it, 4.2, is the least width of the biweight, near the 4.685 with
which it is 95 % efficient."""
SHRINK = 0.4
"""Factor on that distance from step to step. A judgement: from 0.5 m it takes three or four steps
to the noise, in each of which the pose comes nearer by more than that."""
MIN_PAIRS = 10
"""Fewer pairs determine nothing. A judgement: three unknowns, three times over."""
MOSTLY_FAKE = 0.4
"""No step is made in a direction in which more than this share of the information is fake: the
judgement calls such a direction not determined, and leaves it to the guess."""


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
    scale : (k,) array
        Root mean square residual over its expectation; 1 for a perfect model.
    pairing : Pairing
        Where it ended.
    """

    pose: Array
    covariance: Array
    information: Array
    fake: Array
    scale: Array
    pairing: "Pairing"

    @property
    def determined(self) -> Flags:
        """(k,) whether enough points are paired to determine a pose."""
        return np.asarray((self.pairing.weight > 0).sum(-1) >= MIN_PAIRS, dtype=bool)


@dataclass(frozen=True)
class Pairing:
    """Moving points paired with lines of the reference, k starts by n points.

    Parameters
    ----------
    index : (k, n) int array
        Point of the reference whose line is used.
    model : (k, 4, n) array
        Derivative of the residual by the pose, and, last, the residual: the distance from the
        line in metres.
    weight : (k, n) array
        Inverse variance times the outlier weight; 0 for no pair.
    variance : (k, n) array
        Of the residual, from both sweeps.
    moving_variance : (n,) array
        Its part from the moving sweep.
    moments : (k, 4, 4) array
        Weighted products of the model: Hessian, gradient, and squared residuals.
    fake : (k, 3, 3) array
        What the scatter of the normals adds to the Hessian. A normal off by s adds s times the
        tangent; squared and summed it looks like information along the wall.
    """

    index: Indices
    model: Array
    weight: Array
    variance: Array
    moving_variance: Array
    moments: Array
    fake: Array

    def only(self, row: int) -> "Pairing":
        """That of one start."""
        one = slice(row, row + 1)
        return Pairing(
            self.index[one],
            self.model[one],
            self.weight[one],
            self.variance[one],
            self.moving_variance,
            self.moments[one],
            self.fake[one],
        )


def align(
    reference: Surface,
    moving: Surface,
    guess: npt.ArrayLike,
    *,
    reach: float = 0.5,
    stride: int = 1,
    max_steps: int = MAX_STEPS,
    small_step: float = SMALL_STEP,
    covariance: bool = True,
    home: tuple[Array, Array] | None = None,
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
    small_step : float
        A step below this, in metres and radians, ends the iteration.
    covariance : bool
        Whether the covariance is wanted too; without, it is infinite.
    home : ((3,) array, (3,) array), optional
        A pose, and how near to it, metres and radians, all starts have to be for the iteration to
        end.

    Notes
    -----
    The basin is that of any local matcher: for guesses off by more than some 0.2 m or 10 degrees
    use `laser_gt.matching.judgement.match`, which adds a search.

    Point-to-line metric as in Censi, "An ICP variant using a point-to-line metric" (2008), with
    lines fitted over windows instead of through two points. Each point weighs by its variance
    across the surface, sigma^2 cos^2 of the incidence (at least a tenth), which is what makes the
    estimate efficient: a point seen at a grazing angle says much about where the wall is.
    """
    pose = np.array(np.atleast_2d(np.asarray(guess, dtype=float)))
    source = moving.movable[:, ::stride]
    finest = FINEST * moving.noise
    gate = max(reach, finest)
    for _ in range(max_steps):
        pairing = _pair(reference, source, pose, gate)
        change = _gauss_newton(pairing)
        pose += change
        if home is not None and (np.abs(wrapped(pose - home[0])) <= home[1]).all():
            break
        if gate <= finest and (np.abs(change) < small_step).all():
            break  # the pairing is of a place less than a small step away: good enough
        gate = max(gate * SHRINK, finest)
    else:
        pairing = _pair(reference, source, pose, gate)
    if not covariance:
        unknown = np.full((len(pose), 3, 3), np.inf)
        known = pairing.moments[:, :3, :3] - pairing.fake
        scale = np.full(len(pose), np.nan)
        return Alignment(wrapped(pose), unknown, known, pairing.fake, scale, pairing)
    return _alignment(reference, pose, pairing)


def _pair(reference: Surface, source: Array, pose: Array, gate: float) -> Pairing:
    """Each moved point (`Surface.movable`) with the line of the nearest point of the reference."""
    starts, points = len(pose), source.shape[1]
    # x of all starts, then y of all: one product turns the points and their normals.
    turn = rotation(pose[:, 2]).transpose(1, 0, 2).reshape(-1, 2)
    sides = source[:4].reshape(2, 2, points).transpose(1, 0, 2).reshape(2, -1)
    arm, facing = (turn @ sides).reshape(2, starts, 2, points).transpose(2, 0, 1, 3)
    place = arm + pose[:, :2].T[..., None]
    index = reference.grid.index(*place)
    lines = reference.lines.take(index, axis=1)
    normal, near, offset, line_variance, scatter = lines[:2], lines[2:4], *lines[4:]
    apart = place - near
    apart *= apart
    facing = normal * facing
    paired = apart[0] + apart[1] < gate * gate
    paired &= facing[0] + facing[1] > FACING
    model = np.empty((starts, 4, points))
    model[:, :2] = normal.transpose(1, 0, 2)
    model[:, 2] = normal[1] * arm[0] - normal[0] * arm[1]
    place *= normal
    model[:, 3] = residual = place[0] + place[1] - offset
    tangent = np.empty((starts, 3, points))
    np.negative(normal[1], out=tangent[:, 0])
    tangent[:, 1] = normal[0]
    arm = normal * arm
    np.add(arm[0], arm[1], out=tangent[:, 2])
    variance = line_variance + source[4]
    width = np.maximum(TUKEY**2 * variance, gate**2 / 4)
    tukey = np.maximum(1 - residual * residual / width, 0.0)
    tukey *= tukey
    weight = tukey / variance * paired
    moments = (model * weight[:, None]) @ model.transpose(0, 2, 1)
    fake = (tangent * (weight * scatter)[:, None]) @ tangent.transpose(0, 2, 1)
    return Pairing(index, model, weight, variance, source[4], moments, fake)


def _gauss_newton(pairing: Pairing) -> Array:
    """(k, 3) steps; none where too few points are paired, nor along what is not determined.

    In coordinates in which the Hessian is the identity, directions whose information is mostly
    fake are left out, so that along a corridor the guess stays where it is instead of drifting
    with the noise.
    """
    hessian, gradient = pairing.moments[:, :3, :3], pairing.moments[:, :3, 3:]
    hessian = hessian.copy()
    diagonal = np.einsum("kii->ki", hessian)
    diagonal += 1e-9 * diagonal.sum(-1, keepdims=True) + 1e-9
    inverse = np.linalg.inv(hessian)
    change = -(inverse @ gradient)[..., 0]
    # The shares of all directions add up to this: mostly, no single one can be too large.
    faked = np.einsum("kij,kij->k", inverse, pairing.fake) >= MOSTLY_FAKE
    if faked.any():
        whitener = np.linalg.inv(np.linalg.cholesky(hessian[faked]))
        whitener_t = whitener.transpose(0, 2, 1)
        share, axes = np.linalg.eigh(whitener @ pairing.fake[faked] @ whitener_t)
        along = axes.transpose(0, 2, 1) @ (whitener @ gradient[faked])
        along *= (share < MOSTLY_FAKE)[..., None]
        change[faked] = -(whitener_t @ (axes @ along))[..., 0]
    change[(pairing.weight > 0).sum(-1) < MIN_PAIRS] = 0.0
    return np.asarray(np.maximum(np.minimum(change, 0.5), -0.5))


def _alignment(reference: Surface, pose: Array, pairing: Pairing) -> Alignment:
    """Covariance and residuals of the final pairing."""
    used = pairing.weight > 0
    pairs = used.sum(-1)
    information, fake = pairing.moments[:, :3, :3], pairing.fake
    squared = (pairing.model[:, 3] ** 2 / pairing.variance * used).sum(-1)
    scale = np.sqrt(squared / np.maximum(pairs - 3, 1))
    gradient = _gradient_covariance(reference, pairing)
    covariance = _sandwich(information, fake, gradient)
    covariance[pairs < MIN_PAIRS] = np.inf
    pose = wrapped(pose)
    return Alignment(pose, covariance, information - fake, fake, scale, pairing)


def _gradient_covariance(reference: Surface, pairing: Pairing) -> Array:
    """(k, 3, 3) covariance of the gradient from the noise of both sweeps.

    The moving points' noise is independent from pair to pair, that of the reference is not: a
    point of it takes part in all the lines whose windows hold it.
    """
    moving, common = _shares(reference, pairing)
    total = (moving * _own_squares(pairing)[:, None]) @ moving.transpose(0, 2, 1)
    common_t = common.transpose(0, 2, 1)
    return np.asarray(total + (common * reference.measured_variances) @ common_t)


def _shares(reference: Surface, pairing: Pairing) -> tuple[Array, Array]:
    """(k, 3, m) and (k, 3, n) derivative of the gradient by the noise of each point.

    By the m moving points, and by the n points of the reference: the sum over the lines that a
    point takes part in of weight times Jacobian over window length, found for all points at once
    as a running sum over window starts and ends. Noise is counted along the normal, so that of
    the reference enters with the other sign.
    """
    moving = pairing.model[:, :3] * pairing.weight[:, None]
    share = moving / reference.window_lengths.take(pairing.index)[:, None]
    ends = np.stack([reference.first, reference.last + 1]).take(pairing.index, axis=1)
    signed = np.stack([share, -share])
    size = len(reference) + 1
    table = np.arange(len(share) * 3).reshape(-1, 3, 1) * size
    places = (ends[:, :, None] + table).ravel()
    steps = np.bincount(places, signed.ravel(), len(share) * 3 * size)
    return moving, steps.reshape(-1, 3, size).cumsum(-1)[..., :-1]


def _own_squares(pairing: Pairing) -> Array:
    """(k, m) what the squared residuals say of the moving points' own variance (White).

    The part of a residual that is the line's is left out, as the reference's points bring it in.
    """
    return np.asarray(pairing.model[:, 3] ** 2 * (pairing.moving_variance / pairing.variance))


@dataclass(frozen=True)
class Influence:
    """What the noise of each point does to a pose.

    Parameters
    ----------
    moving : (3, n) array
        Derivative of the pose by the noise of each point of the moving sweep along its normal.
    reference : (3, m) array
        By that of each point of the reference.
    variances : (n,) array
        Of the moving points along their normals: squared residuals of those that are paired.
    reference_variances : (m,) array
        Of the points of the reference.
    """

    moving: Array
    reference: Array
    variances: Array
    reference_variances: Array

    @property
    def covariance(self) -> Array:
        """(3, 3) covariance of the pose, if no two points share noise."""
        by_moving = (self.moving * self.variances) @ self.moving.T
        return by_moving + (self.reference * self.reference_variances) @ self.reference.T


def influence(reference: Surface, moving: Surface, found: Alignment, row: int = 0) -> Influence:
    """How the noise of both sweeps moves the pose at which one of the starts of `align` ended.

    Notes
    -----
    The pose solves H d = -g with the gradient g a sum over the pairs, so that its derivative by
    the noise is -H^-1 times that of g; H without the part that scattering normals fake.
    """
    pairing = found.pairing.only(row)
    by_moving, shares = _shares(reference, pairing)
    solver = -_real_inverse(pairing.moments[:, :3, :3], pairing.fake)[0]
    every = np.zeros((3, len(moving)))
    every[:, moving.flat] = solver @ by_moving[0]
    variances = moving.measured_variances.copy()
    paired = pairing.weight[0] > 0
    variances[np.flatnonzero(moving.flat)[paired]] = _own_squares(pairing)[0, paired]
    by_reference = -solver @ shares[0]
    return Influence(every, by_reference, variances, reference.measured_variances)


WITHIN = 0.12
"""Greatest distance in metres of points whose residuals are asked for. A judgement: ten times the
noise of any scanner but the worst, less than what stands in front of a wall."""


def residuals(reference: Surface, moving: Surface, pose: Array) -> Residuals:
    """How far the moving sweep's ranges are off from the lines of the reference at a pose, (3,)."""
    pairing = _pair(reference, moving.movable, pose[None], max(WITHIN, FINEST * moving.noise))
    paired = pairing.weight[0] > 0
    values = np.full(len(moving), np.nan)
    place = np.flatnonzero(moving.flat)[paired]
    cosine = np.abs((moving.normals * moving.beams).sum(-1)[place])
    values[place] = pairing.model[0, 3, paired] / np.maximum(cosine, np.sqrt(0.1))
    return Residuals(values, float(np.median(reference.window_lengths)))


def _sandwich(information: Array, fake: Array, gradient: Array) -> Array:
    """(k, 3, 3) covariance H^-1 G H^-1 with the fake part taken out of H."""
    inverse = _real_inverse(information, fake)
    return np.asarray(inverse @ gradient @ inverse)


def _real_inverse(information: Array, fake: Array) -> Array:
    """(k, 3, 3) inverse of the Hessian with the fake part taken out.

    A direction in which less than half the information is real is not determined: its
    information is taken as what is real, but no less than a hundredth of the fake, so that the
    standard deviation becomes large and stays finite.
    """
    values, vectors = np.linalg.eigh(information)
    total = np.maximum(values, 1e-12)
    faked = (vectors * (fake @ vectors)).sum(-2)
    real = np.maximum(total - faked, 0.01 * faked + 1e-6)
    return np.asarray((vectors / real[:, None]) @ vectors.transpose(0, 2, 1))
