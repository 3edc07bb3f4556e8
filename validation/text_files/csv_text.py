"""CSV as text."""

import csv
import io
import math
import re
from collections.abc import Iterable, Sequence

_FORMULA = re.compile(r"'*[=+\-@\t\r]")
_MARKED = re.compile(r"'+[=+\-@\t\r]")
_PLAIN_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")


def csv_text(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """CSV text in which floats keep their last bit and NaN is blank.

    Text that a spreadsheet would run as a formula is marked, as in `harmless`.
    """
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(map(harmless, header))
    writer.writerows([_cell(value) for value in row] for row in rows)
    return stream.getvalue()


def harmless(text: str) -> str:
    """The text, with a ' before what a spreadsheet would take for a formula; `meant` undoes it."""
    formula = _FORMULA.match(text) and not _PLAIN_NUMBER.fullmatch(text)
    return f"'{text}" if formula else text


def meant(text: str) -> str:
    """The text of a cell without the mark of `harmless`."""
    return text[1:] if _MARKED.match(text) else text


def _cell(value: object) -> object:
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(float(value))
    return harmless(value) if isinstance(value, str) else value
