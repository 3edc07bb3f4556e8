"""What a moving robot is seen by: cameras, its odometry, a motion capture."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from data_samples.motion.path import ROOM, TruePath
from validation.poses.angles import Array, wrap

CAMERA_RATE, ODOMETRY_RATE, REFERENCE_RATE = 10.0, 50.0, 100.0
"""Frames and messages a second."""
REFERENCE_SIGMA = np.array([0.0003, 0.0003, 0.0005])
"""Noise of the motion capture: metres, radians."""


@dataclass(frozen=True)
class Level:
    """How bad the cameras are.

    Parameters
    ----------
    length, angle : float
        Noise of a camera's poses in the middle of its view, metres and radians.
    jitter : float
        Standard deviation of the way from the camera to the stamp, seconds.
    outliers : float
        Share of poses that are wrong: half of them elsewhere, half turned by half a turn.
    drift_ppm : float
        How fast a camera's clock may run away.
    """

    length: float
    angle: float
    jitter: float
    outliers: float
    drift_ppm: float


LEVELS = {
    1: Level(0.003, 0.002, 0.000, 0.005, 0.0),
    2: Level(0.008, 0.005, 0.002, 0.02, 0.0),
    3: Level(0.015, 0.010, 0.010, 0.03, 100.0),
    4: Level(0.030, 0.020, 0.030, 0.05, 200.0),
}


@dataclass(frozen=True)
class TrueClock:
    """What the clock of a source does.

    Parameters
    ----------
    delay_s : float
        Added to a stamp gives the true time, at ``at_s``; the mean latency is in it.
    at_s : float
        A stamp, seconds.
    drift_ppm : float
        Change of the delay, microseconds a second.
    jitter_s : float
        Standard deviation of the latency.
    """

    delay_s: float
    at_s: float
    drift_ppm: float
    jitter_s: float

    def stamps(self, times: Array) -> Array:
        """(n,) stamps of true times, before the latency of each."""
        rate = 1e-6 * self.drift_ppm
        return (times - self.delay_s + rate * self.at_s) / (1 + rate)


@dataclass(frozen=True)
class Seen:
    """Poses of one source, and their stamps."""

    stamps: Array
    poses: Array


def camera(
    path: TruePath, number: int, level: Level, clock: TrueClock, rng: np.random.Generator
) -> Seen:
    """What one of four cameras sees: the robot in its quarter of the room, and a bit around.

    The noise grows towards the edge of the view, has heavier tails than a normal one, and a third
    of its variance lasts for some frames. Frames are lost singly and in bursts.
    """
    times = rng.uniform(0, 0.1) + np.arange(0, path.times[-1] - 0.1, 1 / CAMERA_RATE)
    poses = path.at(times)
    centre = ROOM * [0.25 + 0.5 * (number % 2), 0.25 + 0.5 * (number // 2)]
    off = np.abs(poses[:, :2] - centre) / (ROOM * 0.31)
    sigmas = np.array([level.length, level.length, level.angle])
    edge = 1.0 + 0.5 * np.clip(off.max(1), 0, 1)[:, None] ** 2
    noisy = poses + edge * sigmas * _noise(len(times), 0.33, 0.75, rng)
    noisy[:, 2] = wrap(noisy[:, 2])
    _spoil(noisy, level.outliers, rng)
    lost = rng.random(len(times)) < 0.02
    for start in rng.integers(0, len(times), max(1, len(times) // 600)):
        lost[start : start + rng.integers(3, 15)] = True
    seen = (off <= 1).all(1) & ~lost
    # A latency is never negative: a gamma with shape 4, of which the clock's delay has the mean.
    latency = rng.gamma(4.0, level.jitter / 2.0, len(times)) - 2.0 * level.jitter
    stamps = clock.stamps(times) + latency
    kept = np.flatnonzero(seen)
    order = kept[np.argsort(stamps[kept], kind="stable")]
    return Seen(stamps[order], noisy[order])


def _noise(n: int, slow: float, memory: float, rng: np.random.Generator) -> Array:
    """(n, 3) of variance one: Student's t with 6 degrees of freedom, a share of it slow."""
    quick = rng.standard_t(6, (n, 3)) / np.sqrt(1.5)
    driven = rng.normal(size=(n + 100, 3)) * np.sqrt(1 - memory**2)
    slowly = lfilter([1.0], [1.0, -memory], driven, axis=0)[100:]
    return np.asarray(np.sqrt(1 - slow) * quick + np.sqrt(slow) * slowly)


def _spoil(poses: Array, share: float, rng: np.random.Generator) -> None:
    """Make a share of poses wrong, in place."""
    wrong = rng.random(len(poses))
    elsewhere = wrong < share / 2
    poses[elsewhere, :2] += rng.uniform(-1, 1, (int(elsewhere.sum()), 2))
    poses[elsewhere, 2] = rng.uniform(-np.pi, np.pi, int(elsewhere.sum()))
    turned = (wrong >= share / 2) & (wrong < share)
    poses[turned, 2] = wrap(poses[turned, 2] + np.pi)


def odometry(path: TruePath, rng: np.random.Generator) -> Seen:
    """Wheels: a frame of its own at the start, wrong scales, noise that adds up, whole ticks."""
    times = np.arange(0, path.times[-1], 1 / ODOMETRY_RATE)
    poses = path.at(times)
    middle = (poses[1:, 2] + poses[:-1, 2]) / 2
    steps = np.diff(poses[:, :2], axis=0)
    ahead = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
    turned = np.diff(poses[:, 2])
    scale, turning = 1 + rng.normal(0, 0.005), 1 + rng.normal(0, 0.005)
    # Slip: a millimetre and a milliradian over a metre, half a milliradian over a radian.
    way = np.sqrt(np.abs(ahead))
    ahead = scale * ahead + rng.normal(size=len(ahead)) * 0.001 * way
    turned = turning * turned + rng.normal(size=len(turned)) * (
        0.001 * way + 0.0005 * np.sqrt(np.abs(turned))
    )
    tick = 0.0002
    ahead = np.diff(np.round(np.concatenate([[0.0], np.cumsum(ahead)]) / tick) * tick)
    heading = np.concatenate([[0.0], np.cumsum(turned)])
    between = (heading[1:] + heading[:-1]) / 2
    moves = np.column_stack([ahead * np.cos(between), ahead * np.sin(between)])
    positions = np.vstack([np.zeros(2), np.cumsum(moves, axis=0)])
    return Seen(times, np.column_stack([positions, wrap(heading)]))


def motion_capture(path: TruePath, rng: np.random.Generator) -> Seen:
    """A reference with gaps where its markers are hidden."""
    times = np.arange(0, path.times[-1], 1 / REFERENCE_RATE)
    noisy = path.at(times) + REFERENCE_SIGMA * rng.normal(size=(len(times), 3))
    noisy[:, 2] = wrap(noisy[:, 2])
    seen: npt.NDArray[np.bool_] = np.ones(len(times), dtype=bool)
    for start in rng.integers(0, len(times), max(1, round(path.times[-1] / 60))):
        seen[start : start + rng.integers(30, 300)] = False
    return Seen(times[seen], noisy[seen])
