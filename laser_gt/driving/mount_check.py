"""The stated mount of a scanner against the one that its matches and the odometry tell."""

from dataclasses import replace

import numpy as np
from scipy.special import chdtrc

from laser_gt.driving.closing import closed, through_mount
from laser_gt.driving.graph import DriveGraph, DrivePoses, mount_covariance, solve_drive
from laser_gt.driving.log import DriveInputs, Report
from laser_gt.driving.way import Way, rough_delay, tracked_way
from laser_gt.placing.mounts import OPEN, MountCheck, MountEstimate
from laser_gt.scans.planar import between, compose, inverse, rotation, wrapped
from validation.poses.angles import Array

RARE = 1e-6
"""Probability of a difference by chance below which it is told, as with surveyed stops."""
LOOSE = np.diag([100.0, 100.0, 10.0]) ** 2
"""Covariance of a mount of which nothing is stated: metres and radians."""
WELL_TRACKED = 0.97
"""Share of the sweeps that are matched along the way, below which a mount that is wrong is sought
from a way without odometry: a wrong mount that leaves more than that leads on to the right one."""
FAR = 3.0
"""Standard deviations beyond which a step counts by its distance, no longer by the square."""
MOUNTS = 4
"""Bound on how often a mount that the odometry contradicts is replaced by the one found, and the
way tracked anew: one that is off by half a turn takes one, one in millimetres three."""
SETTLED = 0.01
"""Metres and radians by which a mount found anew may differ from the one that the way was tracked
with: a step of a fifth of a radian is then guessed right to 2 mm."""


def drive_mount(graph: DriveGraph, solved: DrivePoses) -> MountCheck | None:
    """The mount by matches and odometry alone; None without odometry.

    Neither what is stated of the mount counts nor the survey. Where odometry is of another point
    than that of the robot frame, it is the mount in the frame of the odometry.
    """
    if not graph.motions:
        return None
    free = replace(graph, mount_covariance=LOOSE, anchors=(), initial=solved.poses)
    # With a mount that is far off all odometry seems to slip: first none may.
    sure = [replace(one, sure=True) for one in graph.motions]
    first = solve_drive(replace(free, motions=sure))
    free = replace(free, initial=first.poses, mount=first.mount)
    found = solve_drive(free)
    spread = mount_covariance(free, found, max(found.misfit, 1.0))
    turns = np.array([one.pose[2] for one in graph.motions])
    estimate = MountEstimate(found.mount, spread, float(np.sqrt(np.mean(turns**2))), len(turns))
    return MountCheck(graph.mount, np.sqrt(np.diag(graph.mount_covariance)), estimate)


def contradicts(check: MountCheck | None) -> bool:
    """Whether chance does not explain how a stated mount differs from the one of a drive."""
    return check is not None and bool(chdtrc(3, check.squares) < RARE)


def way_with_mount(
    inputs: DriveInputs, workers: int, report: Report
) -> tuple[Way, DriveGraph, DrivePoses, MountCheck | None]:
    """The way and its solved keyframes, with the mount that the odometry tells if it contradicts.

    Other arguments as of `laser_gt.driving.drive.solve_log`.
    """
    tracked = tracked_way(inputs, report)
    graph, solved = closed(tracked, workers, report)
    first = drive_mount(graph, solved)
    if first is None or not contradicts(first):
        return tracked, graph, solved, first
    mount = first
    if tracked.track.matched.mean() < WELL_TRACKED:
        mount = _with_place(first, _by_scans_alone(inputs, first.found.mount, report))
    for _ in range(MOUNTS):
        used = mount
        tracked = tracked_way(_with_found(tracked, used), report)
        graph, solved = closed(tracked, workers, report)
        mount = drive_mount(graph, solved) or used
        if (np.abs(mount.found.mount - used.found.mount) < SETTLED).all():
            break
    mount = replace(mount, stated=first.stated, stated_sigmas=first.stated_sigmas)
    if not _survey_holds(graph, solved, mount):
        return tracked, graph, solved, mount
    # The odometry is of another point: it is moved to the robot frame, and the mount is as stated.
    point = compose(mount.found.mount, inverse(mount.stated))
    assert inputs.odometer is not None  # a mount was found by it
    moved = replace(inputs.odometer, poses=compose(inputs.odometer.poses, point))
    tracked = tracked_way(replace(inputs, odometer=moved), report)
    graph, solved = closed(tracked, workers, report)
    return tracked, graph, solved, replace(mount, of_point=True)


