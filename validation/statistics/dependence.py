"""Intervals and tests of a mean whose values are not independent of their neighbours."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import fft, special

from validation.poses.angles import Array
from validation.statistics.consistency import ConsistencyTest, Interval, verdict
from validation.statistics.error_statistics import BiasTest

Method = Literal["dependent", "withheld"]

MOST_COSINES = 24
"""Of the slowest cosines of a series that are looked at. Measured over 12 settings with 2,000
seeds: of 12, 16, 24, 32 and 48 it is the number with the least width of the interval that holds the
truth in 90 % where the record is ten correlation times long, and which errors that swing do not
widen more than threefold."""
CELLS = 8192
"""Cells of a longer series whose sums stand for its values. Within one, the quickest cosine turns
by 0.5 degrees: of white errors its sum changes by 0.3 % of its standard deviation."""
VALUES_PER_COSINE = 4
"""A cosine whose period is shorter than eight values says nothing of the slow part."""
FEWEST_VALUES = 16
"""Four cosines; with fewer there is nothing to tell slow errors from white ones by."""
RECORD_LENGTHS = (2.5, 4.0, 6.0, 10.0, 16.0, 28.0, 50.0, 90.0)
"""Lengths of the record, in correlation times, that are weighed against each other and against
errors without memory. Steps of 1.5 to 1.8: the spread of the mean differs by less than a fifth
between two of them."""
WHITE_SHARES = (0.0, 0.03, 0.3)
"""White noise beside the slow errors, over the power of these at frequency zero."""
PRIOR_OF_WHITE = 0.5
"""Weight of 'no memory' before the errors are seen; the rest is shared among the record lengths."""
PRIOR_TILT = 0.5
"""Shorter records have more weight, by this power of their length. Both are set so that, of the
intervals printed, 92 % or more hold the truth at ten correlation times (first-order, with white,
log-normal errors; 1,000 seeds each), at the price of intervals 1.4 times as wide as Student's where
there is no memory."""
SHORT = 10.0
"""Correlation times below which a record is called short."""
SHORT_WEIGHT = 0.3
"""Weight of a short record from which it is told. It is told in 97 % of the records of three
correlation times or fewer, in 85 to 90 % of those of ten, in 8 % of errors without memory."""
WITHHELD_WEIGHT = 0.7
"""Weight of a short record from which the interval is withheld: so in 75 to 85 % of the records of
one to three correlation times, of which intervals would hold the truth in 60 to 90 %, in a quarter
to a third of those of ten, in 2 % of those of forty, and never without memory."""
MOST_WIDENED = 3.0
"""Times that an interval is widened for skewed errors at most. Over records of ten correlation
times (300 seeds each) intervals of log-normal errors (sigma 1) then hold the truth in 94 to 96 %
and not in 87 to 92 %, of exponential ones in 93 to 96 %. Of normal series a third are widened, by
some percent."""

UNSEEN = "a correlation longer than the record cannot be seen in it"


@dataclass(frozen=True)
class SeriesMean:
    """Mean of a series, and what is known of it.

    Parameters
    ----------
    n : int
        Number of values.
    mean, std : float
        Mean and sample standard deviation.
    low, high : float
        Interval of the mean; NaN where withheld.
    confidence : float
        Of the interval.
    n_effective : float
        Independent values that would give the mean the same variance, n at most.
    method : {"dependent", "withheld"}
        How the interval was found.
    short : bool
        Whether the record may be shorter than ten correlation times: a part of the errors may be
        too slow to be seen.
    reason : str
        Why there is no interval; empty if there is one.
    spread : Spread, optional
        Distribution of the mean, for tests.
    widened : float
        Times that interval and distribution are wider for the skewness of the values.
    """

    n: int
    mean: float
    std: float
    low: float
    high: float
    confidence: float
    n_effective: float
    method: Method
    short: bool = False
    reason: str = ""
    spread: "Spread | None" = None
    widened: float = 1.0

    @property
    def half_width(self) -> float:
        """Half of the interval; NaN where withheld."""
        return (self.high - self.low) / 2


class Spread(NamedTuple):
    """Distribution of the error of a mean: Student's t with a weight and a scale for each model."""

    weights: Array
    scales: Array
    dof: int

    def below(self, value: float) -> float:
        """Probability that the error is below a value."""
        return float(self.weights @ special.stdtr(self.dof, value / self.scales))

    def quantile(self, probability: float) -> float:
        """The value below which the error is with the given probability, above one half."""
        low, high = 0.0, float(self.scales.max() * special.stdtrit(self.dof, probability))
        for _ in range(50):
            middle = (low + high) / 2
            low, high = (middle, high) if self.below(middle) < probability else (low, middle)
        return high

    @property
    def variance(self) -> float:
        """Of the mean: the geometric mean over the models, which is neither wide nor narrow."""
        return float(np.exp(self.weights @ np.log(self.scales**2)))


