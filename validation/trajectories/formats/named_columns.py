"""Tables with named columns, in the spellings that people and programs use."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from validation.errors import GtvalError, InputError
from validation.poses.angles import Array
from validation.poses.trajectory import Clock
from validation.text_files.time_units import UNIT_NAMES
from validation.trajectories.formats.covariances import last_digit, symmetric
from validation.trajectories.formats.records import Records, without_rows
from validation.trajectories.formats.source import (
    Rows,
    Source,
    cells_of,
    is_number,
    read_rows,
    separator_of,
)

MARK = "# gtval trajectory"
"""First line of gtval's own files; their stamps are seconds, their angles radians."""
CODES = {"plane": "xyt", "space": "xyzuvw", "points_plane": "xy", "points_space": "xyz"}
"""Letters of the covariance columns of each kind; u, v, w are small rotations about X, Y, Z."""

_LENGTHS = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "meters": 1.0, "metres": 1.0, "meter": 1.0}
_ANGLES = {"deg": True, "degree": True, "degrees": True, "°": True, "rad": False, "radians": False}
_BRACKET = re.compile(r"[\[(]\s*([^\])]*?)\s*[\])]\s*$")
_OUTER = {"field", "header", "pose", "transform", "msg", "data", "gt"}
_PREFIXES = {"position", "pos", "p", "translation", "location", "rs", "r", "rb"}
_TURNED = {"q", "quat", "quaternion", "orientation", "rotation", "rot"}
_TIME = {"t", "time", "times", "timestamp", "timestamps", "stamp", "stamps", "epoch", "unixtime"}
_YAW = {"yaw", "theta", "heading", "psi", "th"}


@dataclass(frozen=True)
class Heading:
    """One column: what it is, and in which unit, '' where not said."""

    role: str
    unit: str
    column: int


def heading_of(name: str, column: int) -> Heading:
    """What a column's name says; the role is '' where it says nothing that is known."""
    name = name.strip().lstrip("#%").strip().strip('"')
    unit = ""
    if found := _BRACKET.search(name):
        unit, name = found.group(1).lower(), name[: found.start()]
    words = [word for word in re.split(r"[^a-z0-9°]+", name.lower()) if word]
    known = {**UNIT_NAMES, **_LENGTHS, **_ANGLES}
    if len(words) > 1 and words[-1] in known and not unit:
        unit = words.pop()
    return Heading(_role(words, name), unit, column)


def _role(words: list[str], name: str) -> str:  # noqa: PLR0911  (one rule a line)
    """Role of a column by the words of its name."""
    if words[-1:] == ["stamp"] and words[:1] in (["header"], ["field"]):
        return "header_stamp"
    while len(words) > 1 and words[0] in _OUTER:
        words = words[1:]
    joined = "".join(words)
    if joined in UNIT_NAMES and len(joined) > 2:
        return "sec" if UNIT_NAMES[joined] == "s" else "nsec" if joined.startswith("n") else ""
    if joined in _TIME or joined in {"rosbagtimestamp", "unixtimestamp", "timestampunix"}:
        return "time"
    if joined in _YAW | {"pitch", "roll"}:
        return "yaw" if joined in _YAW else joined
    if joined in {"pose", "stop"} and len(words) == 1:
        return "pose"
    if found := re.fullmatch(r"(?:p|pos|t)?([xyz])(?:pos)?", joined):
        return found.group(1)
    if found := re.fullmatch(r"(?:q|quat|o|quaternion)([xyzw])", joined):
        return f"q{found.group(1)}"
    return _long_role(words, joined, name)


def _long_role(words: list[str], joined: str, name: str) -> str:  # noqa: PLR0911  (same)
    """Role of a column of several words, or a covariance."""
    if len(words) > 1 and words[-1] in set("xyzw"):
        before = [word for word in words[:-1] if word not in _PREFIXES]
        if before and set(before) <= _TURNED:
            return f"q{words[-1]}"
        if not before and words[-1] != "w":
            return words[-1]
    if joined in {"east", "easting"}:
        return "x"
    if joined in {"north", "northing"}:
        return "y"
    if name.strip().lower() in _COVARIANCES:
        return f"c_{name.strip().lower()}"
    short = re.sub(r"^(cov|var|variance)", "", joined)
    if short != joined:
        short = re.sub(r"theta|yaw", "t", short)
        short = short * 2 if joined.startswith("var") else short
        return f"c_{short}" if short in _COVARIANCES else ""
    short = re.sub(r"^(sigma|std|sd)", "", joined)
    if short != joined:
        short = re.sub(r"theta|yaw", "t", short)
        return f"s_{short}" if short in {"x", "y", "z", "t"} else ""
    return ""


