"""Pose tables that are already on disk, compared: single files, or the results of a run."""

from collections.abc import Sequence
from pathlib import Path

from validation.campaign import Campaign
from validation.campaign import Comparison as ComparisonSettings
from validation.csv_tables import Column, read_csv
from validation.errors import InputError, Problem
from validation.evaluation import Evaluation, evaluate
from validation.poses import PLANAR, SPATIAL, Component, PoseTable, from_csv
from validation.statistics import IntervalMethod
from validation.systems import VALIDATION_SYSTEM


def compare_files(
    validation: Path,
    gt: Sequence[Path],
    settings: ComparisonSettings | None = None,
    method: IntervalMethod = "student",
) -> list[Evaluation]:
    """Each GT file's errors with respect to the validation file.

    Parameters
    ----------
    validation : Path
        Pose CSV as `validation.poses.from_csv` reads it, planar or spatial.
    gt : sequence of Path
        The same, one for each system.
    settings : validation.campaign.Comparison, optional
        Confidence and acceptable bias.
    method : {"student", "normal"}
        Of the interval of the mean.

    Raises
    ------
    GtvalError
        Naming the bad places of all files; or if two tables cannot be compared.
    """
    ours, *theirs = _read_all([validation, *gt])
    return [evaluate(ours, table, settings, method) for table in theirs]


def compare_results(campaign: Campaign, method: IntervalMethod = "student") -> list[Evaluation]:
    """The errors of every results/poses_<system>.csv with respect to poses_survey.csv.

    Raises
    ------
    GtvalError
        As `compare_files`, and if there is nothing to compare yet.
    """
    validation = campaign.results / f"poses_{VALIDATION_SYSTEM}.csv"
    gt = [path for path in sorted(campaign.results.glob("poses_*.csv")) if path != validation]
    if not validation.is_file() or not gt:
        what = validation.name if not validation.is_file() else "poses of another system"
        raise InputError(
            [Problem(campaign.results, f"there are no {what} yet; `gtval run` makes them")]
        )
    return compare_files(validation, gt, campaign.settings.comparison, method)


def components_of(path: Path) -> tuple[Component, ...]:
    """What the poses of a file consist of: spatial ones have a column yaw."""
    yaw = read_csv(path, [Column("yaw", required=False, blank=True)]).text["yaw"]
    return SPATIAL if any(yaw) else PLANAR


def _read_all(paths: Sequence[Path]) -> list[PoseTable]:
    """All tables, or the bad places of all."""
    tables: list[PoseTable] = []
    problems: list[Problem] = []
    for path in paths:
        try:
            tables.append(from_csv(path, components=components_of(path)))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    return tables
