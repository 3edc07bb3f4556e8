"""A system's comparison with the validation poses, with the statistics of its errors."""

from dataclasses import dataclass

from validation.campaign.folder import Comparison as ComparisonSettings
from validation.poses.pose_table import Component, PoseTable
from validation.shown import Shown
from validation.statistics.comparison import Comparison, compare
from validation.statistics.error_statistics import (
    ComponentStatistics,
    IntervalMethod,
    error_statistics,
)


@dataclass(frozen=True, repr=False)
class Evaluation(Shown):
    """One GT system's errors and what they amount to.

    Parameters
    ----------
    comparison : Comparison
        Stop by stop.
    statistics : tuple of ComponentStatistics
        Component by component.
    """

    comparison: Comparison
    statistics: tuple[ComponentStatistics, ...]

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
    return Evaluation(comparison, statistics)


def acceptable_bias(component: Component, settings: ComparisonSettings) -> float:
    """The d of 'the bias is below d' for a component, in metres or radians."""
    if component.kind == "length":
        return settings.acceptable_bias_length
    return settings.acceptable_bias_angle