_COVARIANCES = {
    a + b for codes in CODES.values() for a, b in combinations_with_replacement(codes, 2)
}


@dataclass(frozen=True)
class Header:
    """The named columns of a file.

    Parameters
    ----------
    after : int
        Lines before the first row of numbers.
    separator : str
        Between the cells.
    names : list of str
        As written.
    headings : mapping of str to Heading
        By role.
    twice : list of str
        Roles that two columns claim, told as an error.
    """

    after: int
    separator: str
    names: list[str]
    headings: Mapping[str, Heading]
    twice: list[str]

    @property
    def lacks(self) -> list[str]:
        """What is missing to make positions at times."""
        has = set(self.headings)
        lacks = [] if has & {"time", "header_stamp", "sec", "nsec"} else ["a time"]
        return lacks + [name for name in ("x", "y") if name not in has]

    @property
    def order(self) -> list[str]:
        """Roles of all columns as they stand."""
        by_column = {heading.column: role for role, heading in self.headings.items()}
        return [by_column.get(column, "") for column in range(len(self.names))]


def header_of_names(names: Sequence[str], after: int, separator: str) -> Header:
    """The roles of the columns of a header."""
    found: dict[str, Heading] = {}
    twice: list[str] = []
    for column, name in enumerate(names):
        heading = heading_of(name, column)
        role = heading.role
        if not role:
            continue
        if role in {"time", "header_stamp"} and role in found:
            # stamp_sec and stamp_nsec: one is the rest of the other.
            units = [UNIT_NAMES.get(one.unit) for one in (found[role], heading)]
            if units == ["s", "ns"]:
                role = "nsec"
            elif units == ["ns", "s"]:
                found["nsec"] = found.pop(role)
        if role in found:
            # Of 'x' and 'px' the plain name is meant.
            plain = [h for h in (found[role], heading) if names[h.column].strip().lower() == role]
            if len(plain) == 1:
                heading = plain[0]
            else:
                twice.append(role)
        found[role] = Heading(role, heading.unit, heading.column)
    return Header(after, separator, list(names), found, twice)


def find_header(lines: Sequence[str]) -> Header | None:
    """The header of a table, or None where its first row is numbers without names above.

    Names may stand in the last comment before the numbers, as EuRoC and TUM files have them.
    """
    comment: tuple[int, str] | None = None
    for number, line in enumerate(lines):
        stripped = line.strip()
        if not stripped:
            continue
        if stripped[0] in "#%":
            comment = (number, stripped.lstrip("#%").strip())
            continue
        separator = separator_of(stripped)
        cells = cells_of(stripped, separator)
        if not _is_row(cells):
            return header_of_names(cells, number + 1, separator)
        if comment is None:
            return None
        width = len([cell for cell in cells if cell])
        for between in dict.fromkeys((separator, ",", " ")):
            names = [name for name in cells_of(comment[1], between) if name]
            if len(names) == width:
                header = header_of_names(names, number, separator)
                return header if not header.lacks else None
        return None
    if comment is not None:
        names = cells_of(comment[1], separator_of(comment[1]))
        header = header_of_names(names, len(lines), separator_of(comment[1]))
        return header if not header.lacks else None
    return None


def _is_row(cells: Sequence[str]) -> bool:
    """Whether cells are of a row of numbers, not names; a bad cell makes no header of a row."""
    numbers = sum(is_number(cell.replace(",", ".")) for cell in cells)
    return numbers * 2 > len(cells) or (numbers > 0 and is_number(cells[0]))


