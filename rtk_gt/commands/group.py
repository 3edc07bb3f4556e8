"""The commands ``gtval rtk ...``."""

import click

from rtk_gt.commands import clock, clouds, export, noise, path, plan, sensors
from validation.commands.solve import CampaignGroup, solve_command


@click.group(cls=CampaignGroup)
def rtk() -> None:
    """Outdoor ground truth from one, two, three or more RTK-GPS receivers on a vehicle.

    `gtval rtk CAMPAIGN` is short for `gtval rtk solve CAMPAIGN`.
    """


_solve = solve_command(
    "rtk",
    "Find offsets, path, uncertainty and coverage; write them to CAMPAIGN/results.\n\n"
    "`gtval run CAMPAIGN` does the same with a report, beside the campaign's other systems.",
)
rtk.add_command(_solve)
rtk.add_command(_solve, "run")
for _command in (
    *path.COMMANDS,
    *sensors.COMMANDS,
    *clock.COMMANDS,
    *noise.COMMANDS,
    *clouds.COMMANDS,
    *plan.COMMANDS,
    *export.COMMANDS,
):
    rtk.add_command(_command)

COMMANDS: list[click.Command] = [rtk]
