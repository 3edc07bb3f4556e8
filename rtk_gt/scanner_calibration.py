"""Where a vertical scanner is on the vehicle: scans, fixes and walls adjusted together.

Blanco 2009, section 5.3, matches the point clouds of several passes along a path that it takes as
exact. A path of three receivers on a roof is not: its roll has a noise of most of a degree, and
an error of the offsets tilts all of it. Points moved by the path's noise pull a matching to one
side, by centimetres, and nothing in the matching tells. Here the path, the offsets, the antennas'
distances and the pieces of walls and ground are unknowns like the scanner's place, each fix of
each receiver is a measurement, and the covariance is that of the whole adjustment.
"""

from dataclasses import replace

import numpy as np

from rtk_gt.ground import ROAD, KnownGround, road_points
from rtk_gt.offset_prior import VEHICLE_SIZE, OffsetPrior
from rtk_gt.pass_matching import ScannerCalibration, change_from, match_passes, weights_of
from rtk_gt.scanner_equations import (
    SHAPE,
    Given,
    ScannerSettings,
    State,
    gauss_newton_step,
    scan_residuals,
    world_points,
)
from rtk_gt.scans import Cloud, LineScans, cloud_of
from rtk_gt.surfaces import Surfaces, shared_surfaces
from rtk_gt.trajectory import Trajectory, Vehicle
from validation.angles import Array
from validation.errors import GtvalError

FEWEST_SURFACES = 20
_ROUNDS = 10
FARTHEST = 5.0
"""Standard deviations of the hand-measured place beyond which a result cannot be right."""
_SETTLED = 0.1
"""The last choice of points moved the scanner by less than this share of its sigmas."""


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
    state = State(
        trajectory.spline, trajectory.vehicle, rough.pose,
        np.zeros(ROAD) if ground is None else ground.shape, np.empty((0, 3)),
    )  # fmt: skip
    for turn in range(_ROUNDS):
        size, gate = settings.pieces[min(turn, len(settings.pieces) - 1)]
        surfaces = _surfaces(data, state, size, gate)
        state = replace(state, pieces=np.zeros((len(surfaces.centres), SHAPE)))
        begin = state.pose
        for _ in range(2):
            state, covariance = gauss_newton_step(data, state, surfaces)
        moved = change_from(begin, state.pose)
        settled = turn + 1 >= len(settings.pieces)
        settled = settled and bool((np.abs(moved) < _SETTLED * _sigmas(covariance)).all())
        if settled:
            break
    _check_near(data, state.pose)
    # What a new choice of points still moves is not known any better than that.
    covariance = covariance + np.outer(moved, moved)
    spread = _sigmas(covariance)
    residual = scan_residuals(data, state, surfaces)
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


def _check_near(data: Given, pose: Array) -> None:
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
) -> Given:
    cloud = cloud_of(scans)
    start = np.asarray(start, dtype=float)
    road = _beside(cloud, start, ground)
    if len(cloud.own) > settings.points:
        # A fraction of the golden ratio: never in step with the beams of a scan.
        share = settings.points / len(cloud.own)
        chosen = np.mod(np.arange(len(cloud.own)) * 0.6180339887498949, 1.0) < share
        cloud = Cloud(cloud.own[chosen], cloud.scan[chosen])
    known = _prior(trajectory.vehicle, prior or OffsetPrior())
    return Given(
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


def _rough(data: Given, scans: LineScans) -> ScannerCalibration:
    """The pose at which passes agree along the path as it is: good enough to begin with."""
    spline = data.trajectory.spline
    return match_passes(
        data.cloud, scans.times, spline.poses(scans.times), data.start, data.sigmas,
        settings=replace(data.settings.matching, apart=data.settings.apart), ground=data.ground,
    )  # fmt: skip


def _surfaces(data: Given, state: State, size: float, gate: float) -> Surfaces:
    world, origins, _ = world_points(data, state)
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


def _sigmas(covariance: Array) -> Array:
    return np.asarray(np.sqrt(np.diagonal(covariance)))


def _rms(residual: Array) -> float:
    weights = weights_of(residual)
    return float(np.sqrt(np.mean(weights * residual**2) / np.mean(weights)))
