"""The command ``gtval sync``."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import (
    AS_JSON,
    CLOCK_WINDOW,
    EVERYTHING,
    PATH,
    STAMP_METRES,
    STAMP_RADIANS,
    STRICT,
    progress_bar,
)

if TYPE_CHECKING:
    from validation.poses.trajectory import Trajectory


@click.command()
@click.argument("reference", type=PATH)
@click.argument("sources", type=PATH, nargs=-1, required=True, metavar="SOURCE...")
@CLOCK_WINDOW
@click.option(
    "--tolerance",
    type=click.FloatRange(min=0, min_open=True),
    default=STAMP_METRES,
    show_default=True,
    help="Metres that wrong stamps may move a position by.",
)
@click.option(
    "--tolerance-angle",
    type=click.FloatRange(min=0, min_open=True),
    default=STAMP_RADIANS,
    show_default=True,
    help="Radians that they may turn a heading by.",
)
@AS_JSON
@STRICT
@EVERYTHING
def sync(
    reference: Path,
    sources: tuple[Path, ...],
    window: float,
    tolerance: float,
    tolerance_angle: float,
    *,
    as_json: bool,
    strict: bool,
    everything: bool,
) -> None:
    """Tell how late the stamps of each SOURCE are by the clock of REFERENCE.

    All are trajectories of one robot; frames and mounts may differ, and the reference may be
    odometry. The delay is what must be added to a source's stamps: a source that stamps 0.1 s late
    has -0.1 s. Nothing is written.
    """
    from validation.commands.output import end_of_command, print_first_findings
    from validation.report.terminal import print_json, print_table
    from validation.trajectories.clock.estimate import sync as estimated
    from validation.trajectories.clock.tables import (
        Tolerance,
        clock_findings,
        clock_json,
        clock_table,
        parts_table,
    )

    limits = Tolerance(tolerance, tolerance_angle)
    with progress_bar("clocks") as progress:
        read = _read(reference, sources)
        found = estimated(read[0], read[1:], window=window, progress=progress)
    estimates = list(found.values())
    findings = [finding for one in estimates for finding in clock_findings(one, limits)]
    if as_json:
        told = {one.source: clock_json(one, limits) for one in estimates}
        print_json({"reference": read[0].system, "sources": told, "findings": findings})
    else:
        print_table(clock_table(estimates))
        for one in estimates if everything else ():
            if one.parts:
                print_table(parts_table(one))
        print_first_findings(findings, everything=everything)
    end_of_command(findings, failed=False, strict=strict)


def _read(reference: Path, sources: Sequence[Path]) -> "list[Trajectory]":
    """The trajectories, named after their files."""
    from validation.errors import InputError, Problem
    from validation.poses.pose_table import refuse_twice
    from validation.trajectories.formats import read_trajectory
    from validation.trajectories.formats.source import system_name

    refuse_twice([system_name(path) for path in sources])
    read: list[Trajectory] = []
    problems: list[Problem] = []
    for path in (reference, *sources):
        try:
            read.append(read_trajectory(path, system=system_name(path)))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    return read
