"""One step of the adjustment of a drive: curves, offsets, scanners, road and pieces, all at once.

Each piece of a wall is eliminated where it stands; what is left is one dense system of the path
and the few numbers of the vehicle.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy import sparse

from rtk_gt.receivers.fixes import Ints
from rtk_gt.sensors.ground import ROAD, ground_rows, motion_rows, road_beside
from rtk_gt.sensors.pass_matching import change_from, perturbed
from rtk_gt.sensors.scanner_equations import SHAPE, Given, ScanRows, State, scan_rows
from rtk_gt.sensors.surfaces import Surfaces
from rtk_gt.sensors.trajectory import (
    Vehicle,
    antenna_equations,
    fix_sigmas,
    pose_columns,
    roughness_information,
)
from validation.poses.angles import Array

CLUSTER = 4.0
"""Edge in metres of the cells whose pieces are subtracted together: the same passes saw them. It
decides the time taken, not the result."""


@dataclass(frozen=True)
class _Places:
    """First column of each group of unknowns, and the number of all but the pieces."""

    vehicle: int
    scanners: int
    ground: int
    total: int


def _places(state: State) -> _Places:
    vehicle = state.spline.coefficients.size
    scanners = vehicle + state.vehicle.size
    ground = scanners + state.places.size
    return _Places(vehicle, scanners, ground, ground + ROAD)


class NormalEquations:
    """Normal equations H x = -gradient of all but the pieces."""

    def __init__(self, total: int) -> None:
        # Both halves are kept; in this order the factor takes the place of the matrix.
        self.H = np.zeros((total, total), order="F")
        self.gradient = np.zeros(total)

    def add(self, columns: Ints, information: Array, gradient: Array) -> None:
        """A dense block at some columns."""
        self.H.T[columns[:, None], columns] += information
        self.gradient[columns] += gradient

    def add_rows(self, J: "sparse.csr_matrix", residual: Array) -> None:
        """Sparse rows from the first column on."""
        self.add_information((J.T @ J).tocoo(), J.T @ residual)

    def add_information(self, information: "sparse.coo_matrix", gradient: Array) -> None:
        """Sparse information from the first column on."""
        information.sum_duplicates()
        self.H[information.row, information.col] += information.data
        self.gradient[: len(gradient)] += gradient


@dataclass(frozen=True)
class _Pieces:
    """What the numbers of all pieces are once the rest is known: -(inverse @ (of_rest @ x + own)).

    ``inverse`` (6 c, 6 c) has a block a piece, ``of_rest`` (6 c, total), ``own`` (6 c,).
    """

    inverse: "sparse.csr_matrix"
    of_rest: "sparse.csr_matrix"
    own: Array

    def change(self, rest: Array) -> Array:
        """(c, 6) change that belongs to that of all other unknowns."""
        return np.asarray(-(self.inverse @ (self.of_rest @ rest + self.own))).reshape(-1, SHAPE)


def gauss_newton_step(data: Given, state: State, surfaces: Surfaces) -> tuple[State, Array]:
    """One Gauss-Newton step, and the covariance (6 k, 6 k) of the scanners' places there."""
    places = _places(state)
    equations = other_equations(data, state)
    pieces = _add_scans(equations, data, state, surfaces, places)
    factor = scipy.linalg.cho_factor(equations.H, lower=True, overwrite_a=True, check_finite=False)
    chosen = slice(places.scanners, places.ground)
    right = np.zeros((places.total, 1 + state.places.size), order="F")
    right[:, 0] = -equations.gradient
    right[chosen, 1:] = np.eye(state.places.size)
    solved = scipy.linalg.cho_solve(factor, right, overwrite_b=True, check_finite=False)
    change, covariance = solved[:, 0], solved[chosen, 1:]
    moved = State(
        state.spline.moved(change[: places.vehicle].reshape(-1, 6)),
        state.vehicle.moved(change[places.vehicle : places.scanners]),
        np.array(
            [
                perturbed(*pair)
                for pair in zip(state.places, change[chosen].reshape(-1, 6), strict=True)
            ]
        ),
        state.ground + change[places.ground :],
        state.pieces + pieces.change(change),
    )
    return moved, (covariance + covariance.T) / 2


def other_equations(data: Given, state: State) -> NormalEquations:
    """What is known of all but the pieces apart from points on pieces."""
    places = _places(state)
    equations = NormalEquations(places.total)
    _add_known(equations, data, state, places)
    _add_fixes(equations, data, state)
    if data.ground is not None:
        _add_road(equations, data, state, places)
    return equations


def _add_known(equations: NormalEquations, data: Given, state: State, places: _Places) -> None:
    """All that is known beforehand."""
    smooth, slope = roughness_information(state.spline)
    equations.add_information(smooth.tocoo(), slope)
    information, wanted = data.prior
    made = _vehicle_change(data.trajectory.vehicle, state.vehicle)
    by_hand = [change_from(*pair) for pair in zip(data.starts, state.places, strict=True)]
    weight = np.ones(ROAD) if data.ground is None else data.ground.sigmas**-2
    shape = np.zeros(ROAD) if data.ground is None else data.ground.shape
    hand = data.sigmas.ravel() ** -2
    diagonal = np.concatenate([information, hand, weight])
    gradient = np.concatenate(
        [
            information * (made - wanted),
            hand * np.ravel(by_hand),
            weight * (state.ground - shape),
        ]
    )
    equations.add(np.arange(places.vehicle, places.total), np.diag(diagonal), gradient)


