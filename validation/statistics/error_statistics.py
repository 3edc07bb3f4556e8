"""Statistics of errors, component by component: size, bias, and how sure both are."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import special

from validation.poses.angles import Array, circular_mean, mean_angle, wrap
from validation.poses.pose_table import Component

IntervalMethod = Literal["student", "normal"]
"""Of the interval of the mean: Student's t, or the document's mean +- 1.96 s / sqrt(n)."""
UsedMethod = Literal["student", "normal", "dependent"]
"""How an interval was found: 'dependent' allows for errors that depend on their neighbours."""

NAN = float("nan")


@dataclass(frozen=True)
class ComponentStatistics:
    """Statistics of the errors of one component, in metres or radians.

    Parameters
    ----------
    component : Component
        Which.
    n : int
        Number of errors.
    mean, std : float
        Mean, on the circle for angles, and sample standard deviation (n - 1).
    rms, max_abs : float
        Root of the mean square and largest absolute error, both about zero.
    median, mad : float
        Median, and median absolute deviation from it (times 1.4826 it estimates the standard
        deviation of normal errors).
    ci_low, ci_high : float
        Interval of the mean.
    confidence : float
        Of all intervals and tests.
    method : {"student", "normal", "dependent"}
        How the interval was found.
    bias : BiasTest
        What can be said about the bias being small.
    reason : str
        Why numbers are NaN; empty where none is.
    effective : float
        Independent errors that would tell the mean as well, where errors depend on their
        neighbours; NaN where they are taken as independent.
    """

    component: Component
    n: int
    mean: float
    std: float
    rms: float
    max_abs: float
    median: float
    mad: float
    ci_low: float
    ci_high: float
    confidence: float
    method: UsedMethod
    bias: "BiasTest"
    reason: str = ""
    effective: float = NAN

    @property
    def bias_is_significant(self) -> bool | None:
        """Whether zero is outside the interval of the mean; None if there is no interval."""
        if np.isnan(self.ci_low):
            return None
        return bool(self.ci_low > 0 or self.ci_high < 0)


class BiasTest(NamedTuple):
    """The statement 'the bias is below d', by two one-sided tests.

    ``limit`` is d, ``p_value`` the larger of both p-values, ``smallest_limit`` the least d for
    which the statement would hold at the same confidence. NaN where n is too small.
    """

    limit: float
    p_value: float
    smallest_limit: float
    confidence: float

    @property
    def holds(self) -> bool | None:
        """Whether the bias is below the limit with the stated confidence; None if unknown."""
        return None if np.isnan(self.p_value) else bool(self.p_value < 1 - self.confidence)


def error_statistics(
    errors: npt.ArrayLike,
    components: Sequence[Component],
    limits: Sequence[float],
    confidence: float = 0.95,
    method: IntervalMethod = "student",
) -> tuple[ComponentStatistics, ...]:
    """Statistics of every component.

    Parameters
    ----------
    errors : (n, k) array_like
        Validation minus GT, metres and radians; n may be 0.
    components : sequence of Component
        What the k columns are.
    limits : sequence of float
        The d of 'the bias is below d', for each component.
    confidence : float
        Of intervals and tests.
    method : {"student", "normal"}
        Of the interval of the mean. The tests always use Student's t.
    """
    columns = np.asarray(errors, dtype=float).reshape(-1, len(components)).T
    return tuple(
        component_statistics(column, component, limit, confidence, method)
        for column, component, limit in zip(columns, components, limits, strict=True)
    )


def component_statistics(
    errors: npt.ArrayLike,
    component: Component,
    limit: float,
    confidence: float = 0.95,
    method: IntervalMethod = "student",
) -> ComponentStatistics:
    """Statistics of the errors of one component.

    Parameters
    ----------
    errors : (n,) array_like
        Metres or radians.
    component, limit, confidence, method
        As for `error_statistics`.

    Notes
    -----
    AD2.3, "Vision Stats": average, standard deviation, maximum of the absolute values, and
    interval of the mean. The intervals printed there are mean +- 1.96 s / sqrt(22), though the
    table has 20 poses.
    """
    values = np.asarray(errors, dtype=float)
    n = len(values)
    mean, std, median, mad = (float(value) for value in _centre_and_spread(values, component.kind))
    # Differences of equal numbers may differ in the last bits.
    if std <= 1e-12 * (1 + np.abs(values).max(initial=0.0)):
        std = 0.0
    reason = _reason(n, mean, std)
    spread = std if not reason else NAN
    low, high = mean_interval(mean, spread, n, confidence, method)
    return ComponentStatistics(
        component=component,
        n=n,
        mean=mean,
        std=std,
        rms=float(np.sqrt(np.square(values).mean())) if n else NAN,
        max_abs=float(np.abs(values).max()) if n else NAN,
        median=median,
        mad=mad,
        ci_low=float(low),
        ci_high=float(high),
        confidence=confidence,
        method=method,
        bias=bias_test(mean, spread, n, limit, confidence),
        reason=reason,
    )


def _centre_and_spread(values: Array, kind: str) -> tuple[float, float, float, float]:
    """Mean, standard deviation, median and its absolute deviation; NaN where undefined.

    Angles are counted from their circular mean, so that no choice of the wrapping point
    changes anything.
    """
    if not len(values):
        return NAN, NAN, NAN, NAN
    if kind == "angle":
        origin = float(circular_mean(values))
        deviations = wrap(values - origin)
        mean = float(mean_angle(values))
        median = float(wrap(origin + np.median(deviations)))
    else:
        origin, deviations = 0.0, values
        mean, median = float(values.mean()), float(np.median(values))
    std = float(deviations.std(ddof=1)) if len(values) > 1 else NAN
    return mean, std, median, float(np.median(np.abs(deviations - np.median(deviations))))


def _reason(n: int, mean: float, std: float) -> str:
    """Why there is no interval; empty if there is one."""
    if n == 0:
        return "no error to take statistics of"
    if n == 1:
        return "a single error has no spread"
    if np.isnan(mean):
        return "the angles cancel: their mean has no direction"
    if std == 0:
        return "all errors are the same number, so their spread tells nothing about the mean"
    return ""


def two_sided_quantile(confidence: float) -> float:
    """How many standard deviations of a normal value hold the given probability: 1.96 for 95 %."""
    return float(special.ndtri((1 + confidence) / 2))


def mean_interval(
    mean: npt.ArrayLike,
    std: npt.ArrayLike,
    n: int,
    confidence: float = 0.95,
    method: IntervalMethod = "student",
) -> tuple[Array, Array]:
    """Low and high end of the confidence interval of a mean.

    Parameters
    ----------
    mean, std : (...) array_like
        Sample mean and sample standard deviation (n - 1).
    n : int
        Number of values; below 2 the interval is NaN.
    confidence : float
        Of the interval.
    method : {"student", "normal"}
        Student's t with n - 1 degrees of freedom, or the normal quantile to two decimals (1.96
        for 95 %), which is right only for large n.
    """
    mean, std = np.asarray(mean, dtype=float), np.asarray(std, dtype=float)
    if n < 2:
        return np.full_like(mean, np.nan), np.full_like(mean, np.nan)
    probability = (1 + confidence) / 2
    if method == "student":
        quantile = float(special.stdtrit(n - 1, probability))
    else:
        # As the document's tables have it, 1.96: the last printed digit depends on it.
        quantile = round(two_sided_quantile(confidence), 2)
    half = quantile * std / np.sqrt(n)
    return mean - half, mean + half


def bias_test(mean: float, std: float, n: int, limit: float, confidence: float = 0.95) -> BiasTest:
    """Two one-sided t-tests of 'the bias is between -limit and limit'.

    Parameters
    ----------
    mean, std : float
        Sample mean and sample standard deviation.
    n : int
        Number of values; below 2 nothing can be said and the result is NaN.
    limit : float
        The d of the statement, positive.
    confidence : float
        With which the statement is to hold: each test is at the level 1 - confidence.

    Notes
    -----
    Schuirmann (1987), "A comparison of the two one-sided tests procedure ...". The statement
    holds for every limit above ``|mean| + t s / sqrt(n)`` with the one-sided quantile t.
    """
    if n < 2 or np.isnan(std):
        return BiasTest(limit, NAN, NAN, confidence)
    error = std / np.sqrt(n)
    beyond = abs(mean) - limit
    # Values that are all the same leave no doubt.
    p_value = float(special.stdtr(n - 1, beyond / error) if error > 0 else beyond >= 0)
    smallest = abs(mean) + special.stdtrit(n - 1, confidence) * error
    return BiasTest(limit, p_value, float(smallest), confidence)


def by_magnitude(errors: npt.ArrayLike) -> npt.NDArray[np.intp]:
    """Rows of each column in order of falling absolute value; ties stay in table order.

    Parameters
    ----------
    errors : (n, ...) array_like
        Errors.

    Returns
    -------
    (n, ...) array of int
        Row numbers, the largest error first.
    """
    return np.argsort(-np.abs(np.asarray(errors, dtype=float)), axis=0, kind="stable")
