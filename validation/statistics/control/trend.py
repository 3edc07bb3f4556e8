"""The trend of a number over the days, with the scatter from day to day in its interval."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import special

from validation.statistics.control.charts import day_to_day


class Trend(NamedTuple):
    """Change of a number per day, with its interval; NaN where it cannot be told."""

    per_day: float
    low: float
    high: float


UNKNOWN = Trend(np.nan, np.nan, np.nan)


def trend(
    days: npt.ArrayLike, values: npt.ArrayLike, sigmas: npt.ArrayLike, confidence: float = 0.95
) -> Trend:
    """The slope of a straight line through the days.

    Parameters
    ----------
    days : (n,) array_like
        When, in days.
    values, sigmas : (n,) array_like
        The number of each day, and its standard deviation by the day alone.
    confidence : float
        Of the interval.

    Notes
    -----
    Least squares, weighted by the variance of the day and that from day to day together; the size
    of both is that of the residuals, and the interval Student's with n - 2 degrees of freedom.
    """
    at, x, s = (np.asarray(one, dtype=float) for one in (days, values, sigmas))
    n = len(x)
    if n < 3 or np.ptp(at) <= 0:
        return UNKNOWN
    variances = day_to_day(x, s) + s**2
    w = 1 / variances if variances.min() > 0 else np.ones(n)
    z, y = at - w @ at / w.sum(), x - w @ x / w.sum()
    square = float(w @ z**2)
    slope = float(w @ (z * y)) / square
    sigma = np.sqrt(float(w @ (y - slope * z) ** 2) / (n - 2) / square)
    half = float(special.stdtrit(n - 2, (1 + confidence) / 2) * sigma)
    return Trend(slope, slope - half, slope + half)
