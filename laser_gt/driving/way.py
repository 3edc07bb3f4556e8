"""The way of a log, on one clock with its odometry and corrected for motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from laser_gt.driving.log import DriveInputs, Report, SurveyedStop
from laser_gt.driving.odometer import FIRST_ANGLE, FIRST_LENGTH, Odometer
from laser_gt.driving.sweeps import sweeps_of
from laser_gt.driving.tracking import Track, track
from laser_gt.scans.planar import compose, inverse
from laser_gt.scans.scan import Scan, Sweep
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.trajectory import Trajectory
from validation.trajectories.clock.estimate import estimate_clock
from validation.trajectories.clock.result import ClockEstimate

WORSE = 9.0
"""How much larger than `FIRST_LENGTH` and `FIRST_ANGLE` the variances of odometry are taken for
before it is judged: three times the standard deviations."""
SLACK = np.array([0.05, 0.05, 0.08])
"""Metres and radians that a step of odometry may be off by as long as its clock is not known: what
a quarter of a second of braking at 1 m/s^2 and 2 rad/s^2 does to a step of 0.2 s."""
ROUGH_WINDOW, ROUGH_STEP = 2.0, 0.02
"""Seconds to both sides in which the delay is first sought, and from try to try. A judgement: what
a scanner's buffers and drivers hold back; a larger delay is left to the clock."""
CLEAR = 0.5
"""Share of the usual difference of the turns below which a delay stands out. A judgement."""
SETTLED = 0.002
"""Seconds of delay below which the scans are not corrected anew: the speed, from which the beams
are corrected, is then that of 2 ms before, and the map does not show it."""


@dataclass(frozen=True)
class Way:
    """What is known after the way was tracked."""

    inputs: DriveInputs
    odometer: Odometer | None
    sweeps: Sequence[Sweep]
    times: Array
    corrected: int
    track: Track
    delay: float
    nodes: Mapping[str, int]
    clock: ClockEstimate | None = None

    @property
    def mount(self) -> Array:
        """(3,) laser frame in the robot frame, as measured."""
        return next(iter(self.inputs.sensors.values())).mount


def tracked_way(inputs: DriveInputs, report: Report) -> Way:
    """The way by submaps; again where the clock or the motion that it shows differ from before."""
    first = next(iter(inputs.sensors.values()))
    odometer = inputs.odometer
    if odometer is not None:
        odometer = replace(odometer, length=WORSE * FIRST_LENGTH, angle=WORSE * FIRST_ANGLE)
    motion, delay, clock = odometer, 0.0, None
    for turn in range(4):
        scans = _shifted(inputs.scans, delay)
        sweeps, corrected = sweeps_of(scans, inputs.sensors, motion, inputs.max_delay)
        if len(sweeps) < 2:
            raise GtvalError("a drive needs two scans at least that can be matched")
        main = [one.views[0].scan.time for one in sweeps]
        times = np.array(main, dtype=float)
        nodes = _nodes(inputs.stops, times)
        kept = np.isin(np.arange(len(times)), [*nodes.values()])
        unknown = turn == 0 and inputs.own_clock
        found = track(
            sweeps,
            times,
            first.mount,
            odometer,
            kept,
            np.diag(SLACK**2) if unknown else np.zeros((3, 3)),
            lambda share: report("tracking", 0.4 * share),
        )
        robot = compose(found.poses, inverse(first.mount))
        if odometer is not None:
            more = 0.0
            if inputs.own_clock:
                more = rough_delay(odometer, times, robot) if turn == 0 else 0.0
                if not more:
                    told = clock_of(inputs, odometer, times, robot)
                    clock = told if told.verdict == "determined" else clock
                    more = told.delay_s if told.verdict == "determined" else 0.0
            odometer = odometer.judged(times, robot)
            motion = odometer
            if abs(more) < SETTLED:
                break
            delay += more
        else:
            motion = Odometer(times, robot)
            if turn == 1:
                break
    return Way(inputs, odometer, sweeps, times, corrected, found, delay, nodes, clock)


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


def clock_of(inputs: DriveInputs, odometer: Odometer, times: Array, robot: Array) -> ClockEstimate:
    """What is to be added to the scans' stamps to get the odometry's."""
    by_odometry = Trajectory("odometry", odometer.times, odometer.poses, epoch=inputs.epoch)
    return estimate_clock(by_odometry, Trajectory("scanner", times, robot, epoch=inputs.epoch))


def rough_delay(odometer: Odometer, times: Array, robot: Array) -> float:
    """The delay at which the odometry turns as the scans do, to a hundredth of a second.

    From scans that the delay has bent, the clock may not tell its own exactly; after this one it
    has but little left to tell. 0 where turning at no time fits clearly better than usual.
    """
    turned = np.diff(np.unwrap(robot[:, 2]))
    heading = np.unwrap(odometer.poses[:, 2])
    delays = np.arange(-ROUGH_WINDOW, ROUGH_WINDOW + ROUGH_STEP / 2, ROUGH_STEP)
    costs = np.array(
        [
            np.mean(np.abs(np.diff(np.interp(times + delay, odometer.times, heading)) - turned))
            for delay in delays
        ]
    )
    best = int(costs.argmin())
    inside = 0 < best < len(delays) - 1
    clear = costs[best] < CLEAR * np.median(costs)
    return float(delays[best]) if inside and clear else 0.0
