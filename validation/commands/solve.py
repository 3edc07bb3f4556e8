"""The command that solves one system of a campaign: the same for all systems."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click

from validation.commands.options import (
    AS_JSON,
    CAMPAIGN,
    DRY_RUN,
    EVERYTHING,
    SCHEDULER,
    STRICT,
    progress_bar,
)

Option = Callable[[Any], Any]


class CampaignGroup(click.Group):
    """A group of commands of one system, whose first argument may be a campaign.

    ``gtval laser CAMPAIGN`` is short for ``gtval laser solve CAMPAIGN``.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """The arguments, after `solve` where they name no command."""
        if args and args[0] not in ctx.help_option_names and not self.commands.keys() & set(args):
            args = ["solve", *args]
        return super().parse_args(ctx, args)


def solve_command(
    system: str, help_text: str, options: Sequence[Option] = (), name: str = "solve"
) -> click.Command:
    """The command that solves a system, writes its files and prints what it found.

    Parameters
    ----------
    system : str
        Name of the installed system.
    help_text : str
        What the command does, and which files it writes.
    options : sequence of click options
        Of this system alone. Their values are handed to its `solve` by their names; those that
        are None are not.
    name : str
        Of the command.
    """

    def command(
        campaign: Path,
        *,
        as_json: bool,
        strict: bool,
        everything: bool,
        dry_run: bool,
        scheduler: str | None,
        **choices: object,
    ) -> None:
        from validation.commands.output import end_of_command, print_result
        from validation.errors import GtvalError
        from validation.pieces.cluster import on_cluster
        from validation.pieces.store import counted
        from validation.solving import system_output

        with on_cluster(scheduler), counted() as pieces, progress_bar(system) as report:
            solved, findings, results = system_output(
                campaign, system, report, choices, write=not dry_run
            )
        if as_json:
            from validation.report.terminal import print_json

            print_json({**solved.result.facts, "findings": findings, "pieces": pieces.kinds})
        else:
            print_result(solved.result, findings, results, everything=everything)
            click.echo(pieces.text(), nl=False)
        end_of_command(findings, failed=solved.failed, strict=strict)
        found = solved.result
        if not (found.tables or found.trajectories or found.without_poses):
            errors = [one.text for one in findings if one.severity == "error"]
            raise GtvalError("\n".join(errors) or f"{system} has no pose of this campaign")

    command.__doc__ = help_text
    decorated: Any = command
    for option in reversed((CAMPAIGN, AS_JSON, STRICT, EVERYTHING, DRY_RUN, SCHEDULER, *options)):
        decorated = option(decorated)
    return click.command(name)(decorated)
