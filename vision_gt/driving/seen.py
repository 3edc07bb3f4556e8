"""What one camera saw, ready to be held against what another saw."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import special

from validation.poses.angles import Array
from validation.trajectories.clock.continuous import ContinuousPath, continuous_path
from validation.trajectories.clock.result import Place
from validation.trajectories.clock.stamps import FrameLine, frame_line
from vision_gt.driving.stream import Stream

MEDIAN_OF_2 = float(special.chdtri(2, 0.5))
"""Median of the sum of two squares, in variances."""


@dataclass(frozen=True)
class Seen:
    """A camera's poses with times freed of jitter, and the path through them.

    Parameters
    ----------
    camera : str
        Its name.
    stream : Stream
        It was made of; its n poses are those that nothing contradicts.
    epoch : int
        The common one.
    times : (n,) array
        Seconds since the epoch.
    poses, own, common : arrays
        As those of a `Stream`.
    line : FrameLine, optional
        Of a camera with a rate.
    path : ContinuousPath
        Through the poses.
    calm : float
        Variance of the path's places over that of the poses: the smoother, the less.
    """

    camera: str
    stream: Stream
    epoch: int
    times: Array
    poses: Array
    own: Array
    common: npt.NDArray[np.float32]
    line: FrameLine | None
    path: ContinuousPath
    calm: float

    @classmethod
    def of(cls, stream: Stream, epoch: int) -> "Seen | None":
        """What a stream has; None where its poses are too few."""
        moving = stream.trajectory(whole=False)
        if moving is None:
            return None
        kept = stream.posed
        times = stream.times[kept] + (stream.epoch - epoch)
        line = None if stream.clock.stamps == "capture" else frame_line(times)
        if line is not None:
            times = line.times
        poses = stream.poses[kept]
        path = continuous_path(times, poses[:, :2], poses[:, 2], moving.gap)
        # Residuals about a path that was fitted have the noise, less what the path took of it.
        left = float(np.median(((poses[:, :2] - path.positions) ** 2).sum(1))) / MEDIAN_OF_2
        calm = float(np.clip(1 - left / max(float(path.noise[0]) ** 2, 1e-18), 0, 1))
        return cls(
            *(stream.camera, stream, epoch, times, poses, stream.own[kept], stream.common[kept]),
            *(line, path, calm),
        )

    def part(self, first: int, last: int) -> "Seen | None":
        """What some of the n poses tell by themselves."""
        rows = np.flatnonzero(self.stream.posed)[first:last]
        which = np.zeros(len(self.stream), dtype=bool)
        which[rows] = True
        return Seen.of(self.stream.part(which), self.epoch)

    def place_after(self, last: int, first: int, end: int) -> Place:
        """Where a jump after a pose is, between two others, in stamps with their jitter."""
        stamps = self.stream.times[self.stream.posed] + (self.stream.epoch - self.epoch)
        middle = float(stamps[last] + stamps[last + 1]) / 2
        return Place(middle, float(stamps[first]), float(stamps[end]))

    def between(self, at: Array) -> Array:
        """(n, 3) standard deviations of the path in between its poses, for how it bends there.

        A chord is off its arc by the bend times the square of the interval over 8. A path that
        bends one way and back does so at the ends of an interval, not in its middle.
        """
        right = np.clip(np.searchsorted(self.times, at, side="right"), 1, len(self.times) - 1)
        ends = self.times[right - 1], self.times[right] - 1e-9
        bend = np.maximum(*(np.abs(self.path.at(end)[2]) for end in ends))
        return np.asarray(bend * (ends[1] - ends[0])[:, None] ** 2 / 8)
