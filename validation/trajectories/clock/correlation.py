"""Delays by cross-correlation of headings, as AD2.3 sought them, with its faults by name."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.ndimage import median_filter, minimum_filter

from validation.errors import GtvalError
from validation.poses.angles import Array, circular_mean, wrap
from validation.poses.trajectory import Trajectory
from validation.shown import Shown

Mask = npt.NDArray[np.bool_]
Fault = Literal["edge", "flips", "drift", "repeats"]
"""The maximum stands at the window's edge, or may as well; images turned by half a turn are in the
signal; the odometry drifted; each image stands for the time until the next."""

STEP = 0.02
"""Seconds between samples: AD2.3, page 58, whose odometry came at that rate."""
WINDOW = 2.0
"""Seconds by which a signal is moved to either side: AD2.3, page 57."""
LAGS = np.arange(-round(WINDOW / STEP), round(WINDOW / STEP) + 1)
"""The same in samples."""
PART_GAP = 1.0
"""Seconds without an image that end a stretch in which the camera sees the robot: ten images at
AD2.3's rate. Bursts of images that are lost are shorter."""
SHORTEST_PART = 4 * WINDOW
"""Seconds: twice the way that a part is moved in all."""
LEAST_TURN = 0.5
"""Radians of heading in a part, below which nothing turns that could be told from noise."""
MOST_PARTS = 6
"""Of a camera, the longest; AD2.3 chose two to four by eye."""
NEIGHBOURS = 201
"""Images whose median difference tells where a heading should be: about 20 s, so that half-turned
images may last for ten, and the odometry drifts little in it."""
FEWEST_IMAGES = 20
"""Below which a camera is not correlated."""
SPREADS = 6.0
"""Robust standard deviations beyond which a heading is spurious: noise with the heavy tails of
Student's t with 6 degrees of freedom is beyond once in two thousand images."""
NEAREST, FARTHEST = 0.2, np.pi / 2
"""Radians between which that limit is kept: closer no half turn can be meant, and from a quarter
turn on a heading is nearer to the opposite one."""


@dataclass(frozen=True, repr=False)
class Peak(Shown):
    """The maximum of the correlation of a stretch.

    Parameters
    ----------
    first_s, last_s : float
        The camera's first and last image, seconds since the odometry's epoch.
    delay_s : float
        Added to the camera's stamps gives the odometry's time, by the maximum; NaN where nothing
        turns.
    height : float
        Correlation there.
    low_s, high_s : float
        Between these some delays fit as well: they leave a share of the variance that is larger
        by less than two standard deviations of what so many images can tell.
    values : (201,) array
        Correlation at the delays ``STEP * LAGS``; NaN where the two have nothing in common.
    """

    first_s: float
    last_s: float
    delay_s: float
    height: float
    low_s: float
    high_s: float
    values: Array

    @property
    def at_edge(self) -> bool:
        """Whether the maximum, or what fits as well, stands at the window's edge."""
        return bool(max(-self.low_s, self.high_s) > WINDOW - STEP / 2)


NOTHING = Peak(np.nan, np.nan, np.nan, np.nan, np.nan, np.nan, np.empty(0))
"""Of a signal that is not correlated yet."""