def read_named(source: Source, form: str = "csv") -> Records:
    """A table with named columns.

    Raises
    ------
    InputError
        For columns that are missing or told twice, and every bad cell.
    """
    header = find_header(source.lines)
    if header is None:
        raise source.error("the columns have no names", 1)
    if header.lacks:
        missing = ", ".join(header.lacks)
        named = ", ".join(f"'{name}'" for name in header.names[:20])
        raise source.error(f"no column for {missing}; the header has: {named}", header.after)
    if header.twice:
        raise InputError(
            source.problem("two columns could be this; rename or remove one", header.after, role)
            for role in header.twice
        )
    own = source.lines[0].strip() == MARK
    rows = read_rows(source, header.after, header.separator, header.names)
    records = _columns_read(source, header, rows, form)
    if own:
        _own_facts(source, records)
    return records


def _columns_read(source: Source, header: Header, rows: Rows, form: str) -> Records:
    """Positions, orientation and covariance of the rows."""
    columns = header.headings
    axes = [axis for axis in "xyz" if axis in columns]
    blank = _lost(rows, [columns[axis].column for axis in axes])
    lines = rows.lines
    notes: list[str] = []
    if blank is not None:
        notes = without_rows(~blank, lines, "as their position is blank")
        rows = rows.select(np.flatnonzero(~blank).tolist())
    scales = [_scale(source, header, columns[axis]) for axis in axes]
    positions = rows.numbers([columns[axis].column for axis in axes]) * scales
    stamps, unit = _stamps(rows, header)
    records = Records(
        source, form, rows.lines, stamps, positions, unit=unit, notes=notes, assumed=False
    )
    _orientation(records, rows, header)
    _covariance(records, rows, header)
    return records


def _lost(rows: Rows, columns: Sequence[int]) -> "np.ndarray[Any, np.dtype[np.bool_]] | None":
    """Rows whose position is blank: where tracking was lost. None if there are none."""
    if all(all(rows.columns[column]) for column in columns):
        return None
    blank = np.array(
        [not any(map(str.strip, cells)) for cells in zip(*(rows.columns[c] for c in columns))]  # noqa: B905
    )
    return blank if blank.any() and not blank.all() else None


def _scale(source: Source, header: Header, heading: Heading) -> float:
    """Metres of one unit of a column."""
    if heading.unit and heading.unit not in _LENGTHS:
        name = header.names[heading.column]
        raise source.error(f"the unit '{heading.unit}' is no length", header.after, name)
    return _LENGTHS.get(heading.unit, 1.0)


def _stamps(rows: Rows, header: Header) -> tuple[Any, str | None]:
    """The stamps and their unit, where the names tell it."""
    columns = header.headings
    fine = columns.get("nsec")
    whole = columns.get("header_stamp") or columns.get("sec") or columns.get("time")
    if fine is not None and whole is not None:
        values = rows.numbers([whole.column, fine.column])
        if (values[:, 1] < 1e9).all() and (values == np.rint(values)).all() and (values >= 0).all():
            if (values[:, 0] > 1e11).any():
                raise rows.source.error("seconds of no year of ours", rows.lines[0])
            return (
                values[:, 0].astype(np.int64) * 1_000_000_000 + values[:, 1].astype(np.int64),
                "ns",
            )
    heading = fine or whole
    if heading is None:  # pragma: no cover  (a header that lacks a time is refused before)
        raise GtvalError("no column for the time")
    rows.numbers([heading.column])
    said = UNIT_NAMES.get(heading.unit)
    if said is None:
        said = {"sec": "s", "nsec": "ns"}.get(heading.role)
    return rows.text(heading.column), said


def _orientation(records: Records, rows: Rows, header: Header) -> None:
    """Quaternions or angles, where there are columns for them."""
    columns = header.headings
    parts = [f"q{axis}" for axis in "xyzw"]
    if all(part in columns for part in parts):
        if records.positions.shape[1] == 2:
            records.positions = np.column_stack([records.positions, np.zeros(len(rows))])
        records.quaternions = rows.numbers([columns[part].column for part in parts])
        return
    if some := [part for part in parts if part in columns]:
        missing = ", ".join(part for part in parts if part not in columns)
        said = f"a quaternion needs four columns; {missing} is missing"
        raise records.source.error(said, header.after, header.names[columns[some[0]].column])
    names = [name for name in ("yaw", "pitch", "roll") if name in columns]
    if "yaw" not in names:
        return
    told = {_ANGLES.get(columns[name].unit) for name in names}
    if len(told) > 1:
        raise records.source.error("some angles are in degrees, others not", header.after, "yaw")
    records.degrees = told.pop()
    angles = rows.numbers([columns[name].column for name in names])
    if records.positions.shape[1] == 3:
        if len(names) == 1:
            records.notes.append("pitch and roll are not in the file: taken as 0")
        whole = np.zeros((len(rows), 3))
        whole[:, [("yaw", "pitch", "roll").index(name) for name in names]] = angles
        angles = whole
    else:
        angles = angles[:, :1]
    records.angles = angles


