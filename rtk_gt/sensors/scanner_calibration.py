"""Where a vertical scanner is on the vehicle: scans, fixes and walls adjusted together.

Blanco 2009, section 5.3, matches the point clouds of several passes along a path that it takes as
exact. A path of three receivers on a roof is not: its roll has a noise of most of a degree, and
an error of the offsets tilts all of it. Points moved by the path's noise pull a matching to one
side, by centimetres, and nothing in the matching tells. Here the path, the offsets, the antennas'
distances and the pieces of walls and ground are unknowns like the scanner's place, each fix of
each receiver is a measurement, and the covariance is that of the whole adjustment.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rtk_gt.offsets.prior import OffsetPrior
from rtk_gt.receivers.assumptions import VEHICLE_SIZE
from rtk_gt.sensors.ground import ROAD, KnownGround, road_points
from rtk_gt.sensors.pass_matching import (
    MatchedPasses,
    ScannerCalibration,
    change_from,
    match_passes,
    weights_of,
)
from rtk_gt.sensors.scanner_adjustment import gauss_newton_step
from rtk_gt.sensors.scanner_equations import (
    SHAPE,
    Given,
    Points,
    ScannerSettings,
    State,
    scan_residuals,
    world_of,
)
from rtk_gt.sensors.scans import Cloud, LineScans, cloud_of
from rtk_gt.sensors.surfaces import Surfaces, shared_surfaces
from rtk_gt.sensors.trajectory import Trajectory, Vehicle, with_knots
from validation.errors import GtvalError
from validation.poses.angles import Array

FEWEST_SURFACES = 20
"""Pieces seen twice that six numbers of a place need: a judgement, three for each number."""
_ROUNDS = 10
"""At most so often points are chosen anew: a judgement. A result that has not settled says so."""
FARTHEST = 5.0
"""Standard deviations of the hand-measured place beyond which a result cannot be right: by chance
that happens to one of six numbers in 300,000 drives."""
_BELIEVED = 3.0
"""Standard deviations of the hand-measured place within which a rough solution is believed: the
hand is farther off in 1.6 % of the drives, which then begin from the hand's place."""
_SETTLED = 0.3
"""Where less than this share of the sigmas is still to come the sigmas grow by less than 5 %."""
_SLOWEST = 0.95
"""Largest ratio of two movements in a row that is believed: what follows then sums up to 20 times
the last one. A judgement that keeps the sum finite."""
_ROUGH_POINTS = 60_000
"""Points of each scanner that the first, rough solution looks at: a judgement, ten times those that
it matches."""
_TURN = 0.6180339887498949
"""A fraction of the golden ratio."""


@dataclass(frozen=True)
class MountedScans:
    """Scans of a scanner, and where it was measured by hand on the vehicle.

    Parameters
    ----------
    scans : LineScans
        Those at times without a path are left out and counted.
    start : (6,) array
        Hand-measured pose: x, y, z, yaw, pitch, roll.
    sigmas : (6,) array
        How well it was measured: x, y, z in metres, rotations about the vehicle's axes in
        radians. It keeps its weight.
    name : str
        What messages call it.
    """

    scans: LineScans
    start: Array
    sigmas: Array
    name: str = "the scanner"


