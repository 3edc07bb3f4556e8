"""The command ``gtval simulate-drive``."""

from pathlib import Path

import click


@click.command("simulate-drive")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True)
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
def simulate_drive_command(
    folder: Path, seed: int, loops: int, steepest: float, false_fixes: float
) -> None:
    """Write a synthetic campus drive with three RTK-GPS receivers as a campaign to FOLDER.

    The truth is beside it, in FOLDER/truth.
    """
    from math import radians

    from data_samples.drive_files import write_drive
    from data_samples.drives import DriveSettings, simulate_drive
    from validation.errors import GtvalError

    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise GtvalError(f"{folder} is not empty; nothing was written")
    settings = DriveSettings(loops=loops, steepest=radians(steepest), false_fixes=false_fixes)
    write_drive(folder, simulate_drive(seed, settings))
    click.echo(f"A drive of {loops} loops is in {folder}. Next: gtval run {folder}")


COMMANDS: list[click.Command] = [simulate_drive_command]
