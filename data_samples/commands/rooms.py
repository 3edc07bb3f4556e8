"""The commands ``gtval demo`` and ``gtval simulate``."""

from pathlib import Path

import click

from validation.commands.options import (
    AS_JSON,
    EVERYTHING,
    NORMAL,
    PATH,
    SEED,
    STRICT,
    WORKERS,
    progress_bar,
)
from validation.errors import GtvalError

FORCE = click.option("--force", is_flag=True, help="Write into a folder that is not empty.")


@click.command()
@click.argument("folder", type=PATH, default="gtval-demo")
@AS_JSON
@NORMAL
@STRICT
@EVERYTHING
@click.pass_context
def demo(ctx: click.Context, /, folder: Path, *, as_json: bool, **choices: bool) -> None:
    """Copy the published AD2.3 campaign to FOLDER and compute it.

    FOLDER is ./gtval-demo where none is given. It must be new, empty, or an earlier copy.
    """
    from data_samples.demo import copy_demo
    from validation.commands.run import run

    copy_demo(folder)
    if not as_json:
        click.echo(f"The AD2.3 campaign is in {folder}.\n")
    assert run.callback is not None
    ctx.invoke(run.callback, campaigns=(folder,), as_json=as_json, no_report=False, **choices)


@click.command()
@click.argument("folder", type=PATH)
@SEED
@click.option("--stops", type=click.IntRange(1, 5000), default=26, show_default=True)
@click.option("--world-points", type=click.IntRange(2, 500), default=16, show_default=True)
@click.option("--pillars", type=click.IntRange(0, 10), default=0, show_default=True)
@click.option(
    "--blunders", type=click.IntRange(0), default=0, help="Readings that are off by --blunder-size."
)
@click.option(
    "--blunder-size",
    type=click.FloatRange(0, 10, min_open=True),
    default=0.1,
    show_default=True,
    help="Metres.",
)
@click.option(
    "--typos", type=click.IntRange(0), default=0, help="Readings with two digits exchanged."
)
@click.option(
    "--mirror-trap",
    is_flag=True,
    help="Exchange the labels X and Y in the file, and do not say so.",
)
@click.option(
    "--hand-points",
    type=click.IntRange(0),
    default=0,
    help="World points also measured roughly, which tells a mirror image.",
)
@click.option(
    "--initial-guesses", is_flag=True, help="Poses also measured roughly, to 0.1 m and 0.1 rad."
)
@click.option(
    "--bias",
    type=(float, float, float),
    default=(0.0, 0.0, 0.0),
    show_default=True,
    metavar="X Y THETA",
    help="Of the example ground truth, metres and radians.",
)
@click.option("--laser", is_flag=True, help="Also two laser scanners and their scans.")
@click.option(
    "--mount-error",
    type=(float, float, float),
    default=(0.0, 0.0, 0.0),
    show_default=True,
    metavar="X Y THETA",
    help="Of the stated mount of the scanners, metres and radians.",
)
@click.option(
    "--laser-fault",
    "laser_faults",
    type=click.Choice(
        ["boxes", "edges", "floor", "glass", "grazing", "lean", "lost", "tilt"],
    ),
    multiple=True,
    help="What disturbs the scans; may be given several times. docs/laser.md says how much.",
)
@click.option("--vision", is_flag=True, help="Also cameras, a robot with markers, and images.")
@click.option(
    "--drive",
    type=click.FloatRange(2.0, 600.0),
    help="With --vision: the cameras also film a drive of so many seconds, 10 frames a second.",
)
@WORKERS
@FORCE
@AS_JSON
def simulate(
    folder: Path,
    *,
    seed: int,
    stops: int,
    world_points: int,
    pillars: int,
    blunders: int,
    blunder_size: float,
    typos: int,
    mirror_trap: bool,
    hand_points: int,
    initial_guesses: bool,
    bias: tuple[float, float, float],
    laser: bool,
    mount_error: tuple[float, float, float],
    laser_faults: tuple[str, ...],
    vision: bool,
    drive: float | None,
    workers: int | None,
    force: bool,
    as_json: bool,
) -> None:
    """Write the campaign of a synthetic room to FOLDER, with the truth beside it.

    The folder holds a survey of the room and an example ground truth to compare with it;
    `gtval run FOLDER` computes it. What is true is in FOLDER/truth, which no computation reads.
    """
    from data_samples.rendering.drive import DriveSettings
    from data_samples.room_campaign import write_room
    from data_samples.rooms.cameras import VisionSettings
    from data_samples.rooms.laser_campaign import with_faults
    from data_samples.rooms.rooms import RoomSettings
    from data_samples.rooms.simulate import ExampleSystem, SimulationSettings
    from validation.pieces.processors import processors

    if drive is not None and not vision:
        raise click.UsageError("--drive is filmed by the cameras of --vision; give both")
    refuse_to_overwrite(folder, force=force)
    settings = SimulationSettings(
        systems=(ExampleSystem(bias=bias),),
        blunders=blunders,
        blunder_size=blunder_size,
        typos=typos,
        mirror_trap=mirror_trap,
        hand_points=hand_points,
        guess_sigmas=(0.1, 0.1, 0.1) if initial_guesses else None,
    )
    with progress_bar("the room and its survey") as report:
        simulated = write_room(
            folder,
            seed,
            RoomSettings(world_points=world_points, stops=stops, pillars=pillars),
            settings,
            with_faults(laser_faults, mount_error) if laser else None,
            VisionSettings() if vision else None,
            None if drive is None else DriveSettings(seconds=drive),
            processors(workers),
            lambda share: report("rendering", share),
        )
    said = {
        "folder": str(folder),
        "seed": seed,
        "stops": stops,
        "world_points": world_points,
        "readings": len(simulated.readings),
        "wrong_readings": len(simulated.truth.faults),
    }
    if as_json:
        from validation.report.terminal import print_json

        print_json(said)
        return
    click.echo(
        f"{said['readings']} readings of {stops} stops and {world_points} world points are in "
        f"{folder}; what is true is in {folder / 'truth'}.\nCompute it: gtval run {folder}"
    )


def refuse_to_overwrite(folder: Path, *, force: bool = False) -> None:
    """Raise where the folder is no folder, or holds anything and that was not allowed."""
    if folder.exists() and not folder.is_dir():
        raise GtvalError(f"{folder} is a file; give the simulation a folder of its own")
    if folder.exists() and any(folder.iterdir()) and not force:
        raise GtvalError(
            f"{folder} is not empty; nothing was written. Give another folder, or --force to "
            "replace the files of an earlier simulation"
        )
