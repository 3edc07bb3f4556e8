"""Weights that leave good steps alone and take false fixes out."""

from functools import cache

import numpy as np
from scipy import special

from validation.poses.angles import Array


def redescending_weights(mahalanobis: Array, dof: float, widen: float = 1.0) -> Array:
    """Weights (t,) of steps from their squared Mahalanobis distances.

    Parameters
    ----------
    mahalanobis : (t,) array
        Squared distances, chi-squared with ``dof`` degrees of freedom for good steps.
    dof : float
        Degrees of freedom.
    widen : float
        Factor on both limits; larger than 1 in early iterations.

    Notes
    -----
    1 up to the 99 % point, then falling to 0 at twice that distance. The flat top keeps the
    estimate unbiased and nearly efficient where there is nothing to reject.
    """
    start = widen * np.sqrt(special.chdtri(dof, 0.01))
    share = np.clip((2 * start - np.sqrt(mahalanobis)) / start, 0.0, 1.0)
    return np.asarray(share**2)


@cache
def expected_weighted_square(dof: float) -> float:
    """Weighted mean of chi-squared values over their degrees of freedom, slightly below 1.

    A variance from weighted residuals has to be divided by it.
    """
    grid = np.linspace(0.0, 4 * float(special.chdtri(dof, 0.01)), 20001)
    middle = (grid[1:] + grid[:-1]) / 2
    mass = np.diff(special.chdtr(dof, grid)) * redescending_weights(middle, dof)
    return float(mass @ middle / mass.sum() / dof)


def autocorrelation_time(series: Array) -> float:
    """How many steps one independent step is worth, at least 1.

    Parameters
    ----------
    series : (t, k) array
        Residuals of k kinds in order of time, equally spaced as far as possible.

    Notes
    -----
    1 + 2 sum of autocorrelations up to Sokal's window (five times the time itself), averaged
    over the kinds. For white noise it is 1 within a few percent.
    """
    t = len(series)
    centred = series - series.mean(0)
    power = np.square(centred).mean()
    if t < 8 or power <= 0:
        return 1.0
    size = 2 ** int(np.ceil(np.log2(2 * t)))
    spectrum = np.fft.rfft(centred, size, axis=0)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2, size, axis=0)[: t // 2].mean(1) / (t * power)
    summed = 2 * np.cumsum(correlation) - 1
    lags = np.arange(len(summed))
    inside = np.flatnonzero(lags >= 5 * summed)
    return float(max(summed[inside[0]] if len(inside) else summed[-1], 1.0))
