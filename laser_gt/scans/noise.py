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
    one more for what the choice of windows fakes, which counts as independent.
    """
    found = list(residuals)
    products, counts = np.zeros(LAGS + 1), np.zeros(LAGS + 1)
    if not found or sum(int(np.isfinite(one.values).sum()) for one in found) < 20 * LAGS:
        return None
    for one in found:
        values = one.values
        width = CLIP * 1.4826 * float(np.nanmedian(np.abs(values)))
        kept = np.where(np.abs(values) <= width, values, np.nan)
        for lag in range(LAGS + 1):
            both = kept[: len(kept) - lag] * kept[lag:]
            there = np.isfinite(both)
            products[lag] += both[there].sum()
            counts[lag] += there.sum()
    measured = products / np.maximum(counts, 1)
    return _fitted(measured, float(np.median([one.window for one in found])), limits)


def _fitted(measured: Array, window: float, limits: tuple[float, float]) -> RangeNoise:
    """The parts whose products are most like those measured."""
    from scipy.optimize import nnls  # noqa: PLC0415  (loaded when the noise is estimated)

    lag = np.arange(len(measured))
    size = max(round(window), 1)
    inside = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
    own = (lag == 0) + np.maximum(1 - lag / size, 0) / size
    tries = []
    for length in LENGTHS:
        averaged = float(np.exp(-inside / length).mean())
        shared = (1 + averaged) * np.exp(-lag / length)
        faked = np.exp(-lag / FAKED)
        variances, misfit = nnls(np.column_stack([own, shared, faked]), measured)
        tries.append((misfit, length, float(variances[0] + variances[2]), float(variances[1])))
    _, length, own_variance, shared_variance = min(tries)
    total = float(np.sqrt(own_variance + shared_variance))
    scale = float(np.clip(total, *limits)) / max(total, 1e-9)
    parts = scale * np.sqrt([own_variance, shared_variance])
    return RangeNoise(float(parts[0]), float(parts[1]), length)


def smeared(values: Array, length: float) -> Array:
    """(k, n) sums of each value and its neighbours, each times exp(-distance / length)."""
    reach = int(np.ceil(4 * length))
    kernel = np.exp(-np.abs(np.arange(-reach, reach + 1)) / length)
    return np.stack([np.convolve(row, kernel)[reach : reach + len(row)] for row in values])
