"""The command ``gtval simulate-motion``."""

from pathlib import Path

import click

from data_samples.commands.rooms import FORCE, refuse_to_overwrite
from validation.commands.options import AS_JSON, PATH, SEED


@click.command("simulate-motion")
@click.argument("folder", type=PATH)
@SEED
@click.option(
    "--level",
    type=click.IntRange(1, 4),
    default=1,
    show_default=True,
    help="How bad the cameras are: noise of 3, 8, 15 or 30 mm.",
)
@click.option("--minutes", type=click.FloatRange(0.5, 60), default=8.0, show_default=True)
@click.option(
    "--laser",
    is_flag=True,
    help="Seen by a laser scanner on the robot instead of cameras, among people and glass.",
)
@FORCE
@AS_JSON
def simulate_motion_command(
    folder: Path, *, seed: int, level: int, minutes: float, laser: bool, force: bool, as_json: bool
) -> None:
    """Write a synthetic drive, seen by four cameras and a motion capture, as a campaign to FOLDER.

    The cameras have clocks of their own. The truth is beside, in FOLDER/truth.
    """
    from data_samples.motion.drive import SampleMotion, motion_drive
    from data_samples.motion.files import write_laser_drive, write_motion
    from data_samples.motion.laser import LaserDrive, laser_drive

    refuse_to_overwrite(folder, force=force)
    drive: LaserDrive | SampleMotion
    if laser:
        drive = laser_drive(seed, minutes=minutes)
        written = write_laser_drive(folder, drive)
    else:
        drive = motion_drive(seed, level=level, minutes=minutes)
        written = write_motion(folder, drive)
    if as_json:
        from validation.report.terminal import print_json

        stops = len(drive.stops)
        print_json({"folder": folder, "seed": seed, "stops": stops, "files": written})
        return
    click.echo(
        f"A drive of {minutes:g} minutes with {len(drive.stops)} stops is in {folder}. "
        f"Next: gtval run {folder}"
    )
