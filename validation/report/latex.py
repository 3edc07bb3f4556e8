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
    head = "% Needs \\usepackage[T1]{fontenc} and \\usepackage{booktabs,longtable}.\n\n"
    return head + "\n".join(latex_table(table) for table in document.tables)


def latex_table(table: Table) -> str:
    """The table as a longtable, which may break over pages, with its note as last row."""
    columns = range(len(table.columns))
    right = [is_number_column(table.rows, column) for column in columns]
    lines = [
        r"\begin{longtable}{" + "".join("r" if number else "l" for number in right) + "}",
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
    return "\n".join([*lines, r"\end{longtable}"]) + "\n"


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
