"""The commands ``gtval demo``, ``gtval simulate`` and the like."""

import click

from validation.commands.later import Later

COMMANDS: list[click.Command] = [
    Later(
        "demo",
        "data_samples.commands.rooms:demo",
        "Copy the published AD2.3 campaign to FOLDER and compute it.",
    ),
    Later(
        "simulate",
        "data_samples.commands.rooms:simulate",
        "Write the campaign of a synthetic room to FOLDER, with the truth beside it.",
    ),
    Later(
        "simulate-almanac",
        "data_samples.commands.sky:simulate_almanac",
        "Write an almanac of the nominal GPS constellation to FILE, to try `gtval rtk plan`.",
    ),
    Later(
        "simulate-drive",
        "data_samples.commands.drives:simulate_drive_command",
        "Write a synthetic campus drive with RTK-GPS receivers as a campaign to FOLDER.",
    ),
    Later(
        "simulate-motion",
        "data_samples.commands.motion:simulate_motion_command",
        "Write a synthetic drive, seen by four cameras and a motion capture, as a campaign to "
        "FOLDER.",
    ),
    Later(
        "study",
        "data_samples.commands.study:study",
        "Draw many synthetic rooms and tell how often what gtval says of them is true.",
    ),
]
