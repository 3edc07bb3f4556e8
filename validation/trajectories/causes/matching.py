"""Poses of a source beside the motion of the reference, and a rough guess of how they match."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from validation.errors import GtvalError
from validation.poses.angles import Array, circular_mean, wrap
from validation.poses.trajectory import Trajectory
from validation.trajectories.causes.chain import Moving, corrected, reference_times

MOST_POSES = 20_000
"""Poses of a source that are looked at; of more, every second or third, and so on. Noise that
neighbours share makes the poses in between say little; the search takes 2 s for so many."""
FEWEST_POSES = 30
"""Twelve numbers and the noise of poses and headings cannot be found from fewer."""
HALF_STEP = 0.2
"""Seconds before and after a pose between which its velocity is taken. The noise of 3 mm makes
10 mm/s of it; a robot's own motion below 1 Hz loses at most a quarter."""
SMOOTHED = 0.1
"""Seconds before and after a reference pose over which it is smoothed. A delay moves the curve
along itself, and what is rough in the curve would decide which delay fits: of 50 Hz with 1 mm,
unsmoothed, a delay of 2 ms gained 13 in squares where there was none."""
QUADRATIC = np.array([-2.0, 3.0, 6.0, 7.0, 6.0, 3.0, -2.0]) / 21
"""Weights of seven equal steps that leave a cubic as it is (Savitzky and Golay 1964, table I)."""
LONGEST_DELAY = 2.0
"""Seconds, either way, in which the rough guess looks for a delay."""
LAG_STEP = 0.05
"""Seconds between two delays that the rough guess tries; the fit converges from ten times that."""


class Reference:
    """The reference's motion at any time.

    Parameters
    ----------
    trajectory : Trajectory
        In the plane, with headings.
    epoch : int
        Its times are given since this one.
    """

    def __init__(self, trajectory: Trajectory, epoch: int) -> None:
        self.times = trajectory.times_since(epoch)
        turned = np.column_stack([trajectory.poses[:, :2], np.unwrap(trajectory.poses[:, 2])])
        through = CubicSpline(self.times, turned)
        around = np.linspace(-SMOOTHED, SMOOTHED, len(QUADRATIC))
        at = np.clip(self.times[:, None] + around, self.times[0], self.times[-1])
        self._curve = CubicSpline(self.times, np.einsum("k,nkj->nj", QUADRATIC, through(at)))
        self._gap = trajectory.gap

    def supported(self, times: Array, margin: float) -> npt.NDArray[np.bool_]:
        """Whether reference poses stand on both sides, also a margin earlier and later."""
        good = np.ones(len(times), dtype=bool)
        for at in (times - margin, times, times + margin):
            right = np.searchsorted(self.times, at)
            inside = (right > 0) & (right < len(self.times))
            right = np.clip(right, 1, len(self.times) - 1)
            good &= inside & (self.times[right] - self.times[right - 1] <= self._gap)
        return good

    def moving(self, times: Array) -> Moving:
        """Poses and velocities at these times."""
        pose = self._curve(times)
        before, after = self._curve(times - HALF_STEP), self._curve(times + HALF_STEP)
        rate = (after - before) / (2 * HALF_STEP)
        return Moving(
            pose[:, 0] + 1j * pose[:, 1], pose[:, 2], rate[:, 0] + 1j * rate[:, 1], rate[:, 2]
        )


@dataclass(frozen=True)
class Matched:
    """A source's poses with support of the reference.

    Parameters
    ----------
    reference : Reference
        What they are compared with.
    stamps : (n,) array
        Of the source, in seconds since its epoch.
    poses : (n, 3) array
        Metres, radians, in the source's frame.
    middle : float
        Of the stamps.
    """

    reference: Reference
    stamps: Array
    poses: Array
    middle: float

    @property
    def since(self) -> Array:
        """(n,) seconds since the middle."""
        return self.stamps - self.middle

    def residuals(self, parameters: Array) -> tuple[Array, Moving]:
        """(n, 3) reference minus corrected source, and the reference's motion there."""
        at = self.reference.moving(reference_times(parameters, self.stamps, self.since))
        source = corrected(parameters, self.poses, self.since)
        place = at.places - source[:, 0] - 1j * source[:, 1]
        turned = wrap(at.headings - source[:, 2])
        return np.column_stack([place.real, place.imag, turned]), at

    def own_motion(self, parameters: Array, good: npt.NDArray[np.bool_]) -> Moving:
        """The corrected source's own motion, made of its good poses alone."""
        source = corrected(parameters, self.poses, self.since)
        times = reference_times(parameters, self.stamps, self.since)
        source[good, 2] = np.unwrap(source[good, 2])

        def at(moments: Array) -> Array:
            kept = times[good]
            return np.column_stack([np.interp(moments, kept, one) for one in source[good].T])

        pose = at(times)
        before, after = np.clip(times - HALF_STEP, *times[[0, -1]]), times + HALF_STEP
        after = np.clip(after, *times[[0, -1]])
        rate = (at(after) - at(before)) / (after - before)[:, None]
        return Moving(
            pose[:, 0] + 1j * pose[:, 1], pose[:, 2], rate[:, 0] + 1j * rate[:, 1], rate[:, 2]
        )


