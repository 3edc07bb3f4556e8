"""A synthetic drive over a campus: the true path, three RTK receivers, scanners, cameras, IMU.

The vehicle is that of Blanco 2009: its antennas, its two base stations and its sensors. The
receivers lose their fix beside tall buildings; some fixes are false on request.
"""

from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from data_samples.drives.campus import Campus, make_campus
from rtk_gt.offsets.noise import GpsNoise
from rtk_gt.path.orientation import pose_of, transform_of
from rtk_gt.receivers.fixes import RTK_FIXED, RTK_FLOAT, Fixes
from rtk_gt.receivers.steps import pair_differences
from rtk_gt.sensors.scans import LineScans
from validation.poses.angles import Array
from validation.poses.earth_frames import FrameVectors, LocalFrame

START = datetime(2024, 4, 10, 9, 0, 0, tzinfo=UTC).timestamp()
RECEIVERS = ("rear", "front_left", "front_right")
ANTENNAS = np.array([[0.0, 0.0, 0.132], [1.729, 0.5725, 0.115], [1.733, -0.5725, 0.128]])
"""Blanco 2009, Table 1."""
OFFSETS = np.array([[0.0, 0.0, 0.0], [-145.2875, 28.6745, 2.3344], [-145.2914, 28.6712, 1.2915]])
"""Blanco 2009, Table 3, campus."""
MORE_RECEIVERS = ("middle_left", "middle_right")
MORE_ANTENNAS = np.array([[0.85, 0.60, 0.14], [0.80, -0.62, 0.11]])
MORE_OFFSETS = np.array([[35.4, -61.2, -0.85], [35.39, -61.21, -0.35]])
"""A fourth and a fifth, on a third base station."""
ROOF = 2.2
"""Height of the vehicle frame above the ground, metres."""
FLOAT_SIGMA = 0.25
LEFT_SCANNER = np.array([-0.3642, 0.7899, 0.0441, *np.radians([90.58, 6.82, -89.66])])
RIGHT_SCANNER = np.array([-0.3225, -0.8045, -0.0201, *np.radians([-90.33, -2.87, 89.85])])
LEFT_CAMERA = np.array([2.216, 0.430, 0.022, *np.radians([-88.43, -2.99, -87.23])])
"""Blanco 2009, Table 1. Cameras look along their z axis, x to the right, y down."""


@dataclass(frozen=True)
class DriveSettings:
    """What the drive is like.

    ``loops`` round trips at about ``speed`` m/s on a road of ``straight`` metres: up and down its
    two lanes (``route`` "road"), or figures of eight of that length between the buildings
    ("eight"), which show every wall from many directions. ``steepest`` is the greatest slope in
    radians. ``shadow`` seconds beside tall buildings in each loop the
    receivers lose their fix; ``false_fixes`` is the share of fixes that are off by
    ``false_size`` metres, ``missing`` the share that never arrives. ``receivers`` are three to
    five; ``every`` are the seconds between fixes of the rear one and of the others.
    """

    loops: int = 2
    straight: float = 90.0
    speed: float = 3.0
    steepest: float = np.radians(10.0).item()
    noise: GpsNoise = field(default_factory=lambda: GpsNoise(0.0064, 1.75))
    shadow: float = 12.0
    false_fixes: float = 0.0
    false_size: float = 0.3
    up: str = "ellipsoid"
    route: Literal["road", "eight"] = "road"
    missing: float = 0.0
    receivers: int = 3
    every: tuple[float, float] = (1.0, 0.2)


@dataclass(frozen=True)
class Drive:
    """A simulated drive with its truth.

    Parameters
    ----------
    settings : DriveSettings
        What was asked for.
    campus : Campus
        Where it took place.
    frame : LocalFrame
        The local frame of all coordinates.
    offsets : FrameVectors
        (r, 3) what has to be added to recorded positions.
    records : tuple of Fixes
        Of the receivers.
    duration : float
        Seconds.
    wander : (2, 3) array
        Amplitudes and phases by which the vehicle leaves the centre of its lane.
    antennas : (r, 3) array
        On the vehicle, metres.
    seed : int
        That it was made from.
    """

    settings: DriveSettings
    campus: Campus
    frame: LocalFrame
    offsets: FrameVectors
    records: tuple[Fixes, ...]
    duration: float
    wander: Array
    antennas: Array
    seed: int

    def T_local_vehicle(self, times: Array) -> RigidTransform:
        """True poses at times in seconds since 1970."""
        return vehicle_transforms(self.campus, self.settings, self.wander, times - START)

    def poses(self, times: Array) -> Array:
        """(n, 6) true x, y, z, yaw, pitch, roll."""
        return pose_of(self.T_local_vehicle(times))

    @property
    def distances(self) -> Array:
        """(p,) true distances between the antennas of each pair, metres."""
        return np.asarray(np.linalg.norm(pair_differences(self.antennas), axis=-1))