def calibrate_scanners(
    trajectory: Trajectory,
    mounted: Sequence[MountedScans],
    *,
    ground: KnownGround | None = None,
    prior: OffsetPrior | None = None,
    settings: ScannerSettings | None = None,
) -> tuple[ScannerCalibration, ...]:
    """The poses of scanners on the vehicle, from scans along a measured path.

    Two scanners that look to both sides are better found together than each alone: both hold the
    same path, and together they see how the road is bent across.

    Parameters
    ----------
    trajectory : Trajectory
        The smooth path through the fixes (`smooth_trajectory`).
    mounted : sequence of MountedScans
        One of each scanner.
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
    Gauss-Newton on normal equations. Residuals are distances of points from their slightly bent
    piece, fixes minus curves, road points minus the road, and the direction of motion minus the
    road's. Each round chooses the points of the pieces anew; how far more rounds would still move a
    scanner is added to its covariance. What the drive does not show keeps its prior, and
    ``from_drive`` says so.
    """
    settings = settings or ScannerSettings()
    trajectory = with_knots(trajectory, settings.knots)
    given = [len(one.scans.times) for one in mounted]
    mounted = [
        replace(one, scans=one.scans.select(trajectory.spline.covers(one.scans.times)))
        for one in mounted
    ]
    if any(len(one.scans.times) == 0 for one in mounted):
        raise GtvalError("none of the scans is where there is ground truth")
    clouds = [cloud_of(one.scans) for one in mounted]
    data = _prepared(trajectory, mounted, clouds, ground, prior, settings)
    rough = [_rough(data, *pair) for pair in zip(mounted, clouds, strict=True)]
    # Passes that agree where the hand excludes them agree by mistake.
    begins = [
        found.pose
        if (np.abs(change_from(one.start, found.pose)) < _BELIEVED * one.sigmas).all()
        else one.start
        for one, found in zip(mounted, rough, strict=True)
    ]
    begin = State(
        trajectory.spline, trajectory.vehicle, np.array(begins),
        np.zeros(ROAD) if ground is None else ground.shape, np.empty((0, SHAPE)),
    )  # fmt: skip
    last = _adjusted(data, begin)
    residual = scan_residuals(data, last.state, last.surfaces)
    of = data.points.of[last.surfaces.points]
    places = (
        _place(one, last, row, rough[row].rms_before, residual[of == row])
        for row, one in enumerate(mounted)
    )
    return tuple(
        replace(place, left_out=count - len(one.scans.times))
        for place, count, one in zip(places, given, mounted, strict=True)
    )


@dataclass(frozen=True)
class _Adjusted:
    """Where the rounds ended; ``coming`` (k, 6) is how far more of them would still move."""

    state: State
    surfaces: Surfaces
    covariance: Array
    coming: Array
    settled: bool


def _adjusted(data: Given, state: State) -> _Adjusted:
    """Points of pieces chosen, and all adjusted, in turns."""
    pieces = data.settings.pieces
    before = np.zeros((len(state.places), 6))
    for turn in range(_ROUNDS):
        surfaces = _surfaces(data, state, *pieces[min(turn, len(pieces) - 1)])
        state = replace(state, pieces=np.zeros((len(surfaces.centres), SHAPE)))
        begin = state.places
        for _ in range(2):
            state, covariance = gauss_newton_step(data, state, surfaces)
        moved = np.array([change_from(*pair) for pair in zip(begin, state.places, strict=True)])
        sigmas = _sigmas(covariance).reshape(-1, 6)
        coming = moved / (1 - _ratio(moved / sigmas, before / sigmas))
        settled = turn + 1 >= len(pieces) and bool((np.abs(coming) < _SETTLED * sigmas).all())
        if settled:
            break
        before = moved
    return _Adjusted(state, surfaces, covariance, coming, settled)


def _ratio(moved: Array, before: Array) -> float:
    """By how much movements become smaller from round to round, 0 where they turn back.

    Movements that go on in one direction, each smaller by this ratio, add up to the last one
    divided by 1 minus the ratio.
    """
    size = float((before**2).sum())
    ratio = float((moved * before).sum()) / size if size > 0 else 0.0
    return min(max(ratio, 0.0), _SLOWEST)


def _place(
    mounted: MountedScans, last: _Adjusted, row: int, before: float, residual: Array
) -> ScannerCalibration:
    """The result for one scanner."""
    pose, own = last.state.places[row], slice(6 * row, 6 * row + 6)
    _check_near(mounted, pose)
    # What new choices of points would still move is not known any better than that.
    covariance = last.covariance[own, own] + np.outer(last.coming[row], last.coming[row])
    spread = _sigmas(covariance)
    return ScannerCalibration(
        pose=pose,
        covariance=covariance,
        sigmas=spread,
        from_drive=1 - np.square(spread / mounted.sigmas),
        pairs=len(residual),
        rms_before=before,
        rms_after=_rms(residual),
        settled=last.settled,
    )