def match(reference: Trajectory, source: Trajectory) -> tuple[Matched, float]:
    """The source's poses that the reference supports, and a rough delay.

    Raises
    ------
    GtvalError
        Without headings, or with too few poses at common times.
    """
    for one in (reference, source):
        if not one.has_orientation:
            raise GtvalError(
                f"'{one.system}' has positions without headings; causes need both: state headings"
            )
    curve = Reference(reference.planar(), source.epoch)
    planar = source.planar()
    delay = rough_delay(curve, planar)
    times = planar.times
    margin = HALF_STEP + LAG_STEP
    good = curve.supported(times, margin) & curve.supported(times + delay, margin)
    if good.sum() < FEWEST_POSES:
        raise GtvalError(
            f"'{source.system}' has {int(good.sum())} poses at times at which '{reference.system}' "
            f"has poses too; {FEWEST_POSES} are needed. Look at the stamps of both with gtval sync"
        )
    rows = np.flatnonzero(good)[:: -(-int(good.sum()) // MOST_POSES)]
    stamps = times[rows]
    middle = float(stamps[0] + stamps[-1]) / 2
    return Matched(curve, stamps, planar.poses[rows], middle), delay


def rough_delay(reference: Reference, source: Trajectory) -> float:
    """The delay, in seconds, at which speeds and turn rates agree best.

    Neither depends on the frame, and turn rates not on the mount. Least absolute differences: a
    pose that is far off makes two rates wrong.
    """
    times = source.times
    if len(times) < FEWEST_POSES:
        return 0.0
    step = max(float(np.median(np.diff(times))), LAG_STEP)
    grid = np.arange(times[0] + HALF_STEP, times[-1] - HALF_STEP, step)[:MOST_POSES]
    turned = np.unwrap(source.poses[:, 2])
    width = 2 * HALF_STEP

    def at(moments: Array) -> Array:
        three = (source.poses[:, 0], source.poses[:, 1], turned)
        return np.column_stack([np.interp(moments, times, one) for one in three])

    rate = (at(grid + HALF_STEP) - at(grid - HALF_STEP)) / width
    own = (np.hypot(rate[:, 0], rate[:, 1]), rate[:, 2])
    best, delay = np.inf, 0.0
    lags = np.arange(-LONGEST_DELAY, LONGEST_DELAY + LAG_STEP / 2, LAG_STEP)
    for lag in sorted(lags, key=abs):
        good = reference.supported(grid + lag, 0.0)
        if good.sum() < max(FEWEST_POSES, len(grid) // 10):
            continue
        seen = reference.moving(grid[good] + lag)
        cost = 0.0
        for mine, theirs in zip(own, (np.abs(seen.velocities), seen.turn_rates), strict=True):
            size = float(np.mean(np.abs(theirs - theirs.mean()))) + 1e-6
            cost += float(np.mean(np.minimum(np.abs(mine[good] - theirs) / size, 4.0)))
        # Zero is tried first, and is left only for what is clearly better.
        if cost < 0.9 * best:
            best, delay = cost, float(lag)
    return delay


class Start(NamedTuple):
    """Where a fit begins."""

    parameters: Array
    cost: float


def start(matched: Matched, delay: float) -> Start:
    """Frame and heading of the mount by themselves, without what is far off.

    Parameters
    ----------
    matched : Matched
        The poses.
    delay : float
        Taken as known, in seconds.
    """
    parameters = np.zeros(12)
    parameters[7] = delay
    residuals, at = matched.residuals(parameters)
    turn = float(circular_mean(residuals[:, 2]))
    turn = 0.0 if np.isnan(turn) else turn
    turn += float(np.median(wrap(residuals[:, 2] - turn)))
    theirs = at.places
    own = matched.poses[:, 0] + 1j * matched.poses[:, 1]
    weights = np.ones(len(own))
    direction, shift = np.exp(1j * turn), 0j
    for _ in range(20):
        centre, mean = np.average(own, weights=weights), np.average(theirs, weights=weights)
        product = np.sum(weights * (theirs - mean) * np.conj(own - centre))
        if abs(product) > 1e-9:
            direction = product / abs(product)
        shift = mean - direction * centre
        off = np.abs(theirs - direction * own - shift)
        weights = 1 / np.maximum(off, 0.01 + 0.1 * np.median(off))
    parameters[:3] = shift.real, shift.imag, np.angle(direction)
    parameters[5] = wrap(turn - np.angle(direction))
    return Start(parameters, float(np.median(off)))
