"""The command ``gtval rtk clock``, and what `dgps` and `imu` tell of clocks."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from rtk_gt.commands.drive import FINITE, drive_trajectory, lens_of
from validation.commands.options import (
    AS_JSON,
    CAMPAIGN,
    CLOCK_WINDOW,
    EVERYTHING,
    PATH,
    STAMP_METRES,
    STAMP_RADIANS,
    STRICT,
)

if TYPE_CHECKING:
    from validation.poses.trajectory import Trajectory
    from validation.results import Finding
    from validation.trajectories.clock.estimate import Turns
    from validation.trajectories.clock.result import ClockEstimate
    from validation.trajectories.clock.tables import Tolerance


@click.command()
@CAMPAIGN
@click.argument("streams", type=PATH, nargs=-1, required=True, metavar="STREAM...")
@CLOCK_WINDOW
@click.option("--topic", help="Of a bag that has several.")
@click.option(
    "--lens",
    nargs=8,
    type=FINITE,
    help="fx fy cx cy k1 k2 p1 p2: the STREAMs are points seen in a camera's images.",
)
@AS_JSON
@STRICT
@EVERYTHING
def clock(
    campaign: Path,
    streams: tuple[Path, ...],
    window: float,
    topic: str | None,
    lens: tuple[float, ...] | None,
    *,
    as_json: bool,
    strict: bool,
    everything: bool,
) -> None:
    """Tell how late the stamps of each STREAM are by the path of CAMPAIGN.

    A STREAM is what moves with the vehicle: an IMU (a table time,yaw,pitch,roll or time,wx,wy,wz
    in radians, or a bag), odometry, or any trajectory, such as one made of a scanner's data; with
    --lens it is a camera: a table time,x,y,z,u,v of known points seen in its images. Its frame and
    its mount may be others. The delay is what must be added to its stamps: one that stamps 0.1 s
    late has -0.1 s. Nothing is written.
    """
    from rtk_gt.sensors.sensor_files import read_seen_points
    from rtk_gt.sensors.stream_clocks import camera_stream, read_stream, stream_clock
    from validation.commands.output import end_of_command, print_first_findings
    from validation.report.terminal import print_json, print_table
    from validation.trajectories.clock.tables import clock_json, clock_table, parts_table

    read: list[Trajectory | Turns]
    if lens:
        of_camera = lens_of(lens)
        read = [camera_stream(path.stem, read_seen_points(path), of_camera) for path in streams]
    else:
        read = [read_stream(path, topic) for path in streams]
    reference = drive_trajectory(campaign)
    estimates = [stream_clock(reference, stream, window) for stream in read]
    limits = tolerance()
    findings = [said for one in estimates for said in stream_findings(one)]
    if as_json:
        told = {one.source: clock_json(one, limits) for one in estimates}
        print_json({"reference": "rtk", "sources": told, "findings": findings})
    else:
        print_table(clock_table(estimates))
        for one in estimates if everything else ():
            if one.parts:
                print_table(parts_table(one))
        print_first_findings(findings, everything=everything)
    end_of_command(findings, failed=False, strict=strict)


def tolerance() -> "Tolerance":
    """What stamps may cause."""
    from validation.trajectories.clock.tables import Tolerance

    return Tolerance(STAMP_METRES, STAMP_RADIANS)


def stream_findings(one: "ClockEstimate") -> "list[Finding]":
    """What a person should know of a stream's clock."""
    from validation.trajectories.clock.tables import clock_findings

    return clock_findings(one, tolerance())


def told_clock(
    reference: "Trajectory", stream: "Trajectory | Turns"
) -> "tuple[ClockEstimate | None, list[Finding]]":
    """The clock of a stream, and what is said of it; None where it cannot be looked for."""
    from rtk_gt.sensors.stream_clocks import stream_clock
    from validation.errors import GtvalError
    from validation.results import Finding

    try:
        found = stream_clock(reference, stream)
    except GtvalError as error:
        text = f"How late its stamps are cannot be told: {error}."
        return None, [Finding("warning", text, stream.system, "clock_not_determinable")]
    return found, stream_findings(found)


COMMANDS: list[click.Command] = [clock]
