"""Do published coordinates follow from the readings they are said to come from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from survey.estimation.distance_fit import coordinate_sigma, with_heading
from survey.estimation.measurement import independent_variance, linearise
from survey.estimation.vframe import VframeEstimate
from survey.estimation.world_points import WorldPoints
from survey.readings.readings import Readings
from validation.poses.angles import Array

TOLERANCE = 1e-4
"""Metres; the order of the readings and the sigmas move the last 0.1 mm of a solution."""
OUTLYING = 10.0
"""Times the median difference of all points from which one stands out, beyond the tolerance. A
judgement: it separates point 15 of AD2.3 (3.7 mm off) from the others."""
BLUNDER_RANGE = 0.05
"""Changes of a single reading that are tried, metres. A judgement: larger ones are seen by eye."""
_PASSES = 10
"""Of Gauss-Newton, from at most 5 cm away. A judgement: half of them reach the last digit."""


@dataclass(frozen=True)
class PublishedComparison:
    """Published less computed coordinates.

    Parameters
    ----------
    names : tuple of str, length n
        World points that have both.
    difference : (n, 2) array
        Published less computed, metres.
    inconsistent : (n,) array of bool
        Points whose difference stands out from all others'.
    remedies : mapping of str to Remedy
        For each inconsistent point the change of one reading that would help most.
    """

    names: tuple[str, ...]
    difference: Array
    inconsistent: np.ndarray[tuple[int], np.dtype[np.bool_]]
    remedies: Mapping[str, "Remedy"]


@dataclass(frozen=True)
class Remedy:
    """The change of a single reading that brings a point nearest to its published place.

    ``label`` is the Vframe point of the reading, ``change`` its change and ``remains`` the
    distance left, both in metres.
    """

    label: str
    change: float
    remains: float


def compare_published(
    published: Mapping[str, Array],
    world: WorldPoints,
    readings: Readings,
    vframe: VframeEstimate,
    tolerance: float = TOLERANCE,
) -> PublishedComparison:
    """Which published coordinates do not belong to the readings.

    Parameters
    ----------
    published : mapping of str to (2,) array
        Metres.
    world : WorldPoints
        Computed from the readings.
    readings : Readings
        The readings.
    vframe : VframeEstimate
        The frame.
    tolerance : float
        Metres.

    Notes
    -----
    The reference is the points' own scatter, because published coordinates may have been
    computed with other sigmas or in another order.
    """
    names = tuple(name for name in world.names if name in published)
    where = dict(zip(world.names, world.positions, strict=True))
    difference = np.array([published[n] - where[n] for n in names]).reshape(-1, 2)
    size = np.linalg.norm(difference, axis=1)
    usual = np.median(size) if len(size) else 0.0
    inconsistent = size > max(tolerance * np.sqrt(2), OUTLYING * float(usual))
    if len(size) and usual > OUTLYING * tolerance:
        inconsistent = size > OUTLYING * tolerance
    remedies = {
        name: _best_remedy(name, published[name], readings, vframe)
        for name, bad in zip(names, inconsistent, strict=True)
        if bad
    }
    return PublishedComparison(names, difference, inconsistent, remedies)


def _best_remedy(name: str, target: Array, readings: Readings, vframe: VframeEstimate) -> Remedy:
    """Search of all single readings over changes of up to 5 cm, in steps of 1 mm."""
    own = readings.touching([name], vframe.names)
    steps = np.arange(-BLUNDER_RANGE, BLUNDER_RANGE + 1e-9, 0.001)
    changes = np.eye(len(own))[:, None, :] * steps[:, None]
    places = _places(own, own.distance + changes.reshape(-1, len(own)), target, vframe)
    remains = np.linalg.norm(places - target, axis=1)
    best = int(remains.argmin())
    row, step = divmod(best, len(steps))
    return Remedy(own.end[row], float(steps[step]), float(remains[best]))


def _places(own: Readings, distances: Array, start: Array, vframe: VframeEstimate) -> Array:
    """(c, 2) least-squares places for c variants (c, m) of a point's readings."""
    index = [vframe.names.index(end) for end in own.end]
    known = vframe.points[index]
    sigma = coordinate_sigma(vframe.covariance)[index]
    place = np.tile(start, (len(distances), 1))
    for _ in range(_PASSES):
        at = linearise(with_heading(place), known, np.zeros_like(known), distances)
        variance = independent_variance(at, own.sigma, sigma, 0.0)
        weighted = at.H_position / variance[..., None]
        normal = np.swapaxes(weighted, -1, -2) @ at.H_position
        gradient = (weighted * at.h[..., None]).sum(-2)
        place = place - np.linalg.solve(normal, gradient[..., None])[..., 0]
    return place


def worst(comparison: PublishedComparison) -> Sequence[str]:
    """Names of the inconsistent points, the worst first."""
    size = np.linalg.norm(comparison.difference, axis=1)
    order = np.argsort(-size)
    return [comparison.names[i] for i in order if comparison.inconsistent[i]]
