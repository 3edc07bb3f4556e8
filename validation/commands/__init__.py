"""The commands ``gtval run``, ``gtval compare``, ``gtval report`` and ``gtval fuse``."""

import click

from validation.commands.fuse import COMMANDS as FUSE
from validation.commands.run import compare, report, run

COMMANDS: list[click.Command] = [run, compare, report, *FUSE]