def _covariance(records: Records, rows: Rows, header: Header) -> None:
    """The upper triangle, or standard deviations, where there are columns for all of it."""
    columns = header.headings
    plane = records.positions.shape[1] == 2
    turned = records.quaternions is not None or records.angles is not None
    codes = CODES[("" if turned else "points_") + ("plane" if plane else "space")]
    codes = codes if turned else CODES["points_plane" if plane else "points_space"]
    names = [f"c_{a}{b}" for a, b in combinations_with_replacement(codes, 2)]
    there = [name for name in names if name in columns]
    if there and len(there) == len(names):
        wrong = [
            n for n in there if columns[n].unit not in {"", "m^2", "m2", "rad^2", "m rad", "m"}
        ]
        if wrong:
            name = header.names[columns[wrong[0]].column]
            raise records.source.error("covariances must be in m and rad", header.after, name)
        places = [columns[name].column for name in names]
        records.covariances = symmetric(rows.numbers(places, blank=True), len(codes))
        records.digit = last_digit([rows.columns[place] for place in places])
    elif there:
        missing = ", ".join(name[2:] for name in names if name not in columns)
        records.notes.append(f"the covariance is not used, as columns are missing: {missing}")
    sigmas = [f"s_{code}" for code in codes]
    if not there and all(name in columns for name in sigmas):
        values = rows.numbers([columns[name].column for name in sigmas], blank=True)
        scale = [_sigma_scale(columns[name].unit) for name in sigmas]
        records.covariances = (values * scale)[:, :, None] ** 2 * np.eye(len(codes))
        records.covariances[np.isnan(values).any(1)] = np.nan


def _sigma_scale(unit: str) -> float:
    """Metres or radians of one unit of a standard deviation."""
    return float(np.radians(1.0)) if _ANGLES.get(unit) else _LENGTHS.get(unit, 1.0)


def _own_facts(source: Source, records: Records) -> None:
    """What the comments of gtval's own file say."""
    told: dict[str, Any] = {}
    for number, line in enumerate(source.lines[1:], 2):
        if not line.startswith("#"):
            break
        name, equals, value = line[1:].partition("=")
        if not equals:
            continue
        try:
            told[name.strip()] = json.loads(value)
        except ValueError:
            raise source.error("not a value", number, name.strip(), value.strip()) from None
    wanted = {"epoch": int, "rate": (int, float), "exposure": (int, float)}
    wanted |= {"longest_interval": (int, float)}
    wanted |= dict.fromkeys(("system", "frame", "child_frame", "stamps"), str)
    for name, kind in wanted.items():
        if told.get(name) is not None and not isinstance(told[name], kind):  # type: ignore[arg-type]
            raise source.error("not a value for this", None, name, str(told[name]))
    stamps = told.get("stamps", "unknown")
    if stamps not in {"capture", "receipt", "unknown"}:
        raise source.error("expected capture, receipt or unknown", None, "stamps", str(stamps))
    records.own = True
    records.unit, records.assumed, records.degrees = "s", False, False
    records.digit = None
    records.clock = Clock(stamps, told.get("rate"), told.get("exposure"))
    records.epoch = told.get("epoch")
    records.longest_interval = told.get("longest_interval")
    records.system = told.get("system", "")
    records.frame, records.child_frame = told.get("frame", ""), told.get("child_frame", "")


def upper_triangle(covariances: Array) -> Array:
    """(n, m (m + 1) / 2) numbers of the upper triangles, row by row."""
    rows, columns = np.triu_indices(covariances.shape[1])
    return np.asarray(covariances[:, rows, columns])
