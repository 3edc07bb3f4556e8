"""Hand-laser readings: the file, the names of the points, the distances they stand for."""

import difflib
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Self
from unicodedata import normalize

import numpy as np
import numpy.typing as npt

from survey.readings.instrument import corrected, reading_sigma
from survey.readings.point_names import robot_point
from survey.readings.units import check_distances, places_of_frame
from survey.settings import SurveySettings
from validation.campaign.folder import Campaign
from validation.poses.angles import Array
from validation.text_files.csv_tables import Column, CsvTable, read_csv
from validation.text_files.table_rows import SHEETS

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Readings:
    """Distances between named points.

    Parameters
    ----------
    start, end : tuple of str, length n
        The two points of each reading; the order has no meaning.
    distance : (n,) array
        Metres, corrected for the instrument's offset and scale.
    sigma : (n,) array
        Standard deviation of each, metres.
    line : tuple of int, length n
        Line of the file, 0 where there is no file.
    observer : tuple of str, length n
        Who measured, '' where not noted.
    time : tuple of str, length n
        When, as it stands in the file, '' where not noted.
    """

    start: tuple[str, ...]
    end: tuple[str, ...]
    distance: Array
    sigma: Array
    line: tuple[int, ...] = ()
    observer: tuple[str, ...] = ()
    time: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.start)
        object.__setattr__(self, "distance", np.asarray(self.distance, dtype=float))
        sigma = np.broadcast_to(np.asarray(self.sigma, dtype=float), (n,))
        object.__setattr__(self, "sigma", sigma)
        object.__setattr__(self, "line", tuple(self.line) or (0,) * n)
        object.__setattr__(self, "observer", tuple(self.observer) or ("",) * n)
        object.__setattr__(self, "time", tuple(self.time) or ("",) * n)
        if not len(self.end) == len(self.distance) == n:
            raise ValueError(f"{n} start points, {len(self.end)} ends, {self.distance.shape}")

    def __len__(self) -> int:
        return len(self.start)

    def select(self, rows: Mask | Sequence[int] | npt.NDArray[np.intp]) -> Self:
        """The given rows."""
        index = np.arange(len(self))[np.asarray(rows)]
        return replace(
            self,
            start=tuple(self.start[i] for i in index),
            end=tuple(self.end[i] for i in index),
            distance=self.distance[index],
            sigma=self.sigma[index],
            line=tuple(self.line[i] for i in index),
            observer=tuple(self.observer[i] for i in index),
            time=tuple(self.time[i] for i in index),
        )

    @cached_property
    def rows_of_point(self) -> dict[str, list[int]]:
        """Rows of the readings that start or end at each point."""
        rows: dict[str, list[int]] = {}
        for row, (a, b) in enumerate(zip(self.start, self.end, strict=True)):
            rows.setdefault(a, []).append(row)
            rows.setdefault(b, []).append(row)
        return rows

    def touching(self, names: Sequence[str], others: Sequence[str]) -> Self:
        """Readings between one of ``names`` and one of ``others``, turned to start in ``names``."""
        here, there = set(names), set(others)
        near = sorted({row for name in here for row in self.rows_of_point.get(name, ())})
        ends = [(self.start[row], self.end[row]) for row in near]
        forward = [a in here and b in there for a, b in ends]
        backward = [b in here and a in there for a, b in ends]
        kept = [f or b for f, b in zip(forward, backward, strict=True)]
        chosen = self.select(np.array(near, dtype=np.intp)[np.array(kept, dtype=bool)])
        pairs = [
            (a, b) if f else (b, a) for (a, b), f, k in zip(ends, forward, kept, strict=True) if k
        ]
        return replace(chosen, start=tuple(a for a, _ in pairs), end=tuple(b for _, b in pairs))

    @cached_property
    def _marks_of_pose(self) -> dict[str, list[str]]:
        """Names of the read marks of each pose, in the order of their first reading."""
        marks: dict[str, list[str]] = {}
        for name in self.rows_of_point:
            point = robot_point(name)
            if point is not None:
                marks.setdefault(point[0], []).append(name)
        return marks

    @cached_property
    def count_of_pose(self) -> dict[str, int]:
        """How many readings each pose has to what is not its own."""
        count = dict.fromkeys(self._marks_of_pose, 0)
        for pair in zip(self.start, self.end, strict=True):
            poses = [(robot_point(name) or ("",))[0] for name in pair]
            if poses[0] != poses[1]:
                for pose in poses:
                    if pose in count:
                        count[pose] += 1
        return count

    def of_pose(self, pose: str) -> Self:
        """Readings with a rig point of one pose at either end, turned to start there."""
        names = self._marks_of_pose.get(pose, [])
        rows = {row for name in names for row in self.rows_of_point[name]}
        others = {n for row in rows for n in (self.start[row], self.end[row])} - set(names)
        return self.touching(names, sorted(others))

    @property
    def poses(self) -> list[str]:
        """Ids of the poses that occur, in the order of their first reading."""
        return list(self._marks_of_pose)


@dataclass(frozen=True)
class ReadingsFile:
    """What a readings file holds.

    Parameters
    ----------
    used : Readings
        The readings to compute with.
    set_aside : Readings
        Those that a person marked with use = no.
    notes : tuple of str
        Why, in their order.
    said_before : tuple of int
        Lines that repeat an earlier one in time, pair and value: taken as repeats.
    """

    used: Readings
    set_aside: Readings
    notes: tuple[str, ...] = ()
    said_before: tuple[int, ...] = ()


