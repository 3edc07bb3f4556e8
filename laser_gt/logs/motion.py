"""Scans taken while driving: every beam is put where the moving scanner was when it fired.

A mirror takes 13 ms for a turn, and the SICK scanners of CARMEN and RAWSEEDS logs put a scan of
half degrees together from two turns, the odd beams one turn after the even ones. At 0.7 rad/s
that moves them by 9 mrad, more than a whole beam: walls become saw teeth.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from laser_gt.logs.records import ScanRecord
from laser_gt.scans.planar import between, rotation, transform
from laser_gt.scans.scan import Scan
from validation.errors import GtvalError
from validation.poses.angles import Array

TIE = 1e-12
"""Least distance of neighbouring angles in radians: two beams may come to point the same way. Far
above the last bit of an angle (4e-16), far below the step of any scanner."""
LONGEST = 1.5
"""Odometry further apart than this, in seconds, says little about the speed at a scan. A judgement:
logs have it several times a second; in 1.5 s a robot stops, turns and starts again."""


class Timing(Protocol):
    """When the beams of a scan are fired."""

    def times(self, angles: Array) -> Array:
        """(n,) seconds from the stamp of the scan at which each beam is fired."""
        ...


@dataclass(frozen=True)
class SteadyTiming:
    """Beams fired one after the other, the first at the stamp, as in a LaserScan of ROS.

    Parameters
    ----------
    increment : float
        Seconds from beam to beam; negative where the angles fall in time.
    """

    increment: float

    def times(self, angles: Array) -> Array:
        """(n,) seconds from the stamp."""
        steps = np.arange(len(angles))
        return np.asarray(abs(self.increment) * (steps if self.increment >= 0 else steps[::-1]))


@dataclass(frozen=True)
class MirrorTiming:
    """When the beams of a scan are fired.

    Parameters
    ----------
    turn_time : float
        Seconds of a turn of the mirror, which turns towards growing angles; 1/75 for a SICK LMS.
    interlaced : int
        Turns that a scan is put together from: beam i is of turn i modulo this number.
    """

    turn_time: float
    interlaced: int = 1

    def times(self, angles: Array) -> Array:
        """(n,) seconds from the middle of the scan at which each beam is fired."""
        turn = np.arange(len(angles)) % self.interlaced - (self.interlaced - 1) / 2
        return np.asarray(self.turn_time * (turn + angles / (2 * np.pi)))


def moved(twist: Array, times: Array) -> Array:
    """Poses at some times of a frame that moves at a constant twist, in its frame at time zero.

    Parameters
    ----------
    twist : (3,) array
        Velocities along x and y of the frame (m/s) and of turning (rad/s).
    times : (n,) array
        Seconds.

    Returns
    -------
    (n, 3) array
        The exponential of twist times time.
    """
    step = np.asarray(times)[:, None] * np.asarray(twist)
    angle = step[:, 2]
    along = np.sinc(angle / np.pi)
    half = angle / 2
    across = np.sinc(half / np.pi) * np.sin(half)
    x = along * step[:, 0] - across * step[:, 1]
    y = across * step[:, 0] + along * step[:, 1]
    return np.column_stack([x, y, angle])


def twist_between(first: Array, second: Array, seconds: float) -> Array:
    """(3,) constant twist that leads from a pose to another in a time; inverse of `moved`."""
    step = between(first, second)
    half = step[2] / 2
    along = half / np.tan(half) if abs(half) > 1e-9 else 1.0
    x, y = along * step[0] + half * step[1], along * step[1] - half * step[0]
    return np.array([x, y, step[2]]) / seconds


def undistorted(scan: Scan, twist: Array, timing: Timing) -> Scan:
    """The scan as a scanner at rest at the middle of its time would have taken it.

    Parameters
    ----------
    scan : Scan
        As logged.
    twist : (3,) array
        Of the sensor frame: m/s, m/s, rad/s.
    timing : Timing
        When the beams were fired.

    Raises
    ------
    GtvalError
        If the twist is not finite.

    Notes
    -----
    Beams change places where odd and even ones cross; they are sorted by their new angles. What
    a scanner that sees all around sees twice, because it turned on meanwhile, is left out.
    """
    if not np.isfinite(twist).all():
        raise GtvalError(f"the motion during a scan of '{scan.sensor}' is not known: {twist}")
    ranges = np.where(scan.returned, scan.ranges, 1.0)
    ends = ranges[:, None] * np.column_stack([np.cos(scan.angles), np.sin(scan.angles)])
    points = transform(moved(twist, timing.times(scan.angles)), ends[:, None])[:, 0]
    angles = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    angles += 2 * np.pi * np.round((scan.angles[0] - angles[0]) / (2 * np.pi))
    order = np.argsort(angles, kind="stable")
    angles = np.maximum.accumulate(angles[order]) + TIE * np.arange(len(scan))
    inside = angles - angles[0] <= 2 * np.pi
    length = np.clip(np.hypot(*points.T)[order], scan.range_min, np.nextafter(scan.range_max, 0))
    length = np.where(scan.returned[order], length, np.inf)
    sigma = scan.range_sigma
    return replace(scan, ranges=length[inside], angles=angles[inside], sigma=sigma)


def sensor_twist(twist: Array, mount: Array) -> Array:
    """(3,) twist of a sensor frame from that of the robot frame that carries it."""
    x, y, turn = twist
    at_sensor = np.array([x - turn * mount[1], y + turn * mount[0]])
    return np.append(rotation(mount[2]).T @ at_sensor, turn)


def twists(times: Array, poses: Array) -> Array:
    """Twists at the times of a log, from the poses around each.

    Parameters
    ----------
    times : (n,) array
        Seconds, increasing.
    poses : (n, 3) array
        Of the robot, by odometry.

    Returns
    -------
    (n, 3) array
        Mean over the steps before and after, weighted by their time; NaN where both take longer
        than 1.5 s.
    """
    steps = np.diff(times)
    known = (steps > 0) & (steps <= LONGEST)
    weighted = np.zeros((len(times), 3))
    weight = np.zeros(len(times))
    for number in np.flatnonzero(known):
        twist = twist_between(poses[number], poses[number + 1], steps[number])
        for end in (number, number + 1):
            weighted[end] += twist * steps[number]
            weight[end] += steps[number]
    return np.where(weight[:, None] > 0, weighted / np.maximum(weight, 1e-12)[:, None], np.nan)


MIRROR = 1 / 75
"""Seconds of a turn of the mirror of a SICK LMS; those of other scanners take longer."""
MOVED = (0.006, 0.003)
"""Metres and radians in a turn of the mirror from which on a robot is said to move at a stop: the
standard deviations from which on a match is imprecise. That is 0.45 m/s, or 0.22 rad/s."""


@dataclass(frozen=True)
class MovingStops:
    """Stops at which a scan was taken while the robot moved, and that are not corrected for it.

    Parameters
    ----------
    sensor : str
        Name of the scanner.
    stops : tuple of str
        The stops.
    speed, turn : float
        The fastest of them, m/s and rad/s.
    """

    sensor: str
    stops: tuple[str, ...]
    speed: float
    turn: float


def moving_stops(
    records: Sequence[ScanRecord], by_stop: Mapping[str, Sequence[ScanRecord]]
) -> list[MovingStops]:
    """For each scanner the stops at which the robot moved by the odometry of the log.

    Parameters
    ----------
    records : sequence of ScanRecord
        All of the log.
    by_stop : mapping of str to sequence of ScanRecord
        Those of each stop.
    """
    found = []
    for sensor in dict.fromkeys(record.scan.sensor for record in records):
        mine = sorted(
            (record for record in records if record.scan.sensor == sensor and _placed(record)),
            key=lambda record: record.scan.time,
        )
        if len(mine) < 2:
            continue
        times = np.array([record.scan.time for record in mine])
        motion = twists(times, np.array([record.odometry for record in mine]))
        fast = np.column_stack([np.hypot(motion[:, 0], motion[:, 1]), np.abs(motion[:, 2])])
        at = {record.line: number for number, record in enumerate(mine)}
        moved = {
            stop: fast[at[one.line]]
            for stop, scans in by_stop.items()
            for one in scans
            if one.scan.sensor == sensor and one.line in at and not one.undistorted
        }
        # NaN, where the motion is not known, is not above anything
        moved = {stop: by for stop, by in moved.items() if (by * MIRROR > MOVED).any()}
        if moved:
            speed, turn = np.max(list(moved.values()), axis=0).tolist()
            found.append(MovingStops(sensor, tuple(moved), speed, turn))
    return found


def _placed(record: ScanRecord) -> bool:
    """Whether a scan has a time and a pose by odometry."""
    return record.odometry is not None and bool(np.isfinite(record.scan.time))


def undistorted_records(
    records: Sequence[ScanRecord],
    timings: Mapping[str, MirrorTiming],
    mounts: Mapping[str, Array],
) -> list[ScanRecord]:
    """The records of a log, the scans of the named scanners undistorted by the logged odometry.

    Parameters
    ----------
    records : sequence of ScanRecord
        As read.
    timings : mapping of str to MirrorTiming
        For the scanners to be undistorted.
    mounts : mapping of str to (3,) array
        Sensor frames in the robot frame.

    Returns
    -------
    list of ScanRecord
        Scans without odometry close enough in time stay as they are, and are not marked as
        undistorted.
    """
    result = list(records)
    for sensor, timing in timings.items():
        mine = [
            number
            for number, record in enumerate(records)
            if record.scan.sensor == sensor and record.odometry is not None
        ]
        mine.sort(key=lambda number: records[number].scan.time)
        times = np.array([records[number].scan.time for number in mine])
        poses = np.array([records[number].odometry for number in mine])
        for number, twist in zip(mine, twists(times, poses), strict=True):
            if np.isfinite(twist).all():
                scan = undistorted(
                    records[number].scan, sensor_twist(twist, mounts[sensor]), timing
                )
                result[number] = replace(records[number], scan=scan, undistorted=True)
    return result
