"""The command ``gtval simulate-drive``."""

from pathlib import Path
from typing import Literal

import click

from data_samples.commands.rooms import FORCE, refuse_to_overwrite
from validation.commands.options import AS_JSON, PATH, SEED, progress_bar


@click.command("simulate-drive")
@click.argument("folder", type=PATH)
@SEED
@click.option("--loops", type=click.IntRange(1, 50), default=2, show_default=True)
@click.option(
    "--steepest",
    type=click.FloatRange(0, 20),
    default=10.0,
    show_default=True,
    help="Greatest slope, degrees.",
)
@click.option(
    "--false-fixes",
    type=click.FloatRange(0, 0.5),
    default=0.0,
    show_default=True,
    help="Share of fixes that are off by 30 cm.",
)
@click.option(
    "--route",
    type=click.Choice(["road", "eight"]),
    default="road",
    show_default=True,
    help="Up and down a road, or figures of eight between buildings, as to calibrate scanners.",
)
@click.option("--receivers", type=click.IntRange(3, 5), default=3, show_default=True)
@click.option("--scans", is_flag=True, help="Write the scans of both vertical scanners, too.")
@click.option(
    "--sensors",
    is_flag=True,
    help="Write a consumer GPS, an IMU, a camera's points and a standing receiver, too.",
)
@click.option(
    "--images", is_flag=True, help="Draw the left camera's images, too: half a second each."
)
@FORCE
@AS_JSON
def simulate_drive_command(
    folder: Path,
    seed: int,
    loops: int,
    steepest: float,
    false_fixes: float,
    route: Literal["road", "eight"],
    receivers: int,
    scans: bool,
    sensors: bool,
    images: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Write a synthetic campus drive with RTK-GPS receivers as a campaign to FOLDER.

    The truth is beside it, in FOLDER/truth.
    """
    from math import radians

    import numpy as np

    from data_samples.drives.drive import DriveSettings, scan_along, simulate_drive
    from data_samples.drives.files import SCANNERS, write_drive

    refuse_to_overwrite(folder, force=force)
    settings = DriveSettings(
        loops=loops, steepest=radians(steepest), false_fixes=false_fixes, route=route,
        receivers=receivers,
    )  # fmt: skip
    with progress_bar("the drive") as report:
        drive = simulate_drive(seed, settings)
        read = {}
        for row, (name, pose) in enumerate(SCANNERS.items() if scans else ()):
            report(f"scans of {name}", row / len(SCANNERS))
            read[name] = scan_along(drive, pose, np.random.default_rng([seed, row]), every=0.2)
        report("writing", 0.0)
        written = write_drive(folder, drive, read, other_sensors=sensors, images=images)
    if as_json:
        from validation.report.terminal import print_json

        print_json({"folder": folder, "seed": seed, "loops": loops, "files": written})
        return
    click.echo(f"A drive of {loops} loops is in {folder}. Next: gtval run {folder}")
