"""A whole drive: the truth, its cameras, odometry, motion capture and survey of the stops."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from data_samples.motion.path import TruePath, drive
from data_samples.motion.sensors import (
    CAMERA_RATE,
    LEVELS,
    ODOMETRY_RATE,
    REFERENCE_RATE,
    REFERENCE_SIGMA,
    Level,
    Seen,
    TrueClock,
    camera,
    motion_capture,
    odometry,
)
from validation.errors import GtvalError
from validation.poses.angles import Array, wrap
from validation.poses.pose_table import PoseTable
from validation.poses.trajectory import Clock, Trajectory
from validation.shown import Shown
from validation.trajectories.stops import Stop

EPOCH = 1_700_000_000
"""Second at which the drives begin."""
SURVEY_SIGMA = np.array([0.0015, 0.0015, 0.002])
"""Of the surveyed stops: metres, radians; a hand-held laser and a rig of half a metre."""
CAMERAS = 4


@dataclass(frozen=True, repr=False)
class SampleMotion(Shown):
    """A drive and what was recorded of it.

    Parameters
    ----------
    level : Level
        How bad the cameras are.
    truth : Trajectory
        True poses, 200 a second.
    reference : Trajectory
        A motion capture in the frame of the room.
    odometry : Trajectory
        In a frame of its own.
    cameras : mapping of str to Trajectory
        By name, in the frame of the room, on their own clocks.
    survey : PoseTable
        Surveyed poses of the stops.
    stops : tuple of Stop
        When the robot stood where, true time.
    true_stops : PoseTable
        Their true poses.
    clocks : mapping of str to TrueClock
        Of the cameras.
    """

    level: Level
    truth: Trajectory
    reference: Trajectory
    odometry: Trajectory
    cameras: Mapping[str, Trajectory]
    survey: PoseTable
    stops: tuple[Stop, ...]
    true_stops: PoseTable
    clocks: Mapping[str, TrueClock]


def motion_drive(seed: int, *, level: int = 1, minutes: float = 8.0) -> SampleMotion:
    """A robot drives from stop to stop through a room of 8 m by 6 m.

    Parameters
    ----------
    seed : int
        Of all that is drawn.
    level : {1, 2, 3, 4}
        How bad the cameras are, see `data_samples.motion.sensors.LEVELS`.
    minutes : float
        How long it drives.

    Raises
    ------
    GtvalError
        If a camera never sees the robot, as may happen in less than two minutes.
    """
    rng = np.random.default_rng([seed, level])
    quality, path = LEVELS[level], drive(60 * minutes, rng)
    clocks = {f"camera_{number + 1}": _clock(path, quality, rng) for number in range(CAMERAS)}
    cameras = {
        name: _trajectory(name, camera(path, number, quality, clock, rng), CAMERA_RATE, "receipt")
        for number, (name, clock) in enumerate(clocks.items())
    }
    reference = _trajectory("mocap", motion_capture(path, rng), REFERENCE_RATE)
    n = len(reference)
    reference = replace(
        reference, covariances=np.tile(np.diag(REFERENCE_SIGMA**2), (n, 1, 1)), frame="room"
    )
    true_stops = _stop_table("truth", path, np.zeros((len(path.stops), 3)))
    noise = rng.normal(size=(len(path.stops), 3)) * SURVEY_SIGMA
    truth = Trajectory("truth", path.times, _wrapped(path), epoch=EPOCH, frame="room")
    return SampleMotion(
        level=quality,
        truth=truth,
        reference=reference,
        odometry=_trajectory("odometry", odometry(path, rng), ODOMETRY_RATE),
        cameras=cameras,
        survey=_stop_table("survey", path, noise),
        stops=tuple(Stop(s.name, s.start + EPOCH, s.end + EPOCH) for s in path.stops),
        true_stops=true_stops,
        clocks=clocks,
    )


def _clock(path: TruePath, level: Level, rng: np.random.Generator) -> TrueClock:
    """A camera's clock; the delay is that in the middle of the drive."""
    drift = level.drift_ppm * rng.uniform(-1, 1)
    return TrueClock(rng.uniform(-0.3, 0.34), float(path.times[-1]) / 2, drift, level.jitter)


def _trajectory(name: str, seen: Seen, rate: float, stamps: str = "capture") -> Trajectory:
    """Poses as they are recorded, sorted by their stamps."""
    if len(seen.stamps) == 0:
        raise GtvalError(
            f"'{name}' never sees the robot; let it drive longer, or take another seed"
        )
    kept = np.concatenate([[True], np.diff(seen.stamps) > 0])
    clock = Clock("receipt" if stamps == "receipt" else "capture", rate)
    return Trajectory(name, seen.stamps[kept], seen.poses[kept], epoch=EPOCH, clock=clock)


def _wrapped(path: TruePath) -> Array:
    return np.column_stack([path.poses[:, :2], wrap(path.poses[:, 2])])


def _stop_table(system: str, path: TruePath, noise: Array) -> PoseTable:
    """Poses of the stops, with an error of each."""
    middle = np.array([(stop.start + stop.end) / 2 for stop in path.stops])
    poses = path.at(middle) + noise
    poses[:, 2] = wrap(poses[:, 2])
    covariances = np.tile(np.diag(SURVEY_SIGMA**2), (len(poses), 1, 1))
    return PoseTable(system, tuple(stop.name for stop in path.stops), poses, covariances)
