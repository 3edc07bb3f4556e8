"""Errors and statistics as CSV text."""

import math
from collections.abc import Sequence

from validation.statistics.error_statistics import ComponentStatistics
from validation.statistics.evaluation import Evaluation
from validation.text_files.csv_text import csv_text


def errors_csv(evaluations: Sequence[Evaluation]) -> str:
    """errors.csv: one row a system and stop.

    Columns ``system``, ``pose``, the errors ``dx``, ``dy``, ``dtheta`` (metres, radians),
    ``distance``, ``nees`` with its interval, and the normalised errors ``nx``, ``ny``,
    ``ntheta``; those are blank where covariances are not stated, ``not_available`` says why.
    """
    names = [c.name for c in evaluations[0].comparison.components] if evaluations else []
    header = [
        *("system", "pose", *(f"d{name}" for name in names), "distance", "nees"),
        *("nees_low", "nees_high", *(f"n{name}" for name in names), "not_available"),
    ]
    rows: list[list[object]] = []
    for evaluation in evaluations:
        one = evaluation.comparison
        normalised, distances = one.normalised, one.distances
        for row, name in enumerate(one.ids):
            available = math.isfinite(one.nees[row])
            interval = one.nees_interval if available else ("", "")
            numbers = [*one.errors[row], distances[row], one.nees[row], *interval]
            why = "" if available else one.unavailable
            rows.append([one.system, name, *numbers, *normalised[row], why])
    return csv_text(header, rows)


def statistics_csv(evaluations: Sequence[Evaluation], confidence: float) -> str:
    """statistics.csv: one row a system and component; blank where there is no number.

    Columns as in `ComponentStatistics`; ``bias_limit``, ``bias_p`` and ``bias_smallest_limit``
    are the two one-sided tests of 'the bias is below the limit', ``mean_sigma_stated`` the
    standard deviation of the mean by the stated covariances.
    """
    percent = f"{100 * confidence:g}"
    header = [
        *("system", "component", "unit", "n", "mean", "std", "rms", "max_abs", "median", "mad"),
        *(f"ci{percent}_low", f"ci{percent}_high", "interval"),
        *("bias_limit", "bias_p", "bias_smallest_limit", "mean_sigma_stated"),
        "reason",
    ]
    rows = [
        [evaluation.system, *_statistics_row(statistics), float(stated), statistics.reason]
        for evaluation in evaluations
        for statistics, stated in zip(
            evaluation.statistics, evaluation.comparison.mean_sigmas, strict=True
        )
    ]
    return csv_text(header, rows)


def _statistics_row(one: ComponentStatistics) -> list[object]:
    spread = [one.mean, one.std, one.rms, one.max_abs, one.median, one.mad]
    bias = [one.bias.limit, one.bias.p_value, one.bias.smallest_limit]
    interval = [one.ci_low, one.ci_high, one.method]
    return [one.component.name, one.component.unit, one.n, *spread, *interval, *bias]
