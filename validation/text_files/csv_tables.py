"""CSV files as people and spreadsheets write them, read with every bad place reported.

Separators may be commas, semicolons or tabs (told from the header). A decimal comma is
accepted where it cannot mean anything else: in quotes, or where the separator is another
character. Nothing is guessed: what cannot be read is a :class:`~validation.errors.Problem`.
"""

import csv
import io
import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from validation.errors import MAX_SHOWN_PROBLEMS, InputError, Problem, shown
from validation.text_files.reading import file_bytes

MAX_BYTES = 20_000_000
"""Some 200,000 rows: two orders more than any survey; a larger file is something else."""

MAX_PROBLEMS = 1000
"""After so many bad places a file is given up: it is something else. A judgement: no one mends
so many by hand."""

_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")
_WITH_UNIT = re.compile(rf"{_NUMBER.pattern}\s*([^\W\d_]{{1,6}}|['\"°])")


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
        For messages: 'm', 'rad'.
    """

    name: str
    kind: str = "text"
    required: bool = True
    blank: bool = False
    low: float = -math.inf
    high: float = math.inf
    unit: str = ""


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
    problems : list of Problem
        All the bad places found so far.
    """

    path: Path
    lines: list[int] = field(default_factory=list)
    text: dict[str, list[str]] = field(default_factory=dict)
    numbers: dict[str, list[float]] = field(default_factory=dict)
    raw: dict[str, list[str]] = field(default_factory=dict)
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


def read_csv(path: Path, columns: Sequence[Column], *, max_bytes: int = MAX_BYTES) -> CsvTable:
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

    Raises
    ------
    InputError
        Where nothing can be read: missing, empty, too large, not a table, columns missing.
    """
    rows = _rows(path, _decode(path, max_bytes))
    if not rows:
        raise InputError([Problem(path, "the file is empty; expected a header line", 1)])
    header_line, header = rows[0]
    header = [cell.strip() for cell in header]
    _check_header(path, header_line, header, columns)
    table = CsvTable(path)
    for column in columns:
        table.raw[column.name] = []
    for line, cells in rows[1:]:
        _add_row(table, line, cells, header)
    for column in columns:
        _read_column(table, column)
    return table


def header_of(path: Path, *, max_bytes: int = MAX_BYTES) -> list[str]:
    """The headings of a CSV file, for files whose columns are not known beforehand.

    Raises
    ------
    InputError
        Where nothing can be read, or the file is empty.
    """
    lines = _decode(path, max_bytes).lstrip("\r\n").split("\n", 1)
    rows = _rows(path, lines[0])
    if not rows:
        raise InputError([Problem(path, "the file is empty; expected a header line", 1)])
    return [cell.strip() for cell in rows[0][1]]


def _decode(path: Path, max_bytes: int) -> str:
    """Text of a file, undecodable bytes kept as lone surrogates."""
    data = file_bytes(path, max_bytes, "a table", text=True)
    if data.startswith(b"PK\x03\x04"):
        raise InputError([Problem(path, "this is a spreadsheet or an archive; save it as CSV", 1)])
    return data.decode("utf-8-sig", errors="surrogateescape")


def _rows(path: Path, text: str) -> list[tuple[int, list[str]]]:
    """Non-blank rows with the line on which each starts."""
    first = text.lstrip("\r\n").split("\n", 1)[0]
    delimiter = max(",;\t", key=first.count)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
    rows: list[tuple[int, list[str]]] = []
    start = 1
    try:
        for cells in reader:
            if any(cell.strip() for cell in cells):
                rows.append((start, cells))
            start = reader.line_num + 1
    except csv.Error as error:
        raise InputError([Problem(path, f"not a CSV table: {error}", start)]) from error
    return rows


def _check_header(path: Path, line: int, header: Sequence[str], columns: Iterable[Column]) -> None:
    """Raise for missing or repeated columns."""
    problems = [
        Problem(
            path,
            f"the column is missing; {_renamed(column.name, header) or _shown_header(header)}",
            line,
            column.name,
        )
        for column in columns
        if column.required and column.name not in header
    ]
    problems += [
        Problem(path, "the column stands twice in the header", line, column.name)
        for column in columns
        if header.count(column.name) > 1
    ]
    if problems:
        raise InputError(problems)


def _shown_header(header: Sequence[str]) -> str:
    """The headings as far as a person would read them."""
    named = [shown(name) for name in header[:MAX_SHOWN_PROBLEMS] if name]
    more = ", …" if len(header) > MAX_SHOWN_PROBLEMS else ""
    return "the header has: " + (", ".join(named) + more if named else "nothing")


def _renamed(name: str, header: Iterable[str]) -> str:
    """What to do about a heading that differs in capital letters only."""
    return next((f"write '{name}' instead of {shown(h)}" for h in header if h.lower() == name), "")


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
    table.lines.append(line)
    by_name = dict(zip(header, cells + [""] * (len(header) - len(cells)), strict=True))
    for name, column in table.raw.items():
        column.append(by_name.get(name, ""))


def _read_column(table: CsvTable, column: Column) -> None:
    """Fill `text` or `numbers` from the raw cells."""
    if _is_of_smaller_unit(table, column):
        table.numbers[column.name] = [math.nan] * len(table)
        return
    for row, raw in enumerate(table.raw[column.name]):
        cell = raw.strip()
        bad = _bad_text(cell, column)
        number = math.nan
        if bad is None and cell and column.kind == "number":
            number, bad = _number(cell, column)
        if bad is not None:
            table.flag(row, column.name, bad)
        if column.kind == "number":
            table.numbers.setdefault(column.name, []).append(number)
        else:
            table.text.setdefault(column.name, []).append(cell)
    if column.kind == "number":
        table.numbers.setdefault(column.name, [])
    else:
        table.text.setdefault(column.name, [])


def _is_of_smaller_unit(table: CsvTable, column: Column) -> bool:
    """Whether most lengths are above the limit, as in millimetres: told once, not for each."""
    if column.unit != "m":
        return False
    unlimited = replace(column, high=math.inf)
    numbers = [_number(raw.strip(), unlimited)[0] for raw in table.raw[column.name]]
    large = [row for row, number in enumerate(numbers) if number > column.high]
    if len(large) < 3 or 2 * len(large) < len(numbers):
        return False
    table.flag(
        large[0],
        column.name,
        f"out of range, like {len(large)} of {len(numbers)} cells; expected {_expected(column)}: "
        "divide millimetres by 1000, centimetres by 100",
    )
    return True


def _bad_text(cell: str, column: Column) -> str | None:
    """What is wrong with a cell as text, None if nothing is."""
    if not cell.isascii() and any("\udc80" <= character <= "\udcff" for character in cell):
        return "not UTF-8; save the file as UTF-8"
    if "\0" in cell or "\n" in cell or "\r" in cell:
        return "control characters or a line break in the cell (an unclosed quote?)"
    if not cell and column.required and not column.blank:
        return f"the cell is empty; expected {_expected(column)}"
    return None


def _number(cell: str, column: Column) -> tuple[float, str | None]:
    """A cell's number and what is wrong with it."""
    if _NUMBER.fullmatch(cell) is None:
        alone = "; write it without the unit" if _WITH_UNIT.fullmatch(cell) else ""
        return math.nan, f"not a number{alone}; expected {_expected(column)}"
    value = float(cell.replace(",", "."))
    if not column.low <= value <= column.high or not math.isfinite(value):
        return math.nan, f"out of range; expected {_expected(column)}"
    return value, None


def _expected(column: Column) -> str:
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
