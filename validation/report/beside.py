"""The published way of a system beside its own: the same data, two ways."""

from collections.abc import Iterable

import numpy as np

from validation.poses.pose_table import PoseTable, in_common, pose_difference
from validation.results import AS_PUBLISHED, Section, Table, TableColumn, listed_ids
from validation.statistics.evaluation import Evaluation

MILLI = 1e3


def beside_tables(tables: Iterable[PoseTable]) -> list[Table]:
    """Stop by stop, how far the published way is from a system's own, for each that has both."""
    known = {table.system: table for table in tables}
    pairs = [(known.get(name.removesuffix(AS_PUBLISHED)), one) for name, one in known.items()]
    return [
        _difference_table(own, published)
        for own, published in pairs
        if own is not None and own is not published and set(own.ids) & set(published.ids)
    ]


def _difference_table(own: PoseTable, published: PoseTable) -> Table:
    """Poses of the published way, and what the system's own poses differ by."""
    ids = in_common([own, published])
    one, other = own.select(ids), published.select(ids)
    off = pose_difference(other.poses, one.poses, one.components)
    columns: list[TableColumn] = [("pose", "", ids)]
    for k, component in enumerate(one.components):
        columns.append((f"{component.name} [{component.unit}]", ".4f", other.poses[:, k]))
    for k, component in enumerate(one.components):
        columns.append((f"d{component.name} [m{component.unit}]", "+.1f", MILLI * off[:, k]))
    both = set(ids)
    missing = [name for name in own.ids if name not in both]
    lost = f" It gives no pose of {listed_ids(missing)}." if missing else ""
    note = f"d: the published way minus '{own.system}'.{lost}"
    return Table.of_columns(f"'{own.system}' by the published way", columns, note)


def beside_section(
    tables: Iterable[PoseTable], evaluations: Iterable[Evaluation]
) -> Section | None:
    """Both ways of every system that has both; None where none has."""
    differences = beside_tables(tables)
    if not differences:
        return None
    judged = {one.system: one for one in evaluations}
    rows: list[list[str | float]] = []
    for name, evaluation in judged.items():
        own = judged.get(name.removesuffix(AS_PUBLISHED))
        if own is None or own is evaluation:
            continue
        there = set(evaluation.comparison.ids)
        ids = [stop for stop in own.comparison.ids if stop in there]
        both = [_errors(one, ids) for one in (own, evaluation)]
        for k, component in enumerate(own.comparison.components):
            sizes = [float(MILLI * np.sqrt(np.mean(errors[:, k] ** 2))) for errors in both]
            label = f"{component.name} [m{component.unit}]"
            rows.append([own.system, label, len(ids), *sizes, sizes[1] / sizes[0]])
    heading = ("system", "component", "stops", "rms error, own way", "rms error, published way")
    summary = Table(
        "Errors of both ways at the same stops",
        (*heading, "published/own"),
        rows,
        ("", "", "", ".1f", ".1f", ".2f"),
    )
    return Section("The published way beside gtval's", [*([summary] if rows else []), *differences])


def _errors(evaluation: Evaluation, ids: list[str]) -> np.ndarray:
    """(n, k) errors of the named stops."""
    comparison = evaluation.comparison
    rows = {name: row for row, name in enumerate(comparison.ids)}
    return comparison.errors[[rows[name] for name in ids]]
