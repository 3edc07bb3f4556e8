"""The commands ``gtval run``, ``gtval compare`` and ``gtval report``."""

import click

from validation.commands.run import compare, report, run

COMMANDS: list[click.Command] = [run, compare, report]
