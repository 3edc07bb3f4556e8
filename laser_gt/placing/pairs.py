"""Candidate pairs: which scans are likely to show the same place, from the initial guess."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from laser_gt.scans.planar import between, transform
from laser_gt.scans.scan import Flags, Indices, Sweep
from validation.poses.angles import Array, wrap


@dataclass(frozen=True)
class PairSettings:
    """Limits on what is matched.

    Judgements: within 4 m and with a third of the view in common two scans of a room show enough
    of the same walls, and eight neighbours make loops in all directions.

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


WIDER = (1.0, 1.5, 2.0, 3.0)
"""Factors on the radius, tried in turn until chains of pairs join all stops. A judgement: three
times the distance that was stated is still a neighbour, and more is another room."""


def find_pairs(
    poses: Array,
    sweeps: Sequence[Sweep],
    settings: PairSettings,
    decided: Iterable[tuple[str, str]] = (),
) -> Indices:
    """Pairs to be matched, and those that a decision names.

    Parameters
    ----------
    poses : (n, 3) array
        Initial guess of the sweeps' frames in any common frame.
    sweeps : sequence of Sweep
        One for each.
    settings : PairSettings
        Limits. Where the radius leaves stops without a chain of pairs to the others, it is made
        larger.
    decided : iterable of (str, str)
        Names of stops whose pair is taken in any case.

    Returns
    -------
    (m, 2) int array
        Stops, the smaller index first.
    """
    for wider in WIDER:
        pairs = candidate_pairs(poses, sweeps, replace(settings, radius=settings.radius * wider))
        if connected_stops(len(sweeps), pairs, [0]).all():
            break
    number = {sweep.name: index for index, sweep in enumerate(sweeps)}
    named = dict.fromkeys(
        tuple(sorted((number[reference], number[moving]))) for reference, moving in decided
    )
    have = {tuple(pair) for pair in pairs.tolist()}
    more = [pair for pair in named if pair not in have]
    return np.concatenate([pairs, np.array(more, dtype=np.intp).reshape(-1, 2)])


def connected_stops(count: int, pairs: npt.ArrayLike, roots: Sequence[int]) -> Flags:
    """(count,) True for stops that a chain of pairs, (m, 2), connects with a root."""
    reached = np.zeros(count, dtype=bool)
    reached[list(roots)] = True
    joined = np.asarray(pairs, dtype=np.intp).reshape(-1, 2)
    while True:
        before = int(reached.sum())
        reached[joined[reached[joined].any(1)]] = True
        if int(reached.sum()) == before:
            return reached


def parts_of(count: int, pairs: npt.ArrayLike) -> Indices:
    """(count,) the part that each stop is in, its first stop, where pairs, (m, 2), join stops."""
    from scipy import sparse  # noqa: PLC0415  (loaded when stops are joined)
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415

    joined = np.asarray(pairs, dtype=np.intp).reshape(-1, 2)
    ones = np.ones(len(joined))
    graph = sparse.coo_array((ones, (joined[:, 0], joined[:, 1])), shape=(count, count))
    _, labels = connected_components(graph, directed=False)
    _, first, which = np.unique(labels, return_index=True, return_inverse=True)
    return np.asarray(first[which], dtype=np.intp)


def bridges(poses: Array, pairs: Indices, parts: Indices, most: int) -> Indices:
    """(k,) rows of the pairs, (m, 2), that join different parts: for each two parts the shortest.

    Parameters
    ----------
    poses : (n, 3) array
        Initial guess of the stops.
    pairs : (m, 2) int array
        To choose from.
    parts : (n,) int array
        Part of each stop.
    most : int
        Pairs for each two parts.
    """
    ends = np.sort(parts[pairs], axis=1)
    between_parts: dict[tuple[int, int], list[int]] = {}
    for row in np.argsort(distances(poses, pairs), kind="stable").tolist():
        if ends[row, 0] != ends[row, 1]:
            between_parts.setdefault((int(ends[row, 0]), int(ends[row, 1])), []).append(row)
    chosen = sorted(row for rows in between_parts.values() for row in rows[:most])
    return np.array(chosen, dtype=np.intp)


