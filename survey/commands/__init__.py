"""The command ``gtval survey`` and the survey's other commands."""

import click

from survey.commands import accuracy, convergence, instrument, planning, solve

COMMANDS: list[click.Command] = [
    command
    for module in (solve, instrument, convergence, accuracy, planning)
    for command in module.COMMANDS
]
