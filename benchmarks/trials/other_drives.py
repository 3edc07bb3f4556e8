"""Drives of a generator of its own: an L of two halls with columns, other faults than the samples.

Nothing of it is shared with the drives of the samples but the container of a scan: rays are cast on
segments and circles here, and the robot follows arcs. Odometry has scales that roll, a bias that
turns, and slip; scans are dropped in bursts, stamps jitter, panes let oblique beams through, people
walk, beams are fired one after the other by a mirror of 25 ms.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from laser_gt.driving.log import DriveInputs, SurveyedStop
from laser_gt.driving.odometer import Odometer
from laser_gt.driving.sweeps import Sensor
from laser_gt.logs.motion import MirrorTiming
from laser_gt.scans.planar import compose, wrapped
from laser_gt.scans.scan import Flags, Scan
from validation.poses.angles import Array

TURN_TIME, RATE = 0.025, 8.0
"""Seconds of a turn of the mirror, and scans a second."""
FIELD, BEAMS, FAR, SIGMA = np.deg2rad(270), 541, 25.0, 0.008
MOUNT, MOUNT_SIGMAS = np.array([0.22, 0.05, 0.3]), np.array([0.001, 0.001, 0.0005])
SURVEY = np.array([0.002, 0.002, 0.002])
JITTER = 0.002
"""Seconds by which stamps of scans are off, each by itself."""
LOOP = np.array([[2, 2], [7, 2.2], [11.5, 2], [11, 4.2], [7, 4.3], [4.2, 4.5], [4, 8], [2.2, 10.5],
                 [1.8, 7], [2.4, 4.5]])  # fmt: skip
"""Places that are passed, again and again, in metres."""


@dataclass(frozen=True)
class OtherDrive:
    """A drive: what was recorded, and the truth at any time of the odometry's clock."""

    inputs: DriveInputs
    times: Array
    poses: Array
    delay: float

    def at(self, times: Array) -> Array:
        """(n, 3) true poses."""
        track = np.column_stack([self.poses[:, :2], np.unwrap(self.poses[:, 2])])
        return wrapped(np.column_stack([np.interp(times, self.times, one) for one in track.T]))


def _segments(rng: np.random.Generator) -> tuple[Array, Flags]:
    """(m, 4) segments x1 y1 x2 y2 of walls, and which are panes."""
    outline = [(0, 0), (13, 0), (13, 6), (6, 6), (6, 12.2), (0, 12), (0, 0)]
    walls, glass = [], []
    for (x1, y1), (x2, y2) in pairwise(outline):
        cuts = np.sort(rng.uniform(0.1, 0.9, 2))
        way = np.array([x2 - x1, y2 - y1])
        out = np.array([way[1], -way[0]]) / np.hypot(*way)
        ends = [np.array([x1, y1]) + share * way for share in (0, *cuts, 1)]
        deep = out * rng.uniform(-0.3, 0.4)
        walls += [
            (*ends[0], *ends[1]),
            (*(ends[1] + deep), *(ends[2] + deep)),
            (*ends[2], *ends[3]),
        ]
        walls += [(*ends[1], *(ends[1] + deep)), (*ends[2], *(ends[2] + deep))]
        glass += [False, rng.random() < 0.3, False, False, False]
    return np.array(walls), np.array(glass)


def _cast(origins: Array, headings: Array, walls: Array, glass: Flags, circles: Array) -> Array:
    """(n,) ranges of beams with origins of their own; infinite for nothing."""
    beams = np.column_stack([np.cos(headings), np.sin(headings)])
    along = walls[:, 2:] - walls[:, :2]
    apart = walls[:, :2] - origins[:, None]
    cross = beams[:, None, 0] * along[:, 1] - beams[:, None, 1] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        there = (apart[..., 0] * along[:, 1] - apart[..., 1] * along[:, 0]) / cross
        share = (apart[..., 0] * beams[:, None, 1] - apart[..., 1] * beams[:, None, 0]) / cross
    squarely = np.abs(cross) / np.hypot(*along.T) > np.cos(0.2)
    hit = (there > 0) & (share >= 0) & (share <= 1) & (~glass | squarely)
    ranges = np.where(hit, there, np.inf).min(1)
    for x, y, radius in circles:
        away = np.array([x, y]) - origins
        middle = (away * beams).sum(1)
        inside = radius**2 - (away**2).sum(1) + middle**2
        near = middle - np.sqrt(np.maximum(inside, 0))
        ranges = np.minimum(ranges, np.where((inside > 0) & (near > 0), near, np.inf))
    return np.asarray(ranges)


