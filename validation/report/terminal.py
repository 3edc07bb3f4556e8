"""Tables and findings in the terminal."""

import re
import sys
from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING

from validation.report.characters import as_shown
from validation.report.layout import table_lines, wrapped
from validation.results import Finding, Severity, Table, sentences
from validation.text_files.json_text import as_json, json_text

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["as_json", "console", "most_severe_first", "print_findings", "print_json", "print_table"]

WIDTH_OF_A_PIPE = 200
"""Columns where the output is no terminal, for those who print by the console itself. A judgement:
wider than what is typed in a dialogue."""

SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note", "good")
_INDENT = max(map(len, SEVERITIES)) + 2
_BRACKETS = re.compile(r"\s*\([^()]*\)")
_STYLES = {"error": "bold red", "warning": "bold yellow", "note": "cyan", "good": "green"}


def console(*, stderr: bool = False) -> "Console":
    """A rich console on stdout or stderr; no terminal counts as a wide one."""
    from rich.console import Console  # noqa: PLC0415  (50 ms that `gtval --help` does without)

    stream = sys.stderr if stderr else sys.stdout
    return Console(file=stream, width=None if stream.isatty() else WIDTH_OF_A_PIPE, highlight=False)


def print_table(table: Table, to: "Console | None" = None) -> None:
    """Print a table with its title and note, and an empty line after it.

    Parameters
    ----------
    table : Table
        Its cells are plain text: nothing in them is taken as markup.
    to : rich.console.Console, optional
        Where to; stdout by default. What is no terminal gets whole lines, however long.
    """
    to = to or console()
    for line in table_lines(table, _width(to), partial(as_shown, encoding=to.encoding)):
        _print_line(to, (line.text, "bold" if line.kind else ""))
    _print_line(to)


def _width(to: "Console") -> int | None:
    return to.width if to.is_terminal else None


def _print_line(to: "Console", *parts: tuple[str, str]) -> None:
    """One line of texts and their styles, as it is: not folded, not padded, no markup."""
    from rich.text import Text  # noqa: PLC0415

    to.print(Text.assemble(*parts), soft_wrap=True)


def most_severe_first(findings: Iterable[Finding]) -> list[Finding]:
    """The findings with errors first, then warnings, notes and good ones, else as they were."""
    return sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity))


def print_findings(
    findings: Iterable[Finding], to: "Console | None" = None, *, brief: bool = False
) -> None:
    """Print findings, the most severe first, each with its severity as a word.

    Parameters
    ----------
    findings : iterable of Finding
        What was found.
    to : rich.console.Console, optional
        Where to; stdout by default.
    brief : bool
        Those that are no errors in short, see `in_short`.
    """
    to = to or console()
    width = _width(to)
    for finding in most_severe_first(findings):
        whole = not brief or finding.severity == "error"
        text = finding.text if whole else in_short(finding.text)
        subject = f"{finding.subject}: " if finding.subject else ""
        said = as_shown(f"{finding.severity:{_INDENT}}{subject}{text}", to.encoding)
        first, *others = wrapped(said, width, _INDENT)
        _print_line(
            to, (finding.severity, _STYLES[finding.severity]), (first[len(finding.severity) :], "")
        )
        for line in others:
            _print_line(to, (line, ""))


def print_text(text: str) -> None:
    """Print a sentence or several on stdout, folded where a terminal is narrower."""
    to = console()
    for line in wrapped(as_shown(text, to.encoding), _width(to), 0):
        _print_line(to, (line, ""))


def in_short(text: str) -> str:
    """The first sentence without what it says in brackets: not how sure it is, nor what to do."""
    short = sentences(text)[0]
    return _BRACKETS.sub("", _BRACKETS.sub("", short))


SCHEMA = "gtval/1"
"""Of the objects that --json prints, see schema.json beside this module; the number changes when a
key is renamed or taken out."""


def print_json(value: object) -> None:
    """Print a record or mapping as a JSON object on stdout; see `as_json` and schema.json.

    It says its schema and the command that made it. Characters that stdout lacks are escaped.
    """
    told = {"schema": SCHEMA, "command": _command(), **as_json(value)}
    text = json_text(told)
    if as_shown(text, sys.stdout.encoding or "utf-8") != text:
        text = json_text(told, ascii_only=True)
    sys.stdout.write(text)


def _command() -> str:
    """The command that runs, without the program's name: 'laser solve'."""
    from click import get_current_context  # noqa: PLC0415  (reports are written without it)

    context, names = get_current_context(silent=True), []
    while context is not None and context.parent is not None:
        names.append(str(context.info_name))
        context = context.parent
    return " ".join(reversed(names))
