"""Drives of a robot through a room, seen by cameras and by its odometry; the truth stays beside."""

from dataclasses import dataclass

import numpy as np

from validation.poses.angles import Array
from validation.poses.trajectory import Trajectory
from validation.trajectories.smoothing.source import Source

NOISE = ((0.003, 0.002), (0.008, 0.005), (0.015, 0.010), (0.030, 0.020))
JITTER = (0.0, 0.002, 0.010, 0.030)
OUTLIERS = (0.005, 0.02, 0.03, 0.05)
DRIFT = (0.0, 0.0, 100.0, 200.0)
DELAY_SIGMA = (0.0003, 0.001, 0.0016, 0.0036)
"""Of the delay as a clock estimate tells it, s: a median error of 0.2, 0.6, 1.1, 2.5 ms."""


@dataclass(frozen=True)
class Drive:
    """Truth every millisecond or so, the sources, odometry."""

    times: Array
    truth: Array
    sources: list[Source]
    odometry: Trajectory

    def at(self, times: Array) -> Array:
        """(n, 3) true poses."""
        return np.column_stack([np.interp(times, self.times, column) for column in self.truth.T])


def motion(rng: np.random.Generator, seconds: float) -> tuple[Array, Array]:
    """Times and poses of a robot that goes from place to place, slows down, stops and turns."""
    dt = 0.002
    t = np.arange(-5.0, seconds + 5.0, dt)
    pose = np.array([rng.uniform(-3, 3), rng.uniform(-3, 3), rng.uniform(-np.pi, np.pi)])
    v = w = 0.0
    goal, wait = rng.uniform(-4, 4, 2), 0.0
    top = rng.uniform(0.5, 1.0)
    out = np.empty((len(t), 3))
    for k in range(len(t)):
        out[k] = pose
        ahead = goal - pose[:2]
        off = np.arctan2(ahead[1], ahead[0]) - pose[2]
        off = np.arctan2(np.sin(off), np.cos(off))
        if wait > 0:
            wait -= dt
            want_v, want_w = 0.0, 0.0
        else:
            want_v = top * max(0.0, np.cos(off)) ** 2
            want_w = np.clip(1.5 * off, -1.0, 1.0)
            if ahead @ ahead < 0.09:
                goal = rng.uniform(-4, 4, 2)
                wait = rng.uniform(1, 6) if rng.random() < 0.4 else 0.0
                top = rng.uniform(0.3, 1.0)
        v += np.clip(want_v - v, -0.8 * dt, 0.8 * dt)
        w += np.clip(want_w - w, -2.0 * dt, 2.0 * dt)
        pose = pose + dt * np.array([v * np.cos(pose[2]), v * np.sin(pose[2]), w])
    return t, out


def drive(seed: int, level: int, seconds: float = 300.0, cameras: int = 4) -> Drive:
    """A drive of one of four levels of noise (0 to 3)."""
    rng = np.random.default_rng([seed, level])
    t, truth = motion(rng, seconds)
    made = Drive(t, truth, [], _odometry(rng, t, truth, seconds))
    angle = rng.uniform(0, 2 * np.pi)
    for number in range(cameras):
        look = angle + 2 * np.pi * number / cameras
        centre = 2.5 * np.array([np.cos(look), np.sin(look)])
        made.sources.append(_camera(rng, made, level, f"camera_{number + 1}", centre, seconds))
    return made


def _camera(
    rng: np.random.Generator, made: Drive, level: int, name: str, centre: Array, seconds: float
) -> Source:
    period = 0.1
    capture = np.arange(rng.uniform(0, period), seconds, period)
    poses = made.at(capture)
    seen = np.linalg.norm(poses[:, :2] - centre, axis=1) < 3.2
    seen &= rng.random(len(seen)) > 0.03
    capture, poses = capture[seen], poses[seen]
    n = len(capture)
    sp, sa = NOISE[level]
    noisy = poses + rng.normal(0, 1, (n, 3)) * [sp, sp, sa]
    wild = rng.random(n) < OUTLIERS[level]
    flip = wild & (rng.random(n) < 0.5)
    noisy[flip, 2] += np.pi
    wild &= ~flip
    noisy[wild, :2] += rng.normal(0, 0.5, (wild.sum(), 2))
    noisy[wild, 2] += rng.normal(0, 0.5, wild.sum())
    jitter = rng.gamma(2.0, JITTER[level] / np.sqrt(2), n) if JITTER[level] else np.zeros(n)
    jitter -= JITTER[level] * np.sqrt(2)
    delay = rng.uniform(-0.3, 0.34)
    drift = rng.choice([-1.0, 1.0]) * DRIFT[level] * 1e-6
    middle = seconds / 2
    # delay and drift are added to the stamp: stamp + delay + drift (stamp - middle) = capture.
    stamp = (capture - delay + drift * middle) / (1 + drift) + jitter
    order = np.argsort(stamp)
    sigma = DELAY_SIGMA[level]
    trajectory = Trajectory(name, stamp[order], noisy[order], "plane")
    return Source(
        trajectory,
        delay + rng.normal(0, sigma),
        sigma,
        drift * 1e6 + rng.normal(0, 5.0),
        5.0,
        middle,
    )


def _odometry(rng: np.random.Generator, t: Array, truth: Array, seconds: float) -> Trajectory:
    """Wheels with errors of scale, white noise and slip, every 20 ms, from an origin of its own."""
    times = np.arange(0.0, seconds, 0.02)
    poses = np.column_stack([np.interp(times, t, column) for column in truth.T])
    steps = np.diff(poses, axis=0)
    c, s = np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2])
    own = np.column_stack([c * steps[:, 0] + s * steps[:, 1], c * steps[:, 1] - s * steps[:, 0]])
    own = np.column_stack([own, steps[:, 2]])
    way = np.abs(own[:, 0]) + 0.3 * np.abs(own[:, 2])
    own[:, 0] *= 1 + rng.normal(0, 0.01)
    own[:, 2] *= 1 + rng.normal(0, 0.01)
    noise = rng.normal(0, 1, own.shape) * np.sqrt(way)[:, None] * [0.004, 0.002, 0.006]
    own += noise + rng.normal(0, 1, own.shape) * [2e-5, 1e-5, 5e-5]
    theta = np.concatenate([[0.0], np.cumsum(own[:, 2])])
    c, s = np.cos(theta[:-1]), np.sin(theta[:-1])
    moved = np.column_stack([c * own[:, 0] - s * own[:, 1], s * own[:, 0] + c * own[:, 1]])
    places = np.concatenate([np.zeros((1, 2)), np.cumsum(moved, axis=0)])
    return Trajectory("odometry", times, np.column_stack([places, theta]), "plane")


def figures(made: Drive, with_odometry: bool) -> tuple[float, float, float]:
    """Rms of the position error in mm, NEES, and the share with support, of one fusion."""
    from validation.trajectories.smoothing.fusion import fuse

    fused = fuse(made.sources, odometry=made.odometry if with_odometry else None)
    return score(made, fused)


def score(made, fused):
    from validation.poses.angles import wrap

    keep = fused.supported
    error = fused.trajectory.poses[keep] - made.at(fused.trajectory.times[keep])
    error[:, 2] = wrap(error[:, 2])
    nees = np.einsum(
        "ni,ni->n",
        error,
        np.linalg.solve(fused.trajectory.covariances[keep], error[..., None])[..., 0],
    )
    rms = np.sqrt((error[:, :2] ** 2).sum(1).mean())
    return 1e3 * float(rms), float(nees.mean()), float(keep.mean())
