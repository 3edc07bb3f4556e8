"""The command ``gtval vision``."""

import click

from validation.commands.later import Later

COMMANDS: list[click.Command] = [
    Later(
        "vision",
        "vision_gt.commands.group:vision",
        "Robot poses from a camera network and markers.",
    ),
]
