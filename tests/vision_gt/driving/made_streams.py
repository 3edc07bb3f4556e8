"""Streams of poses without images: what cameras would say of a robot on a known way."""

import numpy as np

from validation.poses.trajectory import Clock
from vision_gt.driving.stream import Stream

POSITION, HEADING = 0.003, 0.004
"""Noise of a frame: metres, radians."""
JITTER = 0.003
"""Scatter of stamps, seconds."""
SHARED = 0.001
"""Metres that each camera is off by in x and in y."""


def bends(times):
    """(n, 3) poses on a way that bends both ways at 0.2 to 0.5 m/s."""
    x, y = 0.7 + 0.55 * np.sin(0.26 * times), 1.7 + 0.9 * np.sin(0.52 * times + 0.3)
    slope = np.arctan2(0.468 * np.cos(0.52 * times + 0.3), 0.143 * np.cos(0.26 * times))
    return np.column_stack([x, y, np.unwrap(slope)])


def straight(times):
    """(n, 3) poses on a straight line, at one speed."""
    return np.column_stack([0.4 * times, 0.1 * times, np.full(len(times), 0.245)])


def standing(times):
    """(n, 3) poses of a robot that stands."""
    return np.tile([1.0, 2.0, 0.5], (len(times), 1))


def stream(number, way, seen, late, rng, *, of=2, rate=5.0, wrong=0.03, off=(0.0, 0.0, 0.0)):
    """The stream of one of some cameras that saw a robot on a way from one time to another.

    ``late`` is how late its stamps are, seconds, or a function of the times; ``off`` what its
    frame is off by, beyond what its covariance says.
    """
    times = np.arange(seen[0] + rng.uniform(0, 1 / rate), seen[1], 1 / rate)
    times = times[rng.random(len(times)) > 0.02]
    stamps = times + (late(times) if callable(late) else late)
    stamps = np.sort(stamps + rng.normal(0, JITTER, len(times)))
    sigmas = np.array([POSITION, POSITION, HEADING])
    poses = way(times) + sigmas * rng.standard_normal((len(times), 3))
    bad = rng.random(len(times)) < wrong
    poses[bad] += rng.normal(0, 1.0, (int(bad.sum()), 3))
    common = np.zeros((len(times), 3, 2 * of), dtype=np.float32)
    common[:, 0, 2 * number] = common[:, 1, 2 * number + 1] = SHARED
    poses += [*(SHARED * rng.standard_normal(2)), 0.0]
    poses += off
    poses[:, 2] = np.angle(np.exp(1j * poses[:, 2]))
    count = len(times)
    made = Stream(
        *(str(number + 1), stamps, 0, ("kept",) * count, ((14,),) * count, poses),
        *(np.tile(np.diag(sigmas**2), (count, 1, 1)), common, Clock("receipt")),
    )
    return made, bad
