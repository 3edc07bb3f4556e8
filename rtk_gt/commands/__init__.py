"""The command ``gtval rtk``."""

import click

from validation.commands.later import Later

COMMANDS: list[click.Command] = [
    Later(
        "rtk",
        "rtk_gt.commands.group:rtk",
        "Outdoor ground truth from one, two, three or more RTK-GPS receivers on a vehicle.",
    ),
]
