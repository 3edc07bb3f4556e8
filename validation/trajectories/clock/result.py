"""The clock of a source against a reference."""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from validation.poses.angles import Array
from validation.poses.trajectory import Trajectory
from validation.shown import Shown

Verdict = Literal["determined", "ambiguous", "not_determinable"]
"""Whether the motion tells the delay; or only up to others that fit as well; or not at all."""


@dataclass(frozen=True)
class Part:
    """The delay in a part of the record.

    Parameters
    ----------
    first_s, last_s : float
        The part, in the stamps of the source that is not the continuous one.
    delay_s, low_s, high_s : float
        The delay at its middle, with its interval.
    """

    first_s: float
    last_s: float
    delay_s: float
    low_s: float
    high_s: float


@dataclass(frozen=True)
class Place:
    """Where a clock jumps, in stamps of the source.

    Parameters
    ----------
    stamp_s : float
        Between the parts before and after; seconds since the epoch of the estimate.
    first_s, last_s : float
        What it may lie between: poses that tell, or a time without any.
    """

    stamp_s: float
    first_s: float
    last_s: float

    @classmethod
    def between(cls, first: float, last: float) -> "Place":
        """In the middle between two poses."""
        return cls((first + last) / 2, first, last)

    def later(self, by: float) -> "Place":
        """The same with other stamps."""
        return Place(self.stamp_s + by, self.first_s + by, self.last_s + by)


@dataclass(frozen=True)
class Jump:
    """A change of the delay at once, as where a clock is set.

    Parameters
    ----------
    place : Place
        Where.
    before_s, after_s : float
        The delay there, by the part before and the part after.
    low_s, high_s : float
        Interval of the change.
    """

    place: Place
    before_s: float
    after_s: float
    low_s: float
    high_s: float

    @property
    def stamp_s(self) -> float:
        """The stamp between the parts, seconds since the epoch of the estimate."""
        return self.place.stamp_s

    @property
    def size_s(self) -> float:
        """Added to the delay."""
        return self.after_s - self.before_s


@dataclass(frozen=True, repr=False)
class ClockEstimate(Shown):
    """Delay, drift and jitter of a source's stamps.

    Parameters
    ----------
    source : str
        Its name.
    epoch : int
        Seconds that ``at_s`` counts from: the reference's.
    verdict : {"determined", "ambiguous", "not_determinable"}
        What the motion tells.
    reason : str
        Why not more, in words.
    delay_s, low_s, high_s : float
        Added to the source's stamps to get the reference's time, mean latency included, with its
        interval; NaN where nothing can be told.
    at_s : float
        The reference's time at which that is so: the middle of the common time.
    drift_ppm, drift_low_ppm, drift_high_ppm : float
        Change of the delay, microseconds a second.
    jitter_s : float
        Standard deviation of the stamps; NaN where unknown.
    period_s, interval_s : float
        Of the source's frames where it has a rate, NaN where not; median interval.
    frame, mount : (3,) array
        x, y, theta: ``reference = frame * source * mount``. The mean where the frame wanders.
    mount_covariance : (3, 3) array
        Square metres and radians.
    rivals : tuple of (delay, score)
        Other delays that fit as well; score: how much worse, in standard deviations.
    parts : tuple of Part
        The same by parts of the record.
    jumps : tuple of Jump
        Of the clock, in order. All other numbers are those of the longest piece between them.
    pieces : tuple of ClockEstimate
        The clock before, between and after its jumps; empty where there is none.
    noise : (2,) array
        Standard deviation of the poses of the two together, metres and radians.
    wander : (2,) array
        Of the frame, for a metre of motion: metres, radians.
    speeds, turn_rates : (2,) array
        Root mean square, and what 95 % are below: m/s, rad/s.
    poses : int
        That were used.
    inflation : float
        By which the interval was widened for what the record's blocks show.
    confidence : float
        Of the intervals.
    """

    source: str
    epoch: int
    verdict: Verdict
    reason: str = ""
    delay_s: float = np.nan
    at_s: float = np.nan
    low_s: float = np.nan
    high_s: float = np.nan
    drift_ppm: float = np.nan
    drift_low_ppm: float = np.nan
    drift_high_ppm: float = np.nan
    jitter_s: float = np.nan
    period_s: float = np.nan
    interval_s: float = np.nan
    frame: Array = field(default_factory=lambda: np.full(3, np.nan))
    mount: Array = field(default_factory=lambda: np.full(3, np.nan))
    mount_covariance: Array = field(default_factory=lambda: np.full((3, 3), np.nan))
    rivals: tuple[tuple[float, float], ...] = ()
    parts: tuple[Part, ...] = ()
    jumps: tuple[Jump, ...] = ()
    pieces: tuple["ClockEstimate", ...] = ()
    noise: Array = field(default_factory=lambda: np.full(2, np.nan))
    wander: Array = field(default_factory=lambda: np.full(2, np.nan))
    speeds: Array = field(default_factory=lambda: np.full(2, np.nan))
    turn_rates: Array = field(default_factory=lambda: np.full(2, np.nan))
    poses: int = 0
    inflation: float = 1.0
    confidence: float = 0.95


def on_reference_clock(source: Trajectory, clock: ClockEstimate) -> Trajectory:
    """The source with the reference's time as its stamps.

    Poses of two pieces that overlap at a jump, by less than a frame or two, are left out.
    """
    times = source.times + added(clock, source.times_since(clock.epoch))
    if not clock.jumps:
        return replace(source, times=times)
    later = np.minimum.accumulate(times[::-1])[::-1]
    kept = times == later
    kept[:-1] &= times[:-1] < later[1:]
    return replace(source.select(kept), times=times[kept])


def added(clock: ClockEstimate, stamps: Array) -> Array:
    """(n,) seconds added to stamps, in seconds since the clock's epoch, by the piece each is in."""
    if not clock.pieces:
        drift = 0.0 if np.isnan(clock.drift_ppm) else 1e-6 * clock.drift_ppm
        return np.asarray(clock.delay_s + drift * (stamps - clock.at_s))
    place = np.searchsorted([jump.stamp_s for jump in clock.jumps], stamps)
    every = np.array([added(piece, stamps) for piece in clock.pieces])
    return np.asarray(every[place, np.arange(len(stamps))])
