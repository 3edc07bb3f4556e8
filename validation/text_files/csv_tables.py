"""Tables as people and spreadsheets write them, read with every bad place reported.

Separators may be commas, semicolons or tabs (told from the header, or by a line 'sep=;'); sheets
(xlsx, ods) are read too. A decimal comma is accepted where it cannot mean anything else: in
quotes, or where the separator is another character. Headings may be in capitals and state the
unit; lengths may state theirs in the cell. Nothing is guessed: what cannot be read is a
:class:`~validation.errors.Problem`.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from validation.errors import InputError, Problem, shown
from validation.text_files.csv_text import meant
from validation.text_files.headings import NUMBER, missing_column
from validation.text_files.lengths import (
    in_metres,
    split_heading,
    unit_of_word,
    with_unit,
)
from validation.text_files.table_rows import MAX_BYTES, SEPARATORS, Row, table_rows
from validation.text_files.time_units import UNIT_NAMES

__all__ = ["MAX_BYTES", "Column", "CsvTable", "expected", "header_of", "read_csv"]

MAX_PROBLEMS = 1000
"""After so many bad places a file is given up: it is something else. A judgement: no one mends
so many by hand."""

_WITH_UNIT = re.compile(rf"{NUMBER.pattern}\s*([^\W\d_]{{1,6}}|['\"°])")
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(([.,' \u00a0\u2009\u202f’])\d{3})+([.,]\d+)?(\s*[^\W\d_]+)?")


@dataclass(frozen=True)
class Column:
    """What a column holds.

    Parameters
    ----------
    name : str
        Header.
    kind : {"text", "number"}
        How its cells are read.
    required : bool
        Whether the column must be there; the cells of a missing optional one are blank.
    blank : bool
        Whether a cell may be empty ('' or NaN is then returned).
    low, high : float
        Closed limits of a number.
    unit : str
        'm', 'rad', for messages; a cell or heading of a column in 'm' may state another unit of
        length, and its numbers are then metres.
    written_in : str
        Unit of lengths that state none.
    """

    name: str
    kind: str = "text"
    required: bool = True
    blank: bool = False
    low: float = -math.inf
    high: float = math.inf
    unit: str = ""
    written_in: str = "m"


@dataclass
class CsvTable:
    """Columns of a file with the line each row came from; problems are added as they are found.

    Parameters
    ----------
    path : Path
        The file.
    lines : list of int
        Line on which each row starts, from 1.
    text : dict of str to list of str
        Stripped cells of the text columns.
    numbers : dict of str to list of float
        Cells of the number columns, NaN where blank or bad.
    raw : dict of str to list of str
        Every cell as written.
    own_unit : dict of str to list of bool
        Of columns of lengths, whether the cell or the heading states the unit.
    problems : list of Problem
        All the bad places found so far.
    """

    path: Path
    lines: list[int] = field(default_factory=list)
    text: dict[str, list[str]] = field(default_factory=dict)
    numbers: dict[str, list[float]] = field(default_factory=dict)
    raw: dict[str, list[str]] = field(default_factory=dict)
    own_unit: dict[str, list[bool]] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.lines)

    def flag(self, row: int, name: str, expected: str) -> None:
        """Record that a cell is bad; `raise_problems` reports it."""
        value = self.raw[name][row] if name in self.raw else None
        self.add(Problem(self.path, expected, self.lines[row], name, value))

    def add(self, problem: Problem) -> None:
        """Record a problem; raise what there is once there are far too many."""
        self.problems.append(problem)
        if len(self.problems) >= MAX_PROBLEMS:
            self.raise_problems()

    def flag_duplicates(
        self, names: Sequence[str], key: Callable[[int], object] | None = None
    ) -> None:
        """Record every row whose key was already on an earlier line."""
        first: dict[object, int] = {}
        for row, line in enumerate(self.lines):
            cells = tuple(self.raw[name][row].strip() for name in names)
            identity = cells if key is None else key(row)
            if identity in first:
                said = ", ".join(f"{n} = {c}" for n, c in zip(names, cells, strict=True))
                self.add(
                    Problem(
                        self.path,
                        f"the same as line {first[identity]} ({said}); remove one of the two",
                        line,
                        names[0],
                        self.raw[names[0]][row],
                    )
                )
            else:
                first[identity] = line

    def raise_problems(self) -> None:
        """Raise an InputError if anything was found."""
        if self.problems:
            raise InputError(sorted(self.problems, key=lambda problem: problem.line or 0))


def read_csv(
    path: Path,
    columns: Sequence[Column],
    *,
    max_bytes: int = MAX_BYTES,
    data: bytes | None = None,
    renamed: Mapping[str, str] | None = None,
) -> CsvTable:
    """The cells of a CSV file, with its bad places recorded in ``problems``.

    Call ``raise_problems`` on the result after adding checks of your own.

    Parameters
    ----------
    path : Path
        The file, UTF-8 with or without a byte-order mark.
    columns : sequence of Column
        What is expected; further columns are ignored.
    max_bytes : int
        A larger file is refused unread.
    data : bytes, optional
        Contents of the file, where they were unpacked before.
    renamed : mapping of str to str, optional
        What headings are read as, by how they are written.

    Raises
    ------
    InputError
        Where nothing can be read: missing, empty, too large, not a table, columns missing.
    """
    rows = table_rows(path, max_bytes, data)
    if not rows:
        raise InputError([Problem(path, "the file is empty; expected a header line", 1)])
    if renamed:
        line, written = rows[0]
        rows = [(line, [renamed.get(cell, cell) for cell in written]), *rows[1:]]
    header, units = _matched_header(path, rows, columns)
    table = CsvTable(path)
    for column in columns:
        table.raw[column.name] = []
    if all(len(cells) == len(header) for _, cells in rows[1:]):
        table.lines.extend(line for line, _ in rows[1:])
        by_name = dict(
            zip(header, zip(*(cells for _, cells in rows[1:]), strict=True), strict=False)
        )
        for name, found in table.raw.items():
            found.extend(by_name.get(name, [""] * len(table.lines)))
    else:
        for line, cells in rows[1:]:
            _add_row(table, line, cells, header)
    for column in columns:
        _read_column(table, column, units.get(column.name, ""))
    return table


def header_of(path: Path, *, max_bytes: int = MAX_BYTES) -> list[str]:
    """The headings of a table, for files whose columns are not known beforehand.

    Raises
    ------
    InputError
        Where nothing can be read, or the file is empty.
    """
    rows = table_rows(path, max_bytes)
    if not rows:
        raise InputError([Problem(path, "the file is empty; expected a header line", 1)])
    return [meant(cell.strip()) for cell in rows[0][1]]


def _matched_header(
    path: Path, rows: Sequence[Row], columns: Sequence[Column]
) -> tuple[list[str], dict[str, str]]:
    """The names of the columns in their order, and the units that headings state.

    A heading counts as that of a column if it is its name, or its name in other letters or with
    a unit where no other heading is.

    Raises
    ------
    InputError
        For missing or repeated columns, and for units that cannot be used.
    """
    line, written = rows[0]
    header = [meant(cell.strip()) for cell in written]
    units: dict[str, str] = {}
    problems = []
    required = [column.name for column in columns if column.required]
    for column in columns:
        exact = [at for at, name in enumerate(header) if name == column.name]
        alike = [at for at, name in enumerate(header) if split_heading(name)[0] == column.name]
        found = exact or alike
        if len(found) > 1:
            said = "the column stands twice in the header; remove or rename one"
            problems.append(Problem(path, said, line, column.name))
        elif found:
            unit = "" if exact else split_heading(header[found[0]])[1]
            if _bad_unit(unit, column):
                said = f"the heading says {shown(unit)}; write {column.unit or 'plain numbers'}"
                problems.append(Problem(path, said, line, column.name, header[found[0]]))
            units[column.name] = unit_of_word(unit) if column.unit == "m" else ""
            header[found[0]] = column.name
        elif column.required:
            said = f"the column is missing; {missing_column(column.name, rows, required)}"
            problems.append(Problem(path, said, line, column.name))
    if problems:
        raise InputError(problems)
    return header, units


def _bad_unit(unit: str, column: Column) -> bool:
    """Whether a heading states a unit that the numbers of a column cannot be in."""
    if unit and column.unit == "s":
        return UNIT_NAMES.get(unit, "s" if column.kind == "text" else unit) != "s"
    if not unit or column.kind != "number":
        return False
    return not unit_of_word(unit) if column.unit == "m" else unit != column.unit.lower()


def _add_row(table: CsvTable, line: int, cells: list[str], header: Sequence[str]) -> None:
    """Append a row's raw cells; a row of the wrong length is a problem and left out."""
    while len(cells) > len(header) and not cells[-1].strip():
        cells = cells[:-1]
    if len(cells) > len(header):
        table.add(
            Problem(
                table.path,
                f"{len(cells)} cells under {len(header)} headings (a decimal comma needs quotes, "
                "or ';' between the cells)",
                line,
                header[-1],
                ",".join(cells),
            )
        )
        return
    if len(cells) == 1 < len(header) and sum(map(cells[0].count, SEPARATORS)) > 1:
        said = "its cells are not divided as those of the header are: use the same character"
        table.add(Problem(table.path, said, line, header[0], cells[0]))
        return
    table.lines.append(line)
    by_name = dict(zip(header, cells + [""] * (len(header) - len(cells)), strict=True))
    for name, column in table.raw.items():
        column.append(by_name.get(name, ""))