@dataclass(frozen=True, repr=False)
class HeadingCorrelation(Shown):
    """The heading of a camera against that of odometry.

    Parameters
    ----------
    camera, odometry : str
        Their names.
    start_s : float
        Time of the first sample, seconds since the odometry's epoch.
    odometry_headings : (s,) array
        Every `STEP`, without jumps at half a turn; NaN where it has a gap.
    times : (n,) array
        Of the images, seconds since the odometry's epoch.
    headings : (n,) array
        Turned by one angle into the frame of the odometry, on its nearest turn.
    spurious : (n,) array of bool
        Those far from the odometry's heading.
    flips : int
        Of these, how many are about half a turn off.
    drift : float
        Radians between the largest and the least median difference of the parts.
    turn_rate : float
        Root mean square of the odometry's, radians a second, while images came.
    period_s : float
        Between images.
    repeats : int
        Samples that one image stands for.
    before, after : Peak
        Of the whole signal: as it came, and without what is spurious.
    parts : tuple of Peak
        Of the selected parts, without what is spurious.
    """

    camera: str
    odometry: str
    start_s: float
    odometry_headings: Array
    times: Array
    headings: Array
    spurious: Mask
    flips: int
    drift: float
    turn_rate: float
    period_s: float
    repeats: int
    before: Peak
    after: Peak
    parts: tuple[Peak, ...]

    @property
    def held_s(self) -> float:
        """Mean age of the image at a sample: the maximum shows the camera so much later.

        Of m samples the ages are 0, 1, ... m - 1 steps.
        """
        return (self.repeats - 1) / 2 * STEP

    def without_repeats(self, peak: Peak) -> float:
        """The delay of a peak without what the repetition of images added, in seconds."""
        return peak.delay_s + self.held_s

    def faults(self, peak: Peak) -> tuple[Fault, ...]:
        """What is known to be wrong with a peak."""
        whole = peak is self.before or peak is self.after
        # A drift matters where it is an angle that the robot takes longer than an image to turn by.
        drifted = self.drift > self.turn_rate * self.period_s
        found: dict[Fault, bool] = {
            "edge": peak.at_edge,
            "flips": self.flips > 0 and peak is self.before,
            "drift": drifted and whole,
            "repeats": self.repeats > 1,
        }
        return tuple(name for name, there in found.items() if there)

    def held(self, images: Mask) -> Array:
        """(s,) samples of some of the images, each repeated; NaN where there is none."""
        samples = np.full(len(self.odometry_headings), np.nan)
        first = np.round((self.times[images] - self.start_s) / STEP).astype(int)
        places = (first[:, None] + np.arange(self.repeats)).ravel()
        values = np.repeat(self.headings[images], self.repeats)
        inside = (places >= 0) & (places < len(samples))
        # A later image takes the place of an earlier one that is still repeated.
        samples[places[inside]] = values[inside]
        return samples


def correlate_headings(odometry: Trajectory, camera: Trajectory) -> HeadingCorrelation:
    """Delay of a camera against odometry, by the maximum of the correlation of their headings.

    Parameters
    ----------
    odometry : Trajectory
        Poses with headings, in a frame of its own.
    camera : Trajectory
        Poses with headings.

    Returns
    -------
    HeadingCorrelation
        With the delay of the whole signal, before and after spurious images are taken out, and of
        the parts in which the camera sees the robot.

    Raises
    ------
    GtvalError
        If one has no orientation, or they have too little time in common.

    Notes
    -----
    RAWSEEDS AD2.3, section "Collection of GT data in continuous acquisition", pages 57 to 61. The
    correlation is Pearson's, of the samples that both have at each delay: neither the constant
    angle between the frames nor how far the robot turned in a stretch changes it.
    """
    start, samples = _sampled(odometry)
    times = camera.times_since(odometry.epoch)
    own = start + STEP * np.arange(len(samples))
    known = np.isfinite(samples)
    inside = np.interp(times, own, known, left=0.0, right=0.0) > 0
    if inside.sum() < FEWEST_IMAGES:
        said = f"'{camera.system}' has {inside.sum()} images while '{odometry.system}' was logged"
        raise GtvalError(f"headings are not correlated: {said}; {FEWEST_IMAGES} are needed")
    times, seen = times[inside], camera.headings[inside]
    there = np.interp(times, own[known], samples[known])
    period = float(np.median(np.diff(times)))
    apart, off = _apart(seen, there)
    limit = _limit(off)
    # No delay of the window makes an image spurious.
    lowest, highest = (np.interp(times, own, f(samples, len(LAGS))) for f in (_least, _most))
    beyond = np.maximum(off - (highest - there), (lowest - there) - off)
    found = HeadingCorrelation(
        camera=camera.system,
        odometry=odometry.system,
        start_s=start,
        odometry_headings=samples,
        times=times,
        headings=there + apart,
        spurious=beyond > limit,
        flips=0,
        drift=0.0,
        turn_rate=float(np.sqrt(np.mean(np.gradient(there, times) ** 2))),
        period_s=period,
        repeats=max(1, round(period / STEP)),
        before=NOTHING,
        after=NOTHING,
        parts=(),
    )
    first = _peak(found, ~found.spurious)
    delay = 0.0 if first.at_edge or np.isnan(first.delay_s) else found.without_repeats(first)
    if delay:
        # With the delay out, turning robots show what is spurious as standing ones do.
        apart, off = _apart(seen, np.interp(times + delay, own[known], samples[known]))
        limit = _limit(off)
        found = replace(found, spurious=np.abs(off) > limit)
    parts = _parts(times, there, ~found.spurious)
    medians = [float(np.median(apart[part])) for part in parts] or [0.0]
    return replace(
        found,
        flips=int((found.spurious & (np.abs(off) > np.pi - limit)).sum()),
        drift=float(np.ptp(medians)),
        before=_peak(found, np.ones_like(found.spurious)),
        after=_peak(found, ~found.spurious),
        parts=tuple(_peak(found, np.isin(np.arange(len(times)), part)) for part in parts),
    )


