"""The control chart of one number a day, as if it had been looked at on every day."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import special

from validation.poses.angles import Array
from validation.shown import Shown
from validation.statistics.control.changes import (
    Change,
    evidence,
    is_one_drift,
    likeliest,
)
from validation.statistics.control.limits import FIRST, limit

MOST_DAYS = 400
"""Days that are looked back on: so the cost is that of the days, and the limits are known."""
FALSE_ALARM_DAYS = 730.0
"""Days without any change between two false alarms, on average, all charts of a hall together. A
judgement: half as many as one in a year, which leaves room for errors that are not quite normal."""
HALVINGS = 30
"""Of the interval in which the scatter from day to day lies: to a billionth of its end."""


@dataclass(frozen=True, repr=False)
class ControlChart(Shown):
    """A series of days and what was noticed in it.

    Parameters
    ----------
    values : (n,) array
        One number a day.
    sigmas : (n,) array
        Standard deviation of each, that of the day alone.
    evidence : (n,) array
        How sure a change was on that day, as a normal score; NaN on days too few to tell.
    limits : (n,) array
        What the evidence had to exceed to be noticed; NaN on the same days.
    centre, low, high : (n,) array
        What the days before led to expect, and where that day alone would have been noticed.
    changes : tuple of Change
        All that was noticed, in the order of the days.
    """

    values: Array
    sigmas: Array
    evidence: Array
    limits: Array
    centre: Array
    low: Array
    high: Array
    changes: tuple[Change, ...]

    @property
    def noticed(self) -> tuple[int, ...]:
        """Days on which a change was noticed, from 0."""
        return tuple(change.noticed for change in self.changes)

    def drifts_on(self, start: int, since: int, end: int) -> bool:
        """Whether a drift that the days from a start to another show goes on as it was to the end.

        True where no day is left to tell.
        """
        if since >= end:
            return True
        x, s = self.values[start:end], self.sigmas[start:end]
        return is_one_drift(x, _weights(x, s), since - start)

    def likeliest_of(self, start: int, end: int) -> Change:
        """The change that some days tell, by all of them; as many as a chart needs, at least."""
        rows = slice(start, end)
        x, s = self.values[rows], self.sigmas[rows]
        return _counted_from(likeliest(x, _weights(x, s)), start)


def control_chart(
    values: npt.ArrayLike,
    sigmas: npt.ArrayLike | None = None,
    *,
    false_alarm_days: float = FALSE_ALARM_DAYS,
    charts: int = 1,
    confidence: float = 0.95,
) -> ControlChart:
    """Changes of a series, each noticed by the days up to then alone.

    Parameters
    ----------
    values : (n,) array_like
        One number a day, in the order of the days.
    sigmas : (n,) array_like, optional
        Standard deviation of each, that of the day alone; by default all days are as good. To it
        comes the scatter from day to day, which is estimated from the days.
    false_alarm_days : float
        Days without change between two false alarms, on average, of all charts together.
    charts : int
        How many there are.
    confidence : float
        Of the intervals of what is noticed.

    Raises
    ------
    ValueError
        If a value is not finite, a sigma negative or not finite, or their numbers differ.

    Notes
    -----
    On each day the likelihood ratio of a change (`evidence`) is held against a limit that, of
    normal values without change, so many days exceed as are wanted. Mean and variance are unknown
    and nothing has to be said of them: both come from the days themselves. When a change was
    noticed, the chart begins anew on the next day: what comes after is compared with itself.

    Weights are reciprocal variances, that of the day and the scatter from day to day together. The
    variance as a whole is estimated anew on each day, so that only the relation of sigmas counts.
    """
    x = np.asarray(values, dtype=float)
    s = np.zeros(len(x)) if sigmas is None else np.asarray(sigmas, dtype=float)
    if x.ndim != 1 or x.shape != s.shape:
        raise ValueError(f"values and sigmas are one number a day each, not {x.shape}, {s.shape}")
    if not (np.isfinite(x).all() and np.isfinite(s).all() and (s >= 0).all()):
        raise ValueError("values and sigmas are finite, and sigmas not negative")
    rate = 1 / (false_alarm_days * charts)
    told = np.full((5, len(x)), np.nan)
    changes: list[Change] = []
    start, drifting = 0, 0
    for day in range(len(x)):
        since = max(start, day + 1 - MOST_DAYS)
        here = slice(since, day + 1)
        number = day + 1 - start
        if number < FIRST:
            continue
        weights = _weights(x[here], s[here])
        height = limit(rate, number)
        sure = float(evidence(x[here], weights))
        told[:, day] = sure, height, *_expected(x[here], weights, height)
        if sure > height:
            change = _counted_from(likeliest(x[here], weights, confidence), since)
            whole = slice(max(drifting, day + 1 - MOST_DAYS), day + 1)
            goes_on = _goes_on(changes, x[whole], s[whole], whole.start)
            changes.append(change._replace(goes_on=goes_on))
            start, drifting = day + 1, drifting if goes_on else start
    found, limits, centre, low, high = told
    return ControlChart(x, s, found, limits, centre, low, high, tuple(changes))


def _goes_on(changes: Sequence[Change], values: Array, sigmas: Array, since: int) -> bool:
    """Whether what is noticed is the drift before it, noticed anew; its days count from `since`.

    The first days of a drift may have looked like a step.
    """
    if not changes or changes[-1].began <= since:
        return False
    return is_one_drift(values, _weights(values, sigmas), changes[-1].noticed + 1 - since)


def _counted_from(change: Change, since: int) -> Change:
    """The change with days counted from the first of all."""
    days = ("noticed", "began", "began_low", "began_high")
    return change._replace(**{name: getattr(change, name) + since for name in days})


def day_to_day(values: Array, sigmas: Array) -> float:
    """Variance from day to day beside that of the days, rather too large than too small.

    Notes
    -----
    By the differences of successive days, of which a step changes one only and a slow drift none
    much. Their squares over the variances that they have with it would add up to their number m
    (Paule and Mandel 1982, "Consensus values and weighting factors"); it is chosen so that they add
    up to one standard deviation less, the root of 3 m, as neighbouring differences share a day.
    0 where the days alone explain so much.
    """
    squares = np.diff(values) ** 2
    own = sigmas[1:] ** 2 + sigmas[:-1] ** 2
    m = len(squares)
    wanted = max(m - np.sqrt(3 * m), 0.3 * m)
    low, high = 0.0, float(squares.sum()) / max(wanted, 1.0)
    if high <= 0:
        return 0.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        tried = 2 * middle + own
        if (squares / np.maximum(tried, np.finfo(float).tiny)).sum() > wanted:
            low = middle
        else:
            high = middle
    return 0.0 if low == 0 else high


def _weights(values: Array, sigmas: Array) -> Array:
    """Reciprocal variances, the largest being 1."""
    if np.ptp(sigmas) == 0:
        return np.ones(len(sigmas))
    variances = day_to_day(values, sigmas) + sigmas**2
    if not variances.min() > 0:  # what is stated as exact does not rule all other days
        variances = variances + max(float(np.var(np.diff(values))), np.finfo(float).tiny)
    return np.asarray(variances.min() / variances)


def _expected(values: Array, weights: Array, height: float) -> tuple[float, float, float]:
    """Mean of the days before the last, and where the last alone would be noticed."""
    before, w = values[:-1], weights[:-1]
    mean = float(w @ before / w.sum())
    dof = len(before) - 1
    variance = float(w @ (before - mean) ** 2) / dof
    reach = -float(special.stdtrit(dof, special.ndtr(-height)))
    half = reach * np.sqrt(variance * (1 / weights[-1] + 1 / w.sum()))
    return mean, mean - float(half), mean + float(half)
