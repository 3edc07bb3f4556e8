"""Rows of a table as text: from a CSV file of any encoding, or from a sheet."""

import csv
import io
import re
import zipfile
from collections.abc import Iterable
from datetime import date, datetime, time
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

from validation.errors import GtvalError, InputError, Problem
from validation.text_files.reading import file_bytes, is_utf16

MAX_BYTES = 20_000_000
"""Some 200,000 rows: two orders more than any survey; a larger file is something else."""
MAX_UNPACKED = 500_000_000
"""Bytes that a sheet may have when unpacked: what 20 MB of numbers pack into; more is a trap."""
SHEETS = (".xlsx", ".ods", ".xls")
_UNCOMPUTED = re.compile(
    rb'<c (?![^>]*t="str")[^>]*r="[A-Z]+(\d+)"[^>]*><f[^>]*>[^<]*</f>(<v ?/>|<v></v>)?</c>'
)
"""A cell of a workbook with a formula and no value, unless that is an empty text."""
SEPARATORS = ",;\t|"
"""Characters that may stand between cells."""
MOST_KEPT = 2_000_000
"""Characters of a table whose rows are kept: a command asks the same few tables for their columns,
their units and their numbers. Some 20,000 rows; four such tables take 40 MB."""
_ZIP, _OLE = b"PK\x03\x04", b"\xd0\xcf\x11\xe0"
Row = tuple[int, list[str]]
"""The line (of a sheet, the row) on which it starts, from 1, and its cells."""


def table_rows(path: Path, max_bytes: int = MAX_BYTES, data: bytes | None = None) -> list[Row]:
    """The non-blank rows of a table, undecodable bytes kept as lone surrogates.

    Parameters
    ----------
    path : Path
        The file.
    max_bytes : int
        A larger one is refused unread.
    data : bytes, optional
        Its contents, where they were read, or unpacked, before.

    Raises
    ------
    InputError
        If the file is missing, too large, or neither a CSV table nor a sheet.
    """
    data = file_bytes(path, max_bytes, "a table") if data is None else data
    if data.startswith((_ZIP, _OLE)) or path.suffix.lower() in SHEETS:
        return _sheet_rows(path, data)
    text = decoded(data)
    return list(_kept_rows(path, text)) if len(text) <= MOST_KEPT else _csv_rows(path, text)


def decoded(data: bytes) -> str:
    """The text of a file: UTF-16 where its bytes say so, else UTF-8."""
    if is_utf16(data):
        if data.startswith((b"\xff\xfe", b"\xfe\xff")):
            return data.decode("utf-16", errors="replace")
        low = bool(data[0:100:2].strip(b"\0"))
        return data.decode("utf-16-le" if low else "utf-16-be", errors="replace")
    return data.decode("utf-8-sig", errors="surrogateescape")


@lru_cache(maxsize=4)
def _kept_rows(path: Path, text: str) -> list[Row]:
    """Rows of CSV text, which nobody changes; those of the last few tables are kept."""
    return _csv_rows(path, text)


def _csv_rows(path: Path, text: str) -> list[Row]:
    """Rows of CSV text; a first line such as 'sep=;' names the separator."""
    lines = text.lstrip("\r\n").split("\n", 2)
    first = lines[0].strip().strip('"').lower()
    stated = first.removeprefix("sep=") if first.startswith("sep=") else ""
    header = lines[1] if stated and len(lines) > 1 else lines[0]
    delimiter = stated if len(stated) == 1 else max(SEPARATORS, key=header.count)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
    rows: list[Row] = []
    start = 1
    try:
        for cells in reader:
            if any(cell.strip() for cell in cells):
                rows.append((start, cells))
            start = reader.line_num + 1
        if first.startswith("sep="):
            rows = rows[1:]
        width = len(rows[0][1]) if rows else 0
        rows = [(line, _resplit(cells, width, delimiter)) for line, cells in rows]
    except csv.Error as error:
        hint = " (an inch mark inside quotes is written twice)" if "after" in str(error) else ""
        raise InputError([Problem(path, f"not a CSV table: {error}{hint}", start)]) from error
    return rows


