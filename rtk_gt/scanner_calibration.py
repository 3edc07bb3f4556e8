"""Where a vertical scanner is on the vehicle: scans, fixes and walls adjusted together.

Blanco 2009, section 5.3, matches the point clouds of several passes along a path that it takes as
exact. A path of three receivers on a roof is not: its roll has a noise of most of a degree, and
an error of the offsets tilts all of it. Points moved by the path's noise pull a matching to one
side, by centimetres, and nothing in the matching tells. Here the path, the offsets, the antennas'
distances and the pieces of walls and ground are unknowns like the scanner's place, each fix of
each receiver is a measurement, and the covariance is that of the whole adjustment.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from rtk_gt.fixes import Ints
from rtk_gt.ground import ROAD, KnownGround, ground_rows, motion_rows, road_points
from rtk_gt.offset_prior import VEHICLE_SIZE, OffsetPrior
from rtk_gt.orientation import matrix_of
from rtk_gt.pass_matching import (
    MatchingSettings,
    ScannerCalibration,
    change_from,
    match_passes,
    perturbed,
    weights_of,
)
from rtk_gt.scans import Cloud, LineScans, cloud_of
from rtk_gt.surfaces import Surfaces, shared_surfaces
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
from validation.errors import GtvalError
from validation.robust import sigma_from_median

FEWEST_SURFACES = 20
GRAZING = 0.3
"""Surfaces are rough: the noise across them is at least this share of that along the beam."""
SHAPE = 6
"""Numbers of a piece: height, two slopes, three curvatures."""
_ROUNDS = 10
FARTHEST = 5.0
"""Standard deviations of the hand-measured place beyond which a result cannot be right."""
_SETTLED = 0.1
"""The last choice of points moved the scanner by less than this share of its sigmas."""


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
class _State:
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
class _Data:
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


def calibrate_scanner(
    trajectory: Trajectory,
    scans: LineScans,
    start: Array,
    sigmas: Array,
    *,
    ground: KnownGround | None = None,
    prior: OffsetPrior | None = None,
    settings: ScannerSettings | None = None,
) -> ScannerCalibration:
    """The pose of a scanner on the vehicle, from scans along a measured path.

    Parameters
    ----------
    trajectory : Trajectory
        The smooth path through the fixes (`smooth_trajectory`).
    scans : LineScans
        Of the scanner; those at times without a path are left out.
    start : (6,) array
        Hand-measured pose: x, y, z, yaw, pitch, roll.
    sigmas : (6,) array
        How well it was measured: x, y, z in metres, rotations about the vehicle's axes in
        radians. It keeps its weight.
    ground : KnownGround, optional
        The plane of the road under the wheels in the vehicle frame.
    prior : OffsetPrior, optional
        What is known of offsets and distances apart from the drive.
    settings : ScannerSettings, optional
        How to match.

    Raises
    ------
    GtvalError
        If too few flat pieces are seen from two passes, or the result contradicts the place that
        was measured by hand by more than `FARTHEST` standard deviations.

    Notes
    -----
    Gauss-Newton on sparse normal equations. Residuals are distances of points from their
    slightly bent piece, fixes minus curves, road points minus the road, and the direction of motion
    minus the road's. Each round chooses the points of the pieces anew; where that goes on moving
    the scanner, the last movement is added to the covariance. What the drive does not show keeps
    its prior, and ``from_drive`` says so.
    """
    settings = settings or ScannerSettings()
    scans = scans.select(trajectory.spline.covers(scans.times))
    if len(scans.times) == 0:
        raise GtvalError("none of the scans is where there is ground truth")
    data = _prepared(trajectory, scans, start, sigmas, ground, prior, settings)
    rough = _rough(data, scans)
    state = _State(
        trajectory.spline, trajectory.vehicle, rough.pose,
        np.zeros(ROAD) if ground is None else ground.shape, np.empty((0, 3)),
    )  # fmt: skip
    for turn in range(_ROUNDS):
        size, gate = settings.pieces[min(turn, len(settings.pieces) - 1)]
        surfaces = _surfaces(data, state, size, gate)
        state = replace(state, pieces=np.zeros((len(surfaces.centres), SHAPE)))
        begin = state.pose
        for _ in range(2):
            state, covariance = _step(data, state, surfaces)
        moved = change_from(begin, state.pose)
        settled = turn + 1 >= len(settings.pieces)
        settled = settled and bool((np.abs(moved) < _SETTLED * _sigmas(covariance)).all())
        if settled:
            break
    _check_near(data, state.pose)
    # What a new choice of points still moves is not known any better than that.
    covariance = covariance + np.outer(moved, moved)
    spread = _sigmas(covariance)
    residual = _scan_residuals(data, state, surfaces)
    return ScannerCalibration(
        pose=state.pose,
        covariance=covariance,
        sigmas=spread,
        from_drive=1 - np.square(spread / sigmas),
        pairs=len(residual),
        rms_before=rough.rms_before,
        rms_after=_rms(residual),
        settled=settled,
    )


def _check_near(data: _Data, pose: Array) -> None:
    """Refuse a place that the hand-measured one excludes: the matching went astray, or the hand."""
    away = change_from(data.start, pose)
    worst = int(np.abs(away / data.sigmas).argmax())
    if abs(away[worst]) <= FARTHEST * data.sigmas[worst]:
        return
    name = ("x", "y", "z", "about x", "about y", "about z")[worst]
    said = (
        f"{100 * away[worst]:+.1f} cm in {name}"
        if worst < 3
        else f"{np.degrees(away[worst]):+.1f} degrees {name}"
    )
    raise GtvalError(
        f"the scans put the scanner {said} of where it was measured by hand, "
        f"{abs(away[worst] / data.sigmas[worst]):.0f} standard deviations: either that measurement "
        "or its sigma is wrong, or this drive sees its walls from too few directions"
    )


def _prepared(
    trajectory: Trajectory,
    scans: LineScans,
    start: Array,
    sigmas: Array,
    ground: KnownGround | None,
    prior: OffsetPrior | None,
    settings: ScannerSettings,
) -> _Data:
    cloud = cloud_of(scans)
    start = np.asarray(start, dtype=float)
    road = _beside(cloud, start, ground)
    if len(cloud.own) > settings.points:
        # A fraction of the golden ratio: never in step with the beams of a scan.
        share = settings.points / len(cloud.own)
        chosen = np.mod(np.arange(len(cloud.own)) * 0.6180339887498949, 1.0) < share
        cloud = Cloud(cloud.own[chosen], cloud.scan[chosen])
    known = _prior(trajectory.vehicle, prior or OffsetPrior())
    return _Data(
        trajectory, cloud, scans.times[cloud.scan], road, scans.times[road.scan], start,
        np.asarray(sigmas, dtype=float), ground, known, settings,
    )  # fmt: skip


def _beside(cloud: Cloud, start: Array, ground: KnownGround | None) -> Cloud:
    """All points that may be road once the scanner's place is known better."""
    if ground is None:
        return Cloud(cloud.own[:0], cloud.scan[:0])
    wide = replace(ground, reach=ground.reach + 0.5, roughness=2 * ground.roughness)
    rows = road_points(cloud.in_vehicle(start), start, ground.shape, wide)
    return Cloud(cloud.own[rows], cloud.scan[rows])


