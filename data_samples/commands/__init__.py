"""The commands ``gtval demo``, ``gtval simulate`` and the like."""

import click

from data_samples.commands import drives, motion, rooms

COMMANDS: list[click.Command] = [*rooms.COMMANDS, *drives.COMMANDS, *motion.COMMANDS]
