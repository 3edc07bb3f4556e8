"""Candidate pairs: which scans are likely to show the same place, from the initial guess."""

from dataclasses import dataclass

import numpy as np

from laser_gt.scans.planar import between, transform
from laser_gt.scans.scan import Indices, Sweep
from validation.poses.angles import Array, wrap


@dataclass(frozen=True)
class PairSettings:
    """Limits on what is worth matching.

    Parameters
    ----------
    radius : float
        Largest distance between two stops, metres.
    heading : float
        Largest difference of heading, radians; pi for scanners that see all around.
    overlap : float
        Least expected overlap, 0 to 1.
    most : int
        Largest number of pairs a stop starts; its nearest neighbours are taken.
    """

    radius: float = 4.0
    heading: float = float(np.pi)
    overlap: float = 0.35
    most: int = 8


@dataclass(frozen=True)
class CandidatePairs:
    """Pairs worth matching.

    Parameters
    ----------
    index : (m, 2) int array
        Stops, the smaller index first.
    overlap : (m,) array
        Expected overlap.
    """

    index: Indices
    overlap: Array


def candidate_pairs(
    poses: Array, sweeps: list[Sweep], settings: PairSettings | None = None
) -> CandidatePairs:
    """Pairs of stops that are near enough to each other, and look the same way.

    Parameters
    ----------
    poses : (n, 3) array
        Initial guess of the sweeps' frames in any common frame.
    sweeps : list of Sweep
        One for each.
    settings : PairSettings
        Limits.

    Notes
    -----
    AD2.3, "Finding Pairs of Corresponding Scans": a kd-tree over the initial guess.
    """
    from scipy.spatial import cKDTree  # noqa: PLC0415  (loaded when stops are paired)

    settings = settings or PairSettings()
    near = cKDTree(poses[:, :2]).query_pairs(settings.radius, output_type="ndarray")
    near = np.sort(np.asarray(near, dtype=np.intp).reshape(-1, 2), axis=1)
    turned = np.abs(wrap(poses[near[:, 1], 2] - poses[near[:, 0], 2]))
    near = near[turned <= settings.heading + 1e-9]
    overlap = np.array(
        [expected_overlap(poses[i], poses[j], sweeps[i], sweeps[j]) for i, j in near]
    )
    enough = overlap >= settings.overlap if len(near) else np.zeros(0, dtype=bool)
    near, overlap = near[enough], overlap[enough]
    keep = _nearest(poses, near, settings.most)
    order = np.lexsort((near[keep, 1], near[keep, 0]))
    return CandidatePairs(near[keep][order], overlap[keep][order])


def _nearest(poses: Array, pairs: Indices, most: int) -> Indices:
    """Pairs that are among the nearest of one of their two stops."""
    if not len(pairs):
        return np.zeros(0, dtype=np.intp)
    distance = np.hypot(*(poses[pairs[:, 0], :2] - poses[pairs[:, 1], :2]).T)
    kept: set[int] = set()
    for stop in np.unique(pairs):
        mine = np.flatnonzero((pairs == stop).any(1))
        kept.update(mine[np.argsort(distance[mine], kind="stable")[:most]].tolist())
    return np.array(sorted(kept), dtype=np.intp)


def expected_overlap(first: Array, second: Array, one: Sweep, other: Sweep) -> float:
    """Share of the points of both sweeps that lie in the other's field of view and reach.

    Walls in between are not asked; this is an upper bound that costs little.
    """
    inside = total = 0
    for a, b, source, target in ((first, second, other, one), (second, first, one, other)):
        points = transform(between(a, b), source.points[::4])
        seen = np.zeros(len(points), dtype=bool)
        for view in target.views:
            offset = points - view.mount[:2]
            azimuth = np.arctan2(offset[:, 1], offset[:, 0]) - view.mount[2]
            start = view.scan.angles[0]
            within = np.mod(azimuth - start, 2 * np.pi) <= view.scan.angles[-1] - start + 1e-6
            seen |= within & (np.hypot(*offset.T) <= 1.1 * target.reach)
        inside += int(seen.sum())
        total += len(points)
    return inside / max(total, 1)
