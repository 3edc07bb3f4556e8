"""Long series as a screen shows them: no more points than it has places for."""

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array

PLACES = 1000
"""Along a figure: one of 7 inches has no more on a screen."""


def rows_shown(values: Array, places: int = PLACES) -> npt.NDArray[np.intp]:
    """Rows of a series that look on a screen as all of it does.

    Parameters
    ----------
    values : (n,) or (n, k) array
        In order of time.
    places : int
        Along the figure.

    Returns
    -------
    (m,) array of int
        Rising: the first and the last of each stretch that falls on one place, and the least and
        the greatest of each column there, so that no peak is lost. All where there are few.
    """
    columns = np.atleast_2d(np.asarray(values, dtype=float).T)
    n = columns.shape[1]
    if n <= 2 * (1 + len(columns)) * places:
        return np.arange(n)
    starts = np.linspace(0, n, places + 1).astype(np.intp)
    rows = [starts[:-1], starts[1:] - 1]
    length = int(np.diff(starts).max())
    # The last of a short stretch stands again where it has fewer than the longest.
    at = np.minimum(starts[:-1, None] + np.arange(length), starts[1:, None] - 1)
    for column in columns:
        there = column[at]
        rows += [at[np.arange(places), pick(there, axis=1)] for pick in (np.argmin, np.argmax)]
    return np.unique(np.concatenate(rows))
