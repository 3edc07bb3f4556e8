"""A whole log of a driving robot as a trajectory: way, loops, graph, every scan in its map."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import ndtri

from laser_gt.driving.closing import BACK, through_mount
from laser_gt.driving.graph import (
    HELD,
    LEAST_MISFIT,
    Anchor,
    DriveGraph,
    DrivePoses,
    Marginals,
    marginals,
    own_noise,
    robot_covariances,
)
from laser_gt.driving.log import DriveInputs, DriveOutcome, Report
from laser_gt.driving.mount_check import way_with_mount
from laser_gt.driving.refining import Place, Placed, carried, placed_sweeps
from laser_gt.driving.surveyed_stops import held_by_stops
from laser_gt.driving.tracking import GUESS_SIGMAS, SURPRISE
from laser_gt.driving.way import ROUGH_STEP, Way, clock_of
from laser_gt.scans.planar import between, compose, compose_jacobians, inverse, wrapped
from laser_gt.scans.scan import Flags, Indices
from validation.poses.angles import Array
from validation.poses.trajectory import Clock, Trajectory
from validation.trajectories.clock.result import ClockEstimate

TRACKED = np.diag([0.02, 0.02, 0.01]) ** 2
"""Covariance of a step that was tracked from scan to scan: several times what its matches state."""
AROUND = 10
"""Keyframes of the map that a sweep is placed in. A judgement: of a place that was passed several
times those nearest, which have it in view."""


def solve_log(inputs: DriveInputs, workers: int, report: Report) -> DriveOutcome:
    """The trajectory of the robot.

    Parameters
    ----------
    inputs : DriveInputs
        The log.
    workers : int
        Processes for what can be done at once.
    report : callable
        Told what is being done and the share done.

    Raises
    ------
    GtvalError
        If there are fewer than two scans that can be matched.
    """
    tracked, graph, solved, mount = way_with_mount(inputs, workers, report)
    tracked, graph, solved, doubt = held_by_stops(tracked, graph, solved, workers, report)
    outcome = _outcome(tracked, graph, solved, workers, report)
    ends = [
        one.end for one, weight in zip(graph.motions, solved.moving, strict=True) if weight < 0.5
    ]
    slips = tuple(tracked.times[tracked.track.keyframes[ends]].tolist())
    return replace(outcome, doubt=doubt, mount_check=mount, slips=slips)


def _outcome(
    tracked: Way, graph: DriveGraph, solved: DrivePoses, workers: int, report: Report
) -> DriveOutcome:
    """Every sweep in its map, as a trajectory of the robot."""
    believed = solved.weights > 0.5
    scale = float(np.clip(solved.misfit, LEAST_MISFIT, None))
    shared = max(1.0 - scale, 0.0)
    own = own_noise(graph, believed) * shared
    loose = replace(graph, anchors=_loosened(graph, own))
    known = marginals(loose, solved, scale)
    places = _places(tracked, solved, own)
    placed = placed_sweeps(
        tracked.sweeps, places, workers, lambda share: report("placing", 0.8 + 0.2 * share)
    )
    laser, covariances, cross, matched = _laser_poses(tracked, solved, known, own, placed)
    robot = compose(laser, inverse(solved.mount))
    spread = robot_covariances(laser, covariances, cross, solved.mount, known.mount)
    if not graph.anchors:
        spread[0] = np.eye(3) / HELD  # the frame is that of this pose
    clock, delay, unsure = _clock(tracked, robot)
    spread = spread + _by_time(tracked.times, robot, unsure)
    trajectory = Trajectory(
        "laser_drive",
        tracked.times,
        robot,
        covariances=spread,
        epoch=tracked.inputs.epoch,
        clock=Clock("capture", 1 / float(np.median(np.diff(tracked.times)))),
        frame="" if graph.anchors else "own",
    )
    trajectory = trajectory.shifted(delay - tracked.delay)
    noise = (np.nan, np.nan)
    if tracked.odometer is not None:
        at_metre = tracked.odometer.covariance(np.array([[1.0, 0.0, 0.0]]))[0]
        noise = (float(np.sqrt(at_metre[0, 0])), float(np.sqrt(at_metre[2, 2])))
    first = next(iter(tracked.inputs.scans))
    ends = np.array([(one.start, one.end) for one in graph.links]).reshape(-1, 2)
    return DriveOutcome(
        trajectory=trajectory,
        matched=matched,
        scans=len(tracked.inputs.scans[first]),
        corrected=tracked.corrected,
        keyframes=tracked.track.keyframes,
        sweeps=tracked.sweeps,
        mount=solved.mount,
        links=int(believed.sum()),
        loops=int((believed & (ends[:, 1] - ends[:, 0] > max(BACK))).sum()),
        switched_off=int((~believed).sum()),
        misfit=solved.misfit,
        clock=clock,
        delay_s=delay,
        anchors=tuple(stop.name for stop in tracked.inputs.stops if stop.name in tracked.nodes),
        odometry_noise=noise,
    )


def _clock(tracked: Way, robot: Array) -> tuple[ClockEstimate | None, float, float]:
    """Clock of the scans against the odometry, their delay, and how far a stamp may be off."""
    if tracked.odometer is None or not tracked.inputs.own_clock:
        return None, tracked.delay, 0.0
    found = clock_of(tracked.inputs, tracked.odometer, tracked.times, robot)
    clock = found if found.verdict == "determined" or tracked.clock is None else tracked.clock
    if clock.verdict != "determined":
        return clock, tracked.delay, ROUGH_STEP / 2
    delay = tracked.delay + (clock.delay_s if clock is found else 0.0)
    widths = (clock.high_s - clock.low_s) / 2 / ndtri((1 + clock.confidence) / 2)
    return clock, delay, float(np.hypot(widths, np.nan_to_num(clock.jitter_s)))


def _by_time(times: Array, robot: Array, unsure: float) -> Array:
    """(n, 3, 3) what stamps that may be off by some seconds add to the covariances of poses.

    The pose at a stamp is that of another time: off by the speed times the error of the stamp.
    """
    track = np.column_stack([robot[:, :2], np.unwrap(robot[:, 2])])
    speeds = np.gradient(track, times, axis=0)
    return np.asarray(unsure**2 * speeds[:, :, None] * speeds[:, None, :])


def _loosened(graph: DriveGraph, own: Array) -> list[Anchor]:
    """Anchors with the noise of the scan that they hold added to their own."""
    return [replace(one, covariance=one.covariance + own[one.node]) for one in graph.held]


def _places(tracked: Way, solved: DrivePoses, own: Array) -> list[Place]:
    """For each keyframe, the map around it and the sweeps after it, up to the next."""
    from scipy.spatial import cKDTree  # noqa: PLC0415

    keys, poses = tracked.track.keyframes, solved.poses
    flat = np.column_stack([poses[:, :2], np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    near = cKDTree(flat).query(flat, k=min(AROUND, len(keys)))[1].reshape(len(keys), -1)
    found = []
    for node, key in enumerate(keys.tolist()):
        end = int(keys[node + 1]) if node + 1 < len(keys) else len(tracked.sweeps)
        inside = np.arange(key + 1, end)
        if not len(inside):
            continue
        guesses, covariances = _guesses(tracked, key, inside, solved.mount)
        around = near[node].tolist()
        covariances = covariances + own[node]
        found.append(
            Place(node, keys[around].tolist(), between(poses[node], poses[around]),
                  inside.tolist(), guesses, covariances)
        )  # fmt: skip
    return found


def _guesses(tracked: Way, key: int, inside: Indices, mount: Array) -> tuple[Array, Array]:
    """Poses of sweeps seen from a keyframe before they are placed, and covariances."""
    steps = between(tracked.track.poses[key], tracked.track.poses[inside])
    if tracked.odometer is None:
        return steps, np.tile(np.diag(GUESS_SIGMAS**2), (len(steps), 1, 1))
    times = tracked.times
    robot = tracked.odometer.at(times[[key, *inside.tolist()]])
    moved = between(robot[0], robot[1:])
    covariance = through_mount(moved, mount, tracked.odometer.covariance(moved))
    unknown = ~tracked.odometer.known(times[inside])
    covariance[unknown] = covariance[unknown] + np.diag(GUESS_SIGMAS**2)
    by_odometry = compose(compose(inverse(mount), moved), mount)
    off = wrapped(by_odometry - steps)
    squares = np.einsum("mi,mij,mj->m", off, np.linalg.inv(covariance + TRACKED), off)
    slipped = tracked.track.matched[inside] & (squares > SURPRISE)
    covariance[slipped] = TRACKED
    return np.where((unknown | slipped)[:, None], steps, by_odometry), covariance


def _laser_poses(
    tracked: Way,
    solved: DrivePoses,
    known: Marginals,
    own: Array,
    placed: Sequence[Placed],
) -> tuple[Array, Array, Array, Flags]:
    """Poses of the laser frame, their covariances, those with the mount, and what was matched."""
    n, keys = len(tracked.sweeps), tracked.track.keyframes
    poses, covariances = np.empty((n, 3)), np.empty((n, 3, 3))
    cross, matched = np.empty((n, 3, 3)), np.ones(n, dtype=bool)
    poses[keys], covariances[keys] = solved.poses, known.poses + own
    cross[keys], matched[keys] = known.with_mount, tracked.track.matched[keys]
    for one in placed:
        base = solved.poses[one.base]
        poses[one.sweep], covariances[one.sweep] = carried(base, known.poses[one.base], one)
        by_base, _ = compose_jacobians(base, one.pose)
        cross[one.sweep] = by_base @ known.with_mount[one.base]
        matched[one.sweep] = one.matched
    return poses, covariances, cross, matched
