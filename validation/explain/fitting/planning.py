"""How many poses it takes to show a given accuracy."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy import special

from validation.errors import GtvalError
from validation.poses.angles import Array

MOST = 2000
"""Poses beyond which a plan is no plan. A judgement: a stop takes minutes, 2000 take a month."""


def poses_for_bias(
    sigma: float, limit: float, *, bias: float = 0.0, confidence: float = 0.95, power: float = 0.9
) -> int:
    """Number of poses with which 'the bias is below d' is shown with the given chance.

    Parameters
    ----------
    sigma : float
        Expected standard deviation of the errors.
    limit : float
        The d, same unit.
    bias : float
        Expected true bias; below d.
    confidence : float
        Of the statement.
    power : float
        Chance that the campaign succeeds in showing it.

    Raises
    ------
    GtvalError
        If no number of poses can show it.

    Notes
    -----
    Two one-sided t-tests; each fails with a probability given by the noncentral t distribution,
    and the sum of both bounds the chance that either fails (Julious (2004), "Sample sizes for
    clinical trials with normal data", section 5).
    """
    if sigma <= 0 or limit <= abs(bias):
        raise GtvalError(
            f"a bias of {bias:g} cannot be shown to be below {limit:g}; the limit must be larger "
            "than the bias, and sigma positive"
        )

    def chance(n: npt.NDArray[np.intp]) -> Array:
        critical = special.stdtrit(n - 1, confidence)
        shift = np.sqrt(n) / sigma
        fails = special.nctdtr(n - 1, np.minimum((limit - bias) * shift, 300.0), critical)
        fails = fails + special.nctdtr(n - 1, np.minimum((limit + bias) * shift, 300.0), critical)
        return np.asarray(1 - fails, dtype=float)

    return _first(chance, power, "bias")


def poses_for_deviation(
    sigma: float, limit: float, *, confidence: float = 0.95, power: float = 0.9
) -> int:
    """Number of poses with which 'the standard deviation is below d' is shown.

    Parameters
    ----------
    sigma, limit, confidence, power
        As for `poses_for_bias`; sigma must be below the limit.

    Raises
    ------
    GtvalError
        If no number of poses can show it.
    """
    if not 0 < sigma < limit:
        raise GtvalError(f"a standard deviation of {sigma:g} cannot be shown to be below {limit:g}")

    def chance(n: npt.NDArray[np.intp]) -> Array:
        critical = special.chdtri(n - 1, confidence)
        return np.asarray(special.chdtr(n - 1, critical * (limit / sigma) ** 2), dtype=float)

    return _first(chance, power, "deviation")


def _first(chance: Callable[[npt.NDArray[np.intp]], Array], power: float, what: str) -> int:
    """The least n with the wanted chance, searched in blocks, as most plans are short."""
    start, size = 2, 4
    while start <= MOST:
        n = np.arange(start, min(start + size, MOST + 1))
        enough = n[chance(n) >= power]
        if enough.size:
            return int(enough[0])
        start, size = start + size, 2 * size
    raise GtvalError(f"more than {MOST} poses would be needed to show the {what}")