def _prior(vehicle: Vehicle, prior: OffsetPrior) -> tuple[Array, Array]:
    """Information (k,) on offsets and distances, and the change (k,) that it asks for."""
    k = 3 * (len(vehicle.offsets) - 1)
    information = np.full(vehicle.size, VEHICLE_SIZE**-2)
    wanted = np.zeros(vehicle.size)
    if len(prior.offsets):
        stated = np.isfinite(prior.offsets[1:]).ravel()
        information[:k][stated] = 1 / prior.offset_sigmas[1:].ravel()[stated] ** 2
        wanted[:k][stated] = (prior.offsets[1:] - vehicle.offsets[1:]).ravel()[stated]
    if len(prior.distances):
        stated = np.isfinite(prior.distances)
        first, second = np.triu_indices(len(vehicle.offsets), 1)
        now = np.linalg.norm(vehicle.antennas[first] - vehicle.antennas[second], axis=1)
        information[k:][stated] = 1 / prior.distance_sigmas[stated] ** 2
        wanted[k:][stated] = (prior.distances - now)[stated]
    return information, wanted


def _rough(data: _Data, scans: LineScans) -> ScannerCalibration:
    """The pose at which passes agree along the path as it is: good enough to begin with."""
    spline = data.trajectory.spline
    return match_passes(
        data.cloud, scans.times, spline.poses(scans.times), data.start, data.sigmas,
        settings=replace(data.settings.matching, apart=data.settings.apart), ground=data.ground,
    )  # fmt: skip


def _world(data: _Data, state: _State) -> tuple[Array, Array, Array]:
    """Points and scanner positions in the local frame, and the poses, one a point."""
    poses = state.spline.poses(data.times)
    R = matrix_of(poses[:, 3:])
    own = data.cloud.in_vehicle(state.pose)
    world = np.einsum("nij,nj->ni", R, own) + poses[:, :3]
    return world, R @ state.pose[:3] + poses[:, :3], poses


