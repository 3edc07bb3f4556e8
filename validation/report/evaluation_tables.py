"""The tables of the comparisons, as in the document and as used by terminal and report."""

from collections.abc import Sequence

import numpy as np

from validation.poses.pose_table import Component, PoseTable
from validation.report.cells import Value
from validation.results import Table, listed_ids
from validation.statistics.comparison import Comparison
from validation.statistics.conclusions import interval_name
from validation.statistics.error_statistics import by_magnitude
from validation.statistics.evaluation import Evaluation

NUMBER = ".4f"
"""Lengths and angles as the document prints them: to 0.1 mm and 0.1 mrad."""


def _heading(name: str, component: Component) -> str:
    return f"{name} [{component.unit}]"


def overview_table(evaluations: Sequence[Evaluation]) -> Table:
    """Mean and standard deviation of every system, as in AD2.3, "Overall conclusions"."""
    components = evaluations[0].comparison.components
    columns = ["system", "n"]
    for component in components:
        columns += [
            _heading(f"mean {component.name}", component),
            _heading(f"std {component.name}", component),
        ]
    rows: list[list[Value]] = []
    for evaluation in evaluations:
        row: list[Value] = [evaluation.system, len(evaluation.comparison)]
        for statistics in evaluation.statistics:
            row += [statistics.mean, statistics.std]
        rows.append(row)
    return Table(
        "Errors of all systems (validation minus GT)",
        columns,
        rows,
        ["", "d", *[".5f"] * (2 * len(components))],
        "Mean, and sample standard deviation around it (n - 1), over the n poses that system and "
        "survey have in common. Compare systems only where they have the same poses.",
    )


def poses_table(tables: Sequence[PoseTable]) -> Table:
    """What every system gave, where nothing is compared."""
    rows: list[list[Value]] = [
        [table.system, len(table), ", ".join(one.name for one in table.components)]
        for table in tables
    ]
    return Table("Poses of all systems", ["system", "poses", "of"], rows)


def statistics_table(evaluation: Evaluation) -> Table:
    """Everything known about the errors of one system, a component a row."""
    confidence = f"{100 * evaluation.statistics[0].confidence:.3g} %"
    rows: list[list[Value]] = [
        [
            f"{one.component.name} [{one.component.unit}]",
            *(one.n, one.mean, one.std, one.rms, one.max_abs, one.median, one.mad),
            *(one.ci_low, one.ci_high, one.bias.smallest_limit),
        ]
        for one in evaluation.statistics
    ]
    reasons = {
        f" {one.component.name}: {one.reason}." for one in evaluation.statistics if one.reason
    }
    return Table(
        f"Statistics of the errors of {evaluation.system}",
        [
            *("component", "n", "mean", "std", "rms", "max abs", "median", "MAD"),
            *(f"{confidence} low", f"{confidence} high", "bias below"),
        ],
        rows,
        ["", "d", *[NUMBER] * 9],
        f"std: around the mean, which is not in it. Interval of the mean: "
        f"{interval_name(evaluation.statistics[0])}. 'bias below': the smallest bound on the bias "
        f"that can be claimed with {confidence} confidence (two one-sided t-tests). Both hold "
        f"for nearly normal errors."
        f"{''.join(sorted(reasons))}",
    )


def pose_table(comparison: Comparison) -> Table:
    """Validation, GT and error of every pose, as in the document's tables of results."""
    columns = ["pose"]
    has_source = any(comparison.gt.sources)
    if has_source:
        columns.append("source")
    for component in comparison.components:
        columns += [
            _heading(f"{component.name} validation", component),
            _heading(f"{component.name} GT", component),
            _heading(f"{component.name} error", component),
        ]
    columns.append("NEES")
    rows = [_pose_row(comparison, row, has_source) for row in range(len(comparison))]
    low, high = comparison.nees_interval
    note = (
        "Error = validation minus GT, angles wrapped. Of normal errors, a NEES should be "
        f"{low:.2f} to {high:.2f}."
    )
    if comparison.unavailable:
        note += f" NEES not available: {comparison.unavailable}."
    lead = ["", ""] if has_source else [""]
    formats = [*lead, *[NUMBER] * (3 * len(comparison.components)), ".2f"]
    return Table(f"Poses of {comparison.system}", columns, rows, formats, note)


def _pose_row(comparison: Comparison, row: int, has_source: bool) -> list[Value]:
    cells: list[Value] = [comparison.ids[row]]
    if has_source:
        cells.append(comparison.gt.sources[row])
    numbers = np.column_stack(
        [comparison.validation.poses[row], comparison.gt.poses[row], comparison.errors[row]]
    )
    return [*cells, *(float(number) for number in numbers.ravel()), float(comparison.nees[row])]


def magnitude_table(comparison: Comparison, most: int | None = None) -> Table:
    """Errors of each component by falling absolute value, with the pose of each.

    Parameters
    ----------
    comparison : Comparison
        The errors.
    most : int, optional
        How many; all by default.
    """
    order = by_magnitude(comparison.errors)[:most]
    columns = ["rank"]
    for component in comparison.components:
        columns += [f"{component.name}: pose", _heading(f"{component.name} error", component)]
    rows: list[list[Value]] = []
    for rank, chosen in enumerate(order, 1):
        cells: list[Value] = [rank]
        for column, row in enumerate(chosen):
            cells += [comparison.ids[row], float(comparison.errors[row, column])]
        rows.append(cells)
    formats = ["d", *["", NUMBER] * len(comparison.components)]
    return Table(f"Errors of {comparison.system} by magnitude", columns, rows, formats)


def coverage_table(evaluations: Sequence[Evaluation]) -> Table:
    """Which poses each system gave, and which it did not."""
    rows: list[list[Value]] = [
        [
            evaluation.system,
            len(evaluation.comparison),
            len(evaluation.comparison) + len(evaluation.comparison.missing_in_gt),
            listed_ids(evaluation.comparison.missing_in_gt) or "none",
            listed_ids(evaluation.comparison.missing_in_validation) or "none",
        ]
        for evaluation in evaluations
    ]
    columns = ["system", "compared", "validation poses", "missing in GT", "without validation"]
    return Table("Coverage", columns, rows, ["", "d", "d", "", ""])
