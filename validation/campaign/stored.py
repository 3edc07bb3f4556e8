"""Pose tables that are already on disk: single files, or the results of a run."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from validation.campaign.folder import Campaign
from validation.campaign.provenance import (
    RECORD,
    OutOfDate,
    earlier_record,
    earlier_steps,
    out_of_date,
)
from validation.errors import InputError, Problem
from validation.poses.common_origin import with_stored_follows
from validation.poses.joint import with_stored_joint
from validation.poses.pose_table import PLANAR, SPATIAL, Component, PoseTable, from_csv
from validation.results import Finding
from validation.text_files.csv_tables import Column, read_csv

_MOST_RADIANS, _MOST_DEGREES = 4 * np.pi, 720.0
"""Two turns: `from_csv` refuses larger angles in radians, and here it is said why."""


@dataclass(frozen=True)
class StoredTables:
    """Tables as they were read.

    Parameters
    ----------
    tables : tuple of PoseTable
        With the joint covariances that lie beside their files.
    findings : tuple of Finding
        Results that are out of date, or of which nobody knows from what they were made.
    """

    tables: tuple[PoseTable, ...]
    findings: tuple[Finding, ...] = ()
    others: tuple[OutOfDate, ...] = ()
    """Further results, and files of the report, that are out of date."""


def read_tables(paths: Sequence[Path], names: Sequence[str] = ()) -> StoredTables:
    """Pose tables of single files, planar or spatial, each with its joint covariance.

    Parameters
    ----------
    paths : sequence of Path
        CSV files as `validation.poses.pose_table.from_csv` reads them.
    names : sequence of str, optional
        Their systems; by default a system is named after its file.

    Raises
    ------
    InputError
        Naming file, line, field and value of the bad places of all files.
    """
    tables: list[PoseTable] = []
    problems: list[Problem] = []
    for path, name in zip(paths, names or map(system_of, paths), strict=True):
        try:
            refuse_degrees(path)
            table = from_csv(path, system=name, components=components_of(path))
            tables.append(with_stored_follows(with_stored_joint(table, path), path))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    return StoredTables(tuple(tables))


def stored_tables(campaign: Campaign) -> StoredTables:
    """Tables under results/, as a run has written them; none where there was no run.

    In the order of the run, so that sums over them are the same to the last digit; those that
    no run has made come last.

    Raises
    ------
    GtvalError
        If one is bad.
    """
    steps = earlier_steps(earlier_record(campaign))
    made = {name: at for at, name in enumerate(one for s in steps.values() for one in s.outputs)}
    paths = sorted(campaign.results.glob("poses_*.csv"))
    found = read_tables(sorted(paths, key=lambda path: made.get(path.name, len(made))))
    old = out_of_date(campaign, steps)
    reasons = {one.file: one.reason for one in old}
    late = []
    for table in found.tables:
        name = f"poses_{table.system}.csv"
        if name not in made:
            text = f"results/{name}: results/{RECORD} does not say from what it was made"
            late.append(Finding("warning", f"{text}; {ANEW}", table.system, "no_provenance"))
        elif f"results/{name}" in reasons:
            text = f"results/{name} is out of date: {reasons[f'results/{name}']}"
            late.append(Finding("warning", f"{text}; {ANEW}", table.system, "out_of_date"))
    told = {f"results/{path.name}" for path in paths}
    others = tuple(one for one in old if one.file not in told)
    return StoredTables(found.tables, tuple(late), others)


ANEW = "`gtval run` makes it anew."


def system_of(path: Path) -> str:
    """'vision' for vision.csv, for vision.csv.gz and for poses_vision.csv."""
    return re.sub(r"^poses_", "", Path(path.name.removesuffix(".gz")).stem)


def components_of(path: Path) -> tuple[Component, ...]:
    """What the poses of a file consist of: poses in space have a yaw; positions have no heading."""
    names = ("yaw", "theta", "z")
    text = read_csv(path, [Column(name, required=False, blank=True) for name in names]).text
    yaw, theta, height = (any(text[name]) for name in names)
    if yaw:
        return SPATIAL
    if theta or not text["theta"]:
        return PLANAR
    return SPATIAL[:3] if height else PLANAR[:2]


def refuse_degrees(path: Path) -> None:
    """Raise, with their lines, for headings that can be degrees only."""
    cells = read_csv(path, [Column("theta", "number", required=False, blank=True)])
    angles = np.abs(np.array(cells.numbers["theta"], dtype=float))
    large = np.flatnonzero((angles > _MOST_RADIANS) & (angles <= _MOST_DEGREES))
    if len(large) > 2 or (len(large) and len(large) == len(angles)):
        for row in large:
            cells.flag(
                int(row), "theta", "looks like degrees; write radians: degrees times 0.0174533"
            )
        cells.raise_problems()
