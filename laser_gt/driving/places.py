"""Pairs of sweeps that may show one place, by how well their relative pose is known."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from laser_gt.driving.links import Asked, Link
from laser_gt.placing.equations import ends_of
from laser_gt.scans.planar import between
from laser_gt.scans.scan import Indices
from validation.poses.angles import Array, wrap

if TYPE_CHECKING:
    from scipy.sparse import csr_array

NEAR = 2.0
"""Metres within which two scans show enough of the same walls. A judgement: the width of a room's
door and half, beyond which furniture hides other things."""
AWAY = 12
"""Keyframes that lie between two passes of a place at least: one and a half submaps."""
ARM = 5.0
"""Metres by which an error of the heading moves what comes after it. A judgement: a third of the
way through a building."""
TURN_WEIGHT = 1.0
"""Metres that a radian between two headings counts for, when the nearest of a pass is chosen."""
LARGEST = 2.5
"""Standard deviation in metres of a guess, beyond which no match is tried: the search is three of
them wide."""


AT_ONCE = 200
"""Keyframes whose distances to all others are in memory at once."""


@dataclass(frozen=True)
class Uncertainty:
    """Standard deviations of relative positions along the surest way, metres.

    An upper bound of that of the graph, which all ways together tell.

    Parameters
    ----------
    ways : (n, n) sparse array
        Variance that each link or step adds.
    """

    ways: "csr_array"

    def typical(self) -> float:
        """Median over pairs, of a part of the keyframes where they are many."""
        count = self.ways.shape[0]
        rows = np.linspace(0, count - 1, min(count, AT_ONCE)).astype(np.intp)
        return float(np.median(self._of(rows)))

    def of_pairs(self, pairs: Indices) -> Array:
        """(m,) of pairs of keyframes, (m, 2); infinite where nothing joins them."""
        found = np.full(len(pairs), np.inf)
        firsts, place = np.unique(pairs[:, 0], return_inverse=True)
        for start in range(0, len(firsts), AT_ONCE):
            some = firsts[start : start + AT_ONCE]
            rows = np.flatnonzero((place >= start) & (place < start + AT_ONCE))
            found[rows] = self._of(some)[place[rows] - start, pairs[rows, 1]]
        return found

    def _of(self, rows: Indices) -> Array:
        """(k, n) from some keyframes to all."""
        from scipy.sparse.csgraph import dijkstra  # noqa: PLC0415  (loaded when loops are sought)

        return np.asarray(np.sqrt(dijkstra(self.ways, directed=False, indices=rows)))


def uncertainty(count: int, links: Sequence[Link], steps: Sequence[Link]) -> Uncertainty:
    """How well keyframes are known to each other, by links and steps between them."""
    from scipy.sparse import coo_array  # noqa: PLC0415  (loaded when loops are sought)

    every = [*links, *steps]
    ends = ends_of(every)
    information = np.array([one.information for one in every])
    covariance = np.linalg.inv(information + np.diag([1.0, 1.0, 1.0]))
    angle = covariance[:, 2, 2]
    length = np.maximum(covariance[:, 0, 0], covariance[:, 1, 1]) + ARM**2 * angle
    best: dict[tuple[int, int], float] = {}
    for (start, end), cost in zip(ends.tolist(), length.tolist(), strict=True):
        key = (min(start, end), max(start, end))
        best[key] = min(best.get(key, np.inf), cost)
    pairs = np.array(list(best))
    return Uncertainty(coo_array((list(best.values()), pairs.T), shape=(count, count)).tocsr())


def loop_candidates(
    poses: Array,
    sigmas: Uncertainty,
    have: set[tuple[int, int]],
    field: float,
    most: int,
) -> list[Asked]:
    """Pairs of keyframes that may show one place.

    Parameters
    ----------
    poses : (n, 3) array
        Of the keyframes.
    sigmas : Uncertainty
        Of their distances.
    have : set of (int, int)
        Pairs that need not be asked, the smaller first.
    field : float
        Field of view of a sweep in radians.
    most : int
        Passes of its place that each keyframe is matched with.

    Returns
    -------
    list of Asked
        Of each pass the nearest, in place and heading.
    """
    from scipy.spatial import cKDTree  # noqa: PLC0415

    reach = NEAR + 2 * min(sigmas.typical(), LARGEST)
    pairs = cKDTree(poses[:, :2]).query_pairs(reach, output_type="ndarray").astype(np.intp)
    pairs = np.sort(pairs, axis=1)
    apart = pairs[:, 1] - pairs[:, 0] >= AWAY
    pairs = pairs[apart]
    distance = np.hypot(*(poses[pairs[:, 0], :2] - poses[pairs[:, 1], :2]).T)
    turned = np.abs(wrap(poses[pairs[:, 0], 2] - poses[pairs[:, 1], 2]))
    sigma = sigmas.of_pairs(pairs)
    usable = (distance < NEAR + 2 * sigma) & (sigma < LARGEST)
    usable &= turned < max(field - np.deg2rad(90.0), np.deg2rad(60.0))
    pairs, sigma = pairs[usable], sigma[usable]
    cost = distance[usable] + TURN_WEIGHT * turned[usable]
    return _nearest_of_passes(poses, pairs, sigma, cost, have, most)


def _nearest_of_passes(
    poses: Array,
    pairs: Indices,
    sigma: Array,
    cost: Array,
    have: set[tuple[int, int]],
    most: int,
) -> list[Asked]:
    """Of each keyframe's earlier passes of a place, the nearest keyframe of each."""
    asked = []
    order = np.lexsort((cost, pairs[:, 1]))
    done: dict[int, list[int]] = {}
    for row in order.tolist():
        first, second = pairs[row].tolist()
        taken = done.setdefault(second, [])
        if len(taken) >= most or any(abs(first - other) < AWAY for other in taken):
            continue
        taken.append(first)
        if (first, second) in have:
            continue
        length = max(float(sigma[row]), 0.02)
        guess = between(poses[first], poses[second])
        asked.append(Asked(first, second, guess, (length, max(length / ARM, 0.01))))
    return asked