def candidate_pairs(poses: Array, sweeps: Sequence[Sweep], settings: PairSettings) -> Indices:
    """Pairs of stops, (m, 2), that are near enough to each other, and look the same way.

    Parameters as for `find_pairs`.

    Notes
    -----
    AD2.3, "Finding Pairs of Corresponding Scans": a kd-tree over the initial guess.
    """
    from scipy.spatial import cKDTree  # noqa: PLC0415  (loaded when stops are paired)

    near = cKDTree(poses[:, :2]).query_pairs(settings.radius, output_type="ndarray")
    near = np.sort(np.asarray(near, dtype=np.intp).reshape(-1, 2), axis=1)
    turned = np.abs(wrap(poses[near[:, 1], 2] - poses[near[:, 0], 2]))
    near = near[turned <= settings.heading + 1e-9]
    near = near[expected_overlaps(poses, sweeps, near) >= settings.overlap]
    keep = nearest_pairs(poses, near, settings.most)
    order = np.lexsort((near[keep, 1], near[keep, 0]))
    return near[keep][order]


def distances(poses: Array, pairs: Indices) -> Array:
    """(m,) distances of the two stops of pairs, metres."""
    return np.asarray(np.hypot(*(poses[pairs[:, 0], :2] - poses[pairs[:, 1], :2]).T))


def nearest_pairs(poses: Array, pairs: Indices, most: int) -> Indices:
    """(k,) rows of the pairs, (m, 2), that are among the ``most`` nearest of one of their stops."""
    if not len(pairs):
        return np.zeros(0, dtype=np.intp)
    distance = distances(poses, pairs)
    kept: set[int] = set()
    for stop in np.unique(pairs):
        mine = np.flatnonzero((pairs == stop).any(1))
        kept.update(mine[np.argsort(distance[mine], kind="stable")[:most]].tolist())
    return np.array(sorted(kept), dtype=np.intp)


def expected_overlaps(poses: Array, sweeps: Sequence[Sweep], pairs: Indices) -> Array:
    """(m,) share of the points of both sweeps that lie in the other's field of view and reach.

    Parameters
    ----------
    poses : (n, 3) array
        Of the sweeps' frames.
    sweeps : sequence of Sweep
        One for each.
    pairs : (m, 2) int array
        Of sweeps.

    Notes
    -----
    Walls in between are not asked; this is an upper bound that costs little.
    """
    points = [sweep.points[::4] for sweep in sweeps]
    counts = np.array([len(some) for some in points])
    inside = np.zeros(len(pairs))
    for source, target in ((1, 0), (0, 1)):
        for stop in np.unique(pairs[:, target]).tolist():
            rows = np.flatnonzero(pairs[:, target] == stop)
            others = pairs[rows, source]
            of = np.repeat(np.arange(len(rows)), counts[others])
            T = between(poses[stop], poses[others])[of]
            seen = _in_view(
                sweeps[stop],
                transform(T, np.concatenate([points[j] for j in others])[:, None])[:, 0],
            )
            inside[rows] += np.bincount(of, weights=seen, minlength=len(rows))
    return np.asarray(inside / np.maximum(counts[pairs].sum(1), 1))


def _in_view(sweep: Sweep, points: Array) -> Flags:
    """(n,) whether points (n, 2) of a sweep's frame lie in its field of view and reach."""
    seen = np.zeros(len(points), dtype=bool)
    for view in sweep.views:
        offset = points - view.mount[:2]
        azimuth = np.arctan2(offset[:, 1], offset[:, 0]) - view.mount[2]
        start = view.scan.angles[0]
        within = np.mod(azimuth - start, 2 * np.pi) <= view.scan.angles[-1] - start + 1e-6
        seen |= within & (np.hypot(*offset.T) <= 1.1 * sweep.reach)  # a judgement
    return seen
