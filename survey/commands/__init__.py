"""The command ``gtval survey`` and the survey's other commands."""

import click

from validation.commands.later import Later

COMMANDS: list[click.Command] = [
    Later(
        "survey",
        "survey.commands.solve:survey",
        "Turn hand-laser readings into world points and validation poses.",
    ),
    Later(
        "instrument-check",
        "survey.commands.instrument:instrument_check",
        "Offset, scale and noise of a hand laser over known lengths.",
    ),
    Later(
        "walls-check",
        "survey.commands.instrument:walls_check",
        "Whether walls are parallel, from distances between them.",
    ),
    Later(
        "convergence",
        "survey.commands.convergence:convergence",
        "How far off a first guess may be: where thousands of random ones lead.",
    ),
    Later(
        "accuracy",
        "survey.commands.accuracy:accuracy",
        "Whether the survey saw a known small motion between two of its poses.",
    ),
    Later(
        "plan",
        "survey.commands.planning:plan",
        "Predict how good a survey will be, and which further readings help most.",
    ),
    Later(
        "enter",
        "survey.commands.enter:enter",
        "Enter hand-laser readings, one number and Enter at a time.",
    ),
    Later(
        "journal-merge",
        "survey.commands.enter:journal_merge",
        "Merge the journals of two entries that did not see one another.",
    ),
]
