"""Noise of a scanner's ranges: what is independent from beam to beam, and what neighbours share.

One scan shows the first kind only: neighbours that err alike make a smooth wall in the wrong
place. The second shows where two scans are laid over each other.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from laser_gt.scans.scan import Scan
from validation.poses.angles import Array

LAGS = 40
"""Distances in beams up to which residuals are compared. A judgement: what is shared by more than
forty neighbours, a tenth of half a turn, the pose takes up itself."""

LENGTHS = (5.0, 8.0, 16.0, 32.0)
"""Correlation lengths tried, in beams: each some twice the one before, as the sum of the
correlations is what counts, and a step of two is as well as it is known."""

FAKED = 1.5
"""Correlation length in beams of what the choice of windows fakes: the lines of independent noise
are those that fit best. Measured: up to a fifth of the variance, gone after four beams."""

FEWEST = 6
"""Pairs from which on their differences tell how well what is shared is known. A judgement: its
doubt is then known to a third of itself."""

CLEAR = 1.645
"""Standard deviations by which shared noise must be clear of none: one in twenty by chance. In
simulated rooms without any, 0.6 mm were found in the mean beside 5 mm, and covariances of poses
came out 10 % too large, of single rooms 50 %."""

CLIP = 4.0
"""Residuals beyond this many standard deviations are of other surfaces."""

SMALL_SCANNER = 6.0
"""Greatest range in metres of the small scanners that measure phase or triangulate."""

LIMITS = {"small": (0.005, 0.03), "other": (0.001, 0.05)}
"""Least and greatest standard deviation of a range, in metres. Small scanners are stated to 10 mm
up to a metre and to 1 % beyond; of others, the best are good to 1 mm, none is worse than 50 mm."""

STATED_WITHIN = 2.0
"""Factor within which the data may correct the standard deviation that is known of a scanner's
type: data sheets state it for another surface, at another distance."""


@dataclass(frozen=True)
class RangeNoise:
    """Standard deviations of a range, metres.

    Parameters
    ----------
    independent : float
        Part that differs from beam to beam.
    shared : float
        Part that neighbours share, its correlation falling as exp(-beams / length).
    length : float
        Correlation length in beams.
    """

    independent: float
    shared: float = 0.0
    length: float = 1.0

    @property
    def total(self) -> float:
        """Of both parts."""
        return float(np.hypot(self.independent, self.shared))


@dataclass(frozen=True)
class Residuals:
    """How far the ranges of a scan are off from what another scan says.

    Parameters
    ----------
    values : (n,) array
        Metres along the beam, one for each point in the order of the beams; NaN for those that
        are not compared.
    window : float
        Number of points that a line of the other scan was fitted to, typically.
    """

    values: Array
    window: float


def type_limits(scan: Scan) -> tuple[float, float]:
    """Least and greatest standard deviation that a scanner of this type may have, metres."""
    if scan.sigma is not None:
        return scan.sigma / STATED_WITHIN, scan.sigma * STATED_WITHIN
    return LIMITS["small" if scan.range_max <= SMALL_SCANNER else "other"]


def noise_from(residuals: Iterable[Residuals], limits: tuple[float, float]) -> RangeNoise | None:
    """The noise that the residuals of many pairs show together; None if there are too few.

    Parameters
    ----------
    residuals : iterable of Residuals
        Of scans by one scanner.
    limits : (float, float)
        Of the standard deviation of a range, for the scanner's type.

    Notes
    -----
    The mean product of residuals k beams apart has four parts: the point's own noise at k = 0, the
    noise that neighbours share, and both again from the line of the other scan, averaged over its
    window. For each length the variances are found by least squares without negative values, with
    one more for what the choice of windows fakes, which counts as independent. What is shared
    counts where it is clear of its own doubt, from pair to pair (jackknife): without negative
    values, noise that is independent has some of it in every second estimate.
    """
    found = [one for one in residuals if np.isfinite(one.values).any()]
    if sum(int(np.isfinite(one.values).sum()) for one in found) < 20 * LAGS:
        return None
    products, counts = (np.array(each) for each in zip(*map(_products, found), strict=True))
    window = float(np.median([one.window for one in found]))
    tries = [_fitted(products, counts, window, length) for length in LENGTHS]
    best = int(np.argmin([one.misfit for one in tries]))
    every = tries[best]
    independent, shared = every.independent, every.shared
    if len(found) >= FEWEST:
        rows = np.arange(len(found))
        left = [
            _fitted(products[rows != row], counts[rows != row], window, LENGTHS[best]).shared
            for row in rows
        ]
        doubt = np.sqrt((len(found) - 1) * np.var(left))
        if shared < CLEAR * doubt:
            independent, shared = independent + shared, 0.0
    total = float(np.sqrt(independent + shared))
    scale = float(np.clip(total, *limits)) / max(total, 1e-9)
    parts = scale * np.sqrt([independent, shared])
    return RangeNoise(float(parts[0]), float(parts[1]), LENGTHS[best])


def _products(one: Residuals) -> tuple[Array, Array]:
    """(LAGS + 1,) sums of products of residuals so many beams apart, and how many there are."""
    values = one.values
    width = CLIP * 1.4826 * float(np.nanmedian(np.abs(values)))
    kept = np.where(np.abs(values) <= width, values, 0.0)
    there = np.where(np.abs(values) <= width, 1.0, 0.0)
    size = len(values)
    products = [kept[: size - lag] @ kept[lag:] for lag in range(LAGS + 1)]
    counts = [there[: size - lag] @ there[lag:] for lag in range(LAGS + 1)]
    return np.array(products), np.array(counts)


@dataclass(frozen=True)
class _Parts:
    """Variances whose products are most like those measured, and how unlike these are."""

    independent: float
    shared: float
    misfit: float


def _fitted(products: Array, counts: Array, window: float, length: float) -> _Parts:
    """The parts of pairs, (k, LAGS + 1), for a correlation length."""
    from scipy.optimize import nnls  # noqa: PLC0415  (loaded when the noise is estimated)

    measured = products.sum(0) / np.maximum(counts.sum(0), 1)
    lag = np.arange(len(measured))
    size = max(round(window), 1)
    inside = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
    own = (lag == 0) + np.maximum(1 - lag / size, 0) / size
    averaged = float(np.exp(-inside / length).mean())
    shared = (1 + averaged) * np.exp(-lag / length)
    faked = np.exp(-lag / FAKED)
    variances, misfit = nnls(np.column_stack([own, shared, faked]), measured)
    return _Parts(float(variances[0] + variances[2]), float(variances[1]), float(misfit))


def smeared(values: Array, length: float) -> Array:
    """(k, n) sums of each value and its neighbours, each times exp(-distance / length)."""
    reach = int(np.ceil(4 * length))
    kernel = np.exp(-np.abs(np.arange(-reach, reach + 1)) / length)
    return np.stack([np.convolve(row, kernel)[reach : reach + len(row)] for row in values])
