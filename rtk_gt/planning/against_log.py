"""A plan held against the log of the drive: satellites and HDOP, predicted and seen."""

from dataclasses import dataclass

import numpy as np

from rtk_gt.planning.plan import SkyPlan
from rtk_gt.planning.visibility import Bools, dilution
from rtk_gt.receivers.fixes import Fixes, Ints
from validation.errors import GtvalError
from validation.poses.angles import Array, wrap

MINUTE = 60.0
LEAST_MISSING = 2
"""Satellites fewer than predicted that are told. A judgement: one is missing every day, as it
rises, is repaired, or stands behind a tree."""
LONGEST_GAP = 3 * MINUTE
"""Between minutes of one stretch. A judgement: a vehicle that passes a window is not out of the
shadow."""
GGA_MOST = 12
"""Satellites that GGA could tell before NMEA 2.3; receivers of that time stop there."""
MOST_MINUTES = 14400
"""Ten days: of a longer log, which a wrong date makes, pauses say nothing."""
HDOP_STEP, HDOP_SHARE = 0.1, 0.1
"""What a predicted HDOP may differ from the receiver's, as a standard deviation: the digit that GGA
tells, or, as receivers weigh low satellites less, a tenth (a judgement)."""
MOST_TRIED = 8
"""Minutes of a stretch on which obstacles are tried, evenly spread: more add time, not sense."""
AS_GOOD = 3.84
"""An obstacle whose sum of squares is larger than the least by up to this is as good: the 95 %
bound of chi-squared of one number."""
MISFIT = 1.5
"""Satellites by which an obstacle's numbers are off (root mean square) that explain nothing."""


@dataclass(frozen=True)
class Minutes:
    """A log by minutes, from its first fix to its last.

    Parameters
    ----------
    times : (m,) array
        Middles, seconds since 1970 UTC.
    satellites : (m,) array
        Median number of satellites used; NaN where no fix tells it.
    hdop : (m,) array
        Median HDOP; NaN where none is told.
    """

    times: Array
    satellites: Array
    hdop: Array


@dataclass(frozen=True)
class Obstacle:
    """A part of the horizon that hides satellites up to an elevation.

    Parameters
    ----------
    middle, half_width, height : float
        Azimuth of its middle, half of its width, and its upper edge, rad; all around where half
        of its width is pi.
    """

    middle: float
    half_width: float
    height: float


@dataclass(frozen=True)
class Stretch:
    """A time in which fewer satellites were used than predicted.

    Parameters
    ----------
    start, end : float
        Seconds since 1970 UTC.
    missing : int
        Median number of satellites that are missing.
    obstacle : Obstacle
        The smallest of those that explain numbers and HDOP best.
    hidden : tuple of str
        Satellites that it hides in the middle of the stretch.
    misfit : float
        Satellites by which its numbers are off, root mean square over the minutes tried.
    as_good : int
        How many of the other obstacles tried explain the log as well.
    """

    start: float
    end: float
    missing: int
    obstacle: Obstacle
    hidden: tuple[str, ...]
    misfit: float
    as_good: int

    @property
    def explained(self) -> bool:
        """Whether one obstacle would do what was seen."""
        return self.misfit <= MISFIT


@dataclass(frozen=True)
class AgainstLog:
    """Predicted and seen.

    Parameters
    ----------
    plan : SkyPlan
        At the minutes of the log.
    seen : Minutes
        What the log tells.
    predicted : (m,) int array
        Number of satellites predicted, as far as the log can count.
    stretches : tuple of Stretch
        Where fewer were seen, in order of time.
    silent : tuple of (float, float)
        Start and end of the times without any fix in which enough satellites were predicted.
    capped : bool
        Whether the log counts to twelve satellites only.
    """

    plan: SkyPlan
    seen: Minutes
    predicted: Ints
    stretches: tuple[Stretch, ...]
    silent: tuple[tuple[float, float], ...]
    capped: bool

    @property
    def missing(self) -> Array:
        """(m,) satellites fewer than predicted; NaN without a fix."""
        return np.asarray(self.predicted - self.seen.satellites)


def by_minutes(record: Fixes) -> Minutes:
    """A log by minutes; of more than ten days, those with a fix only.

    Raises
    ------
    GtvalError
        If no fix tells its satellites.
    """
    told = record.satellites >= 0
    if not told.any():
        raise GtvalError(f"{record.source}: no fix tells how many satellites it used")
    minute = np.floor(record.times[told] / MINUTE).astype(np.int64)
    columns = record.satellites[told].astype(np.float64), record.hdop[told]
    order = np.argsort(minute, kind="stable")
    filled, starts = np.unique(minute[order], return_index=True)
    whole = filled[-1] - filled[0] < MOST_MINUTES
    shown = np.arange(filled[0], filled[-1] + 1) if whole else filled
    at = np.searchsorted(shown, filled)
    medians = np.full((2, len(shown)), np.nan)
    for row, values in enumerate(columns):
        groups = np.split(values[order], starts[1:])
        medians[row, at] = [_median(group) for group in groups]
    return Minutes((shown.astype(np.float64) + 0.5) * MINUTE, *medians)