def _vehicle_change(first: Vehicle, now: Vehicle) -> Array:
    """Change (k,) of offsets and distances."""
    moved = (now.antennas - first.antennas).ravel()
    by_distance = np.linalg.pinv(first.by_distance) @ moved
    return np.concatenate([(now.offsets - first.offsets)[1:].ravel(), by_distance])


def _add_fixes(equations: NormalEquations, data: Given, state: State) -> None:
    fixes = data.trajectory.fixes
    sigmas = fix_sigmas(data.trajectory.noise)
    residual, by_pose, by_vehicle = antenna_equations(state.spline, state.vehicle, fixes)
    path = pose_columns(state.spline, fixes.times, by_pose / sigmas[:, None])
    vehicle = sparse.csr_matrix((by_vehicle / sigmas[:, None]).reshape(path.shape[0], -1))
    equations.add_rows(sparse.hstack([path, vehicle], format="csr"), (residual / sigmas).ravel())


def _add_road(equations: NormalEquations, data: Given, state: State, places: _Places) -> None:
    """The road beside the vehicle, and the direction of motion over it."""
    if data.ground is None:
        raise ValueError("no ground is known")
    road = data.road
    beside = road_beside(
        road.in_vehicle(state.places),
        road.of,
        road.times[road.scan],
        data.trajectory.spline,
        data.ground,
    )
    J, residual = ground_rows(beside, state.places, state.ground, data.ground)
    equations.add(np.arange(places.scanners, places.total), J.T @ J, J.T @ residual)
    path, by_ground, residual = motion_rows(state.spline, state.ground, data.ground)
    between = sparse.csr_matrix((len(residual), places.ground - places.vehicle))
    rows = sparse.hstack([path, between, sparse.csr_matrix(by_ground)], format="csr")
    equations.add_rows(rows, residual)


def _add_scans(
    equations: NormalEquations, data: Given, state: State, surfaces: Surfaces, places: _Places
) -> _Pieces:
    """The points on the pieces, with the pieces eliminated."""
    rows = scan_rows(data, state, surfaces)
    scan = data.points.scan[surfaces.points]
    at, weights = state.spline.basis(data.points.times)
    scanner = data.points.scanner[scan]
    columns = np.hstack(
        [
            (6 * at[scan][:, :, None] + np.arange(6)).reshape(len(scan), -1),
            places.scanners + 6 * scanner[:, None] + np.arange(6),
        ]
    )
    by_path = weights[scan][:, :, None] * rows.by_pose[:, None, :]
    values = np.hstack([by_path.reshape(len(scan), -1), rows.by_place])
    # Points of one interval between knots have the same columns: they are one small block.
    _add_alike(equations, columns, values, rows.residual, at[scan, 0] * len(state.places) + scanner)
    J = _placed(values, columns, places.total)
    pieces = _eliminated(data, state, surfaces, rows, J)
    _subtract(equations, surfaces, pieces)
    return pieces


def _add_alike(
    equations: NormalEquations, columns: Ints, values: Array, residual: Array, key: Ints
) -> None:
    order = np.argsort(key, kind="stable")
    for mine in np.split(order, np.flatnonzero(np.diff(key[order])) + 1):
        J = values[mine]
        equations.add(columns[mine[0]], J.T @ J, J.T @ residual[mine])


def _eliminated(
    data: Given, state: State, surfaces: Surfaces, rows: ScanRows, J: "sparse.csr_matrix"
) -> _Pieces:
    count = len(state.pieces)
    P = _placed(rows.by_piece, SHAPE * surfaces.of[:, None] + np.arange(SHAPE), SHAPE * count)
    # Pieces rest on their points; the little here keeps a line of points from tilting freely.
    own = np.tile([1e-2, 1.0, 1.0, *[data.settings.bend**-2] * 3], count)
    A = (P.T @ P + sparse.diags(own)).tobsr((SHAPE, SHAPE))
    A.sort_indices()
    inverse = sparse.bsr_matrix(
        (np.linalg.inv(A.data), np.arange(count), np.arange(count + 1)), A.shape
    )
    gradient = P.T @ rows.residual + own * state.pieces.ravel()
    return _Pieces(inverse.tocsr(), (P.T @ J).tocsr(), gradient)


def _subtract(equations: NormalEquations, surfaces: Surfaces, pieces: _Pieces) -> None:
    """Take out of the normal equations what the pieces take up."""
    solved = pieces.inverse @ pieces.of_rest
    cells = np.floor(surfaces.centres / CLUSTER).astype(np.int64)
    _, cluster = np.unique(cells, axis=0, return_inverse=True)
    order = np.argsort(cluster.ravel(), kind="stable")
    for mine in np.split(order, np.flatnonzero(np.diff(cluster.ravel()[order])) + 1):
        rows = (SHAPE * mine[:, None] + np.arange(SHAPE)).ravel()
        own, part = pieces.of_rest[rows], solved[rows]
        columns = np.unique(own.indices)
        left, right = own[:, columns].toarray(), part[:, columns].toarray()
        equations.add(columns, -(left.T @ right), -(right.T @ pieces.own[rows]))


def _placed(values: Array, columns: Ints, total: int) -> "sparse.csr_matrix":
    m, k = values.shape
    return sparse.csr_matrix((values.ravel(), columns.ravel(), np.arange(m + 1) * k), (m, total))
