"""Pose tables for the explanation, from single files or from a campaign's results."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from validation.campaign.stored import read_tables
from validation.errors import GtvalError, InputError, Problem
from validation.explain.analysis import Question
from validation.poses.pose_table import PoseTable
from validation.results import VALIDATION_SYSTEM, Finding
from validation.text_files.csv_tables import Column, read_csv

if TYPE_CHECKING:  # single tables do without the libraries that campaign.toml needs
    from validation.campaign.folder import Campaign
    from validation.explain.settings import ExplainSettings


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


def unknown_systems(
    campaign: "Campaign", settings: "ExplainSettings", present: Sequence[str]
) -> list[Finding]:
    """A warning for each reference and shared sensor of a system that gives no poses.

    Raises
    ------
    InputError
        Naming each system that is called independent and that nothing can give poses of.
    """
    from validation.campaign.toml_files import line_of  # noqa: PLC0415  (pydantic is slow)

    _refuse_unknown_witnesses(campaign, settings, present)
    stated = [("references", name) for name in settings.references]
    stated += [("sensors", name) for names in settings.sensors.values() for name in names]
    said = f"no system of this name gives poses; correct it to one of {', '.join(present)}, or "
    bad = [
        Problem(campaign.toml, f"{said}take it out", line, f"explain.{key}", name)
        for key, name in stated
        for line in (line_of(campaign.toml, ("explain", key, name)),)
        if name not in present
    ]
    return [Finding("warning", str(one), "explain", "unknown_system") for one in bad]


def _refuse_unknown_witnesses(
    campaign: "Campaign", settings: "ExplainSettings", present: Sequence[str]
) -> None:
    """Raise for systems that are called independent, of which there are no poses and can be none.

    A name that says nothing would leave copies to be one witness while a person believes
    otherwise. Systems that are installed or named in the campaign may have no poses today.
    """
    from validation.campaign.toml_files import line_of  # noqa: PLC0415  (pydantic is slow)
    from validation.systems import installed_systems  # noqa: PLC0415  (they are found once needed)

    there = [VALIDATION_SYSTEM, *present, *settings.witnesses]
    there += [one.system for one in campaign.settings.published]
    installed = [one.name for one in installed_systems()]
    line = line_of(campaign.toml, ("explain", "independent"))
    there = list(dict.fromkeys(there))
    said = f"no system of this name; write one of {', '.join(there)}, or take it out"
    problems = [
        Problem(campaign.toml, said, line, "explain.independent", name)
        for name in dict.fromkeys(name for row in settings.independent for name in row)
        if name not in there
        and not any(name == one or name.startswith(f"{one}_") for one in installed)
    ]
    if problems:
        raise InputError(problems)


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
    files = [campaign.folder / file for file in settings.witnesses.values()]
    sensors: Mapping[str, list[str]] = {
        sensor: [name for name in names if name in present]
        for sensor, names in settings.sensors.items()
    }
    return Question(
        references={k: v for k, v in settings.references.items() if k in present},
        sensors={sensor: names for sensor, names in sensors.items() if len(names) > 1},
        witnesses=read_tables(files, tuple(settings.witnesses)).tables,
        independent=tuple(tuple(names) for names in settings.independent),
        confidence=campaign.settings.comparison.confidence,
        invented=settings.invented,
        false_alarm=settings.false_alarm,
    )
