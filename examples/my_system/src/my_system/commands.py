"""The command ``gtval mocap``."""

from gtval.plugins import solve_command

COMMANDS = [
    solve_command(
        "mocap",
        "Compute the poses of the motion-capture rig.\n\n"
        "Writes poses_mocap.csv to CAMPAIGN/results.",
        name="mocap",
    )
]
