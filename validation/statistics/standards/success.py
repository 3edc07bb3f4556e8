"""Probability of success with its confidence, as tests of vehicles state it."""

from typing import NamedTuple

import numpy as np
from scipy import special


class Success(NamedTuple):
    """So many of n trials succeeded; ``low`` is the probability that is shown.

    ``needed`` is how many trials without a failure would show ``goal``.
    """

    n: int
    successes: int
    share: float
    low: float
    confidence: float
    goal: float
    needed: int


def success(n: int, successes: int, confidence: float = 0.95, goal: float = 0.95) -> Success:
    """Lower bound of the probability of success, after n independent trials.

    Parameters
    ----------
    n, successes : int
        Trials, and those of them that succeeded.
    confidence : float
        One-sided, of the bound.
    goal : float
        Probability that somebody asks for.

    Raises
    ------
    ValueError
        If the successes are not between 0 and n, or there is no trial.

    Notes
    -----
    Clopper and Pearson (1934), one-sided: the p for which so many successes or more have the
    probability 1 - confidence, a quantile of a beta distribution. ASTM F3499 (docking of A-UGVs)
    and F3244 (navigation) state results so: the probability of success at a confidence level,
    from the number of repetitions and of failures.
    """
    if n < 1 or not 0 <= successes <= n:
        raise ValueError(f"{successes} successes of {n} trials")
    low = 0.0
    if successes:
        low = float(special.betaincinv(successes, n - successes + 1, 1 - confidence))
    needed = int(np.ceil(np.log1p(-confidence) / np.log(goal)))
    return Success(n, successes, successes / n, low, confidence, goal, needed)
