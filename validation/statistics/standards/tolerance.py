"""Tolerance intervals: what a stated share of all errors stays below, with a stated confidence."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import special

from validation.poses.angles import Array

NODES = 64
"""Of the integral over the mean: with twice as many, factors of 3 to 1,000 values change by less
than 1e-9."""
REACH = 9.0
"""Standard deviations of the mean over which is integrated; beyond lies a share of 2e-19."""
FEWEST = 3
"""Values below which a normal factor is above 19: nobody can use it."""
NOT_NORMAL = 0.05
"""Level of the test for normal errors, as of all others."""


def one_sided_factor(n: float, content: float = 0.95, confidence: float = 0.95) -> float:
    """The k with which ``mean + k s`` is above a share of a normal population, with confidence.

    Parameters
    ----------
    n : float
        Independent values of which mean and standard deviation s (n - 1) are; of dependent ones
        their effective number. NaN below 2.
    content : float
        Share of the population, above one half.
    confidence : float
        Probability with which at least so large a share is below.

    Notes
    -----
    Exact: the quantile of a noncentral t distribution with n - 1 degrees of freedom and the
    noncentrality ``z sqrt(n)``, over ``sqrt(n)``, with the normal quantile z of the content.
    ISO 16269-6:2014, annex; Hahn and Meeker, Statistical Intervals (1991), section 4.6.
    """
    if n < 2:
        return float("nan")
    shift = float(special.ndtri(content) * np.sqrt(n))
    return float(special.nctdtrit(n - 1, shift, confidence) / np.sqrt(n))


@lru_cache(maxsize=256)
def two_sided_factor(n: float, content: float = 0.95, confidence: float = 0.95) -> float:
    """The k with which ``mean +- k s`` holds a share of a normal population, with confidence.

    Parameters
    ----------
    n, content, confidence
        As for `one_sided_factor`.

    Notes
    -----
    Exact, by integrating over the error z of the mean (normal, variance 1 / n): the interval holds
    the share if ``k s`` is at least r(z), whose square is the quantile of a noncentral chi-squared
    with one degree of freedom and the noncentrality z^2. Odeh and Owen, Tables for Normal
    Tolerance Limits (1980), table 3; ISO 16269-6:2014, annex D.
    """
    if n < 2:
        return float("nan")
    points, weights = _nodes()
    z = REACH * (points + 1) / 2
    weights = weights * REACH * np.exp(-np.square(z) / 2) / np.sqrt(2 * np.pi)
    squares = special.chndtrix(content, 1.0, np.square(z) / n)
    low, high = np.log(0.1), np.log(1e4)
    for _ in range(60):
        middle = (low + high) / 2
        held = weights @ special.chdtrc(n - 1, (n - 1) * squares * np.exp(-2 * middle))
        low, high = (middle, high) if held < confidence else (low, middle)
    return float(np.exp(high))


@lru_cache(maxsize=1)
def _nodes() -> tuple[Array, Array]:
    """Points and weights on (-1, 1)."""
    points, weights = np.polynomial.legendre.leggauss(NODES)
    return points, weights


class FreeBound(NamedTuple):
    """A bound from the order of the values alone.

    ``bound`` is NaN where too few values are there for the confidence asked for; ``largest`` is
    the largest value and ``reached`` the confidence with which it is a bound.
    """

    bound: float
    largest: float
    reached: float


def free_bound(values: npt.ArrayLike, content: float = 0.95, confidence: float = 0.95) -> FreeBound:
    """What a share of all values stays below, whatever their distribution.

    Parameters
    ----------
    values : (n,) array_like
        Independent, of one continuous distribution: sizes of errors, say. At least one.
    content, confidence : float
        Share of the population, and with which probability.

    Notes
    -----
    The value of rank r is above the share p if at most r - 1 of n values fall below the
    quantile: a binomial probability. The largest reaches the confidence ``1 - p^n``, so that it
    takes 59 values for 95 % with 95 %. Wilks (1941); ISO 16269-6:2014, section 6.
    """
    ordered = np.sort(np.asarray(values, dtype=float))
    n = len(ordered)
    below = special.bdtr(np.arange(n), n, content)
    rank = int(np.searchsorted(below, confidence))
    bound = float(ordered[rank]) if rank < n else float("nan")
    return FreeBound(bound, float(ordered[-1]), float(1 - content**n))


def fewest_values(content: float = 0.95, confidence: float = 0.95) -> int:
    """How many values it takes for their largest to be a bound: 59 for 95 % with 95 %."""
    return int(np.ceil(np.log1p(-confidence) / np.log(content)))


def normality_p_value(values: npt.ArrayLike) -> float:
    """Probability of so crooked a normal plot, if the values were normal; NaN below 5 values.

    Parameters
    ----------
    values : (n,) array_like
        Independent.

    Notes
    -----
    Shapiro and Francia (1972) with Royston's transformation (1993, "A pocket-calculator algorithm
    for the Shapiro-Francia test for non-normality"), for 5 to 5,000 values; more are thinned.
    """
    ordered = np.sort(np.asarray(values, dtype=float))
    ordered = ordered[:: -(-len(ordered) // 5000)] if len(ordered) else ordered
    n = len(ordered)
    if n < 5 or np.ptp(ordered) == 0:
        return float("nan")
    scores = special.ndtri((np.arange(1, n + 1) - 0.375) / (n + 0.25))
    lost = max(1 - float(np.corrcoef(ordered, scores)[0, 1]) ** 2, 1e-300)
    u = np.log(n)
    v = np.log(u)
    centre, spread = -1.2725 + 1.0521 * (v - u), 1.0308 - 0.26758 * (v + 2 / u)
    return float(special.ndtr(-(np.log(lost) - centre) / spread))


class Tolerance(NamedTuple):
    """What errors of one kind stay below.

    Parameters
    ----------
    name, unit : str
        'x', 'position', ...; 'm' or 'rad'.
    n, n_effective : int, float
        Errors, and independent ones that tell as much.
    factor, low, high : float
        Normal two-sided interval; NaN where it does not hold. Of the length of a position only
        ``high``.
    bound : float
        Size that the share stays below, by the normal interval; NaN where it does not hold.
    free : FreeBound
        The same from the order of the sizes alone; NaN where it does not hold.
    normality_p : float
        Of the test for normal errors.
    reason : str
        What does not hold, or only roughly, and why; empty if nothing is wrong.
    """

    name: str
    unit: str
    n: int
    n_effective: float
    factor: float
    low: float
    high: float
    bound: float
    free: FreeBound
    normality_p: float
    reason: str


def normal_tolerance(
    mean: float, std: float, n: int, effective: float, content: float, confidence: float
) -> tuple[float, float, float]:
    """Factor and both ends of a two-sided interval; of dependent values with their number.

    Parameters
    ----------
    mean, std : float
        Of the n values.
    n : int
        Number of values.
    effective : float
        Independent values that tell as much; it takes the place of n, and the standard deviation
        is made as large as that of so few values would be on average.
    content, confidence : float
        As for `two_sided_factor`.
    """
    if min(n, effective) < FEWEST or not std > 0:
        return (float("nan"),) * 3
    if effective < n:
        std = std * float(np.sqrt((1 - 1 / n) / (1 - 1 / effective)))
    factor = two_sided_factor(round(float(effective), 2), content, confidence)
    return factor, mean - factor * std, mean + factor * std


def length_bound(means: Array, lows: Array, highs: Array) -> float:
    """Length below which a share stays, from intervals of its components.

    Parameters
    ----------
    means, lows, highs : (k,) array
        Of the components; each interval leaves out a k-th part of what the length may leave
        out, and is wrong with a k-th part of its chance (Bonferroni), so the box that they make
        holds the share with the confidence, and its farthest corner bounds the length.
    """
    return float(np.linalg.norm(np.abs(means) + (highs - lows) / 2))