def mean_of_series(values: npt.ArrayLike, confidence: float = 0.95) -> SeriesMean:
    """Mean of values in the order of time, with an interval that allows for their correlation.

    Parameters
    ----------
    values : (n,) array_like
        In the order of time; the steps need not be equal and may have gaps.
    confidence : float
        Of the interval.

    Notes
    -----
    The slowest cosines of the series (those of the equal-weighted cosine estimate of Lazarus,
    Lewis, Stock and Watson 2018, "HAR Inference") are nearly normal, and their variances tell the
    power at low frequencies; that at frequency zero is the variance of the mean. Which power that
    is depends on where the errors lose their memory: errors of a first-order process with white
    noise beside, for records of 4 to 90 correlation times, and white errors, are weighed by the
    likelihood of the cosines (Mueller and Watson 2018, "Long-Run Covariability"), and the interval
    is that of the mixture of their t distributions. It is wide where a slow part may hide, and near
    Student's where none does. The estimate itself, with eight cosines and t, holds the truth in
    80 % where the record is ten correlation times long, and to withhold it where few effective
    values are found takes away those intervals that are wide enough.

    Cosines of the number of the value, not of its time, weigh poses as the mean does. A
    correlation longer than the record cannot be seen in it by any method.
    """
    values = np.asarray(values, dtype=float)
    n = len(values)
    mean = float(values.mean()) if n else np.nan
    std = float(values.std(ddof=1)) if n > 1 else np.nan
    if n < FEWEST_VALUES:
        return _withheld(n, mean, std, confidence, f"{n} values; it takes {FEWEST_VALUES}")
    if std <= 1e-12 * (1 + np.abs(values).max()):
        return _withheld(n, mean, 0.0, confidence, "all values are the same number")
    spread, short = _spread(values - mean)
    effective = min(float(n), std**2 / spread.variance)
    half = spread.quantile((1 + confidence) / 2)
    widened = _widened(values - mean, effective, half / np.sqrt(spread.variance))
    spread, half = spread._replace(scales=spread.scales * widened), half * widened
    if short > WITHHELD_WEIGHT:
        why = f"about {effective:.2g} effective values: the record is too short for errors so slow"
        nan = np.nan
        return SeriesMean(n, mean, std, nan, nan, confidence, effective, "withheld", True, why)
    return SeriesMean(
        *(n, mean, std, mean - half, mean + half, confidence, effective),
        *("dependent", short > SHORT_WEIGHT, "", spread, widened),
    )


def _widened(deviations: Array, effective: float, reach: float) -> float:
    """Times that an interval which reaches this many standard errors is widened for skewness.

    Hall (1992, "On the removal of skewness by transformation"): the end of the interval on the side
    of the long tail, with the effective number of values. What skewness as many normal values
    would show by chance is taken off.
    """
    squares = deviations * deviations
    skewness = abs(float(np.mean(squares * deviations) / np.mean(squares) ** 1.5))
    skewness -= np.sqrt(6 / max(effective, 1.0))
    a = skewness / np.sqrt(max(effective, 1.0))
    if a < 1e-3:
        return 1.0
    end = 3 / a * (1 - np.cbrt(1 - a * reach - a**2 / 6))
    return float(np.clip(end / reach, 1.0, MOST_WIDENED))


def _withheld(n: int, mean: float, std: float, confidence: float, why: str) -> SeriesMean:
    nan = np.nan
    return SeriesMean(n, mean, std, nan, nan, confidence, nan, "withheld", False, why)


class _Models(NamedTuple):
    """What the slowest cosines would be under each model, for a power of one."""

    whitening: Array
    """(k, q, q) inverse Cholesky factors of their covariance."""
    log_weights: Array
    """(k,) of the prior, with the determinants."""
    mean_variance: Array
    """(k,) n times the variance of the mean."""
    short: npt.NDArray[np.bool_]
    """(k,) whether the record is shorter than `SHORT` correlation times."""


@lru_cache(maxsize=MOST_COSINES)
def _models(cosines: int, cells: int = 512) -> _Models:
    """Covariances of the mean and the cosines of a first-order process on a record of length one.

    Its autocovariance at the lag s is ``c / 2 exp(-c s)``, which integrates to one.
    """
    places = (np.arange(cells) + 0.5) / cells
    order = np.arange(cosines + 1)
    basis = np.cos(np.pi * order * places[:, None]) * np.where(order, np.sqrt(2), 1) / cells
    white = np.eye(cosines + 1)
    lags = np.abs(places[:, None] - places)
    found, priors, short = [white], [PRIOR_OF_WHITE], [False]
    total = sum(length**-PRIOR_TILT for length in RECORD_LENGTHS) * len(WHITE_SHARES)
    for length in RECORD_LENGTHS:
        slow = basis.T @ (length / 2 * np.exp(-length * lags)) @ basis
        for share in WHITE_SHARES:
            found.append(slow + share * white)
            priors.append((1 - PRIOR_OF_WHITE) * length**-PRIOR_TILT / total)
            short.append(length < SHORT)
    covariances = np.array(found)
    factors = np.linalg.cholesky(covariances[:, 1:, 1:])
    logs = np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(-1)
    return _Models(
        np.linalg.inv(factors), np.log(priors) - logs, covariances[:, 0, 0], np.array(short)
    )


