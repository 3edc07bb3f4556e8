"""Where the robot was at any time, by odometry or by a trajectory, and how sure that is."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from scipy.special import chdtr, chdtrc, chdtri

from laser_gt.logs.motion import LONGEST, twist_between
from laser_gt.scans.planar import between, wrapped
from laser_gt.scans.scan import Flags
from validation.poses.angles import Array

FIRST_LENGTH = np.array([0.02, 0.01, 0.001]) ** 2
FIRST_ANGLE = np.array([0.02, 0.02, 0.0005]) ** 2
"""Variances of odometry after a metre of way, after a radian of turning, and of a step however
short: square metres; square radians. A judgement, that of wheels on a smooth floor and of a tick of
an encoder; `Odometer.judged` replaces them by what the scans show."""
UNSURE = 3.0
"""Standard deviation of these variances, in themselves, before the scans are asked: a judgement
that counts for nothing beside a few steps, and holds a robot that never turned to something."""
TRIMMED = 9.0
"""Squared standard deviations from which on a step counts no more, however far it is off: slips and
wrong matches. Of normal errors three in a thousand."""
WITHIN = float(chdtr(3, TRIMMED) + TRIMMED * chdtrc(1, TRIMMED))
"""Mean square of a normal error of standard deviation 1 that is cut off there: 0.99."""
ROUNDS = 30
"""Bound on the rounds of the fit of the variances, which changes by a per cent after ten."""
HALF = 0.03
"""Half of the shortest time in seconds over which a speed is taken. A judgement: shorter, ticks of
the encoders show; longer, a robot's change of speed."""

STANDING = 0.01
"""Metres and radians together below which a step tells nothing: a robot that stands."""
FEWEST = 20
"""Steps below which the noise of odometry is not judged: from twenty, a standard deviation is known
to a sixth of itself (1 / sqrt(40))."""


@dataclass(frozen=True)
class Odometer:
    """Poses of the robot at any time of a record, in a frame that drifts.

    Parameters
    ----------
    times : (n,) array
        Seconds, increasing.
    poses : (n, 3) array
        Of the robot.
    length, angle : (3,) array
        Variances as `FIRST_LENGTH` and `FIRST_ANGLE`: a metre, a radian of turning, a step.
    """

    times: Array
    poses: Array
    length: Array = field(default_factory=FIRST_LENGTH.copy)
    angle: Array = field(default_factory=FIRST_ANGLE.copy)

    @cached_property
    def _track(self) -> Array:
        """(3, n) poses whose heading does not jump, a row each for x, y and heading."""
        return np.stack([self.poses[:, 0], self.poses[:, 1], np.unwrap(self.poses[:, 2])])

    @cached_property
    def _half(self) -> float:
        """Half of the time over which a speed is taken."""
        return max(HALF, float(np.median(np.diff(self.times))) / 2)

    def known(self, times: Array) -> Flags:
        """(m,) bool array: whether times lie in the record, and in no gap of it."""
        after = np.clip(np.searchsorted(self.times, times), 1, len(self.times) - 1)
        wide = self.times[after] - self.times[after - 1] > LONGEST
        inside = (times >= self.times[0] - self._half) & (times <= self.times[-1] + self._half)
        exact = (self.times[after] == times) | (self.times[after - 1] == times)
        return np.asarray(inside & (~wide | exact))

    def at(self, times: Array) -> Array:
        """(m, 3) robot poses at times, in between on straight lines; the ends outside."""
        columns = [np.interp(times, self.times, column) for column in self._track]
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
        way = np.hypot(steps[:, 0], steps[:, 1])
        length, angle = _shares(steps) @ self.length, _shares(steps) @ self.angle
        found = np.zeros((len(steps), 3, 3))
        found[:, 0, 0], found[:, 2, 2] = length, angle
        found[:, 1, 1] = length + angle * way**2 / 3
        found[:, 1, 2] = found[:, 2, 1] = angle * way / 2
        return found

    def judged(self, times: Array, poses: Array) -> Self:
        """The same with the noise that it shows against better poses of the robot, (m, 3).

        The better poses may be in any frame.

        Notes
        -----
        What a robot slips by in turning it does not slip by on straight ways, and most ways are
        straight: the parts of the noise are fitted to the squares of the differences, each weighted
        by what the fit expects of it. A difference of many standard deviations is cut off.
        """
        by_odometry = self.at(times)
        steps, better = between(by_odometry[:-1], by_odometry[1:]), between(poses[:-1], poses[1:])
        usable = self.known(times[:-1]) & self.known(times[1:])
        usable &= np.hypot(better[:, 0], better[:, 1]) + np.abs(better[:, 2]) > STANDING
        if usable.sum() < FEWEST:
            return self
        off, shares = wrapped(steps - better)[usable], _shares(steps[usable])
        angle = _variances(off[:, 2] ** 2, shares, FIRST_ANGLE)
        length = _variances(
            np.concatenate([off[:, 0], off[:, 1]]) ** 2, np.vstack([shares, shares]), FIRST_LENGTH
        )
        return replace(self, length=length, angle=angle)


def _shares(steps: Array) -> Array:
    """(m, 3) what the parts of the variances are multiplied by: way, turn, 1."""
    way, turn = np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])
    return np.column_stack([way, turn, np.ones(len(steps))])


def _variances(squares: Array, shares: Array, first: Array) -> Array:
    """(3,) variances whose sum by the shares, (m, 3), is what squared errors, (m,), are on average.

    Notes
    -----
    A square has a standard deviation of root two times its expectation; squares and what the
    variances are known to before go into one least squares, anew until it stands. The last part is
    not below that of ``first``.
    """
    from scipy.optimize import nnls  # noqa: PLC0415  (processes that place scans do without)

    found = first * max(float(np.median(squares / (shares @ first))) / chdtri(1, 0.5), 1e-6)
    for _ in range(ROUNDS):
        expected = shares @ found
        seen = np.minimum(squares, TRIMMED * expected) / WITHIN
        rows = shares / expected[:, None] / np.sqrt(2)
        held = np.diag(1 / (UNSURE * first))
        values = np.concatenate([seen / expected / np.sqrt(2), np.full(3, 1 / UNSURE)])
        solved, _ = nnls(np.vstack([rows, held]), values)
        solved[2] = max(solved[2], first[2])
        if np.allclose(solved, found, rtol=0.01):
            return np.asarray(solved)
        found = solved
    return np.asarray(found)
