"""Tables as lines of text that fit a width, with every number whole."""

import re
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from validation.report.cells import is_number_column, rows_of_text
from validation.results import Table

GAP = "  "
COLUMN_OF_TEXT = 30
"""Characters that a column of sentences keeps at least. A judgement: five or six words a line;
with fewer a sentence becomes a tower of single words."""
MOST_PARTS = 3
"""Parts that a table is cut into at most. A judgement: up to three are still compared by eye,
line by line; beyond them a list, which keeps together what belongs together, is easier to read."""
_TIED = "\N{NO-BREAK SPACE}"
_BEFORE_UNIT = re.compile(
    r"(?<=[0-9]) (?=(?:%|[cmk]?m|m?rad|m?s)(?![a-z]))"
    r"|(?<=\b[np]) (?=[=<])|(?<=\b[np] [=<]) (?=[0-9])"
)


@dataclass(frozen=True)
class Line:
    """A line of a table: 'title', 'heading' or '' (all else), and its text."""

    kind: str
    text: str


@dataclass
class _Column:
    heading: str
    cells: list[str]
    right: bool
    width: int = 0

    @property
    def least(self) -> int:
        """Width below which a number or a word would be broken."""
        words = max(len(word) for word in f"{self.heading} -".split())
        if self.right:
            return max(words, self.most_in_cells)
        longest = max((len(word) for cell in self.cells for word in cell.split()), default=0)
        return max(words, longest, min(self.most_in_cells, COLUMN_OF_TEXT))

    @property
    def most_in_cells(self) -> int:
        return max(map(len, self.cells), default=0)

    @property
    def most(self) -> int:
        return max(len(self.heading), self.most_in_cells)


def table_lines(table: Table, width: int | None, shown: Callable[[str], str] = str) -> list[Line]:
    """A table as text: whole, else in parts with fewer columns, else as a list.

    Parameters
    ----------
    table : Table
        What is printed.
    width : int or None
        Columns of the terminal; None where the output is none, and nothing is folded.
    shown : callable
        A text as the terminal shows it, whose length may differ.

    Returns
    -------
    list of Line
        Without spaces at their ends. Each part begins with the table's first column.
    """
    columns = [
        _Column(
            shown(" ".join(heading.split())),
            [shown(" ".join(row[number].split())) for row in rows_of_text(table)],
            is_number_column(table.rows, number),
        )
        for number, heading in enumerate(table.columns)
    ]
    parts = _parts(columns, width)
    lines = [Line("title", one) for one in wrapped(shown(table.title), width)]
    for number, part in enumerate(parts):
        lines += [Line("", "")] if number else []
        lines += _as_table(part, width)
    if not parts:
        lines += _as_list(columns, width)
    return lines + [Line("", one) for one in wrapped(shown(table.note), width)]


def tied(text: str) -> str:
    """The text with numbers and their units, and 'n = 20', held together on a line."""
    return _BEFORE_UNIT.sub(_TIED, text)


def wrapped(text: str, width: int | None, indent: int = 0) -> list[str]:
    """Text in lines, all but the first indented; words stay whole, and numbers have their units."""
    if width is None:
        return [text] if text else []
    lines = textwrap.wrap(
        tied(text),
        width,
        subsequent_indent=" " * indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [line.replace(_TIED, " ") for line in lines]


def _parts(columns: Sequence[_Column], width: int | None) -> list[list[_Column]]:
    """The columns that stand beside each other, each part with the first; none for a list."""
    if width is None:
        return [list(columns)]
    first, *others = columns
    parts = [[first]]
    for column in others:
        if _total([one.least for one in (*parts[-1], column)]) > width:
            parts.append([first])
        parts[-1].append(column)
    fits = all(_total([one.least for one in part]) <= width for part in parts)
    return parts if fits and len(parts) <= MOST_PARTS else []


def _total(widths: Sequence[int]) -> int:
    return sum(widths) + len(GAP) * (len(widths) - 1)


def _as_table(columns: Sequence[_Column], width: int | None) -> list[Line]:
    """Headings, a rule and the rows."""
    _share(columns, width)
    headings = _row([wrapped(one.heading, one.width) for one in columns], columns, bottom=True)
    lines = [Line("heading", text) for text in headings]
    lines.append(Line("", "─" * _total([one.width for one in columns])))
    for number in range(len(columns[0].cells)):
        cells = [wrapped(one.cells[number], one.width) for one in columns]
        lines += [Line("", text) for text in _row(cells, columns)]
    return lines


def _share(columns: Sequence[_Column], width: int | None) -> None:
    """Give each column its width: what it needs, and of what is left where most is folded."""
    for one in columns:
        one.width = one.most if width is None else one.least
    if width is None:
        return
    for _ in range(width - _total([one.width for one in columns])):
        neediest = max(columns, key=lambda one: one.most / max(one.width, 1))
        if neediest.most > neediest.width:
            neediest.width += 1


def _row(
    cells: Sequence[Sequence[str]], columns: Sequence[_Column], *, bottom: bool = False
) -> list[str]:
    """The lines of one row; cells with fewer lines stand at its top or bottom."""
    height = max(map(len, cells))
    lines = []
    for number in range(height):
        texts = []
        for cell, column in zip(cells, columns, strict=True):
            at = number - (height - len(cell) if bottom else 0)
            text = cell[at] if 0 <= at < len(cell) else ""
            texts.append(text.rjust(column.width) if column.right else text.ljust(column.width))
        lines.append(GAP.join(texts).rstrip())
    return lines


def _as_list(columns: Sequence[_Column], width: int | None) -> list[Line]:
    """Each row as a block of 'heading: value' lines, all but the first indented."""
    lines = []
    for number in range(len(columns[0].cells)):
        for indent, one in zip(["", *[GAP] * len(columns)], columns, strict=False):
            said = f"{indent}{one.heading}: {one.cells[number]}"
            lines += [Line("", text) for text in wrapped(said, width, len(GAP) * 2)]
    return lines