def _spread(deviations: Array) -> tuple[Spread, float]:
    """Distribution of the error of the mean, and the weight of a short record."""
    n = len(deviations)
    cosines = min(MOST_COSINES, n // VALUES_PER_COSINE)
    cells = min(n, CELLS)
    sums = np.add.reduceat(deviations, np.arange(cells) * n // cells) * np.sqrt(cells / n)
    slow = fft.dct(sums, type=2, norm="ortho")[1 : cosines + 1]
    models = _models(cosines)
    sums = np.maximum(np.square(models.whitening @ slow).sum(-1), np.finfo(float).tiny)
    logs = models.log_weights - cosines / 2 * np.log(sums)
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    scales = np.sqrt(models.mean_variance * sums / cosines / n)
    return Spread(weights, scales, cosines), float(weights[models.short].sum())


def bias_of_series(mean: SeriesMean, limit: float, confidence: float = 0.95) -> BiasTest:
    """Two one-sided tests of 'the bias is below the limit'; see `bias_test` for independent errors.

    Parameters
    ----------
    mean : SeriesMean
        Of the errors.
    limit : float
        The d of the statement.
    confidence : float
        With which it is to hold.

    Returns
    -------
    BiasTest
        NaN where the interval of the mean is withheld.
    """
    if mean.spread is None:
        return BiasTest(limit, np.nan, np.nan, confidence)
    size = abs(mean.mean)
    smallest = size + mean.spread.quantile(confidence)
    return BiasTest(limit, mean.spread.below(size - limit), smallest, confidence)


class SeriesRms(NamedTuple):
    """Root of the mean square, with its interval; NaN ends where ``reason`` says why."""

    rms: float
    low: float
    high: float
    n: int
    n_effective: float
    short: bool
    reason: str


def rms_of_series(errors: npt.ArrayLike, confidence: float = 0.95) -> SeriesRms:
    """Root mean square of errors about zero, with an interval that allows for their correlation.

    Parameters
    ----------
    errors : (n,) array_like
        Errors or their lengths, in the order of time.
    confidence : float
        Of the interval.

    Notes
    -----
    The interval of the mean of the squares, carried to their logarithm by its slope (delta
    method): squares are skewed to the right, and so is their mean; the interval cannot fall below
    zero.
    """
    squares = mean_of_series(np.square(np.asarray(errors, dtype=float)), confidence)
    rms = float(np.sqrt(squares.mean))
    # A half-width beyond the mean itself would be a factor that nobody can use.
    factor = np.exp(min(squares.half_width / squares.mean, 50.0) / 2) if rms > 0 else np.nan
    if np.isnan(squares.low):
        factor = np.nan
    return SeriesRms(
        *(rms, rms / factor, rms * factor, squares.n, squares.n_effective),
        *(squares.short, squares.reason),
    )


def nees_of_series(
    scores: npt.ArrayLike, dof: int, confidence: float = 0.95
) -> ConsistencyTest | None:
    """Test of all NEES of a series together, with their effective number.

    Parameters
    ----------
    scores : (n,) array_like
        NEES in the order of time; NaN where a covariance is not stated.
    dof : int
        Components of each.
    confidence : float
        Of the interval.

    Returns
    -------
    ConsistencyTest, optional
        ``poses`` is the effective number, by the width of the interval of the mean NEES; None
        where no number of effective poses can be told.
    """
    scores = np.asarray(scores, dtype=float)
    scores = scores[np.isfinite(scores)]
    mean = mean_of_series(scores, confidence)
    if mean.spread is None:
        return None
    # The distribution of squares below is skewed by itself.
    half = mean.half_width / mean.widened
    by_width = (mean.std * special.ndtri((1 + confidence) / 2) / half) ** 2
    poses = int(np.clip(by_width, 1, mean.n))
    tail = (1 - confidence) / 2
    low, high = special.chdtri(poses * dof, [1 - tail, tail]) / poses
    interval = Interval(float(low), float(high))
    upper = float(special.chdtrc(poses * dof, mean.mean * poses))
    return ConsistencyTest(
        mean=mean.mean,
        interval=interval,
        poses=poses,
        per_pose=dof,
        p_value=2 * min(upper, 1 - upper),
        confidence=confidence,
        verdict=verdict(mean.mean, interval),
        method="mean of NEES, with the effective number of poses in a row",
    )