def _read_column(table: CsvTable, column: Column, heading_unit: str) -> None:
    """Fill `text` or `numbers` from the raw cells."""
    cells = table.raw[column.name]
    if (column.blank or not column.required) and not any(cells):
        if column.kind == "number":
            table.numbers[column.name] = [math.nan] * len(cells)
            table.own_unit[column.name] = [bool(heading_unit)] * len(cells)
        else:
            table.text[column.name] = [""] * len(cells)
    elif column.kind == "number":
        _read_numbers(table, column, heading_unit)
    else:
        _read_text(table, column)


def _read_text(table: CsvTable, column: Column) -> None:
    """Fill `text` from the raw cells."""
    cells = table.raw[column.name]
    table.text[column.name] = [meant(" ".join(raw.split())) for raw in cells]
    filled = column.blank or not column.required or all(table.text[column.name])
    if filled and _is_plain("".join(cells)):
        return
    for row, raw in enumerate(cells):
        bad = _bad_text(raw.strip(), column)
        if bad is not None:
            table.flag(row, column.name, bad)


def _read_numbers(table: CsvTable, column: Column, heading_unit: str) -> None:
    """Fill `numbers` from the raw cells."""
    written_in = heading_unit or column.written_in
    numbers = table.numbers[column.name] = [math.nan] * len(table)
    stated = [bool(heading_unit)] * len(table)
    if column.unit == "m":
        table.own_unit[column.name] = stated
    if (good := _all_numbers(table.raw[column.name], column, written_in)) is not None:
        table.numbers[column.name] = good
        return
    if column.unit == "m" and not heading_unit and _is_of_smaller_unit(table, column):
        return
    for row, raw in enumerate(table.raw[column.name]):
        cell = raw.strip()
        bad = _bad_text(cell, column)
        if bad is None and cell:
            numbers[row], bad, own = _number(cell, column, written_in)
            stated[row] = stated[row] or own
        if bad is not None:
            table.flag(row, column.name, bad)


