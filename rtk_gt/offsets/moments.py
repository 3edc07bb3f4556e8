"""Mean and covariance of offsets where measured distances bend what is possible.

Seen from the end of an arm of known length, a direction that the drive leaves open is an arc and
no line. The sigmas of a linear approximation are then too small across it; a sample of what is
possible has the right ones.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import special

from rtk_gt.offsets.prior import OffsetPrior
from validation.poses.angles import Array

SAMPLES = 20_000
"""Their sigmas are good to 1 % where one in four counts."""
FEWEST = 400
"""Samples that must count, of their weights' inverse square sum: sigmas are then good to 4 %."""
TAIL = 0.9973
"""Share of a normal distribution within three standard deviations."""
_WIDER = 1.3
"""The proposal is wider than what is sought, so that no tail is missed."""


class Geometry(NamedTuple):
    """Distances of the pairs at given offsets: sqrt(2 (kappa + moves c) + |centres|^2).

    ``kappa`` (p,) at offsets 0, ``moves`` (p, m) its change with them, ``signs`` (p, r - 1).
    """

    kappa: Array
    moves: Array
    signs: Array

    def distances(self, offsets: Array) -> tuple[Array, Array]:
        """Distances (..., p) at offsets (..., m), and their derivatives (..., p, m)."""
        shape = offsets.shape[:-1]
        centres = -(self.signs @ offsets.reshape(*shape, -1, 3))
        squares = 2 * (self.kappa + offsets @ self.moves.T) + np.square(centres).sum(-1)
        d = np.sqrt(np.maximum(squares, 1e-6))
        toward = -(self.signs[:, :, None] * centres[..., :, None, :]).reshape(*shape, len(d.T), -1)
        return d, (toward + self.moves) / d[..., None]


class Moments(NamedTuple):
    """Mean (m + p,) and covariance (m + p, m + p) of the offsets, then the distances."""

    mean: Array
    covariance: Array


def posterior_moments(
    drive: tuple[Array, Array],
    belief: tuple[Array, Array],
    prior: OffsetPrior,
    geometry: Geometry,
    mode: Array,
    own: Array,
    *,
    blunt: bool,
) -> Moments | None:
    """What the drive and all that is known make of the offsets; None where samples do not tell.

    Parameters
    ----------
    drive : ((m, m) array, (m,) array)
        Information of the drive, 1/m^2, for the correlation of its errors; the offsets it wants.
    belief : ((m, m) array, (m,) array)
        The same of what is known of the offsets, by `OffsetPrior.of_offsets`.
    prior : OffsetPrior
        With the measured distances.
    geometry : Geometry
        Distances at given offsets.
    mode : (m,) array
        The minimum about which it is sought.
    own : (p, p) array
        Covariance of the distances for given offsets, m^2.
    blunt : bool
        Where too few samples count, let more count than should: sigmas are then too large.

    Notes
    -----
    Importance sampling from two normal distributions: the linear approximation at the minimum, and
    the same without what distances say of heights, which flat roads leave to chance. The numbers
    are drawn from a fixed seed: a result is the same each time.

    What lies on an arc has tails that a normal distribution of its covariance has not: it is
    widened along its axes and as a whole until it holds what lies beyond three standard deviations.
    """
    A, wanted = drive
    B, believed = belief
    measured = np.isfinite(prior.distances) if len(prior.distances) else np.zeros(0, dtype=bool)
    _, slope = geometry.distances(mode)
    proposals = []
    for scale in (1.0, 0.0):
        slopes = slope.copy()
        slopes[:, 2::3] *= scale
        curvature = A + B
        if measured.any():
            weighted = slopes[measured] / prior.distance_sigmas[measured, None]
            curvature = curvature + weighted.T @ weighted
        covariance = _WIDER**2 * np.linalg.inv(curvature)
        centre = mode.copy()
        if scale == 0.0:
            centre[2::3] = np.linalg.solve(A + B, A @ wanted + B @ believed)[2::3]
        proposals.append((centre, np.linalg.cholesky((covariance + covariance.T) / 2)))
    generator = np.random.default_rng(0)
    half = SAMPLES // 2
    c = np.concatenate(
        [at + generator.standard_normal((half, len(mode))) @ root.T for at, root in proposals]
    )
    density = np.logaddexp(*(_log_normal(c - at, root) for at, root in proposals))
    d, _ = geometry.distances(c)
    cost = _square(c - wanted, A) + _square(c - believed, B)
    if measured.any():
        off = (d - prior.distances)[:, measured] / prior.distance_sigmas[measured]
        cost = cost + np.square(off).sum(1)
    log = -cost / 2 - density
    weight = _weights(log)
    if 1 / np.square(weight).sum() < FEWEST:
        if not blunt:
            return None
        weight = _blunted(log)
    values, vectors = np.linalg.eigh((own + own.T) / 2)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    both = np.hstack([c, d + generator.standard_normal(d.shape) @ root.T])
    mean = weight @ both
    away = both - mean
    covariance = (away * weight[:, None]).T @ away
    return Moments(mean, _widened(covariance, away, weight))


def _weights(log: Array) -> Array:
    weight = np.exp(log - log.max())
    return np.asarray(weight / weight.sum())


def _blunted(log: Array) -> Array:
    """Weights of the greatest power below 1 with which `FEWEST` samples count."""
    low, high = 0.0, 1.0
    for _ in range(30):
        middle = (low + high) / 2
        enough = 1 / np.square(_weights(middle * log)).sum() >= FEWEST
        low, high = (middle, high) if enough else (low, middle)
    return _weights(low * log)


def _widened(covariance: Array, away: Array, weight: Array) -> Array:
    """The covariance, widened until `TAIL` of the sample is within three sigmas.

    Along each of its axes, and then as a whole: what is far out along an arc is far across it, too.
    """
    values, axes = np.linalg.eigh(covariance)
    sizes = np.abs(away @ axes) / np.sqrt(np.maximum(values, 1e-18))
    order = np.argsort(sizes, axis=0)
    reached = np.cumsum(weight[order], axis=0) >= TAIL
    beyond = np.take_along_axis(sizes, order, axis=0)[reached.argmax(0), np.arange(len(values))]
    values = np.maximum(values, 1e-18) * np.maximum(beyond / 3.0, 1.0) ** 2
    squares = (np.square(away @ axes) / values).sum(1)
    far = np.argsort(squares)
    whole = squares[far][np.searchsorted(np.cumsum(weight[far]), TAIL)]
    wider = max(float(whole / special.chdtri(len(values), 1 - TAIL)), 1.0)
    return np.asarray((axes * values * wider) @ axes.T)


def _square(away: Array, information: Array) -> Array:
    return np.asarray(((away @ information) * away).sum(1))


def _log_normal(away: Array, root: npt.NDArray[np.floating]) -> Array:
    """Log density up to a constant of N(0, root root')."""
    normal = np.linalg.solve(root, away.T)
    return np.asarray(-np.square(normal).sum(0) / 2 - np.log(np.diagonal(root)).sum())