def _surfaces(data: _Data, state: _State, size: float, gate: float) -> Surfaces:
    world, origins, _ = _world(data, state)
    found = shared_surfaces(
        world, origins, data.times, size=size, gate=gate, apart=data.settings.apart
    )
    if len(found.centres) < FEWEST_SURFACES:
        raise GtvalError(
            f"only {len(found.centres)} flat pieces are seen from two passes at least "
            f"{data.settings.apart:g} s apart; drive past the same walls and ground again, in "
            "another direction"
        )
    return found


def _scan_residuals(data: _Data, state: _State, surfaces: Surfaces) -> Array:
    local = surfaces.local(_world(data, state)[0])
    return _heights(local, state.pieces[surfaces.of])


def _bends(local: Array) -> Array:
    """(m, 6) what the numbers of a piece are multiplied by: 1, u, v, u^2 / 2, u v, v^2 / 2."""
    u, v = local[:, 0], local[:, 1]
    return np.column_stack([np.ones(len(u)), u, v, u**2 / 2, u * v, v**2 / 2])


def _heights(local: Array, pieces: Array) -> Array:
    """(m,) heights of points over their slightly bent pieces."""
    return np.asarray(local[:, 2] - (_bends(local) * pieces).sum(1))


def _places(state: _State) -> _Places:
    vehicle = state.spline.coefficients.size
    scanner = vehicle + state.vehicle.size
    ground = scanner + 6
    pieces = ground + ROAD
    return _Places(vehicle, scanner, ground, pieces, pieces + SHAPE * len(state.pieces))


def _step(data: _Data, state: _State, surfaces: Surfaces) -> tuple[_State, Array]:
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
    moved = _State(
        state.spline.moved(change[: places.vehicle].reshape(-1, 6)),
        state.vehicle.moved(change[places.vehicle : places.scanner]),
        perturbed(state.pose, change[places.scanner : places.ground]),
        state.ground + change[places.ground : k],
        state.pieces + change[k:].reshape(-1, SHAPE),
    )
    return moved, (covariance + covariance.T) / 2


def _known(data: _Data, state: _State) -> tuple["sparse.csc_matrix", Array]:
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


def _fix_rows(data: _Data, state: _State, places: _Places) -> tuple["sparse.csr_matrix", Array]:
    fixes = data.trajectory.fixes
    sigmas = fix_sigmas(data.trajectory.noise)
    residual, by_pose, by_vehicle = antenna_equations(state.spline, state.vehicle, fixes)
    path = pose_columns(state.spline, fixes.times, by_pose / sigmas[:, None])
    vehicle = sparse.csr_matrix((by_vehicle / sigmas[:, None]).reshape(path.shape[0], -1))
    rest = sparse.csr_matrix((path.shape[0], places.total - places.scanner))
    return sparse.hstack([path, vehicle, rest], format="csr"), (residual / sigmas).ravel()


def _scan_rows(
    data: _Data, state: _State, surfaces: Surfaces, places: _Places
) -> tuple["sparse.csr_matrix", Array]:
    """Distances of points from their planes, whitened, and their derivatives."""
    world, _, poses = _world(data, state)
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


def _whitening(data: _Data, surfaces: Surfaces, residual: Array, facing: Array) -> Array:
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


def _road_rows(data: _Data, state: _State, places: _Places) -> tuple["sparse.csr_matrix", Array]:
    if data.ground is None:
        raise ValueError("no ground is known")
    points = data.road.in_vehicle(state.pose)
    J, residual = ground_rows(points, state.pose, state.ground, data.road_times, data.ground)
    columns = np.tile(np.arange(places.scanner, places.pieces), (len(residual), 1))
    return _placed(J, columns, places.total), residual


def _motion_rows(data: _Data, state: _State, places: _Places) -> tuple["sparse.csr_matrix", Array]:
    if data.ground is None:
        raise ValueError("no ground is known")
    path, by_ground, residual = motion_rows(state.spline, state.ground, data.ground)
    path.resize((len(residual), places.total))
    columns = np.tile(np.arange(places.ground, places.pieces), (len(residual), 1))
    return path + _placed(by_ground, columns, places.total), residual


def _sigmas(covariance: Array) -> Array:
    return np.asarray(np.sqrt(np.diagonal(covariance)))


def _rms(residual: Array) -> float:
    weights = weights_of(residual)
    return float(np.sqrt(np.mean(weights * residual**2) / np.mean(weights)))