def _all_numbers(cells: Sequence[str], column: Column, written_in: str) -> list[float] | None:
    """A column of numbers in which nothing is wrong or missing, at once; None for any other."""
    stripped = [raw.strip() for raw in cells]
    if column.unit == "m" and written_in != "m":
        return None
    if not all(map(NUMBER.fullmatch, stripped)):
        return None
    numbers = [float(cell.replace(",", ".")) for cell in stripped]
    good = not numbers or (column.low <= min(numbers) and max(numbers) <= column.high)
    return numbers if good and all(map(math.isfinite, numbers)) else None


def _is_plain(text: str) -> bool:
    """Whether no character of a text can be wrong."""
    return text.isascii() and not any(one in text for one in "\0\n\r")


def _is_of_smaller_unit(table: CsvTable, column: Column) -> bool:
    """Whether most lengths are above the limit, as in millimetres: told once, not for each."""
    if column.unit != "m":
        return False
    wide = replace(column, low=-math.inf, high=math.inf)
    found = [_number(raw.strip(), wide, column.written_in) for raw in table.raw[column.name]]
    plain = [(row, one[0]) for row, one in enumerate(found) if not one[2]]
    large = [row for row, number in plain if number > column.high]
    if len(large) < 3 or 2 * len(large) < len(plain):
        return False
    table.flag(
        large[0],
        column.name,
        f"out of range, like {len(large)} of {len(plain)} cells; expected {expected(column)}: "
        "divide millimetres by 1000, centimetres by 100",
    )
    return True


