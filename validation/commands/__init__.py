"""The commands ``gtval run``, ``gtval compare`` and ``gtval report``."""

import click

from validation.commands.compare import compare
from validation.commands.run import report, run

COMMANDS: list[click.Command] = [run, compare, report]
