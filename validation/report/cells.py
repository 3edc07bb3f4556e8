"""How a number of a table is written, the same in every format."""

import math
from collections.abc import Sequence

from validation.results import Table

NO_VALUE = "–"
"""What stands where there is no value; never 0."""

Value = str | int | float | None


def cell_text(value: Value, number_format: str = "") -> str:
    """The value as it is printed; an en dash where there is none.

    Parameters
    ----------
    value : str, int, float or None
        NaN counts as no value. The minus of negative numbers is a hyphen, so that what is
        copied out is still a number; a zero has no sign.
    number_format : str
        As for `format`, used for numbers only.
    """
    if isinstance(value, str):
        return value
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return NO_VALUE
    text = format(value, number_format)
    return text[1:] if text.startswith("-") and not text.strip("-0.") else text


def rows_of_text(table: Table) -> list[list[str]]:
    """Every row of the table as it is printed."""
    formats = table.formats or [""] * len(table.columns)
    return [
        [cell_text(value, number_format) for value, number_format in zip(row, formats, strict=True)]
        for row in table.rows
    ]


def is_number_column(rows: Sequence[Sequence[Value]], column: int) -> bool:
    """Whether a column holds numbers, and is set to the right."""
    values = [row[column] for row in rows if column < len(row)]
    present = [value for value in values if value is not None]
    return bool(present) and not any(isinstance(value, str) for value in present)