def _survey_holds(graph: DriveGraph, solved: DrivePoses, mount: MountCheck) -> bool:
    """Whether the survey tells that the stated mount is right, and the one by odometry wrong."""
    if len(graph.anchors) < 2:
        return False
    used = solved.mount
    steps = np.array([one.pose for one in graph.motions])
    laser = compose(compose(inverse(used), steps), used)
    spreads = through_mount(
        steps, used, np.linalg.inv(np.array([one.information for one in graph.motions]))
    )
    guessed = [
        replace(one, pose=pose, information=np.linalg.inv(spread) * weight, sure=True)
        for one, pose, spread, weight in zip(
            graph.motions, laser, spreads, solved.moving, strict=True
        )
    ]
    free = replace(
        graph,
        motions=(),
        steps=[*graph.steps, *guessed],
        mount_covariance=LOOSE,
        initial=solved.poses,
    )
    by_survey = solve_drive(free)
    spread = mount_covariance(free, by_survey, max(by_survey.misfit, 1.0))
    found = MountEstimate(by_survey.mount, spread, mount.found.turn, len(graph.anchors))
    stated = MountCheck(mount.stated, mount.stated_sigmas, found)
    other = MountCheck(mount.found.mount, mount.found.sigmas, found)
    return stated.agrees and contradicts(other)


def _with_place(check: MountCheck, mount: Array) -> MountCheck:
    """The same with another mount found."""
    return replace(check, found=replace(check.found, mount=mount))


def _with_found(tracked: Way, mount: MountCheck) -> DriveInputs:
    """The log with the mount that was found, known as well as it was found.

    Other scanners stay where they are on the first.
    """
    inputs = tracked.inputs
    moved = {
        name: replace(one, mount=compose(mount.found.mount, between(mount.stated, one.mount)))
        for name, one in inputs.sensors.items()
    }
    return replace(inputs, sensors=moved, mount_sigmas=mount.found.sigmas)


def _by_scans_alone(inputs: DriveInputs, otherwise: Array, report: Report) -> Array:
    """(3,) mount by a way that is tracked without odometry; ``otherwise`` if that has no turns."""
    odometer = inputs.odometer
    if odometer is None:
        return otherwise
    free = tracked_way(replace(inputs, odometer=None), report)
    keys, poses = free.track.keyframes, free.track.poses
    times = free.times[keys]
    if inputs.own_clock:
        times = times + rough_delay(odometer, free.times, poses)
    robot, laser = odometer.at(times), poses[keys]
    good = free.track.matched[keys] & odometer.known(times)
    good = good[:-1] & good[1:]
    moved = between(robot[:-1], robot[1:])[good]
    seen = between(laser[:-1], laser[1:])[good]
    return hand_eye(seen, moved, odometer.covariance(moved), otherwise)


def hand_eye(laser: Array, robot: Array, covariances: Array, otherwise: Array) -> Array:
    """(3,) mount m with which motions of robot and laser are one: ``robot m = m laser``.

    Parameters
    ----------
    laser, robot : (n, 3) array
        Motions of the laser frame and of the robot over the same times.
    covariances : (n, 3, 3) array
        Of the motions of the robot.
    otherwise : (3,) array
        The answer where these motions do not determine it.

    Notes
    -----
    For a known angle of the mount its place is linear; sixteen angles are begun with, and the best
    is refined with Huber's weights. Motions that turn by less than the noise determine no place.
    """
    information = np.linalg.inv(covariances[:, :2, :2])
    identity = np.eye(2)
    lever = rotation(robot[:, 2]) - identity

    def solved(theta: float, weights: Array) -> tuple[Array, float, Array]:
        wanted = laser[:, :2] @ rotation(theta).T - robot[:, :2]
        weighted = np.swapaxes(lever, 1, 2) @ information * weights[:, None, None]
        normal = (weighted @ lever).sum(0) + identity / LOOSE[0, 0]
        place = np.linalg.solve(normal, (weighted @ wanted[..., None])[..., 0].sum(0))
        off = (lever @ place) - wanted
        squares = np.einsum("ni,nij,nj->n", off, information, off)
        root = np.sqrt(squares)
        cost = np.where(root < FAR, squares, 2 * FAR * root - FAR**2).sum()
        return place, float(cost), np.minimum(1.0, FAR / np.maximum(root, 1e-12))

    theta, weights = 0.0, np.ones(len(laser))
    width = np.pi
    for _ in range(12):
        tried = theta + np.linspace(-width, width, 17)
        theta = float(min(tried, key=lambda one: solved(one, weights)[1]))
        place, _, weights = solved(theta, weights)
        width /= 3
    known = np.linalg.inv((np.swapaxes(lever, 1, 2) @ information @ lever).sum(0) + identity)
    if np.sqrt(known[0, 0]) > OPEN[0]:
        return otherwise
    return wrapped(np.append(place, theta))