def _resplit(cells: list[str], width: int, delimiter: str) -> list[str]:
    """The cells of a row; of one that was added with another separator than the file's, those.

    Only a row that no separator of the file is in, and that another divides into as many cells as
    there are headings; not where two whole numbers beside each other may be one decimal comma.
    """
    if len(cells) != 1 or width == 1:
        return cells
    for other in SEPARATORS.replace(delimiter, ""):
        found = next(csv.reader(cells, delimiter=other), [])
        doubtful = any(a.strip().isdecimal() and b.strip().isdecimal() for a, b in pairwise(found))
        if len(found) == width and not (other == "," and doubtful):
            return found
    return cells


def _sheet_rows(path: Path, data: bytes) -> list[Row]:
    """Rows of the only sheet with cells of a spreadsheet file.

    Raises
    ------
    GtvalError
        If the extra ``sheets`` is not installed.
    """
    _check_packed(path, data)
    _need_values(path, data)
    try:
        from python_calamine import CalamineError, CalamineWorkbook  # noqa: PLC0415  (an extra)
    except ImportError:
        raise GtvalError(
            f"{path} is a spreadsheet: save it as CSV, or install what reads it: "
            "pip install gtval[sheets]"
        ) from None
    try:
        book = CalamineWorkbook.from_filelike(io.BytesIO(data))
        sheets = {
            name: _rows_as_text(book.get_sheet_by_name(name).to_python(skip_empty_area=False))
            for name in book.sheet_names
        }
    except (CalamineError, ValueError, OSError) as error:
        raise _no_sheet(path, str(error)) from None
    filled = {name: rows for name, rows in sheets.items() if rows}
    if len(filled) > 1:
        named = ", ".join(f"'{name}'" for name in filled)
        said = f"{len(filled)} sheets hold cells ({named}); leave one, or save that one as CSV"
        raise InputError([Problem(path, said)])
    return next(iter(filled.values()), [])


def _check_packed(path: Path, data: bytes) -> None:
    """Raise for what is no sheet, or unpacks to far more than a table."""
    if data.startswith(_OLE):
        return
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as packed:
            names = set(packed.namelist())
            size = sum(info.file_size for info in packed.infolist())
    except (zipfile.BadZipFile, ValueError, OSError) as error:
        raise _no_sheet(path, str(error)) from None
    if not names & {"xl/workbook.xml", "content.xml", "xl/workbook.bin"}:
        raise _no_sheet(path, "an archive of other files")
    if size > MAX_UNPACKED:
        raise _no_sheet(path, f"unpacked it has {size / 1e6:.0f} MB")


def _need_values(path: Path, data: bytes) -> None:
    """Raise for a workbook with formulas that nobody has computed: their cells would be blank."""
    if data.startswith(_OLE):
        return
    with zipfile.ZipFile(io.BytesIO(data)) as packed:
        for name in packed.namelist():
            if name.startswith("xl/worksheets/") and name.endswith(".xml"):
                found = _UNCOMPUTED.search(packed.read(name))
                if found:
                    said = "a formula whose value the file does not hold; open it in a spreadsheet"
                    line = int(found[1])
                    raise InputError([Problem(path, f"{said} and save it again", line)])


def _no_sheet(path: Path, why: str) -> InputError:
    said = f"neither a CSV table nor a sheet that can be read ({why}); open it in a spreadsheet"
    return InputError([Problem(path, f"{said}, save it as CSV UTF-8, and name that file", 1)])


def _rows_as_text(cells: Iterable[Iterable[object]]) -> list[Row]:
    rows = [(line, [_as_text(cell) for cell in row]) for line, row in enumerate(cells, 1)]
    return [row for row in rows if any(cell.strip() for cell in row[1])]


def _as_text(cell: object) -> str:
    """A cell as a person would have typed it: whole numbers without a decimal point."""
    if isinstance(cell, float):
        return str(int(cell)) if cell.is_integer() and abs(cell) < 1e15 else repr(cell)
    if isinstance(cell, datetime | date | time):
        return cell.isoformat()
    return "" if cell is None else str(cell)
