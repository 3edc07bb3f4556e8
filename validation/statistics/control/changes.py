"""Changes in a series of days: a step or a drift, from some day on, and how sure that is."""

from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import special

from validation.poses.angles import Array

Kind = Literal["step", "drift"]

SINGLY, FARTHER = 12, 1.25
"""Every day of the last twelve may be the first of a change; farther back each such day lies this
many times as far. A change of 20 days that is taken for one of 22 keeps 95 % of its evidence."""
ONE_LINE = 0.01
"""Of drifts that go on as they were, so many are told as two."""
SAME = 1e-12
"""Of the largest value: values that differ by less are the same number."""


class Change(NamedTuple):
    """A change of a series, as the days up to some day tell it.

    Parameters
    ----------
    noticed : int
        Number of that day, from 0.
    began : int
        The day that is most likely the first of the change.
    began_low, began_high : int
        Days between which it began, with the confidence of the intervals.
    kind : {"step", "drift"}
        Whether the values moved at once, or go on moving by the same each day.
    drift : float
        Probability that it is a drift, where both were as likely before.
    size, low, high : float
        By how much the values of the day it was noticed differ from those before the change, with
        its interval.
    per_day : float
        Of a drift: size of one day; NaN of a step.
    goes_on : bool
        Whether it is an earlier drift, noticed anew: one straight line explains both.
    """

    noticed: int
    began: int
    began_low: int
    began_high: int
    kind: Kind
    drift: float
    size: float
    low: float
    high: float
    per_day: float
    goes_on: bool = False


class Candidates(NamedTuple):
    """Least squares of each change that is looked at.

    ``first`` (c,) is the first day of each; ``product``, ``square`` (..., 2, c) are the products
    of the change, of size one a day, with the values and with itself, the mean taken out: first of
    a step, then of a drift. ``total`` (...) is the sum of squares without a change.
    """

    first: npt.NDArray[np.intp]
    product: Array
    square: Array
    total: Array

    @property
    def gains(self) -> Array:
        """(..., 2, c) what each change takes away of the sum of squares."""
        return np.asarray(self.product**2 / self.square)


def candidates(values: Array, weights: Array, *, every: bool = False) -> Candidates:
    """Every change that may have begun on the second day or later.

    Parameters
    ----------
    values : (..., n) array
        In the order of the days, n at least 3.
    weights : (n,) array
        Reciprocals of their variances, up to a factor.
    every : bool
        Whether each day may be the first, those long ago too.

    Notes
    -----
    A step is 0 before its first day and 1 from then on, a drift 1, 2, 3, ... from then on. Their
    sums over the days of a change are sums from the last day backwards, done once, twice and three
    times: with m for 1, 2, 3, ..., the sum of m w is that of the sums of w, and as
    m**2 = 2 m (m + 1) / 2 - m, that of m**2 w is twice the sum of these less these.
    """
    n, all_weights = values.shape[-1], weights.sum()
    centred = values - ((weights * values).sum(-1) / all_weights)[..., None]
    first = n - (np.arange(1, n) if every else lengths(n))
    w1 = _backwards(weights)
    w2 = _backwards(w1)
    w3 = 2 * _backwards(w2) - w2
    x1 = _backwards(weights * centred)
    x2 = _backwards(x1)
    product = np.stack([x1[..., first], x2[..., first]], axis=-2)
    square = np.stack(
        [w1[first] - w1[first] ** 2 / all_weights, w3[first] - w2[first] ** 2 / all_weights]
    )
    return Candidates(first, product, square, (weights * centred**2).sum(-1))


def lengths(n: int) -> npt.NDArray[np.intp]:
    """Days for which a change may have lasted on the n-th day, n - 1 at most."""
    far = int(np.ceil(np.log(max(n / SINGLY, 1.0)) / np.log(FARTHER))) + 1
    grown = SINGLY * FARTHER ** np.arange(1, far + 1)
    found = np.concatenate([np.arange(1, SINGLY + 1), grown.astype(int)])
    return np.unique(np.minimum(found, n - 1))


def _backwards(values: Array) -> Array:
    """Sums from each place to the end."""
    return np.asarray(np.cumsum(values[..., ::-1], axis=-1)[..., ::-1])