def _median(values: Array) -> float:
    """Of what is told; NaN of nothing."""
    stated = values[np.isfinite(values)]
    return float(np.median(stated)) if len(stated) else np.nan


def compare(plan: SkyPlan, seen: Minutes) -> AgainstLog:
    """Predicted and seen satellites and HDOP.

    Parameters
    ----------
    plan : SkyPlan
        At ``seen.times``.
    seen : Minutes
        The log.
    """
    capped = bool(np.nanmax(seen.satellites) == GGA_MOST < plan.count.max())
    predicted = np.minimum(plan.count, GGA_MOST) if capped else plan.count
    short = np.flatnonzero(predicted - seen.satellites >= LEAST_MISSING)
    stretches = tuple(_stretch(plan, seen, predicted, rows) for rows in _runs(seen.times, short))
    silent = np.flatnonzero(np.isnan(seen.satellites) & (plan.count >= plan.wanted.satellites))
    pauses = [(seen.times[rows[0]], seen.times[rows[-1]]) for rows in _runs(seen.times, silent)]
    half = MINUTE / 2
    return AgainstLog(
        plan,
        seen,
        predicted,
        stretches,
        tuple((float(first - half), float(last + half)) for first, last in pauses),
        capped,
    )


def _runs(times: Array, rows: Ints) -> list[Ints]:
    """Rows split where they are further apart than `LONGEST_GAP`."""
    breaks = np.flatnonzero(np.diff(times[rows]) > LONGEST_GAP) + 1
    return [run for run in np.split(rows, breaks) if len(run)]


def _stretch(plan: SkyPlan, seen: Minutes, predicted: Ints, rows: Ints) -> Stretch:
    """One stretch, and the obstacle that explains it best."""
    spread = np.unique(np.linspace(0, len(rows) - 1, MOST_TRIED).round().astype(int))
    tried = rows[spread]
    obstacles = _obstacles()
    there = np.flatnonzero(plan.used[:, tried].any(1))
    azimuth, elevation = (
        values[np.ix_(there, tried)] for values in (plan.rover.azimuth, plan.rover.elevation)
    )
    aside = np.abs(wrap(azimuth[:, None] - obstacles[:, 0, None]))
    behind = (aside <= obstacles[:, 1, None]) & (elevation[:, None] < obstacles[:, 2, None])
    used = plan.used[np.ix_(there, tried)][:, None] & ~behind
    off = _misfits(plan, seen, tried, there, used)
    best = int(np.argmin(off[0] + off[1]))  # of equal ones the smallest: they are in order of size
    total = (off[0] + off[1])[best]
    middle = len(tried) // 2
    hidden = there[plan.used[there, tried[middle]] & behind[:, best, middle]]
    return Stretch(
        float(seen.times[rows[0]] - MINUTE / 2),
        float(seen.times[rows[-1]] + MINUTE / 2),
        int(np.median(predicted[rows] - seen.satellites[rows])),
        Obstacle(*obstacles[best].tolist()),
        tuple(plan.almanac.names[k] for k in hidden),
        float(np.sqrt(off[0][best] / len(tried))),
        int((off[0] + off[1] <= total + AS_GOOD).sum()) - 1,
    )


def _obstacles() -> Array:
    """(o, 3) middle, half width and height of all obstacles tried, rad, from small to large."""
    some = [
        (middle, half, height)
        for middle in range(0, 360, 15)
        for half in (15, 30, 45, 60, 75, 90, 120)
        for height in range(15, 75, 5)
    ]
    around = [(0, 180, height) for height in range(15, 75, 5)]
    found = np.radians(np.array([*some, *around], dtype=float))
    size = found[:, 1] * np.sin(found[:, 2])
    return np.asarray(found[np.argsort(size, kind="stable")])


def _misfits(
    plan: SkyPlan, seen: Minutes, tried: Ints, there: Ints, used: Bools
) -> tuple[Array, Array]:
    """(o,) sums of squares of numbers of satellites, and of HDOP by its standard deviation.

    Parameters
    ----------
    used : (s, o, m) array of bool
        Satellites ``there`` that each obstacle leaves at the minutes ``tried``.
    """
    shape = used.shape
    azimuth, elevation = (
        np.broadcast_to(values[np.ix_(there, tried)][:, None], shape).reshape(shape[0], -1)
        for values in (plan.rover.azimuth, plan.rover.elevation)
    )
    systems = tuple(plan.almanac.systems[k] for k in there)
    hdop = dilution(azimuth, elevation, used.reshape(shape[0], -1), systems).horizontal
    told = seen.hdop[tried]
    sigma = np.maximum(HDOP_STEP, HDOP_SHARE * told)
    off = (hdop.reshape(shape[1:]) - told) / sigma
    # No position where the log has one: as bad as three standard deviations.
    off = np.where(np.isnan(told), 0.0, np.clip(np.nan_to_num(off, nan=3.0), -3.0, 3.0))
    count = used.sum(0) - seen.satellites[tried]
    return (count**2).sum(1), (off**2).sum(1)
