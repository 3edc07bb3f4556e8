"""Spread of numbers of which some are gross errors."""

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array

SIGMA_OF_MEDIAN = 1.482602218505602
"""Standard deviation of a normal variable over the median of its size."""


def sigma_from_median(values: npt.ArrayLike, axis: int | None = None) -> Array:
    """Standard deviation of values about zero, from the median of their sizes.

    Parameters
    ----------
    values : array_like
        Residuals; up to nearly half of them may be gross errors.
    axis : int, optional
        Along which; all of them if not given.
    """
    return np.asarray(SIGMA_OF_MEDIAN * np.median(np.abs(np.asarray(values)), axis=axis))
