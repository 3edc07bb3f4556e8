"""A plan held against the log of the drive: satellites and HDOP, predicted and seen."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from rtk_gt.planning.plan import SkyPlan
from rtk_gt.planning.visibility import dilution
from rtk_gt.receivers.fixes import Fixes, Ints
from validation.errors import GtvalError
from validation.poses.angles import Array

MINUTE = 60.0
LEAST_MISSING = 2
"""Satellites fewer than predicted that are told. A judgement: one is missing every day, as it
rises, is repaired, or stands behind a tree."""
LONGEST_GAP = 3 * MINUTE
"""Between minutes of one stretch. A judgement: a vehicle that passes a window is not out of the
shadow."""
GGA_MOST = 12
"""Satellites that GGA could tell before NMEA 2.3; receivers of that time stop there."""
_MOST_CANDIDATES = 14
"""The lowest satellites of which sets are tried: 3432 sets of seven at most."""
HDOP_STEP, HDOP_SHARE = 0.1, 0.1
"""What a set's HDOP may differ from the receiver's: by the digit that GGA tells, or, as receivers
weigh low satellites less, by a tenth (a judgement)."""


@dataclass(frozen=True)
class Minutes:
    """A log by minutes: those in which there was a fix that tells its satellites.

    Parameters
    ----------
    times : (m,) array
        Middles, seconds since 1970 UTC.
    satellites : (m,) array
        Median number of satellites used.
    hdop : (m,) array
        Median HDOP; NaN where none is told.
    """

    times: Array
    satellites: Array
    hdop: Array


@dataclass(frozen=True)
class Stretch:
    """A time in which fewer satellites were used than predicted.

    Parameters
    ----------
    start, end : float
        Seconds since 1970 UTC.
    missing : int
        Median number of satellites that are missing.
    hidden : tuple of str
        Satellites that would be hidden: of the sets of that many whose absence gives the HDOP
        seen, the lowest one.
    azimuths, elevations : (missing,) array
        Their directions in the middle of the stretch, rad.
    sets : int
        How many sets give that HDOP: with more than one the satellites are a guess. 0 where none
        does, or no HDOP was told; the lowest satellites are named then.
    """

    start: float
    end: float
    missing: int
    hidden: tuple[str, ...]
    azimuths: Array
    elevations: Array
    sets: int


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
    capped : bool
        Whether the log counts to twelve satellites only.
    """

    plan: SkyPlan
    seen: Minutes
    predicted: Ints
    stretches: tuple[Stretch, ...]
    capped: bool

    @property
    def missing(self) -> Array:
        """(m,) satellites fewer than predicted."""
        return np.asarray(self.predicted - self.seen.satellites)


def by_minutes(record: Fixes) -> Minutes:
    """A log by minutes.

    Raises
    ------
    GtvalError
        If no fix tells its satellites.
    """
    told = record.satellites >= 0
    if not told.any():
        raise GtvalError(f"{record.source}: no fix tells how many satellites it used")
    minute = np.floor(record.times[told] / MINUTE).astype(np.int64)
    satellites, hdop = record.satellites[told].astype(np.float64), record.hdop[told]
    order = np.argsort(minute, kind="stable")
    starts = np.flatnonzero(np.diff(minute[order], prepend=minute[order][0] - 1))
    groups = np.split(order, starts[1:])

    def median(values: Array) -> float:
        stated = values[np.isfinite(values)]
        return float(np.median(stated)) if len(stated) else np.nan

    return Minutes(
        (minute[order][starts].astype(np.float64) + 0.5) * MINUTE,
        np.array([median(satellites[rows]) for rows in groups]),
        np.array([median(hdop[rows]) for rows in groups]),
    )


def compare(plan: SkyPlan, seen: Minutes) -> AgainstLog:
    """Predicted and seen satellites and HDOP.

    Parameters
    ----------
    plan : SkyPlan
        At ``seen.times``.
    seen : Minutes
        The log.
    """
    capped = bool(seen.satellites.max() == GGA_MOST < plan.count.max())
    predicted = np.minimum(plan.count, GGA_MOST) if capped else plan.count
    short = np.flatnonzero(predicted - seen.satellites >= LEAST_MISSING)
    breaks = np.flatnonzero(np.diff(seen.times[short]) > LONGEST_GAP) + 1
    groups = [rows for rows in np.split(short, breaks) if len(rows)]
    stretches = tuple(_stretch(plan, seen, predicted, rows) for rows in groups)
    return AgainstLog(plan, seen, predicted, stretches, capped)


def _stretch(plan: SkyPlan, seen: Minutes, predicted: Ints, rows: Ints) -> Stretch:
    """One stretch with what may be hidden in it, judged at the minute nearest to its middle."""
    lack = predicted[rows] - seen.satellites[rows]
    missing = int(np.floor(np.median(lack)))
    # Of the minutes in which as many are missing, the one nearest to the middle.
    middle = (seen.times[rows[0]] + seen.times[rows[-1]]) / 2
    off = np.abs(lack - missing) * 1e9 + np.abs(seen.times[rows] - middle)
    at = int(rows[np.argmin(off)])
    there = np.flatnonzero(plan.used[:, at])
    there = there[np.argsort(plan.rover.elevation[there, at])]
    lowest = there[:_MOST_CANDIDATES]
    sets = np.array(list(combinations(range(len(lowest)), min(missing, len(lowest)))))
    left = np.ones((len(there), len(sets)), dtype=bool)
    left[sets.T, np.arange(len(sets))] = False
    azimuth = np.broadcast_to(plan.rover.azimuth[there, at, None], left.shape)
    elevation = np.broadcast_to(plan.rover.elevation[there, at, None], left.shape)
    systems = tuple(plan.almanac.systems[k] for k in there)
    hdop = dilution(azimuth, elevation, left, systems).horizontal
    tolerance = max(HDOP_STEP, HDOP_SHARE * float(np.nan_to_num(seen.hdop[at])))
    fits = np.flatnonzero(np.abs(hdop - seen.hdop[at]) <= tolerance)
    # An obstacle hides what is low: of the sets that fit, the one with the lowest elevations.
    heights = plan.rover.elevation[lowest, at][sets].sum(1)
    best = fits[np.argmin(heights[fits])] if len(fits) else int(np.argmin(heights))
    gone = lowest[sets[best]]
    return Stretch(
        float(seen.times[rows[0]] - MINUTE / 2),
        float(seen.times[rows[-1]] + MINUTE / 2),
        missing,
        tuple(plan.almanac.names[k] for k in gone),
        plan.rover.azimuth[gone, at],
        plan.rover.elevation[gone, at],
        len(fits),
    )