def _apart(seen: Array, there: Array) -> tuple[Array, Array]:
    """Differences of headings about their middle, and what of them is not that of neighbours."""
    apart = wrap(seen - there)
    apart = wrap(apart - circular_mean(apart))
    apart = wrap(apart - np.median(apart))
    return apart, wrap(apart - median_filter(apart, NEIGHBOURS, mode="nearest"))


def _limit(off: Array) -> float:
    """Radians from which a difference is spurious."""
    return float(np.clip(SPREADS * 1.4826 * np.median(np.abs(off)), NEAREST, FARTHEST))


def _least(samples: Array, width: int) -> Array:
    return np.asarray(minimum_filter(np.where(np.isnan(samples), np.inf, samples), width))


def _most(samples: Array, width: int) -> Array:
    return -_least(-samples, width)


def _sampled(odometry: Trajectory) -> tuple[float, Array]:
    """Time of the first sample, and headings every `STEP`, with the window empty on both sides."""
    if len(odometry) < 2:
        raise GtvalError(f"'{odometry.system}' has {len(odometry)} poses; no headings to correlate")
    edge = int(LAGS[-1])
    first, last = odometry.times[[0, -1]]
    inner = first + STEP * np.arange(int((last - first) / STEP + 1e-6) + 1)
    values = np.interp(inner, odometry.times, np.unwrap(odometry.headings))
    for begin, end in odometry.gaps:
        values[(inner > begin) & (inner < end)] = np.nan
    return float(first - edge * STEP), np.pad(values, edge, constant_values=np.nan)


def _parts(times: Array, headings: Array, good: Mask) -> list[npt.NDArray[np.intp]]:
    """Rows of the longest stretches with images in which the robot turns, in their order."""
    rows = np.flatnonzero(good)
    stretches = np.split(rows, np.flatnonzero(np.diff(times[rows]) > PART_GAP) + 1)
    usable = [
        part
        for part in stretches
        if len(part) >= FEWEST_IMAGES
        and np.ptp(times[part]) >= SHORTEST_PART
        and np.ptp(headings[part]) >= LEAST_TURN
    ]
    longest = sorted(usable, key=lambda part: -np.ptp(times[part]))[:MOST_PARTS]
    return sorted(longest, key=lambda part: part[0])


def _peak(found: HeadingCorrelation, images: Mask) -> Peak:
    """The maximum of the correlation of some of the images."""
    times, held = found.times[images], found.held(images)
    span = (float(times[0]), float(times[-1])) if len(times) else (np.nan, np.nan)
    rows = np.flatnonzero(np.isfinite(held))
    values = np.array([_pearson(held[rows], _at(found.odometry_headings, rows + k)) for k in LAGS])
    if not np.isfinite(values).any():
        return Peak(*span, np.nan, np.nan, np.nan, np.nan, values)
    best = int(np.nanargmax(values))
    height = float(values[best])
    # A variance that is estimated from n images has a standard deviation of sqrt(2 / n) of it.
    left = (1 - height**2) * (1 + 2 * np.sqrt(2 / max(len(times), 1)))
    as_well = STEP * LAGS[(values > 0) & (1 - values**2 <= left)]
    low, high = (as_well.min(), as_well.max()) if len(as_well) else [STEP * LAGS[best]] * 2
    return Peak(*span, float(STEP * LAGS[best]), height, float(low), float(high), values)


def _at(samples: Array, rows: npt.NDArray[np.intp]) -> Array:
    inside = (rows >= 0) & (rows < len(samples))
    return np.where(inside, samples[np.clip(rows, 0, len(samples) - 1)], np.nan)


def _pearson(a: Array, b: Array) -> float:
    """Correlation of the samples that both have; NaN where half are missing or none vary."""
    both = np.isfinite(b)
    if both.sum() < max(2, len(a) / 2):
        return np.nan
    a, b = a[both] - a[both].mean(), b[both] - b[both].mean()
    size = np.sqrt((a @ a) * (b @ b))
    return float(a @ b / size) if size > 0 else np.nan
