"""One adjustment of a drive: curves, offsets, scanner, road and pieces of walls, all at once.

Residuals are those of the fixes, of points about their pieces, of the road and of the direction of
motion over it, each whitened; the normal equations are sparse.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from rtk_gt.fixes import Ints
from rtk_gt.ground import ROAD, KnownGround, ground_rows, motion_rows
from rtk_gt.orientation import matrix_of
from rtk_gt.pass_matching import MatchingSettings, change_from, perturbed, weights_of
from rtk_gt.scans import Cloud
from rtk_gt.surfaces import Surfaces
from rtk_gt.trajectory import (
    Spline,
    Trajectory,
    Vehicle,
    antenna_equations,
    fix_sigmas,
    point_rows,
    pose_columns,
    roughness_information,
)
from validation.angles import Array
from validation.robust import sigma_from_median

GRAZING = 0.3
"""Surfaces are rough: the noise across them is at least this share of that along the beam."""
SHAPE = 6
"""Numbers of a piece: height, two slopes, three curvatures."""


@dataclass(frozen=True)
class ScannerSettings:
    """How scans and fixes are adjusted.

    ``apart``: passes are at least so many seconds apart. ``pieces``: edge of the flat pieces and
    how far from their planes points may be, metres, from round to round; the last are used until
    the scanner stays where it is. ``points``: at most so many are used. ``block`` and
    ``independent``: of the points that one piece shows in so many seconds, so many count, as they
    share what the curves and the plane leave out. ``sharpest``: least standard deviation of a
    point, metres. ``bend``: standard deviation of the curvature of walls and ground, 1/m.
    ``matching``: of the first, rough solution.
    """

    apart: float = 8.0
    pieces: tuple[tuple[float, float], ...] = ((2.0, 0.6), (2.0, 0.4), (1.5, 0.3), (1.5, 0.2))
    points: int = 60_000
    block: float = 1.0
    independent: int = 4
    sharpest: float = 0.005
    bend: float = 0.02
    matching: MatchingSettings = field(
        default_factory=lambda: MatchingSettings(sources=6000, gates=(1.0, 0.7, 0.5, 0.5))
    )


@dataclass(frozen=True)
class State:
    """All unknowns: curves, vehicle, scanner (6,), road (5,) and pieces (c, 6)."""

    spline: Spline
    vehicle: Vehicle
    pose: Array
    ground: Array
    pieces: Array


@dataclass(frozen=True)
class _Places:
    """First column of each group of unknowns, and the number of all."""

    vehicle: int
    scanner: int
    ground: int
    pieces: int
    total: int


@dataclass(frozen=True)
class Given:
    """All that does not change: fixes, points with their times, what is known beforehand.

    ``cloud`` are the points for walls and ground, ``road`` all that may be on the road.
    """

    trajectory: Trajectory
    cloud: Cloud
    times: Array
    road: Cloud
    road_times: Array
    start: Array
    sigmas: Array
    ground: KnownGround | None
    prior: tuple[Array, Array]
    settings: ScannerSettings


def world_points(data: Given, state: State) -> tuple[Array, Array, Array]:
    """Points and scanner positions in the local frame, and the poses, one a point."""
    poses = state.spline.poses(data.times)
    R = matrix_of(poses[:, 3:])
    own = data.cloud.in_vehicle(state.pose)
    world = np.einsum("nij,nj->ni", R, own) + poses[:, :3]
    return world, R @ state.pose[:3] + poses[:, :3], poses


def scan_residuals(data: Given, state: State, surfaces: Surfaces) -> Array:
    """(m,) distances of points from their slightly bent pieces, metres."""
    local = surfaces.local(world_points(data, state)[0])
    return _heights(local, state.pieces[surfaces.of])


def _bends(local: Array) -> Array:
    """(m, 6) what the numbers of a piece are multiplied by: 1, u, v, u^2 / 2, u v, v^2 / 2."""
    u, v = local[:, 0], local[:, 1]
    return np.column_stack([np.ones(len(u)), u, v, u**2 / 2, u * v, v**2 / 2])


def _heights(local: Array, pieces: Array) -> Array:
    """(m,) heights of points over their slightly bent pieces."""
    return np.asarray(local[:, 2] - (_bends(local) * pieces).sum(1))


def _places(state: State) -> _Places:
    vehicle = state.spline.coefficients.size
    scanner = vehicle + state.vehicle.size
    ground = scanner + 6
    pieces = ground + ROAD
    return _Places(vehicle, scanner, ground, pieces, pieces + SHAPE * len(state.pieces))


def gauss_newton_step(data: Given, state: State, surfaces: Surfaces) -> tuple[State, Array]:
    """One Gauss-Newton step, and the covariance (6, 6) of the scanner's pose there."""
    places = _places(state)
    rows = [_fix_rows(data, state, places), _scan_rows(data, state, surfaces, places)]
    if data.ground is not None:
        rows += [_road_rows(data, state, places), _motion_rows(data, state, places)]
    J = sparse.vstack([part[0] for part in rows], format="csr")
    residual = np.concatenate([part[1] for part in rows])
    H, gradient = _known(data, state)
    H = (H + J.T @ J).tocsc()
    gradient = gradient + J.T @ residual
    # Symmetric and positive: no pivoting, which keeps the factors sparse.
    factor = splu(
        H, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    change = factor.solve(-gradient)
    chosen = slice(places.scanner, places.ground)
    unit = np.zeros((places.total, 6))
    unit[chosen] = np.eye(6)
    covariance = factor.solve(unit)[chosen]
    k = places.pieces
    moved = State(
        state.spline.moved(change[: places.vehicle].reshape(-1, 6)),
        state.vehicle.moved(change[places.vehicle : places.scanner]),
        perturbed(state.pose, change[places.scanner : places.ground]),
        state.ground + change[places.ground : k],
        state.pieces + change[k:].reshape(-1, SHAPE),
    )
    return moved, (covariance + covariance.T) / 2


def _known(data: Given, state: State) -> tuple["sparse.csc_matrix", Array]:
    """Information and gradient of all that is known beforehand."""
    smooth, slope = roughness_information(state.spline)
    information, wanted = data.prior
    made = _vehicle_change(data.trajectory.vehicle, state.vehicle)
    diagonal = [information, 1 / data.sigmas**2]
    gradient = [slope, information * (made - wanted)]
    gradient.append(change_from(data.start, state.pose) / data.sigmas**2)
    if data.ground is None:
        diagonal.append(np.ones(ROAD))
        gradient.append(np.zeros(ROAD))
    else:
        weight = data.ground.sigmas**-2
        diagonal.append(weight)
        gradient.append(weight * (state.ground - data.ground.shape))
    # Pieces rest on their points; the little here keeps a line of points from tilting freely.
    own = np.tile([1e-2, 1.0, 1.0, *[data.settings.bend**-2] * 3], len(state.pieces))
    diagonal.append(own)
    gradient.append(own * state.pieces.ravel())
    H = sparse.block_diag([smooth, sparse.diags(np.concatenate(diagonal))], format="csc")
    return H, np.concatenate(gradient)


def _vehicle_change(first: Vehicle, now: Vehicle) -> Array:
    """Change (k,) of offsets and distances."""
    moved = (now.antennas - first.antennas).ravel()
    by_distance = np.linalg.pinv(first.by_distance) @ moved
    return np.concatenate([(now.offsets - first.offsets)[1:].ravel(), by_distance])


def _fix_rows(data: Given, state: State, places: _Places) -> tuple["sparse.csr_matrix", Array]:
    fixes = data.trajectory.fixes
    sigmas = fix_sigmas(data.trajectory.noise)
    residual, by_pose, by_vehicle = antenna_equations(state.spline, state.vehicle, fixes)
    path = pose_columns(state.spline, fixes.times, by_pose / sigmas[:, None])
    vehicle = sparse.csr_matrix((by_vehicle / sigmas[:, None]).reshape(path.shape[0], -1))
    rest = sparse.csr_matrix((path.shape[0], places.total - places.scanner))
    return sparse.hstack([path, vehicle, rest], format="csr"), (residual / sigmas).ravel()


def _scan_rows(
    data: Given, state: State, surfaces: Surfaces, places: _Places
) -> tuple["sparse.csr_matrix", Array]:
    """Distances of points from their planes, whitened, and their derivatives."""
    world, _, poses = world_points(data, state)
    local = surfaces.local(world)
    pieces = state.pieces[surfaces.of]
    residual = _heights(local, pieces)
    u, v = local[:, 0], local[:, 1]
    by_u = pieces[:, 1] + pieces[:, 3] * u + pieces[:, 4] * v
    by_v = pieces[:, 2] + pieces[:, 4] * u + pieces[:, 5] * v
    lean = np.column_stack([-by_u, -by_v, np.ones(len(u))])
    normals = np.einsum("mji,mj->mi", surfaces.axes[surfaces.of], lean)
    rows = surfaces.points
    own = data.cloud.in_vehicle(state.pose)[rows]
    by_pose = np.einsum("mi,mik->mk", normals, point_rows(poses[rows], own))
    in_vehicle = np.einsum("mij,mi->mj", matrix_of(poses[rows, 3:]), normals)
    arms = own - state.pose[:3]
    by_scanner = np.hstack([in_vehicle, np.cross(arms, in_vehicle)])
    by_piece = -_bends(local)
    # The noise of a range moves a point along its beam: less of it is across a grazed surface.
    facing = np.abs((in_vehicle * arms).sum(1)) / np.linalg.norm(arms, axis=1)
    scale = _whitening(data, surfaces, residual, np.maximum(facing, GRAZING))
    path = pose_columns(state.spline, data.times[rows], by_pose[:, None, :] * scale[:, None, None])
    m = len(rows)
    columns = places.pieces + SHAPE * surfaces.of[:, None] + np.arange(SHAPE)
    piece = _placed(by_piece * scale[:, None], columns, places.total)
    scanner = _placed(
        by_scanner * scale[:, None],
        np.tile(np.arange(places.scanner, places.ground), (m, 1)),
        places.total,
    )
    path.resize((m, places.total))
    return path + piece + scanner, residual * scale


def _whitening(data: Given, surfaces: Surfaces, residual: Array, facing: Array) -> Array:
    """(m,) square roots of the points' weights; noise is in proportion to ``facing``."""
    settings = data.settings
    along = residual / facing
    sigma = max(float(sigma_from_median(along)), settings.sharpest)
    block = np.floor(data.times[surfaces.points] / settings.block).astype(np.int64)
    key = surfaces.of * (int(block.max() - block.min()) + 1) + block - block.min()
    _, inverse, counts = np.unique(key, return_inverse=True, return_counts=True)
    share = np.minimum(settings.independent / counts[inverse], 1.0)
    return np.asarray(np.sqrt(weights_of(along) * share) / (sigma * facing))


def _placed(values: Array, columns: Ints, total: int) -> "sparse.csr_matrix":
    m, k = values.shape
    return sparse.csr_matrix((values.ravel(), columns.ravel(), np.arange(m + 1) * k), (m, total))


def _road_rows(data: Given, state: State, places: _Places) -> tuple["sparse.csr_matrix", Array]:
    if data.ground is None:
        raise ValueError("no ground is known")
    points = data.road.in_vehicle(state.pose)
    J, residual = ground_rows(points, state.pose, state.ground, data.road_times, data.ground)
    columns = np.tile(np.arange(places.scanner, places.pieces), (len(residual), 1))
    return _placed(J, columns, places.total), residual


def _motion_rows(data: Given, state: State, places: _Places) -> tuple["sparse.csr_matrix", Array]:
    if data.ground is None:
        raise ValueError("no ground is known")
    path, by_ground, residual = motion_rows(state.spline, state.ground, data.ground)
    path.resize((len(residual), places.total))
    columns = np.tile(np.arange(places.ground, places.pieces), (len(residual), 1))
    return path + _placed(by_ground, columns, places.total), residual
