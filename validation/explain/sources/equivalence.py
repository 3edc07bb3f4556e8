"""Two systems compared on the stops they share, and a system compared with what is asked of it."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import special

from validation.poses.angles import Array, wrap
from validation.poses.pose_table import Component, PoseTable, in_common, pose_difference
from validation.statistics.error_statistics import BiasTest, bias_test, mean_interval


@dataclass(frozen=True)
class PairedComparison:
    """One component of two systems' errors at their n common stops.

    Parameters
    ----------
    systems : tuple of str
        The two systems, a and b.
    component : Component
        Which component.
    n : int
        Common stops.
    bias_difference, bias_low, bias_high : float
        Mean of (error of a - error of b) and its interval, by paired t.
    size_difference, size_low, size_high : float
        Mean of (|error of a| - |error of b|) and its interval: below zero if a is the better.
    ratio, ratio_low, ratio_high : float
        Standard deviation of a's errors over that of b's, and its interval.
    equivalence : BiasTest
        Whether both biases are the same within d, by two one-sided tests.
    """

    systems: tuple[str, str]
    component: Component
    n: int
    bias_difference: float
    bias_low: float
    bias_high: float
    size_difference: float
    size_low: float
    size_high: float
    ratio: float
    ratio_low: float
    ratio_high: float
    equivalence: BiasTest


def paired_comparison(
    validation: PoseTable,
    a: PoseTable,
    b: PoseTable,
    limits: tuple[float, ...],
    confidence: float = 0.95,
) -> tuple[PairedComparison, ...]:
    """Two systems on the stops that both and the validation have, component by component.

    Parameters
    ----------
    validation, a, b : PoseTable
        Same components.
    limits : tuple of float
        The d of 'equivalent within d' for each component.
    confidence : float
        Of intervals and tests.

    Notes
    -----
    Differences are taken stop by stop, so that hard stops, and errors of the validation pose,
    count for both alike. The ratio's interval allows for the correlation of both errors: Pitman
    (1939), "A note on normal correlation", and Morgan (1939).
    """
    ids = in_common([validation, a, b])
    truth = validation.select(ids).poses
    errors = [
        pose_difference(truth, one.select(ids).poses, validation.components) for one in (a, b)
    ]
    found = []
    for column, component in enumerate(validation.components):
        first, second = errors[0][:, column], errors[1][:, column]
        difference = first - second
        if component.kind == "angle":
            difference = wrap(difference)
        bias = _mean(difference, confidence)
        size = _mean(np.abs(first) - np.abs(second), confidence)
        ratio = deviation_ratio(first, second, confidence)
        deviation = float(difference.std(ddof=1)) if len(ids) > 1 else float("nan")
        test = bias_test(bias[0], deviation, len(ids), limits[column], confidence)
        found.append(
            PairedComparison((a.system, b.system), component, len(ids), *bias, *size, *ratio, test)
        )
    return tuple(found)


def _mean(values: Array, confidence: float) -> tuple[float, float, float]:
    """Mean with its interval."""
    mean = float(values.mean())
    deviation = float(values.std(ddof=1)) if len(values) > 1 else float("nan")
    low, high = mean_interval(mean, deviation, len(values), confidence)
    return mean, float(low), float(high)


def deviation_ratio(a: Array, b: Array, confidence: float = 0.95) -> tuple[float, float, float]:
    """Ratio of the standard deviations of paired errors, with its interval; NaN if n < 3."""
    n = len(a)
    if n < 3 or a.std() == 0 or b.std() == 0:
        return float("nan"), float("nan"), float("nan")
    ratio = float(a.var(ddof=1) / b.var(ddof=1))
    correlation = float(np.corrcoef(a, b)[0, 1])
    t = float(special.stdtrit(n - 2, (1 + confidence) / 2))
    k = 1 + 2 * (1 - correlation**2) * t**2 / (n - 2)
    reach = np.sqrt(k * k - 1)
    ends = np.sqrt(np.maximum([ratio, ratio * (k - reach), ratio * (k + reach)], 0.0))
    return float(ends[0]), float(ends[1]), float(ends[2])


class GoodEnough(NamedTuple):
    """Whether errors are within what is asked.

    ``bias`` is the test that the mean is within +-d, ``deviation_below`` the upper confidence
    limit of the standard deviation, ``holds`` whether the bias is within d and the standard
    deviation below d (None where n is too small).
    """

    bias: BiasTest
    deviation_below: float
    holds: bool | None


def good_enough(errors: Array, limit: float, confidence: float = 0.95) -> GoodEnough:
    """Whether bias and standard deviation are both shown to be below d.

    Parameters
    ----------
    errors : (n,) array
        Of one component.
    limit : float
        The d.
    confidence : float
        Of each of the two statements.
    """
    n = len(errors)
    if n < 2:
        return GoodEnough(bias_test(float("nan"), float("nan"), n, limit), float("nan"), None)
    deviation = float(errors.std(ddof=1))
    test = bias_test(float(errors.mean()), deviation, n, limit, confidence)
    upper = deviation * np.sqrt((n - 1) / special.chdtri(n - 1, confidence))
    return GoodEnough(test, float(upper), bool(test.holds and upper < limit))
