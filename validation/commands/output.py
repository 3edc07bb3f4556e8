"""What commands print, and the status they end with."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:  # listing the commands needs none of them
    from validation.results import Finding, SystemResult, Table

DONE, UNEXPECTED, BAD_INPUT, STRICT_ERROR, INTERRUPTED = 0, 1, 2, 3, 130
"""Exit statuses of all commands; 130 is what shells give a command that Ctrl-C has ended."""
MOST_FINDINGS = 10
"""Findings that are printed without --all: what asks for action, on one screen of a terminal."""


def print_result(
    result: "SystemResult", findings: "Sequence[Finding]", results: Path | None, *, everything: bool
) -> None:
    """Tables and findings of one system, and where its files are."""
    from validation.report.beside import beside_tables
    from validation.report.terminal import print_table

    for table in (*result.overview, *beside_tables(result.tables)):
        print_table(table)
    print_first_findings(findings, everything=everything)
    if results is not None:
        click.echo(f"\nResults: {results}")


def tell_check(
    facts: Mapping[str, object],
    tables: "Iterable[Table]",
    findings: "Sequence[Finding]",
    *,
    as_json: bool,
    strict: bool,
    more: str = "",
) -> None:
    """Print what a check found, all of it, and end as the findings call for.

    Parameters
    ----------
    facts : mapping
        For scripts.
    tables : iterable of Table
        For people.
    findings : sequence of Finding
        For both.
    as_json, strict : bool
        As the options say.
    more : str
        For people, after all else.
    """
    from validation.report.terminal import print_findings, print_json, print_table

    if as_json:
        print_json({**facts, "findings": findings})
    else:
        for table in tables:
            print_table(table)
        print_findings(findings)
        if more:
            click.echo(f"\n{more}")
    end_of_command(findings, strict=strict)


def print_first_findings(findings: "Sequence[Finding]", *, everything: bool) -> None:
    """The findings that ask for action, ten at most and in short; or all of them, whole."""
    from validation.report.terminal import print_findings

    shown = list(findings) if everything else first_findings(findings)
    print_findings(shown, brief=not everything)
    left = len(findings) - len(shown)
    if left:
        plural = "s" if left > 1 else ""
        click.echo(f"{left} more finding{plural}, and what to do about each, with --all.")


def first_findings(findings: "Sequence[Finding]") -> "list[Finding]":
    """Errors and warnings, ten at most, in the order found.

    Where there are more, errors come before warnings, and the first of each kind about each
    subject before the second: ten that say different things.
    """
    asking = [one for one in findings if one.severity in {"error", "warning"}]
    seen: Counter[tuple[str, str]] = Counter()
    ranks = []
    for place, one in enumerate(asking):
        kind = (one.code, one.subject)
        ranks.append((one.severity != "error", seen[kind], place))
        seen[kind] += 1
    return [asking[place] for place in sorted(rank[-1] for rank in sorted(ranks)[:MOST_FINDINGS])]


def end_of_command(findings: "Sequence[Finding]", *, strict: bool, failed: bool = False) -> None:
    """Exit with the status that the findings call for; go on where that is 0."""
    context = click.get_current_context()
    if failed:
        context.exit(UNEXPECTED)
    if strict and any(one.severity == "error" for one in findings):
        context.exit(STRICT_ERROR)
