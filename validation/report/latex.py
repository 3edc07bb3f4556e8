"""Tables as LaTeX, to be included in a paper; they need the packages booktabs and longtable."""

import re
from collections.abc import Sequence

from validation.report.cells import is_number_column, rows_of_text
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
}
_SPECIAL = re.compile("|".join(re.escape(character) for character in _ESCAPES))


def latex_report(document: Document) -> str:
    """All tables, one after the other, with a comment on what they need."""
    head = "% Needs \\usepackage[T1]{fontenc} and \\usepackage{array,booktabs,longtable}.\n\n"
    return head + "\n".join(latex_table(table) for table in document.tables)


PAGE = 455.0
"""Points of a line of text: article, A4, 10 pt."""
CHARACTER = {r"\normalsize": 5.6, r"\footnotesize": 4.8, r"\scriptsize": 4.2, r"\tiny": 3.5}
"""Points of a character, at most on the average of a cell: a digit of Computer Modern has 5.0,
4.25, 3.98 and 3.4 in these sizes, capitals and m more, i and l less."""


def latex_paper(document: Document) -> str:
    """The two narrow tables for a paper, each no wider than a line."""
    head = "% Needs \\usepackage[T1]{fontenc} and \\usepackage{booktabs,array}.\n\n"
    return head + "\n".join(_narrow(table) for table in document.paper)


def _narrow(table: Table) -> str:
    """The table as a float whose columns of text break their lines."""
    size, gap, columns = _fitted(table, always=True)
    lines = [
        r"\begin{table}[htbp]",
        rf"\caption{{{escaped(table.title)}}}",
        rf"{size}\setlength{{\tabcolsep}}{{{gap:g}pt}}",
        rf"\begin{{tabular}}{{@{{}}{columns}@{{}}}}",
        r"\toprule",
        _row(table.columns),
        r"\midrule",
        *(_row(cells) for cells in rows_of_text(table)),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    if table.note:
        lines.append(rf"\par\smallskip\parbox{{\linewidth}}{{{size} {escaped(table.note)}}}")
    return "\n".join([*lines, r"\end{table}"]) + "\n"


def _fitted(table: Table, *, always: bool = False) -> tuple[str, float, str]:
    """Size of the letters, half the gap of columns, and the columns of a table that fits a line.

    Columns keep their longest word or number whole as far as a size allows; what is left of the
    line goes to those of long text.
    """
    cells = [[*column] for column in zip(table.columns, *rows_of_text(table), strict=True)]
    right = [is_number_column(table.rows, k) for k in range(len(cells))]
    most = [max(map(len, column)) for column in cells]
    least = [_least(column, number=number) for column, number in zip(cells, right, strict=True)]
    plain = "".join("r" if number else "l" for number in right)
    if not always and sum(most) * CHARACTER[r"\normalsize"] + 12 * len(cells) <= PAGE:
        return "", 6.0, plain
    for size, gap in ((r"\footnotesize", 3.0), (r"\scriptsize", 2.5), (r"\tiny", 1.5)):
        room = (PAGE - 2 * gap * len(cells)) / CHARACTER[size]
        if sum(least) <= room:
            break
    widths = _shared(least, most, room)
    columns = "".join(
        rf">{{\ragged{side}\arraybackslash}}p{{{CHARACTER[size] * w:.1f}pt}}"
        for side, w in zip(["left" if number else "right" for number in right], widths, strict=True)
    )
    return size, gap, columns


def _least(column: Sequence[str], *, number: bool) -> int:
    """Characters of the longest word of a heading and its cells; numbers stay whole."""
    heading, *cells = column
    whole = number or all(len(cell) <= LONGEST_WHOLE for cell in cells)
    longest = [len(cell) if whole else max(map(len, cell.split()), default=0) for cell in cells]
    return max([*longest, *(len(word) for word in heading.split()), 1])


LONGEST_WHOLE = 16
"""Characters up to which a cell is not broken: '+80.4 ± withheld'."""


def _shared(least: Sequence[int], most: Sequence[int], room: float) -> list[float]:
    """Characters of each column: what it needs, and its share of what is left."""
    wanted = [some - few for some, few in zip(most, least, strict=True)]
    left = room - sum(least)
    if left < 0:
        return [few * room / sum(least) for few in least]
    share = min(left / max(sum(wanted), 1), 1.0)
    return [few + share * more for few, more in zip(least, wanted, strict=True)]


def latex_table(table: Table) -> str:
    """The table as a longtable, which may break over pages, with its note as last row."""
    size, gap, columns = _fitted(table)
    lines = [
        *([rf"\begingroup{size}\setlength{{\tabcolsep}}{{{gap:g}pt}}"] if size else []),
        rf"\begin{{longtable}}{{{columns}}}",
        rf"\caption{{{escaped(table.title)}}} \\",
        r"\toprule",
        _row(table.columns),
        r"\midrule",
        r"\endhead",
        *(_row(cells) for cells in rows_of_text(table)),
        r"\bottomrule",
    ]
    if table.note:
        width = rf"\multicolumn{{{len(table.columns)}}}{{p{{0.9\linewidth}}}}"
        lines.append(rf"{width}{{\footnotesize {escaped(table.note)}}} \\")
    lines += [r"\end{longtable}", *([r"\endgroup"] if size else [])]
    return "\n".join(lines) + "\n"


def _row(cells: Sequence[str]) -> str:
    # A bracket right after the \\ of the row before would be taken as its argument.
    return (
        " & ".join(
            f"{{{escaped(cell)}}}" if cell.startswith(("[", "*")) else escaped(cell)
            for cell in cells
        )
        + r" \\"
    )


def escaped(text: str) -> str:
    """The text on one line, with nothing in it taken as LaTeX."""
    return _SPECIAL.sub(lambda found: _ESCAPES[found[0]], " ".join(text.split()))
