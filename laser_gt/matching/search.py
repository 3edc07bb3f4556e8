"""Global matching: the best pose in a window, found by branch and bound, then polished.

What is guaranteed: no pose of the lattice (cell by cell by heading step) inside the window has a
higher likelihood score than the one returned, if the search was not cut off. That is the best
*score on the grid*, not the right pose: in a room that looks alike from two places, both score,
and the runners-up are returned so that this can be seen.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from laser_gt.matching.local import Alignment, align
from laser_gt.scans.evidence import Evidence, Prepared, evidence
from laser_gt.scans.planar import rotation
from laser_gt.scans.scan import Indices
from validation.poses.angles import Array, wrap


@dataclass(frozen=True)
class SearchSettings:
    """Window and lattice of the search.

    Judgements: the window is as wide as pairs are apart at most; a cell of 0.1 m with a blur as
    wide lets every wall be hit from the cells beside it; 160 points tell a room's walls apart;
    blocks of 16 cells are as large as parts of a room; beyond 400,000 nodes (seconds) the room
    looks alike from everywhere; a room has fewer than six places that look alike.

    Parameters
    ----------
    window : float
        Half width in x and y about the guess, metres.
    heading_window : float
        Half width in heading, radians.
    cell : float
        Edge of a cell, metres.
    blur : float
        Standard deviation of the likelihood about a point, metres.
    points : int
        Points of the moving sweep that are scored, spread evenly over its surfaces.
    levels : int
        Levels of the tree: a root block has 2 ** levels cells a side.
    max_nodes : int
        Bound on the nodes opened; beyond it the search is cut off, and says so.
    modes : int
        Number of distinct poses that are polished.
    """

    window: float = 4.0
    heading_window: float = np.pi
    cell: float = 0.1
    blur: float = 0.1
    points: int = 160
    levels: int = 4
    max_nodes: int = 400_000
    modes: int = 6


@dataclass(frozen=True)
class LatticeSearch:
    """Distinct best poses on the lattice.

    Parameters
    ----------
    pose : (m, 3) array
        The best first.
    score : (m,) array
        Mean likelihood of the points, 0 to 1.
    complete : bool
        Whether the first is proved to be the best of the lattice.
    nodes : int
        Blocks scored.
    """

    pose: Array
    score: Array
    complete: bool
    nodes: int


@dataclass(frozen=True)
class GlobalMatch:
    """Polished poses of a global search.

    Parameters
    ----------
    alignment : Alignment
        Of the distinct modes.
    evidence : Evidence
        Of the same.
    order : (m,) int array
        Their numbers, by falling score.
    """

    alignment: Alignment
    evidence: Evidence
    order: Indices

    @property
    def pose(self) -> Array:
        """(3,) the best pose."""
        return np.asarray(self.alignment.pose[self.order[0]])


def global_match(
    reference: Prepared,
    moving: Prepared,
    guess: npt.ArrayLike = (0.0, 0.0, 0.0),
    settings: SearchSettings | None = None,
) -> GlobalMatch:
    """The pose of a sweep in the frame of another, from anywhere in a window.

    Parameters
    ----------
    reference, moving : Prepared
        The two sweeps.
    guess : (3,) array_like
        Middle of the window.
    settings : SearchSettings
        Window and lattice.
    """
    settings = settings or SearchSettings()
    lattice = search(reference, moving, np.asarray(guess, dtype=float), settings)
    coarse = align(
        reference.surface,
        moving.surface,
        lattice.pose,
        reach=4 * settings.cell,
        stride=3,
        max_steps=10,
    )
    found = evidence(reference, moving, coarse.pose, stride=3)
    keep = distinct(coarse.pose, found.score, 0.15, np.deg2rad(4))
    alignment = align(reference.surface, moving.surface, coarse.pose[keep], reach=0.15)
    final = evidence(reference, moving, alignment.pose)
    return GlobalMatch(alignment, final, np.argsort(-final.score))


def distinct(pose: Array, score: Array, length: float, angle: float, most: int = 1000) -> Indices:
    """Indices of the best poses that differ from all better ones, the best first.

    Parameters
    ----------
    pose : (k, 3) array
        Poses.
    score : (k,) array
        The higher the better.
    length, angle : float
        Poses closer than both are the same.
    most : int
        Number wanted.
    """
    left = np.argsort(-score, kind="stable")
    kept: list[int] = []
    while len(left) and len(kept) < most:
        best = left[0]
        kept.append(int(best))
        apart = np.hypot(*(pose[left, :2] - pose[best, :2]).T) > length
        apart |= np.abs(wrap(pose[left, 2] - pose[best, 2])) > angle
        left = left[apart & (left != best)]
    return np.array(kept, dtype=np.intp)


def search(
    reference: Prepared, moving: Prepared, guess: Array, settings: SearchSettings
) -> LatticeSearch:
    """Best poses of the lattice by branch and bound.

    Notes
    -----
    Olson, "Real-time correlative scan matching" (2009); Hess et al., "Real-time loop closure in
    2D LIDAR SLAM" (2016), with blocks opened best first, many at a time.
    """
    points = thinned(moving.sweep.points, settings.points)
    headings = _headings(points, guess, settings)
    pyramid = _Pyramid.of(reference.sweep.points, points, guess, settings)
    base = pyramid.cells_of(rotation(headings) @ points.T + guess[:2, None])
    open_nodes = pyramid.roots(len(headings), settings)
    bound = pyramid.scores(base, open_nodes)
    leaves, leaf_scores = [], []
    best, nodes, complete = -1.0, len(open_nodes), True
    while len(open_nodes):
        alive = bound > best
        open_nodes, bound = open_nodes[alive], bound[alive]
        if not len(open_nodes):
            break
        if nodes > settings.max_nodes:
            complete = False
            break
        taken, open_nodes, bound = _take_best(open_nodes, bound)
        children = _split(taken, pyramid.half)
        score = pyramid.scores(base, children)
        nodes += len(children)
        is_leaf = children[:, 0] == 0
        if is_leaf.any():
            leaves.append(children[is_leaf])
            leaf_scores.append(score[is_leaf])
            best = max(best, float(score[is_leaf].max()))
        open_nodes = np.concatenate([open_nodes, children[~is_leaf]])
        bound = np.concatenate([bound, score[~is_leaf]])
    found, scores = np.concatenate(leaves), np.concatenate(leaf_scores)
    pose = np.column_stack([guess[:2] + found[:, 2:] * settings.cell, wrap(headings[found[:, 1]])])
    few = np.argsort(-scores, kind="stable")[:400]
    modes = few[distinct(pose[few], scores[few], 0.3, np.deg2rad(8), settings.modes)]
    return LatticeSearch(pose[modes], scores[modes], complete, nodes)


def thinned(points: Array, count: int) -> Array:
    """About ``count`` of the points, spread evenly over the surfaces instead of over the beams.

    A wall close by has more points than one far away; for a search, one point each few
    centimetres is enough. Every point is taken in turn that is the first of its cell, the cell
    growing until they are few enough.
    """
    cell = 0.05
    while True:
        _, first = np.unique(np.floor(points / cell), axis=0, return_index=True)
        if len(first) <= count:
            return points[np.sort(first)]
        cell *= max(1.1, 0.9 * len(first) / count)


def _headings(points: Array, guess: Array, settings: SearchSettings) -> Array:
    """Headings whose neighbours move the far points by about a cell."""
    reach = float(np.quantile(np.sqrt((points**2).sum(-1)), 0.8))
    step = settings.cell / max(reach, 1.0)
    half = min(settings.heading_window, np.pi)
    count = max(int(np.ceil(half / step)), 1)
    full_turn = half >= np.pi
    steps = np.linspace(-half, half, 2 * count + 1)[: -1 if full_turn else None]
    return np.asarray(guess[2] + steps)


@dataclass(frozen=True)
class _Pyramid:
    """Likelihood grid and its running maxima over 2 ** level cells to the right and up."""

    levels: tuple[npt.NDArray[np.uint8], ...]
    low: Array
    columns: int
    rows: int
    cell: float
    half: int

    @classmethod
    def of(
        cls, reference: Array, moving: Array, guess: Array, settings: SearchSettings
    ) -> "_Pyramid":
        """The grid around the reference points, large enough for every pose of the window."""
        import cv2  # noqa: PLC0415  (loaded when the first search is made)

        reach = float(np.sqrt((moving**2).sum(-1).max())) + settings.window
        pad = 2**settings.levels * settings.cell
        low = np.minimum(reference.min(0), guess[:2] - reach) - 1.0
        high = np.maximum(reference.max(0), guess[:2] + reach) + pad + 1.0
        columns, rows = np.ceil((high - low) / settings.cell).astype(int).tolist()
        image = np.full((rows, columns), 255, dtype=np.uint8)
        cells = ((reference - low) / settings.cell).astype(np.intp)
        image[cells[:, 1], cells[:, 0]] = 0
        distance = cv2.distanceTransform(image, cv2.DIST_L2, 5) * settings.cell
        grid = np.rint(255 * np.exp(-0.5 * (distance / settings.blur) ** 2)).astype(np.uint8)
        levels = [grid]
        for level in range(settings.levels):
            shift = 2**level
            wider = levels[-1].copy()
            np.maximum(wider[:, :-shift], levels[-1][:, shift:], out=wider[:, :-shift])
            taller = wider.copy()
            np.maximum(taller[:-shift], wider[shift:], out=taller[:-shift])
            levels.append(taller)
        half = int(np.ceil(settings.window / settings.cell))
        flat = tuple(level.ravel() for level in levels)
        return cls(flat, low, columns, rows, settings.cell, half)

    def cells_of(self, points: Array) -> Indices:
        """(h, n) flat cells of the points of each heading, (h, 2, n), at no offset."""
        column = np.floor((points[:, 0] - self.low[0]) / self.cell).astype(np.intp)
        row = np.floor((points[:, 1] - self.low[1]) / self.cell).astype(np.intp)
        return np.asarray(row * self.columns + column)

    def roots(self, headings: int, settings: SearchSettings) -> Indices:
        """(b, 4) blocks that cover the window: level, heading, column and row offset."""
        block = 2**settings.levels
        offsets = np.arange(-self.half, self.half + 1, block)
        heading, column, row = np.meshgrid(np.arange(headings), offsets, offsets, indexing="ij")
        level = np.full(heading.size, settings.levels)
        return np.column_stack([level, heading.ravel(), column.ravel(), row.ravel()])

    def scores(self, base: Indices, nodes: Indices) -> Array:
        """(b,) mean likelihood; for a block, an upper bound of that of its cells."""
        result = np.empty(len(nodes))
        size = base.shape[1] * 255.0
        for level in np.unique(nodes[:, 0]):
            rows = np.flatnonzero(nodes[:, 0] == level)
            for part in np.array_split(rows, max(1, len(rows) // 1500)):
                chosen = nodes[part]
                cells = base[chosen[:, 1]]
                cells += (chosen[:, 3] * self.columns + chosen[:, 2])[:, None]
                values = self.levels[level].take(cells, mode="clip")
                result[part] = values.sum(-1, dtype=np.uint32) / size
        return result


def _take_best(nodes: Indices, bound: Array, batch: int = 1500) -> tuple[Indices, Indices, Array]:
    """The most promising blocks, and the rest with their bounds."""
    if len(nodes) <= batch:
        return nodes, nodes[:0], bound[:0]
    order = np.argpartition(-bound, batch)
    rest = order[batch:]
    return nodes[order[:batch]], nodes[rest], bound[rest]


def _split(nodes: Indices, half: int) -> Indices:
    """The four quarters of each block, those outside of the window left out."""
    size = 2 ** (nodes[:, 0] - 1)
    quarters = []
    for right in (0, 1):
        for up in (0, 1):
            quarter = nodes.copy()
            quarter[:, 0] -= 1
            quarter[:, 2] += right * size
            quarter[:, 3] += up * size
            quarters.append(quarter)
    children = np.concatenate(quarters)
    return children[(children[:, 2] <= half) & (children[:, 3] <= half)]
