"""The commands ``gtval demo``, ``gtval simulate`` and ``gtval simulate-drive``."""

import click

from data_samples.commands import drives, rooms

COMMANDS: list[click.Command] = [*rooms.COMMANDS, *drives.COMMANDS]
