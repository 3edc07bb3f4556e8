"""The commands below ``gtval rtk``."""

import click

from rtk_gt.commands import clouds, sensors
from rtk_gt.commands.path import rtk

for _command in (*sensors.COMMANDS, *clouds.COMMANDS):
    rtk.add_command(_command)

COMMANDS: list[click.Command] = [rtk]
