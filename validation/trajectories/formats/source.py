"""A file of poses before its format is known, and its rows of numbers."""

import gzip
import re
import warnings
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from pathlib import Path

import numpy as np

from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array
from validation.text_files.reading import file_bytes

MAX_BYTES = 1_000_000_000
"""Two million poses with covariances, a day at 20 Hz, take half of this; a larger file is something
else."""
MAX_PROBLEMS = 1000
"""After so many bad places a file is given up, as in other tables."""
HEAD_BYTES = 65_536
"""What is looked at to tell a format: the header of a motion capture of a hundred bodies, and some
rows."""

LARGEST = 1e30
"""No time, length or variance is larger: nanoseconds since 1970 have 19 digits. Its powers stay far
from what a double holds."""

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_GZIP = b"\x1f\x8b"
_ENDINGS = re.compile(r"\.(gz|csv|tsv|txt|tum|kitti|mcap|bag|db3|gsi|xml|landxml)$", re.IGNORECASE)


@dataclass(frozen=True)
class Asked:
    """What the user says of a file because the file does not.

    Parameters
    ----------
    unit : {"s", "ms", "us", "ns"}, optional
        Of the stamps.
    topic : str, optional
        Of a bag.
    times : Path, optional
        A file with one stamp a line, for formats without times.
    degrees : bool, optional
        Whether angles are in degrees.
    body : str, optional
        Rigid body of a motion capture, child frame of a transform.
    up : {"y", "z"}, optional
        Axis of a motion capture that points up.
    """

    unit: str | None = None
    topic: str | None = None
    times: Path | None = None
    degrees: bool | None = None
    body: str | None = None
    up: str | None = None


@dataclass(frozen=True)
class Source:
    """A file's name and bytes, unpacked if it was compressed."""

    path: Path
    data: bytes

    @cached_property
    def lines(self) -> list[str]:
        """The text by lines; bytes that are not UTF-8 become lone surrogates."""
        text = self.data.decode("utf-8-sig", errors="surrogateescape")
        if "\r" in text:
            text = text.replace("\r\n", "\n").replace("\r", "\n")
        return text.split("\n")

    @property
    def suffix(self) -> str:
        """Ending of the name in small letters, without that of a compression: '.csv'."""
        name = self.path.name.lower()
        return Path(name.removesuffix(".gz")).suffix

    def problem(
        self, said: str, line: int | None = None, field: str | None = None, value: str | None = None
    ) -> Problem:
        """A bad place of this file."""
        return Problem(self.path, said, line, field, value)

    def error(
        self, said: str, line: int | None = None, field: str | None = None, value: str | None = None
    ) -> InputError:
        """An error about one bad place of this file."""
        return InputError([self.problem(said, line, field, value)])


def system_name(path: Path) -> str:
    """A file's name without its endings: 'GROUNDTRUTH' of GROUNDTRUTH.csv.gz."""
    name = path.name
    for _ in range(2):
        name = _ENDINGS.sub("", name)
    return name.removeprefix("poses_") or path.name


def open_source(path: Path) -> Source:
    """A whole file, unpacked where it is compressed with gzip.

    Raises
    ------
    GtvalError
        If it is missing, empty, too large, cut off, UTF-16, or cannot be read.
    """
    data = file_bytes(path, MAX_BYTES, "a trajectory")
    if data.startswith(_GZIP):
        data = _unpacked(path, data, MAX_BYTES)
    if not data.strip():
        raise InputError([Problem(path, "the file is empty", 1)])
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError([Problem(path, "saved as UTF-16; save the file as UTF-8", 1)])
    return Source(path, data)


def open_head(path: Path) -> Source:
    """The whole lines among the first `HEAD_BYTES` of a file, unpacked."""
    with path.open("rb") as stream:
        data = stream.read(HEAD_BYTES)
        whole = not stream.read(1)
    if data.startswith(_GZIP):
        unpacker = zlib.decompressobj(wbits=31)
        try:
            data = unpacker.decompress(data, HEAD_BYTES)
        except zlib.error:
            data = b""
        whole = unpacker.eof
    return Source(path, data if whole else data[: data.rfind(b"\n") + 1] or data)


