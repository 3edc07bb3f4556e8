"""A robot that turns, stops and speeds up, seen by a reference and by a source, both with truth.

Written from the description of the errors, not from the estimator: it moves the robot with steps of
2 ms and stamps what it sees.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from validation.poses.angles import Array, wrap
from validation.poses.trajectory import Trajectory

Way = Literal["ordinary", "straight", "circle", "still", "one_heading"]
STEP = 0.002


@dataclass(frozen=True)
class Drive:
    """What is simulated.

    Parameters
    ----------
    way : {"ordinary", "straight", "circle", "still", "one_heading"}
        How the robot moves; 'one_heading' is a straight line at changing speed, back and forth.
    seconds, rate : float
        Length of the record, and poses a second.
    position, heading : float
        Standard deviation of the source's noise that lasts, in metres and radians.
    white : float
        Share of that beside it, new in each pose.
    correlation_time : float
        Seconds.
    outliers, flips, lost : float
        Shares of poses that are off, have their heading reversed, or are missing.
    tails : float
        Degrees of freedom of Student's t of the white noise.
    """

    way: Way = "ordinary"
    seconds: float = 300.0
    rate: float = 10.0
    position: float = 0.004
    heading: float = 0.003
    white: float = 0.7
    correlation_time: float = 1.0
    outliers: float = 0.0
    flips: float = 0.0
    lost: float = 0.0
    tails: float = 50.0


def _smooth(rng: np.random.Generator, n: int, seconds: float) -> Array:
    """(n,) random curve of standard deviation 1 with a correlation time, twice differentiable."""
    knots = max(int(n * STEP / seconds) + 6, 8)
    values = rng.normal(size=knots)
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(np.arange(knots) * seconds, values)(np.arange(n) * STEP))


def path(drive: Drive, rng: np.random.Generator) -> tuple[Array, Array]:
    """Times from -3 s on, and the robot's poses."""
    n = int((drive.seconds + 6) / STEP)
    times = np.arange(n) * STEP - 3
    speed, turn = np.full(n, 0.4), np.zeros(n)
    if drive.way == "ordinary":
        speed = np.clip(0.4 + 0.35 * _smooth(rng, n, 4.0), 0.0, 1.2)
        turn = 0.6 * _smooth(rng, n, 3.0)
    elif drive.way == "circle":
        turn += 0.2
    elif drive.way == "still":
        speed *= 0
    elif drive.way == "one_heading":
        speed = 0.5 * np.sin(2 * np.pi * times / 20) + 0.2 * _smooth(rng, n, 5.0)
    heading = rng.uniform(-3, 3) + np.cumsum(turn) * STEP
    places = np.cumsum(speed * np.exp(1j * heading)) * STEP
    if drive.way == "ordinary":
        # A room: what wanders off is drawn back slowly, as seen along a smooth curve.
        slow = _smooth(rng, n, 40.0) + 1j * _smooth(rng, n, 40.0)
        trend = np.polynomial.Polynomial.fit(times, places.real, 6)(times)
        trend = trend + 1j * np.polynomial.Polynomial.fit(times, places.imag, 6)(times)
        places = places - trend + slow
        velocity = np.gradient(places, STEP)
        heading = heading + 0 * velocity.real
    places = places + complex(*rng.uniform(-2, 2, 2))
    return times, np.column_stack([places.real, places.imag, heading])


def slow_noise(rng: np.random.Generator, times: Array, correlation_time: float) -> Array:
    """(n,) first-order process of variance 1."""
    memory = np.exp(-np.diff(times, prepend=times[0] - 1e9) / correlation_time)
    fresh = rng.normal(size=len(times)) * np.sqrt(1 - memory**2)
    values = np.empty(len(times))
    last = 0.0
    for row, (keep, new) in enumerate(zip(memory, fresh, strict=True)):
        last = keep * last + new
        values[row] = last
    return values


def simulate(
    drive: Drive, seed: int, causes: Mapping[str, float] | None = None
) -> tuple[Trajectory, Trajectory]:
    """Reference and source.

    Parameters
    ----------
    drive : Drive
        How the robot moves and what is seen.
    seed : int
        Of all that is drawn.
    causes : mapping of str to float
        Truth, by the names of the parameters: what takes the causes away.
    """
    rng = np.random.default_rng(seed)
    p = dict.fromkeys(_NAMES, 0.0) | dict(causes or {})
    times, poses = path(drive, rng)

    def at(moments: Array) -> Array:
        return np.column_stack([np.interp(moments, times, one) for one in poses.T])

    own = np.arange(0, drive.seconds, 0.02) + rng.uniform(0, 0.01)
    seen = at(own) + rng.normal(size=(len(own), 3)) * [0.001, 0.001, 0.001]
    reference = Trajectory("reference", own, np.column_stack([seen[:, :2], wrap(seen[:, 2])]))
    stamps = np.arange(0.5, drive.seconds - 0.5, 1 / drive.rate)
    stamps = stamps + rng.uniform(-0.1, 0.1, len(stamps)) / drive.rate
    stamps = stamps[rng.random(len(stamps)) >= drive.lost]
    since = stamps - (stamps[0] + stamps[-1]) / 2
    truth = at(stamps + p["delay"] + p["clock_drift"] * since)
    n = len(stamps)
    noise = np.column_stack([slow_noise(rng, stamps, drive.correlation_time) for _ in range(3)])
    scale = np.sqrt(drive.tails / (drive.tails - 2))
    noise = noise + drive.white * rng.standard_t(drive.tails, (n, 3)) / scale
    off = rng.random(n) < drive.outliers
    noise[off, :2] += rng.normal(size=(int(off.sum()), 2)) * 0.3 / drive.position
    truth = truth + noise * [drive.position, drive.position, drive.heading]
    truth[:, 2] += np.pi * (rng.random(n) < drive.flips)
    z = truth[:, 0] + 1j * truth[:, 1] - (p["pose_drift_x"] + 1j * p["pose_drift_y"]) * since
    z = np.exp(-1j * p["frame_theta"]) * (z - p["frame_x"] - 1j * p["frame_y"])
    turned = p["frame_theta"] + p["mount_theta"] + p["pose_drift_theta"] * since
    heading = truth[:, 2] - turned
    z = z - np.exp(1j * heading) * (p["mount_x"] + 1j * p["mount_y"])
    z = z / (1 + p["scale"])
    rows = np.column_stack([z.real, z.imag, wrap(heading)])
    return reference, Trajectory("source", stamps, rows)


_NAMES = (
    *("frame_x", "frame_y", "frame_theta", "mount_x", "mount_y", "mount_theta", "scale", "delay"),
    *("clock_drift", "pose_drift_x", "pose_drift_y", "pose_drift_theta"),
)