def _check_near(mounted: MountedScans, pose: Array) -> None:
    """Refuse a place that the hand-measured one excludes: the matching went astray, or the hand."""
    away = change_from(mounted.start, pose)
    worst = int(np.abs(away / mounted.sigmas).argmax())
    if abs(away[worst]) <= FARTHEST * mounted.sigmas[worst]:
        return
    name = ("x", "y", "z", "about x", "about y", "about z")[worst]
    said = (
        f"{100 * away[worst]:+.1f} cm in {name}"
        if worst < 3
        else f"{np.degrees(away[worst]):+.1f} degrees {name}"
    )
    times = abs(away[worst] / mounted.sigmas[worst])
    raise GtvalError(
        f"the scans put {mounted.name} {said} of where it was measured by hand, {times:.0f} "
        "standard deviations: either that measurement or its sigma is wrong, or this drive sees "
        "its walls from too few directions"
    )


def _prepared(
    trajectory: Trajectory,
    mounted: Sequence[MountedScans],
    clouds: Sequence[Cloud],
    ground: KnownGround | None,
    prior: OffsetPrior | None,
    settings: ScannerSettings,
) -> Given:
    fewer = [_thinned(cloud, settings.points) for cloud in clouds]
    starts = np.array([one.start for one in mounted], dtype=float)
    sigmas = np.array([one.sigmas for one in mounted], dtype=float)
    road = _beside(_points_of(mounted, clouds), starts, ground)
    known = _prior(trajectory.vehicle, prior or OffsetPrior())
    return Given(
        trajectory, _points_of(mounted, fewer), road, starts, sigmas, ground, known, settings
    )


def _thinned(cloud: Cloud, most: int) -> Cloud:
    """At most about so many points of a cloud, never in step with the beams of a scan."""
    if len(cloud.own) <= most:
        return cloud
    chosen = np.mod(np.arange(len(cloud.own)) * _TURN, 1.0) < most / len(cloud.own)
    return Cloud(cloud.own[chosen], cloud.scan[chosen])


def _points_of(mounted: Sequence[MountedScans], clouds: Sequence[Cloud]) -> Points:
    """The points of all scanners, one after the other."""
    firsts = np.cumsum([0, *(len(one.scans.times) for one in mounted)])
    return Points(
        np.concatenate([cloud.own for cloud in clouds]),
        np.concatenate([cloud.scan + n for cloud, n in zip(clouds, firsts, strict=False)]),
        np.concatenate([one.scans.times for one in mounted]),
        np.repeat(np.arange(len(mounted)), np.diff(firsts)),
    )


def _beside(points: Points, starts: Array, ground: KnownGround | None) -> Points:
    """All points that may be road once the scanners' places are known better."""
    if ground is None:
        return points.select(np.empty(0, dtype=np.int64))
    wide = replace(ground, reach=ground.reach + 0.5, roughness=2 * ground.roughness)
    rows = road_points(points.in_vehicle(starts), starts[points.of], ground.shape, wide)
    return points.select(rows)


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


def _rough(data: Given, mounted: MountedScans, cloud: Cloud) -> MatchedPasses:
    """The pose at which passes agree along the path as it is: good enough to begin with."""
    times = mounted.scans.times
    return match_passes(
        _thinned(cloud, _ROUGH_POINTS), times, data.trajectory.spline.poses(times), mounted.start,
        mounted.sigmas, settings=replace(data.settings.matching, apart=data.settings.apart),
        ground=data.ground,
    )  # fmt: skip


def _surfaces(data: Given, state: State, size: float, gate: float) -> Surfaces:
    world = world_of(data, state)
    times = data.points.times[data.points.scan]
    found = shared_surfaces(
        world.points, world.origins, times, size=size, gate=gate, apart=data.settings.apart
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
