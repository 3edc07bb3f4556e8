"""The command ``gtval survey``."""

import click

from validation.commands.options import AS_PUBLISHED
from validation.commands.solve import solve_command

_HELP = """Turn hand-laser readings into world points and validation poses.

    Writes world_points.csv, vframe_points.csv, poses_survey.csv, survey_single_poses.csv and
    readings_checked.csv to CAMPAIGN/results: all of them, or none if anything fails.
    """
_ROBUST = click.option(
    "--robust/--not-robust",
    default=None,
    help="Weigh large residuals down (Huber), or not; as [survey] robust says by default.",
)

survey = solve_command("survey", _HELP, (_ROBUST, AS_PUBLISHED), name="survey")

"""The survey of a campaign folder."""
