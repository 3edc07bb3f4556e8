"""Tables as LaTeX, to be included in a paper; they need the packages booktabs and longtable."""

import math
import re
import unicodedata
from collections.abc import Sequence

from validation.report.cells import is_number_column, rows_of_text
from validation.report.characters import plain
from validation.report.document import Document
from validation.results import Table

_ESCAPES = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "_": r"\_",
    "%": r"\%",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
    "±": r"$\pm$",
    "–": "--",
    "—": "---",
    "…": r"\dots{}",
    "°": r"\textdegree{}",
    "−": "$-$",
    "×": r"$\times$",
    "·": r"$\cdot$",
    "²": "$^2$",
    "³": "$^3$",
    "→": r"$\to$",
    "←": r"$\leftarrow$",
    "≤": r"$\leq$",
    "≥": r"$\geq$",
    "≈": r"$\approx$",
    "‘": "`",
    "’": "'",
    "“": "``",
    "”": "''",
}
_ACCENTS = dict(
    zip(
        "\u0300\u0301\u0302\u0303\u0304\u0306\u0307\u0308\u030a\u030b\u030c\u0327",
        "`'^~=u.\"rHvc",
        strict=True,
    )
)
"""Marks above and below letters, as Unicode and as LaTeX name them."""
_SPECIAL = re.compile("|".join(map(re.escape, _ESCAPES)) + r"|[^\x00-\x7f]")


def latex_report(document: Document) -> str:
    """All tables, one after the other, with a comment on what they need."""
    head = "% Needs \\usepackage[T1]{fontenc} and \\usepackage{array,booktabs,longtable}.\n\n"
    return head + "\n".join(latex_table(table) for table in document.tables)


PAGE = 455.0
"""Points of a line of text: article, A4, 10 pt."""
_CHARACTERS = {
    2.8: "!',.:;[]`|il",
    3.5: " fj-",
    4.0: "()rstI",
    5.0: '0123456789acegoz/*$"?',
    5.6: "bdhknpquvxySJ\\{}",
    7.1: "BEFLPZ~^",
    7.9: "ACDGHKNOQRTUVXYw&+<=>@_",
    8.4: "m%#",
    9.2: "M",
}
_POINTS = {one: points for points, row in _CHARACTERS.items() for one in row}
WIDEST = 10.3
"""Points of W, and of a character that is not in ASCII: all others are narrower. The widths are
those of Computer Modern at 10 pt (its metrics), rounded up."""
SIZES = {r"\normalsize": 1.0, r"\footnotesize": 0.85, r"\scriptsize": 0.815, r"\tiny": 0.725}
"""Widths of letters of 10, 8, 7 and 5 pt against those of 10 pt, of the widest for its size: small
letters are cut wider (a digit has 5.0, 4.25, 3.98 and 3.4 pt, an i 2.8, 2.36, 2.26 and 2.01)."""
CAPTION = 280.0
"""Points of a line of a caption of a longtable, 4 inches, less a bit."""


def points_of(text: str) -> float:
    """Width of a line of text at 10 pt, at most."""
    return sum(_POINTS.get(one, WIDEST) for one in text)


def latex_paper(document: Document) -> str:
    """The two narrow tables for a paper, each no wider than a line."""
    head = "% Needs \\usepackage[T1]{fontenc} and \\usepackage{booktabs,array}.\n\n"
    return head + "\n".join(_narrow(table) for table in document.paper)


