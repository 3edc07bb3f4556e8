"""The commands ``gtval run``, ``gtval compare`` and ``gtval report``."""

import click

COMMANDS: list[click.Command] = []
