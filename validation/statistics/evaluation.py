"""A system's comparison with the validation poses, with the statistics of its errors."""

from dataclasses import dataclass, replace

import numpy as np

from validation.campaign.folder import Comparison as ComparisonSettings
from validation.poses.angles import circular_mean, wrap
from validation.poses.pose_table import Component, PoseTable
from validation.shown import Shown
from validation.statistics.comparison import Comparison, compare
from validation.statistics.consistency import ConsistencyTest, sum_test
from validation.statistics.error_statistics import (
    BiasTest,
    ComponentStatistics,
    IntervalMethod,
    error_statistics,
)
from validation.statistics.neighbours import Told, neighbours_of, spread_of_mean


@dataclass(frozen=True, repr=False)
class Evaluation(Shown):
    """One GT system's errors and what they amount to.

    Parameters
    ----------
    comparison : Comparison
        Stop by stop.
    statistics : tuple of ComponentStatistics
        Component by component.
    neighbours : Told, optional
        Whether errors depend on those of their neighbours; None with too few stops.
    """

    comparison: Comparison
    statistics: tuple[ComponentStatistics, ...]
    neighbours: Told | None = None

    @property
    def system(self) -> str:
        """Name of the GT system."""
        return self.comparison.system


def evaluate(
    validation: PoseTable,
    gt: PoseTable,
    settings: ComparisonSettings | None = None,
    method: IntervalMethod = "student",
) -> Evaluation:
    """The errors of a GT system and their statistics.

    Parameters
    ----------
    validation, gt : PoseTable
        As for `validation.statistics.comparison.compare`.
    settings : validation.campaign.Comparison, optional
        Confidence and acceptable bias.
    method : {"student", "normal"}
        Of the interval of the mean.

    Raises
    ------
    GtvalError
        If the components differ or no stop is in common.
    """
    settings = settings or ComparisonSettings()
    comparison = compare(validation, gt, settings.confidence)
    limits = [acceptable_bias(component, settings) for component in comparison.components]
    statistics = error_statistics(
        comparison.errors, comparison.components, limits, settings.confidence, method
    )
    told = _neighbours(validation, comparison)
    if told is None or not told.dependent or method == "normal":
        return Evaluation(comparison, statistics, told)
    wider = tuple(_wider(one, told, column) for column, one in enumerate(statistics))
    return Evaluation(replace(comparison, test=_fewer(comparison, told)), wider, told)


WITHHELD_REASON = (
    "errors of neighbouring stops are alike for so long that these stops do not tell a mean from "
    "what lasts"
)


def _neighbours(validation: PoseTable, comparison: Comparison) -> Told | None:
    """Whether errors depend on their neighbours, in the order of the validation's stops."""
    place = {name: row for row, name in enumerate(validation.ids)}
    steps = np.array([place[name] for name in comparison.ids], dtype=float)
    kinds: dict[str, list[int]] = {"positions": [], "headings": []}
    deviations = comparison.errors.copy()
    for column, component in enumerate(comparison.components):
        angle = component.kind == "angle"
        kinds["headings" if angle else "positions"].append(column)
        values = deviations[:, column]
        middle = float(circular_mean(values)) if angle and len(values) else 0.0
        left = wrap(values - middle) if angle else values - values.mean()
        deviations[:, column] = left
    return neighbours_of(steps, deviations, kinds)


def _wider(one: ComponentStatistics, told: Told, column: int) -> ComponentStatistics:
    """Statistics with the interval and the test of the mean that allow for lasting errors."""
    if one.reason:
        return one
    weighed, at = told.of_column(column)
    spread = spread_of_mean(weighed, at, one.n - 1)
    effective = min(weighed.effective(), float(one.n))
    limit, confidence = one.bias.limit, one.confidence
    if told.withheld:
        bias = BiasTest(limit, np.nan, np.nan, confidence)
        return replace(
            one, ci_low=np.nan, ci_high=np.nan, method="dependent", bias=bias,
            reason=WITHHELD_REASON, effective=effective,
        )  # fmt: skip
    half = max(spread.quantile((1 + confidence) / 2), one.ci_high - one.mean)
    smallest = max(abs(one.mean) + spread.quantile(confidence), one.bias.smallest_limit)
    p_value = max(spread.below(abs(one.mean) - limit), one.bias.p_value)
    return replace(
        one, ci_low=one.mean - half, ci_high=one.mean + half, method="dependent",
        bias=BiasTest(limit, p_value, smallest, confidence), effective=effective,
    )  # fmt: skip


def _fewer(comparison: Comparison, told: Told) -> ConsistencyTest | None:
    """The test of all NEES with as many poses as tell a mean square as well."""
    test = comparison.test
    if test is None:
        return None
    share = min(one.effective(2) / len(one.steps) for one, _ in told.kinds.values())
    poses = max(int(share * test.poses), 1)
    again = sum_test(test.mean * poses, poses, test.per_pose, test.confidence, test.method)
    return again._replace(method=f"{test.method}; as of {poses} independent poses, as errors last")


def acceptable_bias(component: Component, settings: ComparisonSettings) -> float:
    """The d of 'the bias is below d' for a component, in metres or radians."""
    if component.kind == "length":
        return settings.acceptable_bias_length
    return settings.acceptable_bias_angle
