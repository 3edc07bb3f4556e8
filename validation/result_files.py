"""What a run leaves under results/, as text."""

import contextlib
import csv
import io
import math
import re
from collections.abc import Iterable, Mapping, Sequence

from validation.errors import GtvalError
from validation.evaluation import Evaluation
from validation.joint import joint_to_csv
from validation.poses import PoseTable, to_csv, to_tum
from validation.statistics import ComponentStatistics

_SYSTEM = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")


def pose_files(tables: Iterable[PoseTable]) -> dict[str, str]:
    """poses_<system>.csv of each table, and poses_<system>.tum where its stops are numbered.

    Raises
    ------
    GtvalError
        If a system's name cannot be part of a file name.
    """
    files = {}
    for table in tables:
        if not _SYSTEM.fullmatch(table.system):
            raise GtvalError(
                f"the system name '{table.system}' cannot be part of a file name; use letters, "
                "digits, '_', '-' and '.'"
            )
        files[f"poses_{table.system}.csv"] = to_csv(table)
        if table.joint is not None:
            files[f"joint_{table.system}.csv"] = joint_to_csv(table)
        # Stops without numbers have no time to stand in a trajectory.
        with contextlib.suppress(GtvalError):
            files[f"poses_{table.system}.tum"] = to_tum(table)
    return files


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

    Columns as in `validation.statistics.ComponentStatistics`; ``bias_limit``, ``bias_p`` and
    ``bias_smallest_limit`` are the two one-sided tests of 'the bias is below the limit',
    ``mean_sigma_stated`` the standard deviation of the mean by the stated covariances.
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


def csv_text(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """CSV text in which floats keep their last bit and NaN is blank."""
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([_cell(value) for value in row] for row in rows)
    return stream.getvalue()


def _cell(value: object) -> object:
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(float(value))
    return value


def merged(parts: Iterable[tuple[str, Mapping[str, str | bytes]]]) -> dict[str, str | bytes]:
    """All files of several owners together.

    Parameters
    ----------
    parts : iterable of (str, mapping)
        Owner, and its files by their names relative to results/.

    Raises
    ------
    GtvalError
        If two owners write the same file, or a name leads out of the folder.
    """
    files: dict[str, str | bytes] = {}
    owners: dict[str, str] = {}
    for owner, contents in parts:
        for name, content in contents.items():
            if name.startswith("/") or "\\" in name or ".." in name.split("/"):
                raise GtvalError(f"'{owner}' wants to write outside results/: {name}")
            if name in files:
                raise GtvalError(f"'{owner}' and '{owners[name]}' both write results/{name}")
            files[name], owners[name] = content, owner
    return files