def _path(
    rng: np.random.Generator, seconds: float
) -> tuple[Array, Array, list[tuple[float, float]]]:
    """Times, poses, 100 a second, and when the robot stood."""
    step, now = 0.01, np.array([*LOOP[0], 0.0])
    poses: list[Array] = []
    stops: list[tuple[float, float]] = []
    goal, speed, turn = 1, 0.0, 0.0
    rest = 3.0
    while len(poses) * step < seconds:
        time = len(poses) * step
        if rest > 0:
            speed, turn, rest = 0.0, 0.0, rest - step
            if rest <= 0:
                stops.append((max(time - 2.5, 0.0), time - 0.1))
        else:
            away = LOOP[goal % len(LOOP)] - now[:2]
            ahead = float(wrapped(np.array([0, 0, np.arctan2(away[1], away[0]) - now[2]]))[2])
            turn += np.clip(np.clip(1.5 * ahead, -0.9, 0.9) - turn, -0.02, 0.02)
            speed += np.clip(0.6 * max(np.cos(ahead), 0.0) ** 2 - speed, -0.006, 0.006)
            if np.hypot(*away) < 0.35:
                goal += 1
                rest = 3.0 if rng.random() < 0.3 else 0.0
        now = now + step * np.array([speed * np.cos(now[2]), speed * np.sin(now[2]), turn])
        poses.append(now.copy())
    return np.asarray(np.arange(len(poses)) * step, dtype=float), np.array(poses), stops


def _odometry(rng: np.random.Generator, times: Array, poses: Array) -> tuple[Array, Array]:
    """Times and poses of wheels read 25 times a second."""
    rows = np.arange(0, len(times), 4)
    track = poses[rows]
    way = np.hypot(*np.diff(track[:, :2], axis=0).T)
    turn = np.diff(track[:, 2])
    phase = np.cumsum(way) / 6.0
    scale = 1.01 + 0.01 * np.sin(phase)
    slip = rng.normal(0, 1, (2, len(way))) * 0.004 * np.sqrt(way)
    turned = turn * 0.99 + 0.004 * np.sin(0.7 * phase) * way + slip[0]
    went = way * scale + slip[1]
    heading = np.cumsum([0.0, *turned])
    middle = heading[:-1] + turned / 2
    place = np.cumsum(np.column_stack([went * np.cos(middle), went * np.sin(middle)]), axis=0)
    found = np.column_stack([np.vstack([[0, 0], place]), heading])
    return times[rows], wrapped(found)


def other_drive(seed: int, minutes: float = 2.0, people: int = 3) -> OtherDrive:
    """A drive, its log, and the truth."""
    rng = np.random.default_rng([seed, 99])
    walls, glass = _segments(rng)
    columns = np.column_stack([rng.uniform([5, 0.8], [12, 1.2], (3, 2)), rng.uniform(0.1, 0.25, 3)])
    columns = np.vstack([columns, [5.2, 9.5, 0.3], [0.7, 9.0, 0.2]])
    seconds = 60 * minutes
    times, poses, stood = _path(rng, seconds)
    delay = float(rng.uniform(-0.1, 0.1))
    timing = MirrorTiming(TURN_TIME)
    angles = np.linspace(-FIELD / 2, FIELD / 2, BEAMS)
    centre = rng.uniform([2, 2], [9, 4], (people, 2))
    drive = OtherDrive(_nothing(), times, poses, delay)
    scans = []
    lost = 0
    for stamp in np.arange(0.2, seconds - 0.2, 1 / RATE):
        lost = int(rng.integers(2, 7)) if rng.random() < 0.004 else lost - 1
        if lost > 0:
            continue
        robot = drive.at(stamp + TURN_TIME * angles / (2 * np.pi))
        laser = compose(robot, np.broadcast_to(MOUNT, robot.shape))
        legs = [
            [*(spot + 1.5 * np.array([np.cos(0.4 * stamp + k), np.sin(0.55 * stamp)])), 0.09]
            for k, spot in enumerate(centre)
        ]
        legs += [[x + 0.2, y + 0.1 * np.sin(5 * stamp), r] for x, y, r in legs]
        circles = np.vstack([columns, *[[leg] for leg in legs]])
        ranges = _cast(laser[:, :2], laser[:, 2] + angles, walls, glass, circles)
        ranges = ranges + rng.normal(0, SIGMA, BEAMS)
        ranges[(rng.random(BEAMS) < 0.01) | (ranges > FAR) | (ranges < 0.05)] = np.inf
        told = stamp - delay + rng.normal(0, JITTER)
        scans.append(Scan(ranges, angles, 0.05, FAR, time=float(told), sensor="front"))
    chosen = np.unique(np.linspace(0, len(stood) - 1, 6).round().astype(int))
    surveyed = []
    for number in chosen.tolist():
        start, end = stood[number]
        pose = drive.at(np.array([(start + end) / 2]))[0] + rng.normal(size=3) * SURVEY
        surveyed.append(SurveyedStop(str(number), start, end, pose, np.diag(SURVEY**2)))
    stated = MOUNT + rng.normal(size=3) * MOUNT_SIGMAS
    inputs = DriveInputs(
        {"front": scans},
        {"front": Sensor(stated, timing)},
        MOUNT_SIGMAS,
        Odometer(*_odometry(rng, times, poses)),
        own_clock=True,
        stops=surveyed,
    )
    return OtherDrive(inputs, times, poses, delay)


def _nothing() -> DriveInputs:
    return DriveInputs({}, {}, MOUNT_SIGMAS, None)
