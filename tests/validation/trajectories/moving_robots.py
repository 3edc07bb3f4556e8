"""Robots that drive from stop to stop, seen with noise that the estimators do not know."""

import numpy as np
from scipy.signal import lfilter

from validation.poses.angles import wrap
from validation.poses.trajectory import Trajectory
from validation.trajectories.stops import Stop


def robot_between_stops(
    seed,
    *,
    rate=10.0,
    stops=26,
    sigmas=(0.003, 0.003, 0.002),
    memory=0.0,
    flips=0.01,
    outliers=0.01,
    lost=0.03,
):
    """A trajectory of noisy poses, its stops, and their true poses."""
    rng = np.random.default_rng(seed)
    parts, named, truth = [], [], []
    pose, now = np.zeros(3), 0.0
    for name in range(stops):
        goal = np.append(rng.uniform(0, 10, 2), rng.uniform(-3, 3))
        way = np.linspace(0, 1, int(rate * max(2 * np.hypot(*(goal - pose)[:2]), 1)))
        parts.append(pose + (way**2 * (3 - 2 * way))[:, None] * (goal - pose))
        now += len(way) / rate
        count = int(rate * rng.uniform(4, 10))
        parts.append(np.tile(goal, (count, 1)))
        named.append(Stop(str(name), now, now + (count - 1) / rate))
        truth.append(goal)
        now += count / rate
        pose = goal
    true = np.vstack(parts)
    white = rng.normal(size=(len(true) + 300, 3))
    noise = lfilter([np.sqrt(1 - memory**2)], [1, -memory], white, axis=0)[300:]
    poses = true + noise * sigmas
    poses[rng.random(len(poses)) < flips, 2] += np.pi
    wrong = rng.random(len(poses)) < outliers
    poses[wrong, :2] += rng.normal(size=(wrong.sum(), 2))
    poses[:, 2] = wrap(poses[:, 2])
    kept = rng.random(len(poses)) >= lost
    times = np.arange(len(poses)) / rate
    return Trajectory("robot", times[kept], poses[kept]), named, np.array(truth)