def _unpacked(path: Path, data: bytes, most: int) -> bytes:
    """The content of a gzip file.

    Raises
    ------
    InputError
        If it is damaged, cut off, or larger than a trajectory can be.
    """
    from io import BytesIO  # noqa: PLC0415  (most files are not compressed)

    try:
        with gzip.GzipFile(fileobj=BytesIO(data)) as stream:
            content = stream.read(most + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError([Problem(path, f"the gzip file is damaged or cut off: {error}")]) from None
    if len(content) > most:
        raise InputError([Problem(path, f"more than {most / 1e6:.0f} MB when unpacked")])
    return content


def separator_of(line: str) -> str:
    """What stands between the cells of a line: ';', tab, ',' or ' ' for any blanks."""
    if ";" in line:
        return ";"
    if "," in line:
        return "," if "\t" not in line else "\t"
    return "\t" if "\t" in line.strip() else " "


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of one line, stripped; a separator at the end is no cell."""
    if separator == " ":
        return line.split()
    if '"' in line:
        import csv  # noqa: PLC0415  (few files have quotes)

        try:
            cells = [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]
        except (csv.Error, StopIteration):
            cells = [cell.strip() for cell in line.split(separator)]
    else:
        cells = [cell.strip() for cell in line.split(separator)]
    return cells


def is_number(cell: str) -> bool:
    """Whether a cell is a finite decimal number."""
    return _NUMBER.fullmatch(cell) is not None


@dataclass(frozen=True)
class Rows:
    """Rows of cells with the line that each came from.

    Parameters
    ----------
    source : Source
        Their file.
    lines : sequence of int
        From 1.
    columns : sequence of sequence of str
        The cells, one sequence a column.
    names : sequence of str
        What the columns are called in messages.
    decimal : {".", ","}
        The decimal sign.
    plain : bool
        Whether all is ASCII without '_': what `float` takes is a number then.
    body : str
        All cells with one separator, where they may be read at once; empty where not.
    """

    source: Source
    lines: Sequence[int]
    columns: Sequence[Sequence[str]]
    names: Sequence[str]
    decimal: str = "."
    plain: bool = False
    body: str = field(default="", repr=False)

    def __len__(self) -> int:
        return len(self.lines)

    def text(self, column: int) -> list[str]:
        """The cells of a column with decimal points."""
        cells = self.columns[column]
        return [c.strip().replace(",", ".") if self.decimal == "," else c.strip() for c in cells]

    def numbers(self, columns: Sequence[int], *, blank: bool = False) -> Array:
        """(n, k) numbers of some columns.

        Parameters
        ----------
        columns : sequence of int
            Which.
        blank : bool
            Whether a cell may be empty or 'nan'; NaN then.

        Raises
        ------
        InputError
            With every cell that is no finite number.
        """
        if self._whole is not None and not blank:
            return np.asarray(self._whole[:, list(columns)])
        found = np.empty((len(self), len(columns)))
        bad: list[Problem] = []
        for place, column in enumerate(columns):
            cells = self.columns[column]
            if self.decimal == ",":
                cells = self.text(column)
            if blank:
                cells = [cell or "nan" for cell in cells]
            try:
                values = np.array(list(map(float, cells)))
                # float() takes what is no number in a file: 1_000, infinity, digits of all scripts.
                fine = (np.abs(values) < LARGEST) | (blank & np.isnan(values))
                odd = not self.plain or not fine.all()
            except ValueError:
                odd = True
            if odd:
                values = self._checked(cells, column, bad, blank=blank)
            found[:, place] = values
        if bad:
            raise InputError(sorted(bad, key=lambda one: one.line or 0))
        return found

    @cached_property
    def _whole(self) -> Array | None:
        """All cells as numbers, read at once; None where one is none or not finite."""
        if not self.body:
            return None
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # numpy warns where it stops before the end
            try:
                values = np.fromstring(self.body, sep="," if "," in self.body else " ")
            except (DeprecationWarning, ValueError):
                return None
        if values.size != len(self) * len(self.names) or not (np.abs(values) < LARGEST).all():
            return None
        return np.asarray(values.reshape(len(self), len(self.names)))

    def _checked(
        self, cells: Sequence[str], column: int, bad: list[Problem], *, blank: bool
    ) -> Array:
        """The numbers of a column, slowly; what is none becomes a problem."""
        values = np.full(len(cells), np.nan)
        for row, cell in enumerate(map(str.strip, cells)):
            if blank and cell.lower() in {"", "nan"}:
                continue
            if is_number(cell) and abs(float(cell)) < LARGEST:
                values[row] = float(cell)
            elif len(bad) < MAX_PROBLEMS:
                said = "the cell is empty; expected a number" if not cell else "not a number"
                bad.append(self.source.problem(said, self.lines[row], self.names[column], cell))
        return values

    def select(self, rows: Sequence[int]) -> "Rows":
        """Some of the rows."""
        columns = [[column[row] for row in rows] for column in self.columns]
        lines = [self.lines[row] for row in rows]
        return Rows(self.source, lines, columns, self.names, self.decimal, self.plain)


def read_rows(
    source: Source, after: int, separator: str, names: Sequence[str], *, comments: bool = True
) -> Rows:
    """All rows after a number of lines, each with as many cells as there are names.

    Parameters
    ----------
    source : Source
        The file.
    after : int
        Lines before the first row.
    separator : str
        As `separator_of` gives it.
    names : sequence of str
        One a column.
    comments : bool
        Whether lines that begin with '#' or '%' are left out.

    Raises
    ------
    InputError
        If there is no row, or with every row of another length.
    """
    lines = source.lines
    if len(source.data) > HEAD_BYTES and b"\0" in source.data:
        raise source.error("this is a binary file, not text")
    rows = lines[after:]
    while rows and not rows[-1].strip():
        rows.pop()
    text = "\n".join(rows)
    plain: Sequence[int] = range(after, after + len(rows))
    if not all(rows) or (comments and ("#" in text or "%" in text)):
        plain = [k for k in plain if not _is_silent(lines[k], comments=comments)]
        rows = [lines[number] for number in plain]
        text = "\n".join(rows)
    if not rows:
        raise source.error("the file has no row of numbers")
    width = len(names)
    # One list of all cells, not one a row: a hundred thousand lists are slow to keep.
    flat = text.split() if separator == " " else text.replace("\n", separator).split(separator)
    # A row with that many separators has no more cells; as many in all means as many in each.
    even = '"' not in text and {row.count(separator) for row in rows} == {width - 1}
    if not even or len(flat) != width * len(rows):
        flat = _cells_of_rows(source, plain, separator, width)
    decimal = "."
    if separator in {";", "\t"} and any("," in cell for cell in flat[: 50 * width]):
        decimal = ","
    columns = [flat[place::width] for place in range(width)]
    plainly = text.isascii() and "_" not in text
    body = ""
    if even and plainly and separator in {" ", ","}:
        body = text if separator == " " else text.replace("\n", ",")
    lines_of = [number + 1 for number in plain]
    return Rows(source, lines_of, columns, list(names), decimal, plainly, body)


def _is_silent(line: str, *, comments: bool) -> bool:
    """Whether a line is blank or a comment."""
    stripped = line.lstrip()
    return not stripped or (comments and stripped[0] in "#%")


def _cells_of_rows(source: Source, plain: Sequence[int], separator: str, width: int) -> list[str]:
    """All cells of rows that have quotes, or separators at their ends.

    Raises
    ------
    InputError
        With every row of another length.
    """
    rows = [_without_end(cells_of(source.lines[number], separator), width) for number in plain]
    wrong = [(number, len(row)) for number, row in zip(plain, rows, strict=True)]
    wrong = [one for one in wrong if one[1] != width][:MAX_PROBLEMS]
    if wrong:
        raise InputError(
            source.problem(
                f"{count} cells, not {width}"
                + (" (is the file cut off?)" if number == plain[-1] and count < width else ""),
                number + 1,
                None,
                source.lines[number].strip(),
            )
            for number, count in wrong
        )
    return list(chain.from_iterable(rows))


def _without_end(row: list[str], width: int) -> list[str]:
    """A row without blank cells after its last; separators at the end are no cells."""
    while len(row) > width and not row[-1].strip():
        row = row[:-1]
    return row


def read_times_file(path: Path) -> tuple[list[str], list[int]]:
    """The stamps of a file with one a line, as text, and their lines.

    Raises
    ------
    GtvalError
        If it cannot be read, or with every line that is no number.
    """
    source = open_source(path)
    rows = read_rows(source, 0, " ", ["time"])
    rows.numbers([0])
    return rows.text(0), list(rows.lines)


def missing_extra(what: str) -> GtvalError:
    """The error where a library is not installed."""
    return GtvalError(f"{what} needs an extra: pip install 'gtval[bags]'")
