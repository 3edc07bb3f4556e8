"""Where the robot was at any time, by odometry or by a trajectory, and how sure that is."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from laser_gt.logs.motion import LONGEST, twist_between
from laser_gt.scans.planar import between, wrapped
from laser_gt.scans.scan import Flags
from validation.poses.angles import Array
from validation.statistics.robust import sigma_from_median

SLIP_LENGTH, SLIP_ANGLE = 0.02, 0.02
"""Standard deviation of odometry after a metre of way (metres; radians), and after a radian of
turning. A judgement, that of wheels on a smooth floor; `Odometer.judged` replaces it by what the
scans show."""
LEAST_LENGTH, LEAST_ANGLE = 0.001, 0.0005
"""Standard deviation of a step of odometry in metres and radians, however short: what a tick of an
encoder is worth. A judgement."""
HALF = 0.03
"""Half of the shortest time in seconds over which a speed is taken. A judgement: shorter, ticks of
the encoders show; longer, a robot's change of speed."""

FEWEST = 20
"""Steps below which the noise of odometry is not judged: from twenty, a deviation by medians is
known to a quarter of itself (1.17 / sqrt(20))."""


@dataclass(frozen=True)
class Odometer:
    """Poses of the robot at any time of a record, in a frame that drifts.

    Parameters
    ----------
    times : (n,) array
        Seconds, increasing.
    poses : (n, 3) array
        Of the robot.
    worse : (float, float)
        Factors on `SLIP_LENGTH` and `SLIP_ANGLE`.
    """

    times: Array
    poses: Array
    worse: tuple[float, float] = (1.0, 1.0)

    @cached_property
    def _track(self) -> Array:
        """(n, 3) poses whose heading does not jump."""
        return np.column_stack([self.poses[:, :2], np.unwrap(self.poses[:, 2])])

    @cached_property
    def _half(self) -> float:
        """Half of the time over which a speed is taken."""
        return max(HALF, float(np.median(np.diff(self.times))) / 2)

    def known(self, times: Array) -> Flags:
        """(m,) bool array: whether times lie in the record, and in no gap of it."""
        after = np.clip(np.searchsorted(self.times, times), 1, len(self.times) - 1)
        wide = self.times[after] - self.times[after - 1] > LONGEST
        inside = (times >= self.times[0] - self._half) & (times <= self.times[-1] + self._half)
        return np.asarray(inside & (~wide | np.isin(times, self.times)))

    def at(self, times: Array) -> Array:
        """(m, 3) robot poses at times, in between on straight lines; the ends outside."""
        columns = [np.interp(times, self.times, column) for column in self._track.T]
        return wrapped(np.column_stack(columns))

    def twists(self, times: Array) -> Array:
        """(m, 3) velocities at times in the robot frame, m/s and rad/s; NaN where not known."""
        early = np.maximum(times - self._half, self.times[0])
        late = np.minimum(times + self._half, self.times[-1])
        found = np.full((len(times), 3), np.nan)
        first, last = self.at(early), self.at(late)
        for row in np.flatnonzero(self.known(times) & (late - early > 1e-6)):
            found[row] = twist_between(first[row], last[row], late[row] - early[row])
        return found

    def covariance(self, steps: Array) -> Array:
        """(m, 3, 3) covariances of motions, (m, 3), in the frame of their start."""
        way, turn = np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])
        length = (self.worse[0] * SLIP_LENGTH) ** 2 * way + LEAST_LENGTH**2
        angle = (self.worse[1] * SLIP_ANGLE) ** 2 * (way + turn) + LEAST_ANGLE**2
        found = np.zeros((len(steps), 3, 3))
        found[:, 0, 0], found[:, 2, 2] = length, angle
        found[:, 1, 1] = length + angle * way**2 / 3
        found[:, 1, 2] = found[:, 2, 1] = angle * way / 2
        return found

    def judged(self, times: Array, poses: Array) -> Self:
        """The same with the noise that it shows against better poses of the robot, (m, 3).

        The better poses may be in any frame. From medians, so that a few wrong ones do not count.
        """
        steps, better = (
            between(self.at(times)[:-1], self.at(times)[1:]),
            between(poses[:-1], poses[1:]),
        )
        usable = (
            self.known(times[:-1]) & self.known(times[1:]) & (np.hypot(*better[:, :2].T) > 0.01)
        )
        if usable.sum() < FEWEST:
            return self
        off = wrapped(steps - better)[usable]
        sigmas = np.sqrt(
            np.diagonal(type(self)(self.times, self.poses).covariance(steps[usable]), 0, 1, 2)
        )
        x, y, theta = sigma_from_median(off / sigmas, axis=0).tolist()
        return type(self)(self.times, self.poses, (float(np.hypot(x, y) / np.sqrt(2)), theta))
