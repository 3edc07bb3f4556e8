"""The command that fuses several sources of poses into one trajectory."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from validation.commands.options import AS_JSON, PATH

if TYPE_CHECKING:
    from validation.errors import Problem
    from validation.poses.angles import Array
    from validation.trajectories.clock.result import ClockEstimate
    from validation.trajectories.smoothing.source import Fused, Source


@click.command()
@click.argument("sources", nargs=-1, required=True, type=PATH)
@click.option("--output", required=True, type=PATH, help="Write the fused poses to this .csv file.")
@click.option("--odometry", type=PATH, help="Odometry, in a frame of its own; it may drift.")
@click.option("--delays", type=PATH, help="What `gtval sync --json` printed for these sources.")
@click.option(
    "--rate",
    type=click.FloatRange(0, min_open=True),
    help="Fused poses a second; by default at the times of the frames.",
)
@AS_JSON
def fuse(
    sources: tuple[Path, ...],
    *,
    output: Path,
    odometry: Path | None,
    delays: Path | None,
    rate: float | None,
    as_json: bool,
) -> None:
    """Fuse the poses of several SOURCES in one frame into one trajectory; smooth that of one.

    Noise, outliers and headings off by half a turn are found from the data. A source whose clock
    jumps is fused in parts, each with its delay. The file has covariances and the column
    'supported': 1 where data stand on both sides.
    """
    from validation.text_files.writing import write_files
    from validation.trajectories.formats.reading import read_trajectory
    from validation.trajectories.formats.source import system_name
    from validation.trajectories.smoothing.clocked import clocked
    from validation.trajectories.smoothing.fusion import fuse as fuse_sources

    clocks = _clocks(delays)
    read = [
        source
        for path in sources
        for source in clocked(read_trajectory(path), clocks.get(system_name(path)))
    ]
    wheels = None if odometry is None else read_trajectory(odometry)
    times = None if rate is None else _regular(read, rate)
    fused = fuse_sources(read, odometry=wheels, times=times)
    write_files(output.parent, {output.name: _text(fused)})
    _tell(fused, output, as_json)


def _clocks(path: Path | None) -> "dict[str, ClockEstimate]":
    """Clocks by name of the source.

    Raises
    ------
    InputError
        If the file is not what `gtval sync --json` prints.
    """
    import json

    from validation.errors import InputError, Problem

    if path is None:
        return {}
    expected = "expected what `gtval sync REFERENCE SOURCE... --json` prints"
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError([Problem(path, f"{expected} ({error})")]) from error
    sources = found.get("sources") if isinstance(found, dict) else None
    if not isinstance(sources, dict) or not all(isinstance(s, dict) for s in sources.values()):
        raise InputError([Problem(path, expected, field="sources")])
    problems: list[Problem] = []
    clocks = {
        name: _clock(name, told, f"sources.{name}", path, problems)
        for name, told in sources.items()
    }
    if problems:
        raise InputError(problems)
    return clocks


def _clock(
    name: str, told: "dict[str, Any]", field: str, path: Path, problems: "list[Problem]"
) -> "ClockEstimate":
    """The clock of a source, or of a part of it between jumps; what is wrong joins ``problems``."""
    from validation.errors import Problem
    from validation.trajectories.clock.result import ClockEstimate, Jump, Place

    keys = ("delay_s", "low_s", "high_s", "at_s", "drift_ppm", "drift_low_ppm", "drift_high_ppm")
    numbers: dict[str, Any] = {key: _number(told.get(key)) for key in keys}
    for key in keys[:3]:
        if not math.isfinite(numbers[key]):
            words = f"no delay is known for '{name}'; see its verdict, or leave it out"
            problems.append(Problem(path, words, field=f"{field}.{key}"))
    stamps = [_number(jump.get("stamp_s")) for jump in _rows(told, "jumps")]
    pieces = _rows(told, "pieces")
    if not all(map(math.isfinite, stamps)) or len(pieces) != (len(stamps) + 1 if stamps else 0):
        words = (
            f"the clock of '{name}' jumps {len(stamps)} times and has {len(pieces)} parts with a "
            "delay of their own; expected one part more than jumps, and a stamp for each jump. Run "
            "`gtval sync` again"
        )
        problems.append(Problem(path, words, field=f"{field}.pieces"))
        pieces = []
    # Where to part the poses is all that counts here.
    jumps = tuple(Jump(Place(s, s, s), math.nan, math.nan, math.nan, math.nan) for s in stamps)
    parts = (
        _clock(name, piece, f"{field}.pieces[{number}]", path, problems)
        for number, piece in enumerate(pieces)
    )
    return ClockEstimate(name, 0, "determined", jumps=jumps, pieces=tuple(parts), **numbers)


def _rows(told: "dict[str, Any]", key: str) -> "list[dict[str, Any]]":
    """A list of tables; empty where there is none."""
    rows = told.get(key)
    return [row for row in rows if isinstance(row, dict)] if isinstance(rows, list) else []


def _number(value: object) -> float:
    """A number, NaN where it is none."""
    return float(value) if isinstance(value, int | float) else math.nan


def _regular(sources: "list[Source]", rate: float) -> "Array":
    """Times of all sources together, at a rate."""
    import numpy as np

    from validation.errors import GtvalError

    epoch = sources[0].trajectory.epoch
    ends = [s.trajectory.times_since(epoch)[[0, -1]] + s.delay_s for s in sources]
    first, last = min(e[0] for e in ends), max(e[1] for e in ends)
    if (last - first) * rate > 1e7:
        raise GtvalError(
            f"{rate:g} poses a second over {last - first:.0f} s are more than ten million; "
            "give a lower --rate, and check that all sources have one epoch"
        )
    return np.arange(np.ceil(first * rate), np.floor(last * rate) + 1) / rate


def _text(fused: "Fused") -> str:
    """The trajectory's table with the column 'supported' at its end."""
    from validation.trajectories.formats.writing import trajectory_text

    lines = trajectory_text(fused.trajectory).splitlines()
    head = next(place for place, line in enumerate(lines) if not line.startswith("#"))
    lines[head] += ",supported"
    for place, inside in enumerate(fused.supported.tolist(), head + 1):
        lines[place] += ",1" if inside else ",0"
    return "\n".join(lines) + "\n"


