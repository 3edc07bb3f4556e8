"""Tables and findings in the terminal."""

import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING

from validation.report.cells import is_number_column, rows_of_text
from validation.results import Finding, Severity, Table
from validation.text_files.json_text import as_json, json_text

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["as_json", "console", "most_severe_first", "print_findings", "print_json", "print_table"]

WIDTH_OF_A_PIPE = 200
"""Columns where the output is no terminal: wide enough not to fold a table."""

SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note", "good")
_STYLES = {"error": "bold red", "warning": "bold yellow", "note": "cyan", "good": "green"}


def console(*, stderr: bool = False) -> "Console":
    """A rich console on stdout or stderr, that folds only to the width of a real terminal."""
    from rich.console import Console  # noqa: PLC0415  (50 ms that `gtval --help` does without)

    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() else WIDTH_OF_A_PIPE
    return Console(file=stream, width=width, highlight=False, soft_wrap=False)


def print_table(table: Table, to: "Console | None" = None) -> None:
    """Print a table with its title and note.

    Parameters
    ----------
    table : Table
        Its cells are plain text: nothing in them is taken as markup.
    to : rich.console.Console, optional
        Where to; stdout by default.
    """
    from rich import box  # noqa: PLC0415
    from rich.table import Table as RichTable  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    to = to or console()
    drawn = RichTable(
        title=Text(table.title, style="bold"),
        title_justify="left",
        caption=Text(table.note) if table.note else None,
        caption_justify="left",
        box=box.SIMPLE_HEAD,
    )
    for column, heading in enumerate(table.columns):
        right = is_number_column(table.rows, column)
        drawn.add_column(Text(heading), justify="right" if right else "left", overflow="fold")
    for cells in rows_of_text(table):
        drawn.add_row(*(Text(cell) for cell in cells))
    to.print(drawn)


def most_severe_first(findings: Iterable[Finding]) -> list[Finding]:
    """The findings with errors first, then warnings, notes and good ones, else as they were."""
    return sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity))


def print_findings(findings: Iterable[Finding], to: "Console | None" = None) -> None:
    """Print findings, the most severe first, each with its severity as a word.

    Parameters
    ----------
    findings : iterable of Finding
        What was found.
    to : rich.console.Console, optional
        Where to; stdout by default.
    """
    from rich.table import Table as RichTable  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    listed = RichTable.grid(padding=(0, 1))
    for _ in range(3):
        listed.add_column()
    for finding in most_severe_first(findings):
        listed.add_row(
            Text(finding.severity, style=_STYLES[finding.severity]),
            Text(finding.subject),
            Text(finding.text),
        )
    if listed.row_count:
        (to or console()).print(listed)


SCHEMA = "gtval/1"
"""Of the objects that --json prints; the number changes when a key is renamed or taken out."""


def print_json(value: object) -> None:
    """Print a record or mapping as a JSON object on stdout, with its schema; see `as_json`."""
    sys.stdout.write(json_text({"schema": SCHEMA, **as_json(value)}))
