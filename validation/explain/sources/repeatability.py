"""How well a system repeats itself, over runs and where its path comes back to a place."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import special

from validation.errors import GtvalError
from validation.poses.angles import Array, circular_mean, wrap
from validation.poses.pose_table import Component, PoseTable, in_common, pose_difference
from validation.statistics.standards.repeats import SAME_PLACE

REVISIT_RADIUS = SAME_PLACE
"""Stops closer than this (metres) are the same place, where nothing else is stated."""


@dataclass(frozen=True)
class Repeatability:
    """Standard deviation of repeated measurements of one component.

    Parameters
    ----------
    component : Component
        Which.
    deviation, low, high : float
        Standard deviation of a single measurement and its interval (m or rad).
    dof : int
        Degrees of freedom behind it.
    """

    component: Component
    deviation: float
    low: float
    high: float
    dof: int


def repeated_runs(runs: Sequence[PoseTable], confidence: float = 0.95) -> tuple[Repeatability, ...]:
    """Repeatability of a system from two or more runs over the same stops.

    Parameters
    ----------
    runs : sequence of PoseTable
        Same stops, same components.
    confidence : float
        Of the intervals.

    Raises
    ------
    GtvalError
        If there are fewer than two runs or no stop in common.
    """
    if len(runs) < 2:
        raise GtvalError("repeatability needs at least two runs")
    ids = in_common(list(runs))
    poses = np.stack([run.select(ids).poses for run in runs])
    dof = (len(runs) - 1) * len(ids)
    found = []
    for column, component in enumerate(runs[0].components):
        values = poses[..., column]
        if component.kind == "angle":
            values = wrap(values - circular_mean(values, axis=0))
        left = values - values.mean(0)
        found.append(_with_interval(component, float((left**2).sum()), dof, confidence))
    return tuple(found)


def revisits(
    validation: PoseTable, gt: PoseTable, radius: float, confidence: float = 0.95
) -> tuple[Repeatability, ...]:
    """Repeatability of errors between stops at nearly the same place.

    Parameters
    ----------
    validation, gt : PoseTable
        Planar poses with stops in common.
    radius : float
        Stops closer than this (metres) are revisits of a place; each stop is used once.
    confidence : float
        Of the intervals.

    Returns
    -------
    tuple of Repeatability
        Empty where the path does not come back. It holds the validation's own noise too.
    """
    ids = in_common([validation, gt])
    truth = validation.select(ids)
    errors = pose_difference(truth.poses, gt.select(ids).poses, truth.components)
    pairs = _close_pairs(truth.poses[:, :2], radius)
    if not len(pairs):
        return ()
    found = []
    for column, component in enumerate(truth.components):
        difference = errors[pairs[:, 0], column] - errors[pairs[:, 1], column]
        if component.kind == "angle":
            difference = wrap(difference)
        total = float((difference**2).sum()) / 2
        found.append(_with_interval(component, total, len(pairs), confidence))
    return tuple(found)


def _close_pairs(positions: Array, radius: float) -> npt.NDArray[np.intp]:
    """(m, 2) rows closer than the radius, the closest first, no row twice.

    A pair that is the first of both its rows is taken; the rest without these rows comes again.
    """
    from scipy.spatial import cKDTree  # noqa: PLC0415  (slow to import, and used for reports only)

    close = np.sort(cKDTree(positions).query_pairs(radius, output_type="ndarray"), axis=1)
    distance = np.linalg.norm(positions[close[:, 0]] - positions[close[:, 1]], axis=-1)
    # Among equal distances the order of the stops decides.
    left = close[np.lexsort((close[:, 1], close[:, 0], distance))]
    taken = np.zeros(len(positions), dtype=bool)
    pairs = [left[:0]]
    while len(left):
        place = np.arange(len(left))
        first = np.full(len(positions), len(left))
        # Of several values for one row the last written stays: the smallest.
        first[left[::-1].ravel()] = np.repeat(place[::-1], 2)
        best = (first[left] == place[:, None]).all(1)
        pairs.append(left[best])
        taken[left[best]] = True
        left = left[~taken[left].any(1)]
    return np.concatenate(pairs)


def _with_interval(
    component: Component, squares: float, dof: int, confidence: float
) -> Repeatability:
    """Standard deviation with its chi-squared interval."""
    tail = (1 - confidence) / 2
    low, high = squares / special.chdtri(dof, tail), squares / special.chdtri(dof, 1 - tail)
    root = np.sqrt(np.array([squares / dof, low, high], dtype=float))
    return Repeatability(component, float(root[0]), float(root[1]), float(root[2]), dof)
