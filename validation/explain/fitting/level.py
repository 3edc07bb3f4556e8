"""Whether errors are of the size that is stated for them."""

from collections.abc import Sequence

import numpy as np
from scipy import special

from validation.explain.fitting.fit import Fit, fit
from validation.explain.fitting.noise import DIMENSIONS
from validation.explain.fitting.observability import observability
from validation.explain.fitting.pairs import Pairs
from validation.explain.fitting.serial import joint_of, memory_of

DOUBTED = 0.05
"""Chance of such a level if stated covariances are right, below which they are not believed: one in
twenty, the level of all intervals. It costs little to estimate a level that was right, as tests and
intervals then allow for what is not known of it; but with standard deviations half as large as the
errors, a cause was invented in 40 % of 60 clean tables of 20 poses."""
SMALL = 0.5
"""Times what is stated, above which errors that are small are left so: covariances that are twice
too large hide little."""
SURELY = float(np.log(20.0))
"""Log of the odds from which on what is left is taken for errors that last: one in twenty, the
level of all intervals. With even odds, white errors had some in one of ten tables, and a constant
frame beside covariances five times too large was called a drift in 8 of 67."""
FEWEST_FREE = 8
"""Degrees of freedom from which on a level is estimated: its standard deviation is then a quarter
of itself or less."""


def contradicts(fits: Sequence[Fit], pairs: Pairs) -> bool:
    """Whether what the largest explanation leaves is of another size than stated.

    Parameters
    ----------
    fits : sequence of Fit
        Of all explanations, with the noise as stated.
    pairs : Pairs
        What they were fitted to. Where poses share errors, what is left of them says little of
        their level, and nothing is doubted.

    Notes
    -----
    A level of s times the stated one over m degrees of freedom has the log likelihood ratio
    m (s^2 - 1 - log s^2) / 2, for positions and headings each; twice their sum is chi-squared with
    two degrees of freedom. The level is that of the robust fit, so that wrong poses do not count.
    Levels between `SMALL` and 1 count as 1. What lasts over a table goes into its frame and mount,
    and what is left of it looks small: where that still has a memory, no level is too small. Of 20
    poses with a correlation of 0.95, half of whose tables state covariances, a cause was invented
    in 6 % of 600 before that was asked.
    """
    if not pairs.stated or pairs.between is not None:
        return False
    whole = [one for one in fits if observability(one).complete]
    if not whole:
        return False
    largest = max(whole, key=lambda one: (len(one.model.parameters), float(one.log_likelihood[0])))
    count, taken = DIMENSIONS * len(pairs), len(largest.model.parameters)
    free = count * (1 - taken / count.sum())
    if free.sum() < FEWEST_FREE:
        return False
    found = fit(pairs, largest.model, estimate_scale=True)
    square = np.square(found.scale[0]) * count / free
    small = square < SMALL**2
    if small.any() and _lasts(pairs, largest):
        small[:] = False
    counts = (square > 1) | small
    gain = float((counts * free * (square - 1 - np.log(square))).sum())
    return bool(special.chdtrc(2, gain) < DOUBTED)


def _lasts(pairs: Pairs, found: Fit) -> bool:
    """Whether what is left of errors has a memory, beyond doubt."""
    kinds = memory_of(pairs, found)
    return kinds is not None and joint_of(kinds) > SURELY
