"""What commands print, and the status they end with."""

from collections.abc import Sequence
from pathlib import Path

import click

from validation.results import Finding, SystemResult

DONE, UNEXPECTED, BAD_INPUT, STRICT_ERROR, INTERRUPTED = 0, 1, 2, 3, 130
"""Exit statuses of all commands; 130 is what shells give a command that Ctrl-C has ended."""
MOST_FINDINGS = 10
"""Findings that are printed without --all: what asks for action, on one screen of a terminal."""


def print_result(
    result: SystemResult, findings: Sequence[Finding], results: Path | None, *, everything: bool
) -> None:
    """Tables and findings of one system, and where its files are."""
    from validation.report.terminal import print_table

    for table in result.overview:
        print_table(table)
    print_first_findings(findings, everything=everything)
    if results is not None:
        click.echo(f"\nResults: {results}")


def print_first_findings(findings: Sequence[Finding], *, everything: bool) -> None:
    """The findings that ask for action, ten at most; or all of them."""
    from validation.report.terminal import most_severe_first, print_findings

    shown = most_severe_first(findings)
    if not everything:
        shown = [one for one in shown if one.severity in {"error", "warning"}][:MOST_FINDINGS]
    print_findings(shown)
    left = len(findings) - len(shown)
    if left:
        click.echo(f"\n{left} more findings: --all shows them, and so does the report.")


def end_of_command(findings: Sequence[Finding], *, failed: bool, strict: bool) -> None:
    """Exit with the status that the findings call for; go on where that is 0."""
    context = click.get_current_context()
    if failed:
        context.exit(UNEXPECTED)
    if strict and any(one.severity == "error" for one in findings):
        context.exit(STRICT_ERROR)
