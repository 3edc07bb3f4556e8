"""The commands ``gtval run``, ``gtval compare``, ``gtval report`` and ``gtval fuse``."""

import click

from validation.commands.compare import compare
from validation.commands.fuse import COMMANDS as FUSE
from validation.commands.run import report, run

COMMANDS: list[click.Command] = [run, compare, report, *FUSE]
