"""The commands ``gtval run``, ``compare``, ``report``, ``sync`` and ``fuse``."""

import click

from validation.commands.compare import compare
from validation.commands.fuse import COMMANDS as FUSE
from validation.commands.run import report, run
from validation.commands.sync import COMMANDS as SYNC

COMMANDS: list[click.Command] = [run, compare, report, *FUSE, *SYNC]
