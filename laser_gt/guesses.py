"""How good the guesses were, by what the accepted matches say."""

from collections.abc import Sequence

import numpy as np

from laser_gt.judgement import Match
from validation.angles import Array, wrap

FEWEST = 10
"""Accepted matches below which nothing is said."""

_NORMAL = 1.482602218505602
"""Standard deviation of a normal variable over the median of its size."""


def guess_growth(apart: int) -> float:
    """Factor by which a guess is worse than that from one stop to the next, as errors add up."""
    return float(min(np.sqrt(max(apart, 1)), 5.0))


def guess_scatter(matches: Sequence[Match], growth: Sequence[float] | None = None) -> Array | None:
    """Standard deviations of the guesses about the accepted matches.

    Parameters
    ----------
    matches : sequence of Match
        Judged; only the accepted count.
    growth : sequence of float, optional
        Factor by which the guess of each was expected to be worse than the best, 1 if not given.

    Returns
    -------
    (2,) array or None
        Metres in x and y each, and radians, of a guess with factor 1; None where fewer than ten
        matches are accepted.

    Notes
    -----
    From medians, so that a few wild guesses do not count. The accepted are the easier ones, and a
    guess that is far off is less likely to be among them: take it for a lower bound.
    """
    accepted = np.array([one.verdict == "accept" for one in matches], dtype=bool)
    if accepted.sum() < FEWEST:
        return None
    off = np.array([one.pose - one.guess for one in matches])[accepted]
    off[:, 2] = wrap(off[:, 2])
    if growth is not None:
        off /= np.asarray(growth, dtype=float)[accepted, None]
    x, y, theta = _NORMAL * np.median(np.abs(off), axis=0)
    return np.array([np.hypot(x, y) / np.sqrt(2), theta])
