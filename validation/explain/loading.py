"""Pose tables for the explanation, from single files or from a campaign's results."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from validation.csv_tables import Column, read_csv
from validation.errors import GtvalError, InputError, Problem
from validation.explain.analysis import Question
from validation.joint import with_stored_joint
from validation.poses import PoseTable, from_csv
from validation.systems import VALIDATION_SYSTEM

if TYPE_CHECKING:  # single tables do without the libraries that campaign.toml needs
    from validation.campaign import Campaign
    from validation.explain.settings import ExplainSettings

_MOST_RADIANS = 4 * np.pi
_MOST_DEGREES = 720.0


def read_tables(validation: Path, systems: Sequence[Path]) -> tuple[PoseTable, list[PoseTable]]:
    """The validation poses and the systems' from single files.

    Parameters
    ----------
    validation : Path
        Columns pose, x, y, theta and, if known, the covariance.
    systems : sequence of Path
        Same columns; a system is named after its file.

    Raises
    ------
    InputError
        Naming the bad places of all files.
    """
    problems: list[Problem] = []
    tables = []
    for path in (validation, *systems):
        try:
            tables.append(read_table(path, _name(path)))
        except InputError as error:
            problems.extend(error.problems)
    if problems:
        raise InputError(problems)
    return tables[0], tables[1:]


def _name(path: Path) -> str:
    """'vision' for vision.csv and for poses_vision.csv."""
    return re.sub(r"^poses_", "", path.stem)


def read_table(path: Path, system: str) -> PoseTable:
    """One pose table, with angles in degrees noticed and said.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.
    """
    cells = read_csv(path, [Column("theta", "number", required=False, blank=True)])
    angles = np.abs(np.array(cells.numbers["theta"], dtype=float))
    large = np.flatnonzero((angles > _MOST_RADIANS) & (angles <= _MOST_DEGREES))
    if len(large) > 2 or (len(large) and len(large) == len(angles)):
        for row in large:
            cells.flag(int(row), "theta", "looks like degrees; angles are in radians")
        cells.raise_problems()
    return with_stored_joint(from_csv(path, system=system), path)


def read_times(paths: Sequence[Path]) -> dict[str, float] | None:
    """Seconds of each pose from a column 'time', if the GT files have one.

    Raises
    ------
    GtvalError
        If two files give different times to the same pose.
    """
    times: dict[str, float] = {}
    for path in paths:
        columns = [Column("pose"), Column("time", "number", required=False, blank=True, unit="s")]
        table = read_csv(path, columns)
        table.raise_problems()
        for name, value in zip(table.text["pose"], table.numbers["time"], strict=True):
            if np.isnan(value):
                continue
            if times.setdefault(name, value) != value:
                raise GtvalError(f"{path}: pose {name} has another time in another table")
    return times or None


def stored_tables(campaign: "Campaign") -> list[PoseTable]:
    """Tables under results/, as a run has written them.

    Raises
    ------
    GtvalError
        If there are none or one is bad.
    """
    paths = sorted(campaign.results.glob("poses_*.csv"))
    return [read_table(path, _name(path)) for path in paths]


def split_validation(
    tables: Sequence[PoseTable],
) -> tuple[PoseTable, list[PoseTable]]:
    """The validation poses, and all others.

    Raises
    ------
    GtvalError
        If one of both is missing.
    """
    validation = [table for table in tables if table.system == VALIDATION_SYSTEM]
    others = [table for table in tables if table.system != VALIDATION_SYSTEM]
    if not validation:
        raise GtvalError("there are no validation poses; survey the stops first")
    if not others:
        raise GtvalError("there is no GT system to explain")
    return validation[0], others


def campaign_question(
    campaign: "Campaign", settings: "ExplainSettings", present: Sequence[str]
) -> Question:
    """What a campaign's [explain] table says, for the systems that are there.

    Parameters
    ----------
    campaign : Campaign
        For the folder of the witnesses, and the confidence.
    settings : ExplainSettings
        The table.
    present : sequence of str
        Systems with poses; what is said of others is left aside.

    Raises
    ------
    InputError
        If a witness file is bad.
    """
    sensors: Mapping[str, list[str]] = {
        sensor: [name for name in names if name in present]
        for sensor, names in settings.sensors.items()
    }
    return Question(
        references={k: v for k, v in settings.references.items() if k in present},
        sensors={sensor: names for sensor, names in sensors.items() if len(names) > 1},
        witnesses=tuple(
            read_table(campaign.folder / file, name) for name, file in settings.witnesses.items()
        ),
        confidence=campaign.settings.comparison.confidence,
        invented=settings.invented,
        false_alarm=settings.false_alarm,
    )