def _tell(fused: "Fused", output: Path, as_json: bool) -> None:
    """What was found, as JSON or in words."""
    from dataclasses import asdict

    from validation.commands.output import print_first_findings
    from validation.report.terminal import print_json, print_table
    from validation.results import Table

    share = float(fused.supported.mean())
    if as_json:
        told = {
            "command": "fuse",
            "output": str(output),
            "poses": len(fused.trajectory),
            "supported_share": share,
            "sources": {one.system: asdict(one) for one in fused.noise},
            "strengths": dict(fused.strengths),
            "odometry": dict(fused.odometry),
            "findings": list(fused.findings),
        }
        print_json(told)
        return
    print_table(
        Table(
            "Sources of the fused poses",
            [
                "source",
                "outliers [%]",
                "position [mm]",
                "angle [mrad]",
                "jitter [ms]",
                "delay [ms]",
                "sigma [ms]",
            ],
            [
                [
                    one.system,
                    100 * one.outliers,
                    1e3 * one.position,
                    1e3 * one.angle,
                    1e3 * one.jitter_s,
                    1e3 * one.delay_s,
                    1e3 * one.delay_sigma_s,
                ]
                for one in fused.noise
            ],
            ["", ".1f", ".2f", ".2f", ".2f", ".2f", ".2f"],
            note="Noise of single poses, as the fused ones show it.",
        )
    )
    print_first_findings(fused.findings, everything=True)
    click.echo(
        f"\n{len(fused.trajectory)} poses in {output}, {share:.0%} of them with data on both sides."
    )
