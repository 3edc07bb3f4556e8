"""How sure a change has to be to be noticed: limits by the wanted rate of false alarms."""

from functools import lru_cache

import numpy as np
from scipy import interpolate

FIRST = 5
"""Days from which on a change is noticed: with fewer, three cannot tell mean and scatter, and what
a change is beside them."""
RATES = (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4, 6e-5, 3e-5)
"""Shares of the days without change that are noticed, for which there are limits."""
NUMBERS = (5, 6, 8, 10, 14, 19, 27, 40, 60)
"""Days since a chart began, likewise; later they are those of the last."""
LIMITS = (
    (3.445, 3.464, 3.468, 3.439, 3.405, 3.370, 3.342, 3.322, 3.309),
    (3.628, 3.651, 3.670, 3.653, 3.630, 3.593, 3.570, 3.547, 3.537),
    (3.800, 3.842, 3.863, 3.853, 3.834, 3.802, 3.783, 3.762, 3.750),
    (3.977, 4.017, 4.031, 4.041, 4.025, 4.005, 3.981, 3.961, 3.943),
    (4.130, 4.182, 4.192, 4.213, 4.210, 4.189, 4.170, 4.151, 4.153),
    (4.291, 4.358, 4.363, 4.398, 4.394, 4.363, 4.342, 4.336, 4.328),
    (4.450, 4.482, 4.520, 4.566, 4.558, 4.542, 4.518, 4.518, 4.519),
    (4.607, 4.638, 4.656, 4.713, 4.723, 4.721, 4.700, 4.687, 4.690),
)
"""Evidence that so many of a thousand, of a hundred thousand days exceed, of normal values without
change of which none was noticed before: a row for each rate, a column for each number of days.
By `benchmarks/day_limits.py`, a million series; their own uncertainty is 0.01 at the rate of 1e-3,
0.03 at that of 3e-5. Series of 400 days have limits of 0.02 less at their end than at the 60th."""


def limit(rate: float, number: int) -> float:
    """The evidence that is exceeded on the given share of days without change.

    Parameters
    ----------
    rate : float
        Of false alarms, a day and chart. For a smaller one than the least of the table the limit
        goes on as the tail of a normal value does; for a larger one it is that of the largest.
    number : int
        Days since the chart began, `FIRST` at least.

    Notes
    -----
    The rate is held on every day anew, whatever the number of days, so that the time to a false
    alarm has a geometric distribution: its mean is one over the rate.
    """
    return _between(rate, min(number, NUMBERS[-1]))


@lru_cache(maxsize=1024)
def _between(rate: float, number: int) -> float:
    """The limit from those of the table around it."""
    column = [float(np.interp(np.log(number), np.log(NUMBERS), row)) for row in LIMITS]
    # The square of a normal score falls with the logarithm of its tail, nearly on a line.
    logs, squares = -np.log(RATES), np.square(column)
    found = interpolate.make_interp_spline(logs, squares, k=1)(max(-np.log(rate), logs[0]))
    return float(np.sqrt(found))
