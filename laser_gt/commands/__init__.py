"""The command ``gtval laser``."""

import click

from validation.commands.later import Later

COMMANDS: list[click.Command] = [
    Later(
        "laser",
        "laser_gt.commands.group:laser",
        "Robot poses from laser scans: match, judge, inspect, place.",
    ),
]
