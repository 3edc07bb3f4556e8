"""Angles on the circle, in radians."""

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def wrap(angle: npt.ArrayLike) -> Array:
    """The same angle in (-pi, pi].

    Parameters
    ----------
    angle : (...) array_like
        Radians.

    Returns
    -------
    (...) array
        Radians in (-pi, pi].
    """
    return np.pi - np.mod(np.pi - np.asarray(angle, dtype=float), 2 * np.pi)


def circular_mean(angle: npt.ArrayLike, axis: int = -1) -> Any:
    """Direction of the mean of unit vectors, which no choice of the wrapping point changes.

    Parameters
    ----------
    angle : (..., n) array_like
        Radians.
    axis : int
        Axis averaged over.

    Returns
    -------
    (...) array
        Radians in (-pi, pi]; NaN where the vectors cancel and the mean has no direction.

    Notes
    -----
    Mardia and Jupp, Directional Statistics (2000), section 2.2.
    """
    angle = np.asarray(angle, dtype=float)
    sine, cosine = np.sin(angle).mean(axis), np.cos(angle).mean(axis)
    length = np.hypot(sine, cosine)
    return np.where(length > 1e-12, np.arctan2(sine, cosine), np.nan)[()]


def mean_angle(angle: npt.ArrayLike, axis: int = -1) -> Any:
    """Mean on the circle: the arithmetic mean, counted from the circular mean.

    Parameters
    ----------
    angle : (..., n) array_like
        Radians.
    axis : int
        Axis averaged over.

    Returns
    -------
    (...) array
        Radians in (-pi, pi]; NaN where the circular mean has no direction.

    Notes
    -----
    Where all angles lie within pi of the circular mean this is the intrinsic mean, the point
    with the least sum of squared wrapped deviations. Angles that stay within half a circle
    give their arithmetic mean, as printed in AD2.3, which the circular mean itself does not:
    the sine pulls large deviations in. No choice of the wrapping point changes either.
    """
    angle = np.asarray(angle, dtype=float)
    centre = np.expand_dims(circular_mean(angle, axis), axis)
    return wrap(centre.squeeze(axis) + wrap(angle - centre).mean(axis))[()]