def simulate_drive(seed: int, settings: DriveSettings | None = None) -> Drive:
    """A drive, the same for the same seed and settings.

    Parameters
    ----------
    seed : int
        Of all random choices.
    settings : DriveSettings, optional
        What the drive is like.
    """
    settings = settings or DriveSettings()
    generator = np.random.default_rng(seed)
    campus = make_campus(generator, settings.steepest, road_line(settings))
    wander = np.stack([generator.uniform(0.1, 0.4, 3), generator.uniform(0, 2 * np.pi, 3)])
    up = "geocentric" if settings.up == "geocentric" else "ellipsoid"
    frame = LocalFrame.from_degrees(36.714459075, -4.478958828333333, 38.8887, up)  # type: ignore[arg-type]
    duration = settings.loops * loop_length(settings) / settings.speed
    roof = list(zip(
        RECEIVERS + MORE_RECEIVERS, np.vstack([ANTENNAS, MORE_ANTENNAS]),
        np.vstack([OFFSETS, MORE_OFFSETS]), strict=True,
    ))[: settings.receivers]  # fmt: skip
    records = tuple(
        _record(generator, settings, (campus, frame, wander), row, one, duration)
        for row, one in enumerate(roof)
    )
    offsets = FrameVectors(frame, np.array([offset for _, _, offset in roof]))
    antennas = np.array([antenna for _, antenna, _ in roof])
    return Drive(settings, campus, frame, offsets, records, duration, wander, antennas, seed)


TURN_RADIUS = 7.0
"""Metres: an electric buggy turns so on a road with two lanes."""


def loop_length(settings: DriveSettings) -> float:
    """Length of one round trip, metres."""
    if settings.route == "eight":
        phase = np.linspace(0, 2 * np.pi, 2001)
        return float(np.linalg.norm(np.diff(_eight(settings, phase), axis=0), axis=1).sum())
    return 2 * settings.straight + 2 * np.pi * TURN_RADIUS


def _centre_line(settings: DriveSettings, s: Array) -> Array:
    """(n, 2) the line driven: a stadium at the distances s, or an eight, slower in its turns."""
    if settings.route == "eight":
        return _eight(settings, 2 * np.pi * s / loop_length(settings))
    s = np.mod(s, loop_length(settings))
    L, r = settings.straight, TURN_RADIUS
    arc = np.pi * r
    first, second = (s - L) / r, (s - 2 * L - arc) / r
    x = np.select(
        [s < L, s < L + arc, s < 2 * L + arc],
        [s, L + r * np.sin(first), 2 * L + arc - s],
        -r * np.sin(second),
    )
    y = np.select(
        [s < L, s < L + arc, s < 2 * L + arc], [-r, -r * np.cos(first), r], r * np.cos(second)
    )
    return np.column_stack([x - L / 2, y])


EIGHT_WIDTH = 8.0
"""Greatest distance of the eight from its axis, metres."""


def _eight(settings: DriveSettings, phase: Array) -> Array:
    """(n, 2) a figure of eight, crossed at about 30 degrees to its axis."""
    return np.column_stack([settings.straight / 2 * np.sin(phase), EIGHT_WIDTH * np.sin(2 * phase)])


def road_line(settings: DriveSettings) -> Array:
    """(m, 2) centre line of the road, every 2 m."""
    return _centre_line(settings, np.arange(0.0, loop_length(settings), 2.0))