def is_cell(text: str) -> bool:
    """Whether a text comes back from a table as it was written there."""
    return _unreadable(text) is None and " ".join(text.split()) == text


def _unreadable(cell: str) -> str | None:
    """What keeps a cell from being read as text, None if nothing does."""
    if not cell.isascii() and any("\udc80" <= character <= "\udcff" for character in cell):
        return "not UTF-8; save the file as UTF-8"
    if "\ufffd" in cell:
        return "a character that cannot be read; save the file as UTF-8"
    if "\0" in cell or "\n" in cell or "\r" in cell:
        return "control characters or a line break in the cell (an unclosed quote?)"
    return None


def _bad_text(cell: str, column: Column) -> str | None:
    """What is wrong with a cell as text, None if nothing is."""
    if unreadable := _unreadable(cell):
        return unreadable
    if not cell and column.required and not column.blank:
        return f"the cell is empty; expected {expected(column)}"
    return None


def _number(cell: str, column: Column, written_in: str) -> tuple[float, str | None, bool]:
    """A cell's number, what is wrong with it, and whether it states its own unit."""
    own = False
    if NUMBER.fullmatch(cell) is not None:
        value = float(cell.replace(",", "."))
        if column.unit == "m" and written_in != "m":
            value = in_metres(value, written_in)
    else:
        length = with_unit(cell) if column.unit == "m" else None
        own = length is not None
        if column.unit == "m" and written_in == "in" and not own:
            length = with_unit(f"{cell} in")  # 136 1/2
        if length is None:
            hint = _hint(cell, is_length=column.unit == "m")
            return math.nan, f"not a number{hint}; expected {expected(column)}", False
        value = length[0]
    if not column.low <= value <= column.high or not math.isfinite(value):
        return math.nan, f"out of range; expected {expected(column)}", own
    return value, None, own


def _hint(cell: str, *, is_length: bool) -> str:
    """What to do about a cell that is no number."""
    if len(cell) > 2 and cell[0] == cell[-1] and cell[0] in "'`":
        return "; write it without quotes"
    if not any(character.isdigit() for character in cell):
        return "; leave the row out where nothing was measured"
    if cell.startswith("="):
        return "; write the value of the formula"
    unit = _WITH_UNIT.fullmatch(cell)
    like = "; write it like 2.504, 2.504 m or 8' 2 9/16\"" if is_length else ""
    if unit and not (is_length and unit_of_word(unit[unit.re.groups])):
        return f"; write it without the unit{', in m, cm, mm, ft or in' * is_length}"
    return "; write it without signs between the thousands" if _THOUSANDS.fullmatch(cell) else like


def expected(column: Column) -> str:
    """What a good cell looks like, in words."""
    if column.kind != "number":
        return "a name"
    unit = f" {column.unit}" if column.unit else ""
    if math.isinf(column.low) and math.isinf(column.high):
        return f"a number{' in ' + column.unit if column.unit else ''}"
    if math.isinf(column.high):
        return f"a number of at least {column.low:g}{unit}"
    if math.isinf(column.low):
        return f"a number of at most {column.high:g}{unit}"
    return f"a number from {column.low:g} to {column.high:g}{unit}"
