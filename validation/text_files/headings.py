"""Headings of tables: what to do where one is missing."""

import re
from collections.abc import Sequence
from difflib import get_close_matches

from validation.errors import MAX_SHOWN_PROBLEMS, shown
from validation.text_files.lengths import split_heading
from validation.text_files.table_rows import Row
from validation.text_files.time_units import SCALES, time_heading

NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")
"""A number as people write it."""
_TITLE_LINES = 20
"""So many lines may stand above the header for it to be found, and the fix named."""


def missing_column(name: str, rows: Sequence[Row], required: Sequence[str]) -> str:
    """What to do about a missing column: rename one, delete a title, or write a header.

    Parameters
    ----------
    name : str
        Of the column.
    rows : sequence of Row
        Of the table; the first is taken for the header.
    required : sequence of str
        Columns that must be there.
    """
    header = [cell.strip() for cell in rows[0][1]]
    needed = set(required)
    for line, cells in rows[1:_TITLE_LINES]:
        if needed <= {split_heading(cell)[0] for cell in cells}:
            return f"the header is on line {line}: delete what stands above it"
    if len(header) == 1 and {*needed} <= {*re.split(r"[^\w]+", header[0].lower())}:
        return "write ',' or ';' between the cells"
    others = {split_heading(h)[0]: h for h in reversed(header)}
    near = get_close_matches(name, [one for one in others if one not in needed], 1, cutoff=0.5)
    if near:
        written = others[near[0]]
        stem, unit = time_heading(written)
        scaled = stem == name and SCALES.get(unit, 1) != 1
        said = f", and its numbers in seconds, not in {unit}" if scaled else ""
        return f"write '{name}' instead of {shown(written)}{said}"
    if any(NUMBER.fullmatch(cell) for cell in header):
        headings = ",".join(required)
        return f"write a first line with the headings, such as {headings}"
    return f"{_shown_header(header)}; rename the one that holds it to '{name}'"


def _shown_header(header: Sequence[str]) -> str:
    """The headings as far as a person would read them."""
    named = [shown(name) for name in header[:MAX_SHOWN_PROBLEMS] if name]
    more = ", …" if len(header) > MAX_SHOWN_PROBLEMS else ""
    return "the header has: " + (", ".join(named) + more if named else "nothing")
