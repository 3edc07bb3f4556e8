"""A robot that speeds up, slows down and turns, and what two sources see of it."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from validation.poses.trajectory import Trajectory

STEP = 0.01


@dataclass(frozen=True)
class Drive:
    """The true path: times, and x, y, theta."""

    times: np.ndarray
    poses: np.ndarray

    def at(self, times):
        return np.column_stack([np.interp(times, self.times, one) for one in self.poses.T])


def drive(seconds=120.0, seed=0):
    """Smooth random speed, at times none, and turn rate."""
    rng = np.random.default_rng(seed)
    count = int(seconds / STEP)

    def smooth(size, over):
        drawn = gaussian_filter1d(rng.standard_normal(count + 4000), over / STEP)[2000:-2000]
        return size * drawn / drawn.std()

    speed = np.clip(0.5 + smooth(0.35, 3.0), 0, None)
    heading = np.cumsum(smooth(0.4, 2.0)) * STEP
    x, y = (np.cumsum(speed * f(heading)) * STEP for f in (np.cos, np.sin))
    return Drive(np.arange(count) * STEP, np.column_stack([x, y, heading]))


def seen(path, rate=10.0, sigma=0.0, seed=1, system="source", start=2.0, stated=False):
    """Planar poses of a source."""
    rng = np.random.default_rng(seed)
    times = np.arange(start, path.times[-1] - start, 1 / rate)
    poses = path.at(times)
    poses = poses + sigma * rng.standard_normal(poses.shape)
    covariances = np.broadcast_to(sigma**2 * np.eye(3), (len(times), 3, 3)) if stated else ()
    return Trajectory(system, times, poses, covariances=np.array(covariances))


def in_space(one):
    """The same with height, pitch and roll that change smoothly."""
    t = one.times
    x, y, theta = one.poses.T
    turned = Rotation.from_euler("ZYX", np.column_stack([theta, 0.3 * np.sin(t), 0.2 * np.cos(t)]))
    poses = np.column_stack([x, y, 0.5 * np.sin(t / 5), turned.as_quat()])
    return Trajectory(one.system, t, poses, "space")