def _narrow(table: Table) -> str:
    """The table as a float whose columns of text break their lines."""
    size, gap, columns, widths = _fitted(table, always=True)
    lines = [
        r"\begin{table}[htbp]",
        rf"\caption{{{escaped(table.title, CAPTION)}}}",
        rf"{size}\setlength{{\tabcolsep}}{{{gap:g}pt}}",
        rf"\begin{{tabular}}{{@{{}}{columns}@{{}}}}",
        r"\toprule",
        _row(table.columns, widths),
        r"\midrule",
        *(_row(cells, widths) for cells in rows_of_text(table)),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    if table.note:
        note = escaped(table.note, PAGE / SIZES[size])
        lines.append(rf"\par\smallskip\parbox{{\linewidth}}{{{size}\raggedright {note}}}")
    return "\n".join([*lines, r"\end{table}"]) + "\n"


def _fitted(table: Table, *, always: bool = False) -> tuple[str, float, str, list[float]]:
    """Size of the letters, half the gap of columns, the columns, and their points at 10 pt.

    A table of a line stays as it is, without points. Else columns keep their longest word or number
    whole as far as a size allows; what is left of the line goes to those of long text.
    """
    cells = [[*column] for column in zip(table.columns, *rows_of_text(table), strict=True)]
    right = [is_number_column(table.rows, k) for k in range(len(cells))]
    most = [max(map(points_of, column)) for column in cells]
    least = [_least(column, number=number) for column, number in zip(cells, right, strict=True)]
    plain = "".join("r" if number else "l" for number in right)
    if not always and sum(most) + 12 * len(cells) <= PAGE:
        return "", 6.0, plain, []
    for size, gap in ((r"\footnotesize", 3.0), (r"\scriptsize", 2.5), (r"\tiny", 1.5)):
        room = (PAGE - 2 * gap * len(cells)) / SIZES[size]
        if sum(least) <= room:
            break
    widths = _shared(least, most, room)
    columns = "".join(
        rf">{{\ragged{side}\arraybackslash}}p{{{math.floor(10 * SIZES[size] * w) / 10:.1f}pt}}"
        for side, w in zip(["left" if number else "right" for number in right], widths, strict=True)
    )
    return size, gap, columns, widths


def _least(column: Sequence[str], *, number: bool) -> float:
    """Points of the longest word of a heading and its cells; numbers stay whole."""
    heading, *cells = column
    whole = number or all(len(cell) <= LONGEST_WHOLE for cell in cells)
    parts = [cell for cell in cells if whole] or [word for cell in cells for word in cell.split()]
    longest = max(map(points_of, [*parts, *heading.split(), "0"]))
    # A tenth of a point is lost where widths are rounded.
    return (longest if number else min(longest, LONGEST_WORD)) + 0.2


LONGEST_WHOLE = 16
"""Characters up to which a cell is not broken: '+80.4 ± withheld'."""
LONGEST_WORD = 120.0
"""Points at 10 pt beyond which a word may be broken: some 22 letters, a quarter of the line."""


def _shared(least: Sequence[float], most: Sequence[float], room: float) -> list[float]:
    """Points of each column: what it needs, and its share of what is left."""
    wanted = [max(some - few, 0.0) for some, few in zip(most, least, strict=True)]
    left = room - sum(least)
    if left < 0:
        return [few * room / sum(least) for few in least]
    share = min(left / max(sum(wanted), 1), 1.0)
    return [few + share * more for few, more in zip(least, wanted, strict=True)]


def latex_table(table: Table) -> str:
    """The table as a longtable, which may break over pages, with its note as last row."""
    size, gap, columns, widths = _fitted(table)
    lines = [
        *([rf"\begingroup{size}\setlength{{\tabcolsep}}{{{gap:g}pt}}"] if size else []),
        rf"\begin{{longtable}}{{{columns}}}",
        rf"\caption{{{escaped(table.title, CAPTION)}}} \\",
        r"\toprule",
        _row(table.columns, widths),
        r"\midrule",
        r"\endhead",
        *(_row(cells, widths) for cells in rows_of_text(table)),
        r"\bottomrule",
    ]
    if table.note:
        ragged = r">{\raggedright\arraybackslash}p{0.9\linewidth}"
        width = rf"\multicolumn{{{len(table.columns)}}}{{{ragged}}}"
        note = escaped(table.note, 0.9 * PAGE / SIZES[r"\footnotesize"])
        lines.append(rf"{width}{{\footnotesize {note}}} \\")
    lines += [r"\end{longtable}", *([r"\endgroup"] if size else [])]
    return "\n".join(lines) + "\n"


def _row(cells: Sequence[str], widths: Sequence[float] = ()) -> str:
    # A bracket right after the \\ of the row before would be taken as its argument.
    rooms = widths or [math.inf] * len(cells)
    return (
        " & ".join(
            f"{{{escaped(cell, room)}}}" if cell.startswith(("[", "*")) else escaped(cell, room)
            for cell, room in zip(cells, rooms, strict=True)
        )
        + r" \\"
    )


def escaped(text: str, room: float = math.inf) -> str:
    """The text on one line, with nothing in it taken as LaTeX.

    A word of more than ``room`` points at 10 pt may be broken after each of its characters.
    """
    return " ".join(
        _safe(word)
        if points_of(word) <= room
        else r"\allowbreak{}".join(_safe(one) for one in word)
        for word in text.split()
    )


def _safe(word: str) -> str:
    return _SPECIAL.sub(lambda found: _ESCAPES.get(found[0]) or _by_accent(found[0]), word)


def _by_accent(character: str) -> str:
    """A letter of other languages by its accent, a Greek one by its name, else in plain ASCII."""
    parts = unicodedata.normalize("NFD", character)
    if len(parts) == 2 and parts[1] in _ACCENTS and parts[0].isascii():
        return rf"\{_ACCENTS[parts[1]]}{{{parts[0]}}}"
    if "ß" <= character <= "ÿ" or character in "ÆØÅÐÞŁłŒœ":
        return character
    return "".join(_ESCAPES.get(one, one) for one in plain(character))
