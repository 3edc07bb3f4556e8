"""The command ``gtval convert``."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import AS_JSON, PATH

if TYPE_CHECKING:
    from validation.poses.trajectory import Trajectory

FROM = ["csv", "tum", "tum_covariance", "kitti", "euroc", "rawseeds"]
FROM += ["motive", "vicon", "qualisys", "gsi", "landxml", "bag"]
TO = ["csv", "tum", "tum_covariance", "kitti", "euroc", "mcap"]


@click.command()
@click.argument("source", type=PATH, metavar="IN")
@click.argument("target", type=PATH, metavar="OUT")
@click.option("--from", "form_in", type=click.Choice(FROM), help="Format of IN.")
@click.option("--to", "form_out", type=click.Choice(TO), help="Format of OUT.")
@click.option("--unit", type=click.Choice(["s", "ms", "us", "ns"]), help="Of the stamps in IN.")
@click.option("--topic", help="Of a bag.")
@click.option("--body", help="Rigid body of a motion capture, child frame of a transform.")
@click.option("--times", type=PATH, help="One time a line, for poses or points without times.")
@click.option("--degrees/--radians", "degrees", default=None, help="Unit of angles in IN.")
@click.option("--up", type=click.Choice(["y", "z"]), help="Axis of a motion capture that is up.")
@AS_JSON
def convert(
    source: Path,
    target: Path,
    form_in: str | None,
    form_out: str | None,
    unit: str | None,
    topic: str | None,
    body: str | None,
    times: Path | None,
    degrees: bool | None,
    up: str | None,
    *,
    as_json: bool,
) -> None:
    """Convert a trajectory: poses at times, from one format of file to another.

    The format of IN is told by its content, that of OUT by the end of its name: .csv (gtval's own,
    which keeps all there is), .tum, .kitti, .mcap; .gz behind it compresses. Nothing is guessed:
    what the file does not tell is asked for.
    """
    from validation.errors import GtvalError
    from validation.trajectories.formats.reading import read_trajectory
    from validation.trajectories.formats.writing import format_to_write, losses, write_trajectory

    written = form_out or format_to_write(target)
    if target.exists() and source.exists() and target.samefile(source):
        raise GtvalError(f"OUT is IN: {target} would be lost; give another name")
    trajectory = read_trajectory(
        source,
        format=form_in,
        unit=unit,
        topic=topic,
        times=times,
        degrees=degrees,
        body=body,
        up=up,
    )
    files = write_trajectory(trajectory, target, written)
    _tell(trajectory, written, files, losses(trajectory, written), as_json=as_json)


def _tell(
    trajectory: "Trajectory", written: str, files: list[Path], lost: list[str], *, as_json: bool
) -> None:
    """What was read, what was written, and what is not in it."""
    from validation.trajectories.formats.assembly import facts_of

    facts = facts_of(trajectory)
    read = str(trajectory.provenance["format"])
    notes = [*_notes(trajectory), *lost]
    if as_json:
        from validation.report.terminal import print_json

        told = {"read_as": read, "written_as": written, **facts, "notes": notes, "files": files}
        print_json({**told, "provenance": trajectory.provenance})
        return
    span = float(trajectory.times[-1] - trajectory.times[0])
    kind = trajectory.kind.replace("_", " in the ") if "_" in trajectory.kind else trajectory.kind
    click.echo(f"{len(trajectory)} poses ({kind}) over {span:.3f} s, read as {read}")
    for note in notes:
        click.echo(f"- {note}")
    for file in files:
        click.echo(f"{written}: {file}")


def _notes(trajectory: "Trajectory") -> list[str]:
    """What reading left out, sorted or took for granted."""
    notes = trajectory.provenance.get("notes", [])
    return [str(note) for note in notes] if isinstance(notes, list) else []
