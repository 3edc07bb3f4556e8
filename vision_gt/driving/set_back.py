"""A camera whose clock was set back while it filmed: its stamps of some seconds come twice."""

from dataclasses import dataclass

import numpy as np

from validation.poses.angles import Array, wrap
from validation.poses.trajectory import Trajectory
from validation.trajectories.clock.result import ClockEstimate
from validation.trajectories.interpolation import interpolate
from vision_gt.driving.stream import Stream

FEWEST = 12
"""Contradicted poses that tell a delay of their own, as many as two cameras must share."""
GRID, FINE = 0.05, 0.001
"""Seconds between the delays that are tried, and then about the best one."""
ROUGH, SAME = 0.1, 0.03
"""Metres and radians within which a pose agrees: while it is looked for, as a robot of 1 m/s moves
half of it between two delays of the grid; and in the end, ten times what a good frame is off by."""
SHARE = 0.5
"""Of the contradicted poses that agree with one other delay. Wrong markers and a camera that moved
are off by different lengths along the way; the rest is for frames that are wrong besides."""


@dataclass(frozen=True)
class SetBack:
    """A clock that was set back once.

    Parameters
    ----------
    size : float
        Seconds.
    stamp : float
        The last stamp before it, seconds since ``epoch``, on the camera's clock.
    epoch : int
        Whole seconds.
    poses : int
        That are contradicted, and agree with the trajectory with the other delay.
    """

    size: float
    stamp: float
    epoch: int
    poses: int


def set_back(
    stream: Stream, clock: ClockEstimate, trajectory: Trajectory, window: float
) -> SetBack | None:
    """Whether a camera's contradicted poses agree as those of a clock that was set back.

    Parameters
    ----------
    stream : Stream
        Judged; its frames stand in the order of their stamps, so that those of before and after
        are mixed where stamps come twice.
    clock : ClockEstimate
        Of the poses that are not contradicted.
    trajectory : Trajectory
        Fused, of all cameras.
    window : float
        Seconds to both sides in which the other delay is looked for.
    """
    wrong = np.array([one == "spurious" for one in stream.verdicts], dtype=bool)
    if wrong.sum() < FEWEST or clock.pieces or not stream.kept.any():
        return None
    stamps = stream.times + (stream.epoch - trajectory.epoch)
    tried = clock.delay_s + np.arange(-window, window + GRID / 2, GRID)
    far = [_far(stream.poses[wrong], stamps[wrong] + d, trajectory) for d in tried]
    near = tried[int(np.argmax([(rows < ROUGH).sum() for rows in far]))]
    fine = near + np.arange(-GRID, GRID + FINE / 2, FINE)
    far = [_far(stream.poses[wrong], stamps[wrong] + d, trajectory) for d in fine]
    place = int(np.argmin([np.square(np.minimum(rows, SAME)).sum() for rows in far]))
    best, good = float(fine[place]), far[place] < SAME
    if good.sum() < SHARE * wrong.sum():
        return None
    own, others = stamps[wrong][good], stamps[stream.kept]
    first = np.median(own) < np.median(others)
    size = (clock.delay_s - best) * (1.0 if first else -1.0)
    before, after = (own, others) if first else (others, own)
    # Where the first part ends is where the last of its stamps is; the second begins that much
    # earlier, and no more.
    twice = float(np.quantile(before, 0.95) - np.quantile(after, 0.05))
    if size < ROUGH or twice > size:
        return None
    last = float(before.max()) + trajectory.epoch - stream.epoch
    return SetBack(size, last, stream.epoch, int(good.sum()))


def _far(poses: Array, times: Array, trajectory: Trajectory) -> Array:
    """(n,) how far poses are from a trajectory at some times: the larger of metres and radians."""
    order = np.argsort(times)
    found = np.full(len(times), np.inf)
    at = interpolate(trajectory, times[order])
    some = order[at.supported]
    off = poses[some] - at.trajectory.poses
    found[some] = np.maximum(np.hypot(off[:, 0], off[:, 1]), np.abs(wrap(off[:, 2])))
    return found