def load_readings(campaign: Campaign, settings: SurveySettings) -> ReadingsFile | None:
    """The campaign's readings; None where it has no readings file.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.
    """
    path = readings_path(campaign, settings)
    if not path.exists():
        return None
    instrument = campaign.settings.instrument
    distance = Column("distance", "number", unit="m", written_in=settings.units)
    table = read_csv(
        path,
        [
            Column("from"),
            Column("to"),
            distance,
            Column("time", required=False, blank=True),
            Column("observer", required=False, blank=True),
            Column("use", required=False, blank=True),
            Column("note", required=False, blank=True),
        ],
    )
    for column in ("from", "to"):
        table.text[column] = _without_blanks(table.text[column], campaign, settings)
    _check_names(table, campaign, settings)
    _check_rows(table)
    places = places_of_frame(campaign.settings.vframe.points, settings.labels)
    limits = replace(distance, low=instrument.range_min, high=instrument.range_max)
    check_distances(table, places, limits)
    if len(table) == 0 and not table.problems:
        table.lines.append(1)
        table.raw["from"].append("")
        table.flag(0, "from", "the file has a header but no reading")
    table.raise_problems()
    readings = _as_readings(table, campaign, settings)
    kept = np.array([use.lower() != "no" for use in table.text["use"]])
    notes = [note for note, keep in zip(table.text["note"], kept, strict=True) if not keep]
    return ReadingsFile(
        readings.select(kept), readings.select(~kept), tuple(notes), _said_before(table)
    )


def _as_readings(table: CsvTable, campaign: Campaign, settings: SurveySettings) -> Readings:
    """Rows as distances between points, labels replaced by what they stand for."""
    instrument = campaign.settings.instrument
    meaning = settings.labels
    raw = np.array(table.numbers["distance"])
    sigma = (
        reading_sigma(instrument, raw)
        if settings.reading_sigma is None
        else np.full(len(raw), settings.reading_sigma)
    )
    return Readings(
        start=tuple(meaning.get(name, name) for name in table.text["from"]),
        end=tuple(meaning.get(name, name) for name in table.text["to"]),
        distance=corrected(instrument, raw),
        sigma=sigma,
        line=tuple(table.lines),
        observer=tuple(table.text["observer"]),
        time=tuple(table.text["time"]),
    )


def _without_blanks(names: list[str], campaign: Campaign, settings: SurveySettings) -> list[str]:
    """Names as campaign.toml writes them, which knows no blanks: 'mark 3' where it has 'mark_3'."""
    known = {*campaign.settings.vframe.points, *settings.labels, *settings.world_points}
    bare: dict[str, set[str]] = {}
    for name in known:
        bare.setdefault(re.sub("[-_]", "", normalize("NFC", name)), set()).add(name)

    def meant(name: str) -> str:
        name = re.sub(" ?/ ?", "/", name)
        if name in known or (" " not in name and name.isascii()):
            return name
        name = normalize("NFC", name)  # a Mac may write ü as u and a sign of its own
        alike = bare.get(re.sub("[- _]", "", name), set())
        return next(iter(alike)) if len(alike) == 1 else name

    return [meant(name) for name in names]


def _check_names(table: CsvTable, campaign: Campaign, settings: SurveySettings) -> None:
    """Flag names that are no known point."""
    vframe = set(campaign.settings.vframe.points)
    rig = set(campaign.settings.robot_frame.points)
    known = vframe | set(settings.labels) | set(settings.world_points)
    for column in ("from", "to"):
        for row, name in enumerate(table.text[column]):
            point = robot_point(name)
            if not name or name in known:
                continue
            if point is None:
                table.flag(row, column, _unknown_point(name, known))
            elif point[1] not in rig or not point[0] or "/" in point[1]:
                table.flag(
                    row, column, f"expected POSE/POINT with a point of {', '.join(sorted(rig))}"
                )


def _unknown_point(name: str, known: set[str]) -> str:
    if re.match(r"\d{4}-\d\d-\d\d", name):
        return "unknown point; where a spreadsheet made a date of it, write it as text"
    near = [one for one in sorted(known) if one.lower() == name.lower()]
    near = near or difflib.get_close_matches(name, known, 1, cutoff=0.5)
    hint = f"; did you mean '{near[0]}'?" if near else ""
    return (
        f"unknown point{hint} (Vframe points are set in [vframe.points], world points listed in "
        "[survey] world_points, robot points written POSE/POINT)"
    )


def _check_rows(table: CsvTable) -> None:
    """Flag readings from a point to itself and bad 'use' cells."""
    for row, (start, end) in enumerate(zip(table.text["from"], table.text["to"], strict=True)):
        if start and start == end:
            table.flag(row, "to", "a reading from a point to itself")
    for row, use in enumerate(table.text["use"]):
        if use.lower() not in {"", "yes", "no"}:
            table.flag(row, "use", "expected yes, no or nothing")


def _said_before(table: CsvTable) -> tuple[int, ...]:
    """Lines that repeat an earlier one in time, pair and value."""
    seen: set[object] = set()
    found = []
    for row, line in enumerate(table.lines):
        pair = frozenset((table.text["from"][row], table.text["to"][row]))
        same = pair, table.raw["distance"][row].strip(), table.text["time"][row]
        if same in seen:
            found.append(line)
        seen.add(same)
    return tuple(found)


def readings_path(campaign: Campaign, settings: SurveySettings) -> Path:
    """Where the readings are or would be: a sheet beside it where the file is not there."""
    path = campaign.folder / settings.readings
    sheets = (path.with_suffix(suffix) for suffix in SHEETS)
    return path if path.exists() else next((one for one in sheets if one.exists()), path)
