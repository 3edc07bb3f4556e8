"""Flat pieces of walls and ground that several passes of a vehicle have seen."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from rtk_gt.receivers.fixes import Bools, Ints
from validation.poses.angles import Array

_FEWEST = 12
"""Points that make a plane: a judgement, three times the numbers of a plane and its centre."""
_ALIKE = 0.8
"""Cosine of the angle between normals of one surface, 37 degrees: a judgement that keeps the walls
of a corner apart."""


@dataclass(frozen=True)
class Surfaces:
    """Planes, and the points that lie on them.

    Parameters
    ----------
    centres : (c, 3) array
        A point of each plane, metres.
    axes : (c, 3, 3) array
        Two directions in the plane and its normal, one a row.
    points : (m,) int array
        Rows of the points that belong to a plane.
    of : (m,) int array
        The plane that each belongs to.
    """

    centres: Array
    axes: Array
    points: Ints
    of: Ints

    def local(self, world: Array) -> Array:
        """(m, 3) coordinates of the points in the frames of their planes; the third is height."""
        away = world[self.points] - self.centres[self.of]
        return np.asarray(np.einsum("mij,mj->mi", self.axes[self.of], away))


def shared_surfaces(
    world: Array, origins: Array, times: Array, *, size: float, gate: float, apart: float
) -> Surfaces:
    """Planes that passes at least some seconds apart have seen from the same side.

    Parameters
    ----------
    world : (n, 3) array
        Points, metres.
    origins : (n, 3) array
        Where the scanner was when it saw each.
    times : (n,) array
        When, seconds.
    size : float
        Edge of the pieces, metres.
    gate : float
        Points of one piece are within so many metres of its plane.
    apart : float
        Seconds between passes.

    Notes
    -----
    Seeds come from cells of a grid; the points of each plane are then gathered symmetrically
    about it. Cutting surfaces at the walls of the grid instead would cut off the noise of one
    side and pull passes together.
    """
    centres, normals, spread = _seeds(world, size, gate)
    tree = cKDTree(world)
    chosen = _thinned(centres, normals, spread, size, gate)
    frames: list[tuple[Array, Array]] = []
    points, owners, distances = [], [], []
    for seed in chosen:
        near = np.array(tree.query_ball_point(centres[seed], 0.75 * size + gate), dtype=np.int64)
        found = _piece(world, origins, near, centres[seed], normals[seed], (size, gate))
        if found is None or np.ptp(times[found[2]]) < apart:
            continue
        centre, axes, rows = found
        if not _several_passes(times[rows], apart):
            continue
        owners.append(np.full(len(rows), len(frames)))
        frames.append((centre, axes))
        points.append(rows)
        distances.append(np.linalg.norm(world[rows] - centre, axis=1))
    if not frames:
        return Surfaces(np.empty((0, 3)), np.empty((0, 3, 3)), np.empty(0, int), np.empty(0, int))
    return _owned(frames, np.concatenate(points), np.concatenate(owners), np.concatenate(distances))


def _seeds(world: Array, size: float, gate: float) -> tuple[Array, Array, Ints]:
    """Centres, normals and numbers of points of grid cells that hold something flat."""
    cell = np.floor(world / size).astype(np.int64)
    _, inverse, counts = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    inverse = inverse.ravel()
    sums = np.stack([np.bincount(inverse, world[:, k]) for k in range(3)], axis=1)
    centres = sums / counts[:, None]
    away = world - centres[inverse]
    second = np.empty((len(counts), 3, 3))
    for i in range(3):
        for j in range(3):
            second[:, i, j] = np.bincount(inverse, away[:, i] * away[:, j])
    values, vectors = np.linalg.eigh(second / counts[:, None, None])
    # Judgements: an even square of that size has a variance of (0.29 size)^2 along each edge, less
    # than half of that is a strip; across, a sixth of it in variance is no longer flat.
    flat = (values[:, 0] < gate**2) & (values[:, 1] > (0.12 * size) ** 2) & (counts >= _FEWEST)
    flat &= values[:, 0] < 0.15 * values[:, 1]
    return centres[flat], vectors[flat, :, 0], counts[flat]


def _thinned(centres: Array, normals: Array, counts: Ints, size: float, gate: float) -> Ints:
    """Seeds, the strongest first, without those that lie on the piece of a stronger one."""
    if len(centres) == 0:
        return np.empty(0, dtype=np.int64)
    tree = cKDTree(centres)
    open_seeds = np.ones(len(centres), dtype=bool)
    chosen = []
    for seed in np.argsort(-counts, kind="stable"):
        if not open_seeds[seed]:
            continue
        chosen.append(int(seed))
        near = np.array(tree.query_ball_point(centres[seed], 0.6 * size + gate), dtype=np.int64)
        alike = np.abs(normals[near] @ normals[seed]) > _ALIKE
        close = np.abs((centres[near] - centres[seed]) @ normals[seed]) < 2 * gate
        open_seeds[near[alike & close]] = False
    return np.array(chosen, dtype=np.int64)


def _piece(
    world: Array,
    origins: Array,
    near: Ints,
    centre: Array,
    normal: Array,
    extent: tuple[float, float],
) -> tuple[Array, Array, Ints] | None:
    """Centre, axes and rows of the points of one plane, gathered about it three times."""
    size, gate = extent
    rows = near
    for _ in range(3):
        away = world[near] - centre
        height = away @ normal
        flat = np.linalg.norm(away - height[:, None] * normal, axis=1)
        rows = near[(np.abs(height) < gate) & (flat < 0.6 * size)]
        if len(rows) < _FEWEST:
            return None
        centre, axes, values = _plane(world[rows])
        normal = axes[2]
    # A little less strict and more strict than for the seeds: a judgement.
    if values[1] < (0.1 * size) ** 2 or values[0] > 0.1 * values[1]:
        return None
    side = np.einsum("ni,i->n", origins[rows] - world[rows], normal) > 0
    majority = side.mean() > 0.5
    # A thin wall has two sides: only those who look at the same one may be compared.
    rows = rows[side == majority]
    return (centre, axes, rows) if len(rows) >= _FEWEST else None


def _plane(points: Array) -> tuple[Array, Array, Array]:
    """Centre, axes (two in the plane, then the normal) and variances, smallest first."""
    centre = points.mean(0)
    away = points - centre
    values, vectors = np.linalg.eigh(away.T @ away / len(points))
    return centre, vectors[:, ::-1].T, values


def _several_passes(times: Array, apart: float) -> bool:
    """True if a pause of ``apart`` seconds lies between the points."""
    ordered = np.sort(times)
    return bool(np.diff(ordered).max() >= apart)


def _owned(
    frames: list[tuple[Array, Array]], points: Ints, owners: Ints, distances: Array
) -> Surfaces:
    """Each point only to the plane whose centre is nearest."""
    order = np.lexsort((distances, points))
    points, owners = points[order], owners[order]
    first: Bools = np.concatenate([[True], np.diff(points) > 0])
    centres = np.array([centre for centre, _ in frames])
    axes = np.array([axis for _, axis in frames])
    return Surfaces(centres, axes, points[first], owners[first])
