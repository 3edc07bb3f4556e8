"""Noise that neighbours share: a first-order process with white noise beside it.

All is exact for stamps at any distance, with cells left out, in time that grows with their number:
the inverse covariance of the slow part is tridiagonal (Rue and Held, Gaussian Markov Random Fields,
2005, section 1.2).
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import optimize
from scipy.linalg import cho_solve_banded, cholesky_banded

from validation.poses.angles import Array

Mask = npt.NDArray[np.bool_]

START_TIMES = (0.3, 1.5, 8.0)
"""Correlation times in seconds at which the search for the likeliest noise begins, each with half
of the variance slow: steps of a factor of five, within which the likelihood has one summit."""
LONGEST = 0.25
"""Longest correlation time, in lengths of the record. A longer one looks like a drift of the pose,
which is a cause of its own."""
SMALLEST_SHARE = 1e-3
"""Least share of either part of the noise, so that both stay defined."""


@dataclass(frozen=True)
class Noise:
    """Noise of one kind of cells.

    Parameters
    ----------
    white, slow : float
        Standard deviations of the part that is new in each pose and of that which lasts; metres or
        radians.
    correlation_time : float
        Seconds in which the slow part loses 63 % of its memory.
    """

    white: float
    slow: float
    correlation_time: float

    @property
    def sigma(self) -> float:
        """Of one pose."""
        return float(np.hypot(self.white, self.slow))


class Whitener:
    """Products with the inverse covariance of a series.

    Parameters
    ----------
    times : (n,) array
        Seconds, increasing.
    used : (n,) array of bool
        Cells that count; the others are not observed.
    noise : Noise
        Of the cells.
    """

    def __init__(self, times: Array, used: Mask, noise: Noise) -> None:
        memory = np.exp(-np.diff(times) / noise.correlation_time)
        fresh = -np.expm1(-2 * np.diff(times) / noise.correlation_time)
        band = np.ones((2, len(times)))
        # A step adds memory^2 / fresh to the places at its two ends, beside the 1 of every place.
        band[1, :-1] += memory**2 / fresh
        band[1, 1:] += memory**2 / fresh
        band[0, 0], band[0, 1:] = 0.0, -memory / fresh
        band /= noise.slow**2
        log_slow = float(np.log(fresh).sum()) + 2 * len(times) * np.log(noise.slow)
        self.weights = np.where(used, 1 / noise.white**2, 0.0)
        band[1] += self.weights
        self._factor = cholesky_banded(band, check_finite=False)
        inner = 2 * float(np.log(self._factor[1]).sum())
        self.log_determinant = inner + log_slow + 2 * int(used.sum()) * np.log(noise.white)

    def slow_part(self, values: Array) -> Array:
        """(n, ...) likeliest slow part of values."""
        flat = (self.weights[:, None] * values.reshape(len(values), -1)).astype(float)
        solved = cho_solve_banded((self._factor, False), flat, check_finite=False)
        return np.asarray(solved.reshape(values.shape))

    def __call__(self, values: Array) -> Array:
        """(n, ...) inverse covariance times values; zero where not used."""
        left = values - self.slow_part(values)
        return np.asarray(left * self.weights.reshape(-1, *[1] * (values.ndim - 1)))


def estimate_noise(times: Array, used: Mask, residuals: Array, slopes: Array) -> Noise:
    """The noise that makes residuals likeliest, after what a fit has taken from them.

    Parameters
    ----------
    times : (n,) array
        Seconds.
    used : (n,) array of bool
        Cells that count.
    residuals : (n, c) array
        Of c components that have the same noise, x and y for example.
    slopes : (n, c, k) array
        Their derivatives by all that was fitted.

    Notes
    -----
    Restricted maximum likelihood (Patterson and Thompson 1971): the fit has taken away the slowest
    part of the noise, and is given back its degrees of freedom.
    """
    basis = _basis(slopes, used)
    sizes = np.sqrt(np.mean(residuals[used] ** 2)) or 1e-12
    step = float(np.median(np.diff(times)))
    low, high = np.log(step / 3), np.log(max(LONGEST * (times[-1] - times[0]), step))
    edge = np.log(1 / SMALLEST_SHARE)

    def shape(point: Array) -> Noise:
        tau = float(np.exp(np.clip(point[0], low, high)))
        share = 1 / (1 + np.exp(-np.clip(point[1], -edge, edge)))
        return Noise(sizes * np.sqrt(1 - share), sizes * np.sqrt(share), tau)

    def cost(point: Array) -> float:
        beyond = max(low - point[0], point[0] - high, abs(point[1]) - edge, 0.0)
        return _restricted(times, used, residuals, basis, shape(point))[0] + 10 * float(beyond) ** 2

    starts = [np.array([np.clip(np.log(tau), low, high), 0.0]) for tau in START_TIMES]
    best = min(starts, key=cost)
    simplex = best + np.array([[0.0, 0.0], [0.8, 0.0], [0.0, 0.8]])
    options = {"initial_simplex": simplex, "xatol": 0.05, "fatol": 0.02, "maxfev": 60}
    found = optimize.minimize(cost, best, method="Nelder-Mead", options=options)
    noise = shape(found.x)
    factor = np.sqrt(_restricted(times, used, residuals, basis, noise)[1])
    return Noise(noise.white * factor, noise.slow * factor, noise.correlation_time)


def _basis(slopes: Array, used: Mask) -> Array:
    """(n, c, r) independent columns that span the slopes."""
    flat = np.where(used[:, None, None], slopes, 0.0).reshape(-1, slopes.shape[2])
    size = np.linalg.norm(flat, axis=0)
    flat = flat[:, size > 0] / size[size > 0]
    if not flat.shape[1]:
        return np.zeros((*slopes.shape[:2], 0))
    vectors, values, _ = np.linalg.svd(flat, full_matrices=False)
    kept = vectors[:, values > 1e-7 * values[0]]
    return np.asarray(kept.reshape(*slopes.shape[:2], -1))


def _restricted(
    times: Array, used: Mask, residuals: Array, basis: Array, noise: Noise
) -> tuple[float, float]:
    """Minus twice the log likelihood with the likeliest variance, and that variance's factor."""
    whiten = Whitener(times, used, noise)
    weighed = whiten(basis)
    information = np.einsum("ncj,nck->jk", basis, weighed)
    rest = np.einsum("nck,nc->k", weighed, residuals)
    squares = float(np.sum(residuals * whiten(residuals)))
    squares -= float(rest @ np.linalg.solve(information, rest))
    freedom = int(used.sum()) * residuals.shape[1] - basis.shape[2]
    factor = max(squares, 1e-300) / freedom
    log_determinant = residuals.shape[1] * whiten.log_determinant
    log_determinant += float(np.linalg.slogdet(information)[1])
    return float(freedom * np.log(factor) + log_determinant), factor


def effective_number(times: Array, used: Mask, noise: Noise) -> float:
    """Independent poses that would tell a mean as well as these do."""
    ones = np.ones(len(times))
    return float(noise.sigma**2 * (ones @ Whitener(times, used, noise)(ones)))