def evidence(values: Array, weights: Array) -> Array:
    """How sure it is that the values have changed, by the likeliest change of all.

    Parameters
    ----------
    values : (..., n) array
        In the order of the days.
    weights : (n,) array
        Reciprocals of their variances, up to a factor.

    Returns
    -------
    (...) array
        The normal score whose two tails have the probability of Student's t of that change, its
        first day taken as known; 0 where all values are the same.

    Notes
    -----
    The likelihood ratio of one change against none, mean and variance being unknown (Hawkins, Qiu
    and Kang 2003, "The changepoint model for statistical process control"), here with drifts
    beside steps. Of values without change its distribution depends on their number alone, so that
    limits hold whatever the mean and the variance, and however few days they are known from.
    """
    n = values.shape[-1]
    found = candidates(values, weights)
    best = found.gains.max((-2, -1))
    nothing = found.total <= weights.sum() * (SAME * (1 + np.abs(values).max(-1))) ** 2
    share = np.where(nothing, 0.0, best / np.where(nothing, 1.0, found.total))
    left = np.maximum(1 - share, SAME)
    t = np.sqrt(share / left * (n - 2))
    tail = np.maximum(special.stdtr(n - 2, -t), np.finfo(float).tiny)
    return np.asarray(-special.ndtri(tail))


def likeliest(values: Array, weights: Array, confidence: float = 0.95) -> Change:
    """What change the days up to the last tell, as a mixture of all that may have been.

    Parameters
    ----------
    values, weights : (n,) array
        As for `evidence`; n at least 4.
    confidence : float
        Of the intervals.

    Notes
    -----
    Each change has the weight of its likelihood, the variance being unknown: its sum of squares to
    the power -n/2. All have the same number of unknowns. Size and interval are those of the
    mixture, so that they allow for not knowing when it began, and whether it is a step or a drift.
    """
    n = len(values)
    found = candidates(values, weights, every=True)
    floor = SAME * max(float(found.total), np.finfo(float).tiny)
    left = np.maximum(found.total - found.gains, floor)
    logs = -n / 2 * np.log(left)
    logs[1, found.first == n - 1] = -np.inf  # one day is a step and a drift alike
    chances = np.exp(logs - logs.max())
    chances /= chances.sum()
    one = found.product / found.square
    days = np.stack([np.ones(len(found.first)), n - found.first])
    variances = left / (n - 2) / found.square
    size, spread = _mixture(chances, one * days, variances * days**2)
    half = float(special.stdtrit(n - 2, (1 + confidence) / 2)) * spread
    drift = float(chances[1].sum())
    kind: Kind = "drift" if drift > 0.5 else "step"
    by_day = chances.sum(0)
    order = np.argsort(found.first)
    rising = np.cumsum(by_day[order])
    tail = (1 - confidence) / 2
    low, high = np.searchsorted(rising, [tail, 1 - tail])
    places = found.first[order]
    row = chances[int(kind == "drift")]
    return Change(
        noticed=n - 1,
        began=int(found.first[row.argmax()]),
        began_low=int(places[low]),
        began_high=int(places[min(high, len(places) - 1)]),
        kind=kind,
        drift=drift,
        size=size,
        low=size - half,
        high=size + half,
        per_day=_mixture(chances[1], one[1], variances[1])[0] if kind == "drift" else np.nan,
    )


def is_one_drift(values: Array, weights: Array, since: int) -> bool:
    """Whether one drift explains the values as well as one that changes once more.

    Parameters
    ----------
    values, weights : (n,) array
        As for `evidence`; the days before the drift are in it.
    since : int
        The first day on which level and slope may have changed once more.

    Notes
    -----
    The F test of two more unknowns, for the likeliest day of a second change and times the number
    of such days (Bonferroni). The first day of the single drift is chosen, too, which favours that
    it is one: what is told twice has to differ.
    """
    n = len(values)
    found = candidates(values, weights, every=True)
    first = int(found.first[found.gains[1].argmax()])
    days = np.arange(n)
    line = np.stack([np.ones(n), np.maximum(days - first + 1, 0)], axis=1)
    alone = _left(line, values, weights)
    kinks = range(max(since, 1), n)
    left = min(
        _left(np.column_stack([line, days >= day, np.maximum(days - day, 0)]), values, weights)
        for day in kinks
    )
    free = n - 4
    if free < 1 or alone <= left:
        return True
    test = (alone - left) / 2 / max(left / free, np.finfo(float).tiny)
    return bool(special.fdtrc(2, free, test) * len(kinks) > ONE_LINE)


def _left(unknowns: Array, values: Array, weights: Array) -> float:
    """Weighted sum of squares that the best combination of unknowns leaves."""
    root = np.sqrt(weights)
    solved, *_ = np.linalg.lstsq(unknowns * root[:, None], values * root, rcond=None)
    return float(weights @ (values - unknowns @ solved) ** 2)


def _mixture(chances: Array, means: Array, variances: Array) -> tuple[float, float]:
    """Mean and standard deviation of a mixture."""
    chances = chances / chances.sum()
    mean = float((chances * means).sum())
    return mean, float(np.sqrt((chances * (variances + (means - mean) ** 2)).sum()))