def vehicle_transforms(
    campus: Campus, settings: DriveSettings, wander: Array, elapsed: Array
) -> RigidTransform:
    """T_local_vehicle at seconds since the start: the wheels on the ground, the nose ahead."""

    def ground_place(seconds: Array) -> Array:
        s = settings.speed * seconds
        centre, ahead = _centre_line(settings, s), _centre_line(settings, s + 0.01)
        course = (ahead - centre) / np.linalg.norm(ahead - centre, axis=1, keepdims=True)
        side = np.column_stack([-course[:, 1], course[:, 0]])
        lengths = np.array([23.0, 37.0, 61.0])
        sway = (wander[0] * np.sin(2 * np.pi * s[:, None] / lengths + wander[1])).sum(1)
        flat = centre + sway[:, None] * side
        return np.column_stack([flat, campus.height(flat[:, 0], flat[:, 1])])

    elapsed = np.asarray(elapsed, dtype=float)
    here = ground_place(elapsed)
    # A second each way smooths the joints of straights and arcs, as steering does.
    course = ground_place(elapsed + 0.6) - ground_place(elapsed - 0.6)
    slope = campus.slope(here[:, 0], here[:, 1])
    up = np.column_stack([-slope, np.ones(len(slope))])
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    forward = course - (course * up).sum(1, keepdims=True) * up
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    R = np.stack([forward, np.cross(up, forward), up], axis=-1)
    return RigidTransform.from_components(here + ROOF * up, Rotation.from_matrix(R))


def _record(
    generator: np.random.Generator,
    settings: DriveSettings,
    place: tuple[Campus, LocalFrame, Array],
    row: int,
    receiver: tuple[str, Array, Array],
    duration: float,
) -> Fixes:
    """What one receiver writes."""
    campus, frame, wander = place
    name, antenna, offset = receiver
    every = settings.every[0 if row == 0 else 1]
    elapsed: Array = np.arange(0.0, round(duration / every)) * every
    T = vehicle_transforms(campus, settings, wander, elapsed)
    n = len(elapsed)
    shaded = _shaded(settings, elapsed, row)
    kinds = np.where(shaded, RTK_FLOAT, RTK_FIXED)
    base = np.sqrt(np.diagonal(settings.noise.covariance))
    sigmas = np.where(shaded[:, None], FLOAT_SIGMA * np.array([1, 1, settings.noise.eta]), base)
    error = generator.standard_normal((n, 3)) * sigmas
    false = generator.random(n) < settings.false_fixes
    direction = generator.standard_normal((n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    error += false[:, None] * settings.false_size * direction
    recorded = T.apply(np.tile(antenna, (n, 1))) - offset + error
    record = Fixes(
        receiver=name,
        times=START + elapsed,
        geodetic=frame.to_geodetic(recorded),
        kinds=kinds.astype(np.int64),
        satellites=np.where(shaded, 5, 9)
        + np.repeat(generator.integers(-1, 2, n), round(15 / every))[:n],
        hdop=np.round(np.where(shaded, 2.6, 1.1) + generator.uniform(0, 0.3, n), 2),
        covariances=sigmas[:, :, None] ** 2 * np.eye(3),
        lines=np.arange(1, n + 1),
        source=Path(f"{name}.nmea"),
    )
    # Drawn last: a drive without missing fixes is the same for the same seed as ever.
    arrived = generator.random(n) >= settings.missing if settings.missing else np.full(n, True)
    return record.select(arrived)


def _shaded(settings: DriveSettings, elapsed: Array, row: int) -> Array:
    """True beside tall buildings; the receivers lose and regain their fix at different times."""
    period = loop_length(settings) / settings.speed
    phase = np.mod(elapsed, period) - 0.3 * period
    return np.asarray((phase > 0.4 * row) & (phase < settings.shadow + 1.5 * row))


def scan_along(
    drive: Drive,
    scanner: Array,
    generator: np.random.Generator,
    *,
    every: float = 0.1,
    beams: int = 121,
    sigma: float = 0.01,
) -> LineScans:
    """What a line scanner on the vehicle records.

    Parameters
    ----------
    drive : Drive
        The drive.
    scanner : (6,) array
        True pose of the scanner on the vehicle.
    generator : numpy.random.Generator
        Of the noise of the ranges.
    every : float
        Seconds between scans.
    beams : int
        Over 180 degrees.
    sigma : float
        Of a range, metres.
    """
    times = START + np.arange(0.0, drive.duration - 1.0, every)
    angles = np.linspace(-np.pi / 2, np.pi / 2, beams)
    T = drive.T_local_vehicle(times) * transform_of(scanner)
    own = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(beams)])
    directions = np.einsum("sij,bj->sbi", T.rotation.as_matrix(), own).reshape(-1, 3)
    origins = np.repeat(T.translation, beams, axis=0)
    ranges = drive.campus.cast(origins, directions)
    ranges = ranges + sigma * generator.standard_normal(len(ranges))
    return LineScans(times, angles, ranges.reshape(len(times), beams))
