"""A whole log of a driving robot as a trajectory: track, loops, graph, and every scan in its map."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from laser_gt.driving.graph import (
    LEAST_MISFIT,
    Anchor,
    DriveGraph,
    DrivePoses,
    Marginals,
    marginals,
    own_noise,
    solve_drive,
)
from laser_gt.driving.links import Asked, Link, matched_links
from laser_gt.driving.odometer import Odometer
from laser_gt.driving.places import loop_candidates, uncertainty
from laser_gt.driving.refining import Place, Placed, carried, placed_sweeps
from laser_gt.driving.sweeps import Sensor, sweeps_of
from laser_gt.driving.tracking import GUESS_SIGMAS, Track, track
from laser_gt.scans.planar import between, compose, compose_jacobians, inverse, inverse_jacobian
from laser_gt.scans.scan import Flags, Indices, Scan, Sweep
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.trajectory import Clock, Trajectory
from validation.trajectories.clock.estimate import estimate_clock
from validation.trajectories.clock.result import ClockEstimate

BACK = (1, 2, 4)
"""Keyframes back that each is matched with. A judgement: each link is there twice over, once by
others that are its sum, so that the noise of links can be told from that of scans."""
ROUNDS = 4
"""Bound on the rounds of loops; each is sought from the poses that the loops before it leave."""
WORSE = (3.0, 3.0)
"""How much worse than `SLIP_LENGTH` and `SLIP_ANGLE` odometry is taken for before it is judged."""
AROUND = 10
"""Keyframes of the map that a sweep is placed in. A judgement: of a place that was passed several
times those nearest, which have it in view."""


@dataclass(frozen=True)
class SurveyedStop:
    """A stop with a surveyed pose of the robot.

    Parameters
    ----------
    name : str
        Of the stop.
    start, end : float
        Seconds, on the clock of the odometry.
    pose, covariance : (3,), (3, 3) arrays
        In the GTV frame.
    """

    name: str
    start: float
    end: float
    pose: Array
    covariance: Array


@dataclass(frozen=True)
class DriveInputs:
    """A log.

    Parameters
    ----------
    scans : mapping of str to sequence of Scan
        By scanner, in the order of time; the first one's frame is the laser frame.
    sensors : mapping of str to Sensor
        Of the same names.
    mount_sigmas : (3,) array
        How well the first one's mount was measured.
    odometer : Odometer or None
        Odometry.
    own_clock : bool
        Whether odometry has stamps of its own, of another clock than the scans.
    stops : sequence of SurveyedStop
        Anchors; without any the first pose of the robot is the origin.
    epoch : int
        Whole seconds that were taken off all times.
    max_delay : float
        Between scans of several scanners, seconds.
    """

    scans: Mapping[str, Sequence[Scan]]
    sensors: Mapping[str, Sensor]
    mount_sigmas: Array
    odometer: Odometer | None = None
    own_clock: bool = False
    stops: Sequence[SurveyedStop] = ()
    epoch: int = 0
    max_delay: float = 0.05


@dataclass(frozen=True)
class DriveOutcome:
    """What follows from a log.

    Parameters
    ----------
    trajectory : Trajectory
        Of the robot, on the clock of the odometry where it has one of its own.
    matched : (n,) bool array
        Poses whose scan was used; the others are those of odometry from the nearest that was.
    scans : int
        In the log.
    corrected : int
        Scans corrected for the motion of the robot.
    keyframes : (k,) int array
        Poses that the map is made of.
    sweeps : sequence of Sweep
        Of all poses.
    mount : (3,) array
        Laser frame in the robot frame, as it fits best.
    links, loops : int
        Links between keyframes, and those of them that close loops.
    switched_off : int
        Links that the others contradict.
    misfit : float
        Mean square of the links' residuals over its expectation.
    clock : ClockEstimate or None
        Of the scans against the odometry.
    delay_s : float
        Added to the scans' stamps to get the trajectory's.
    anchors : tuple of str
        Surveyed stops that hold the trajectory.
    odometry_noise : (float, float)
        Of the odometry over a metre: metres, radians; NaN without odometry.
    """

    trajectory: Trajectory
    matched: Flags
    scans: int
    corrected: int
    keyframes: Indices
    sweeps: Sequence[Sweep]
    mount: Array
    links: int
    loops: int
    switched_off: int
    misfit: float
    clock: ClockEstimate | None
    delay_s: float
    anchors: tuple[str, ...]
    odometry_noise: tuple[float, float]


Report = Callable[[str, float], None]


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
    tracked = _tracked(inputs, report)
    graph, solved = _closed(tracked, workers, report)
    return _outcome(tracked, graph, solved, workers, report)


@dataclass(frozen=True)
class _Tracked:
    """What is known after the way was tracked."""

    inputs: DriveInputs
    odometer: Odometer | None
    sweeps: Sequence[Sweep]
    times: Array
    corrected: int
    track: Track
    delay: float
    nodes: Mapping[str, int]

    @property
    def mount(self) -> Array:
        """(3,) laser frame in the robot frame, as measured."""
        return next(iter(self.inputs.sensors.values())).mount


def _tracked(inputs: DriveInputs, report: Report) -> _Tracked:
    """The way by submaps; again where the clock or the motion that it shows differ from before."""
    first = next(iter(inputs.sensors.values()))
    odometer = None if inputs.odometer is None else replace(inputs.odometer, worse=WORSE)
    motion, delay = odometer, 0.0
    for turn in range(3):
        scans = _shifted(inputs.scans, delay)
        sweeps, corrected = sweeps_of(scans, inputs.sensors, motion, inputs.max_delay)
        if len(sweeps) < 2:
            raise GtvalError("a drive needs two scans at least that can be matched")
        main = [one.views[0].scan.time for one in sweeps]
        times = np.array(main, dtype=float)
        nodes = _nodes(inputs.stops, times)
        kept = np.isin(np.arange(len(times)), [*nodes.values()])
        found = track(
            sweeps,
            times,
            first.mount,
            odometer,
            kept,
            lambda share: report("tracking", 0.4 * share),
        )
        robot = compose(found.poses, inverse(first.mount))
        if odometer is not None:
            more = _delay(inputs, odometer, times, robot) if inputs.own_clock else 0.0
            odometer = odometer.judged(times, robot)
            motion = odometer
            if abs(more) < SETTLED:
                break
            delay += more
        else:
            motion = Odometer(times, robot)
            if turn == 1:
                break
    return _Tracked(inputs, odometer, sweeps, times, corrected, found, delay, nodes)


SETTLED = 0.002
"""Seconds of delay below which the scans are not corrected anew: at 1 m/s and 1 rad/s the beams of a
scan are off by 2 mm and 2 mrad together, and the map by nothing."""


def _shifted(scans: Mapping[str, Sequence[Scan]], delay: float) -> Mapping[str, Sequence[Scan]]:
    """Scans with a delay added to their stamps."""
    if not delay:
        return scans
    return {
        name: [replace(scan, time=scan.time + delay) for scan in each]
        for name, each in scans.items()
    }


def _nodes(stops: Sequence[SurveyedStop], times: Array) -> dict[str, int]:
    """The sweep nearest to the middle of each stop that has one."""
    found = {}
    for stop in stops:
        middle = (stop.start + stop.end) / 2
        nearest = int(np.abs(times - middle).argmin())
        if stop.start <= times[nearest] <= stop.end:
            found[stop.name] = nearest
    return found


def _clock(inputs: DriveInputs, odometer: Odometer, times: Array, robot: Array) -> ClockEstimate:
    """What is to be added to the scans' stamps to get the odometry's."""
    by_odometry = Trajectory("odometry", odometer.times, odometer.poses, epoch=inputs.epoch)
    return estimate_clock(by_odometry, Trajectory("scanner", times, robot, epoch=inputs.epoch))


def _delay(inputs: DriveInputs, odometer: Odometer, times: Array, robot: Array) -> float:
    """The delay, 0 where the motion does not tell it."""
    clock = _clock(inputs, odometer, times, robot)
    return clock.delay_s if clock.verdict == "determined" else 0.0


def _closed(tracked: _Tracked, workers: int, report: Report) -> tuple[DriveGraph, DrivePoses]:
    """The keyframes with their links and loops, solved."""
    found, keys = tracked.track, tracked.track.keyframes
    sweeps = [tracked.sweeps[number] for number in keys]
    poses = found.poses[keys]
    chain = [
        Asked(number - back, number, between(poses[number - back], poses[number]))
        for number in range(1, len(keys))
        for back in BACK
        if back <= number
    ]
    links = matched_links(
        sweeps, chain, workers, lambda share: report("links", 0.4 + 0.15 * share), judged=False
    )
    graph = DriveGraph(
        initial=poses,
        mount=tracked.mount,
        mount_covariance=np.diag(tracked.inputs.mount_sigmas**2),
        links=links,
        steps=_steps(tracked),
        anchors=_anchors(tracked),
    )
    graph = replace(graph, initial=_first_poses(graph))
    solved = solve_drive(graph)
    have: set[tuple[int, int]] = set()
    widest = max(_field(sweep) for sweep in sweeps[:20])
    for turn in range(ROUNDS):
        believed = [
            one for one, good in zip(graph.links, solved.weights > 0.5, strict=True) if good
        ]
        sigmas = uncertainty(len(keys), believed, graph.steps)
        asked = loop_candidates(solved.poses, sigmas, have, widest, most=2)
        if turn == 0:
            asked = [one for one in asked if one.end % 3 == 0]
        if not asked:
            break
        have |= {(one.start, one.end) for one in asked}
        more = matched_links(sweeps, asked, workers, _part(report, turn), judged=True)
        graph = replace(graph, links=[*graph.links, *more], initial=solved.poses)
        solved = solve_drive(graph)
    return replace(graph, initial=solved.poses), solved


def _part(report: Report, turn: int) -> Callable[[float], None]:
    """Progress of a round of loops."""
    return lambda share: report("loops", 0.55 + 0.2 * (turn + share) / ROUNDS)


def _field(sweep: Sweep) -> float:
    """Field of view of a sweep in radians, all of its scanners together."""
    total = sum(float(np.ptp(view.scan.angles)) for view in sweep.views)
    return min(total, 2 * np.pi)


def _steps(tracked: _Tracked) -> list[Link]:
    """Motions between keyframes by odometry; where there is none, those that were tracked."""
    keys, mount = tracked.track.keyframes, tracked.mount
    starts, ends = keys[:-1], keys[1:]
    times = tracked.times[keys]
    laser = between(tracked.track.poses[starts], tracked.track.poses[ends])
    covariances = np.tile(np.diag(GUESS_SIGMAS**2), (len(laser), 1, 1))
    if tracked.odometer is not None:
        robot = tracked.odometer.at(times)
        steps = between(robot[:-1], robot[1:])
        known = tracked.odometer.known(times[:-1]) & tracked.odometer.known(times[1:])
        laser[known] = compose(compose(inverse(mount), steps[known]), mount)
        carried_over = _through_mount(steps, mount, tracked.odometer.covariance(steps))
        covariances = np.where(known[:, None, None], carried_over, covariances)
    return [
        Link(number, number + 1, pose, np.linalg.inv(covariance), sure=True)
        for number, (pose, covariance) in enumerate(zip(laser, covariances, strict=True))
    ]


def _through_mount(steps: Array, mount: Array, covariances: Array) -> Array:
    """(m, 3, 3) covariances of motions of the laser frame from those of the robot."""
    back = inverse(mount)
    _, by_step = compose_jacobians(np.broadcast_to(back, steps.shape), steps)
    by_first, _ = compose_jacobians(compose(back, steps), np.broadcast_to(mount, steps.shape))
    jacobian = by_first @ by_step
    return np.asarray(jacobian @ covariances @ np.swapaxes(jacobian, -1, -2))


def _anchors(tracked: _Tracked) -> list[Anchor]:
    """Surveyed stops as anchors of keyframes."""
    place = {number: node for node, number in enumerate(tracked.track.keyframes.tolist())}
    return [
        Anchor(place[tracked.nodes[stop.name]], stop.pose, stop.covariance)
        for stop in tracked.inputs.stops
        if stop.name in tracked.nodes
    ]


def _first_poses(graph: DriveGraph) -> Array:
    """The tracked poses, moved to where the first surveyed stop, or the origin, is."""
    if not graph.anchors:
        return compose(graph.mount, between(graph.initial[0], graph.initial))
    anchor = graph.anchors[0]
    there = compose(anchor.pose, graph.mount)
    return compose(there, between(graph.initial[anchor.node], graph.initial))


def _outcome(
    tracked: _Tracked, graph: DriveGraph, solved: DrivePoses, workers: int, report: Report
) -> DriveOutcome:
    """Every sweep in its map, as a trajectory of the robot."""
    believed = solved.weights > 0.5
    scale = float(np.clip(solved.misfit, LEAST_MISFIT, None))
    shared = max(1.0 - scale, 0.0)
    own = own_noise(graph, believed) * shared
    loose = replace(graph, anchors=_loosened(graph, own))
    known = marginals(loose, solved, scale)
    places = _places(tracked, graph, solved, own)
    placed = placed_sweeps(
        tracked.sweeps, places, workers, lambda share: report("placing", 0.8 + 0.2 * share)
    )
    laser, covariances, cross, matched = _laser_poses(tracked, solved, known, own, placed)
    back = inverse(solved.mount)
    robot = compose(laser, back)
    by_laser, by_back = compose_jacobians(laser, np.broadcast_to(back, laser.shape))
    by_mount = by_back @ inverse_jacobian(solved.mount)
    mixed = by_laser @ cross @ np.swapaxes(by_mount, -1, -2)
    spread = by_laser @ covariances @ np.swapaxes(by_laser, -1, -2)
    spread = spread + by_mount @ known.mount @ np.swapaxes(by_mount, -1, -2)
    spread = spread + mixed + np.swapaxes(mixed, -1, -2)
    trajectory = Trajectory(
        "laser_drive",
        tracked.times,
        robot,
        covariances=(spread + np.swapaxes(spread, 1, 2)) / 2,
        epoch=tracked.inputs.epoch,
        clock=Clock("capture", 1 / float(np.median(np.diff(tracked.times)))),
        frame="" if graph.anchors else "own",
    )
    clock, delay = None, tracked.delay
    if tracked.odometer is not None and tracked.inputs.own_clock:
        clock = _clock(tracked.inputs, tracked.odometer, tracked.times, robot)
        if clock.verdict == "determined":
            trajectory, delay = trajectory.shifted(clock.delay_s), delay + clock.delay_s
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


def _loosened(graph: DriveGraph, own: Array) -> list[Anchor]:
    """Anchors with the noise of the scan that they hold added to their own."""
    return [replace(one, covariance=one.covariance + own[one.node]) for one in graph.anchors]


def _places(tracked: _Tracked, graph: DriveGraph, solved: DrivePoses, own: Array) -> list[Place]:
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
        guesses, covariances = _guesses(tracked, key, inside)
        around = near[node].tolist()
        covariances = covariances + own[node]
        found.append(
            Place(node, keys[around].tolist(), between(poses[node], poses[around]),
                  inside.tolist(), guesses, covariances)
        )  # fmt: skip
    return found


def _guesses(tracked: _Tracked, key: int, inside: Indices) -> tuple[Array, Array]:
    """Poses of sweeps seen from a keyframe before they are placed, and covariances."""
    steps = between(tracked.track.poses[key], tracked.track.poses[inside])
    if tracked.odometer is None:
        return steps, np.tile(np.diag(GUESS_SIGMAS**2), (len(steps), 1, 1))
    times = tracked.times
    robot = tracked.odometer.at(times[[key, *inside.tolist()]])
    moved = between(robot[0], robot[1:])
    covariance = _through_mount(moved, tracked.mount, tracked.odometer.covariance(moved))
    unknown = ~tracked.odometer.known(times[inside])
    covariance[unknown] = covariance[unknown] + np.diag(GUESS_SIGMAS**2)
    by_odometry = compose(compose(inverse(tracked.mount), moved), tracked.mount)
    return np.where(unknown[:, None], steps, by_odometry), covariance


def _laser_poses(
    tracked: _Tracked,
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
