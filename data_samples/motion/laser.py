"""A drive as its laser scanner sees it: beams fired on the way, people, glass, edges."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from data_samples.motion.drive import EPOCH, SURVEY_SIGMA
from data_samples.motion.path import ROOM, TruePath, drive
from data_samples.motion.sensors import ODOMETRY_RATE, odometry
from data_samples.rooms.scanners import SICK_FRONT, Panels, Scanner, box, panels, polyline
from laser_gt.logs.motion import MirrorTiming
from laser_gt.scans.planar import compose
from laser_gt.scans.scan import Scan
from validation.poses.angles import Array, wrap
from validation.poses.pose_table import PoseTable
from validation.poses.trajectory import Clock, Trajectory
from validation.shown import Shown
from validation.trajectories.stops import Stop

SCAN_RATE = 5.0
"""Scans a second that a log has of a SICK scanner on a serial line."""
TIMING = MirrorTiming(1 / 75, 2)
"""Of a SICK scanner: half degrees put together from two turns of the mirror."""
MIXED = 0.008
"""Full angle of a beam in radians; where it meets an edge, the range is a mixture."""
GRAZING = 0.002
"""Metres that a range gets longer for each unit of 1 / cos - 1 of the incidence."""
MOUNT_SIGMAS = (0.001, 0.001, 0.0005)
"""With which the mount is measured: metres, radians."""
STRIDE = 0.9
"""Metres a second of people."""


@dataclass(frozen=True, repr=False)
class LaserDrive(Shown):
    """A drive, and what its scanner and its wheels recorded.

    Parameters
    ----------
    truth : Trajectory
        True poses of the robot, 200 a second, on the clock of the odometry.
    scans : sequence of Scan
        On a clock of their own.
    scanner : Scanner
        With its true mount.
    stated_mount : (3,) array
        As measured by hand.
    delay_s : float
        Added to the scans' stamps gives the odometry's time.
    odometry : Trajectory
        In a frame of its own.
    stops : sequence of Stop
        When the robot stood where.
    survey : PoseTable
        Surveyed poses of some stops.
    true_stops : PoseTable
        True poses of all.
    room : Panels
        What the scanner saw, people left out.
    """

    truth: Trajectory
    scans: Sequence[Scan]
    scanner: Scanner
    stated_mount: Array
    delay_s: float
    odometry: Trajectory
    stops: Sequence[Stop]
    survey: PoseTable
    true_stops: PoseTable
    room: Panels


def laser_drive(
    seed: int,
    *,
    minutes: float = 20.0,
    people: int = 3,
    glass: float = 2.0,
    surveyed: int = 8,
    scanner: Scanner = SICK_FRONT,
) -> LaserDrive:
    """A robot drives from stop to stop through a furnished room, a scanner in front.

    Parameters
    ----------
    seed : int
        Of all that is drawn.
    minutes : float
        How long it drives.
    people : int
        Who walk about meanwhile.
    glass : float
        Width in metres of a window in two of the walls; 0 for none.
    surveyed : int
        Stops with a surveyed pose, spread over the drive.
    scanner : Scanner
        On the robot.

    Notes
    -----
    More than the fitted model has: every beam from where the scanner is when it is fired, mixed
    ranges at edges, longer ones at grazing incidence, whole millimetres, panes that answer only
    beams that hit them squarely, people.
    """
    rng = np.random.default_rng([seed, 18])
    path = drive(60 * minutes, rng)
    room = furnished(rng, glass)
    walks = [drive_of_person(float(path.times[-1]), rng) for _ in range(people)]
    delay = float(rng.uniform(-0.15, 0.15))
    times = np.arange(0.1, float(path.times[-1]) - 0.1, 1 / SCAN_RATE)
    scans = [
        moving_scan(room + _legs(walks, time), scanner, path, time, delay, rng) for time in times
    ]
    wheels = odometry(path, rng)
    clock = Clock("capture", ODOMETRY_RATE)
    chosen = np.unique(np.linspace(0, len(path.stops) - 1, surveyed).round().astype(int))
    middle = np.array([(stop.start + stop.end) / 2 for stop in path.stops])
    true = path.at(middle)
    noisy = true[chosen] + rng.normal(size=(len(chosen), 3)) * SURVEY_SIGMA
    names = tuple(stop.name for stop in path.stops)
    covariances = np.tile(np.diag(SURVEY_SIGMA**2), (len(chosen), 1, 1))
    return LaserDrive(
        truth=Trajectory("truth", path.times, _wrapped(path.poses), epoch=EPOCH, frame="room"),
        scans=scans,
        scanner=scanner,
        stated_mount=np.array(scanner.mount) + rng.normal(size=3) * MOUNT_SIGMAS,
        delay_s=delay,
        odometry=Trajectory("odometry", wheels.stamps, wheels.poses, epoch=EPOCH, clock=clock),
        stops=[Stop(one.name, one.start + EPOCH, one.end + EPOCH) for one in path.stops],
        survey=PoseTable("survey", tuple(names[i] for i in chosen), _wrapped(noisy), covariances),
        true_stops=PoseTable("truth", names, _wrapped(true)),
        room=room,
    )


def _wrapped(poses: Array) -> Array:
    return np.column_stack([poses[:, :2], wrap(poses[:, 2])])


def furnished(rng: np.random.Generator, glass: float) -> Panels:
    """The room of the drives: walls, cupboards along them, a window in two of the walls."""
    width, depth = ROOM
    corners = np.array([[0, 0], [width, 0], [width, depth], [0, depth]], dtype=float)
    found: list[Panels] = []
    for side, (start, end) in enumerate(zip(corners, np.roll(corners, -1, axis=0), strict=True)):
        long = float(np.hypot(*(end - start)))
        along = (end - start) / long
        out = np.array([along[1], -along[0]])
        if glass > 0 and side % 2 == 0:
            middle, half = start + along * long * rng.uniform(0.35, 0.65), along * glass / 2
            found += [
                panels([start, middle + half], [middle - half, end]),
                panels([middle - half], [middle + half], glass=True),
                panels([middle + 2.5 * out - 4 * along], [middle + 2.5 * out + 4 * along]),
            ]
        else:
            found.append(panels([start], [end]))
        place = rng.uniform(0.3, 1.0)
        while place < long - 1.0:
            size, deep = rng.uniform(0.3, 1.2), rng.uniform(0.15, 0.5)
            centre = start + along * (place + size / 2) - out * deep / 2
            angle = float(np.arctan2(along[1], along[0])) + rng.normal(0, 0.02)
            found.append(box((*centre, angle), size, deep))
            place += size + rng.uniform(0.4, 2.0)
    return sum(found[1:], found[0])


def drive_of_person(seconds: float, rng: np.random.Generator) -> Array:
    """(n, 3) time, x and y at the corners of a walk through the room, with rests."""
    rows = [(0.0, *(0.6 + rng.random(2) * (ROOM - 1.2)))]
    while rows[-1][0] < seconds:
        time, x, y = rows[-1]
        goal = 0.6 + rng.random(2) * (ROOM - 1.2)
        there = time + float(np.hypot(goal[0] - x, goal[1] - y)) / STRIDE
        rows += [(there, *goal), (there + rng.uniform(0, 20), *goal)]
    return np.array(rows)


def _legs(walks: Sequence[Array], time: float) -> Panels:
    """Two legs of each person, that step one after the other."""
    found = [panels(np.empty((0, 2)), np.empty((0, 2)))]
    corners = np.linspace(0, 2 * np.pi, 7)[:-1]
    circle = 0.06 * np.column_stack([np.cos(corners), np.sin(corners)])
    for walk in walks:
        spot = np.array([np.interp(time, walk[:, 0], column) for column in walk[:, 1:].T])
        later = np.array([np.interp(time + 0.1, walk[:, 0], column) for column in walk[:, 1:].T])
        ahead = later - spot
        swing = ahead / max(float(np.hypot(*ahead)), 1e-9) * 0.2 * np.sin(2 * np.pi * time)
        aside = np.array([0.12, 0.0])
        legs = (spot + aside + swing, spot - aside - swing)
        found += [polyline(circle + leg, closed=True) for leg in legs]
    return sum(found[1:], found[0])


def moving_scan(
    room: Panels,
    scanner: Scanner,
    path: TruePath,
    time: float,
    delay: float,
    rng: np.random.Generator,
) -> Scan:
    """A scan taken on the way, every beam fired at its time.

    Parameters
    ----------
    room : Panels
        Upright ones.
    scanner : Scanner
        With its mount.
    path : TruePath
        Of the robot.
    time : float
        True time of the middle of the scan.
    delay : float
        Taken off the stamp.
    rng : numpy.random.Generator
        Source of all chance.
    """
    angles = scanner.angles
    laser = compose(path.at(time + TIMING.times(angles)), np.asarray(scanner.mount))
    ranges, grazing = _met(room, laser[:, :2], laser[:, 2] + angles, scanner.glass_angle)
    sides = [
        _met(room, laser[:, :2], laser[:, 2] + angles + off, scanner.glass_angle)[0]
        for off in (-MIXED / 2, MIXED / 2)
    ]
    both = np.isfinite(sides[0]) & np.isfinite(sides[1])
    one, other = (np.where(both, side, 0.0) for side in sides)
    apart = np.abs(one - other)
    share = rng.random(len(angles))
    mixed = np.where(both, share * one + (1 - share) * other, np.inf)
    ranges = np.where(apart > 0.1, mixed, ranges + GRAZING * grazing)
    ranges = ranges + rng.normal(0.0, scanner.sigma, len(ranges))
    ranges = np.round(ranges / scanner.resolution) * scanner.resolution
    seen = (ranges >= scanner.range_min) & (ranges < scanner.range_max)
    seen &= rng.random(len(ranges)) >= scanner.drop_rate
    return Scan(
        np.where(seen, ranges, np.inf),
        angles,
        scanner.range_min,
        scanner.range_max,
        time=time - delay,
        sensor=scanner.name,
    )


def _met(room: Panels, origins: Array, headings: Array, glass_angle: float) -> tuple[Array, Array]:
    """(n,) distance of the first panel along each beam, and 1 / cos - 1 of its incidence."""
    along = room.ends - room.starts
    beams = np.column_stack([np.cos(headings), np.sin(headings)])
    across = beams[:, :1] * along[:, 1] - beams[:, 1:] * along[:, 0]
    off = room.starts[None] - origins[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (off[..., 0] * along[:, 1] - off[..., 1] * along[:, 0]) / across
        place = (off[..., 0] * beams[:, 1:] - off[..., 1] * beams[:, :1]) / across
        cosine = np.abs(across) / np.hypot(along[:, 0], along[:, 1])
    there = (distance > 1e-6) & (place >= 0) & (place <= 1)
    there &= ~room.glass | (cosine >= np.cos(glass_angle))
    distance = np.where(there, distance, np.inf)
    first = distance.argmin(-1)
    rows = np.arange(len(headings))
    return distance[rows, first], 1 / np.maximum(cosine[rows, first], 0.1) - 1
