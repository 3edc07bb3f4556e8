"""The command ``gtval rtk cloud``: a scanner's points along the path, coloured by a camera."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from rtk_gt.commands.drive import FINITE, along_path, lens_of, need_picture, sensor_named, solved
from validation.commands.options import AS_JSON, CAMPAIGN, PATH

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rtk_gt.sensors.clouds import Bytes


@click.command()
@CAMPAIGN
@click.argument("sensor")
@click.argument("scans", type=PATH)
@click.argument("output", type=PATH)
@click.option("--images", type=PATH, help="CSV file time,file: colour the points by these.")
@click.option("--camera", "camera_name", help="The camera of the images in campaign.toml.")
@click.option("--lens", nargs=8, type=FINITE, help="Of the camera: fx fy cx cy k1 k2 p1 p2.")
@click.option("--picture", type=PATH, help="Draw the cloud from above and aside (.png, .svg).")
@AS_JSON
def cloud(
    campaign: Path,
    sensor: str,
    scans: Path,
    output: Path,
    images: Path | None,
    camera_name: str | None,
    lens: tuple[float, ...] | None,
    picture: Path | None,
    as_json: bool,
) -> None:
    """Write the point cloud of a scanner's SCANS along the path as a PLY file.

    With --images, --camera and --lens the points take their colours from the images.
    """
    import numpy as np

    from rtk_gt.sensors.clouds import colour_points, ply
    from rtk_gt.sensors.scans import cloud_of
    from rtk_gt.sensors.sensor_files import read_images, read_line_scans
    from validation.errors import GtvalError
    from validation.report.terminal import print_json
    from validation.text_files.writing import write_files

    given = (images is not None, camera_name is not None, bool(lens))
    if any(given) and not all(given):
        raise click.UsageError("give --images, --camera and --lens together, or none of them")
    need_picture("--picture", picture)
    read = read_line_scans(scans)
    pictures = read_images(images) if images is not None else None
    outcome = solved(campaign)
    found = along_path(outcome, read.times, scans)
    used = cloud_of(read.select(found.available))
    pose = np.array(sensor_named(outcome, sensor).pose)
    points = used.in_world(found.poses[found.available], pose)
    if len(points) == 0:
        raise GtvalError(f"{scans}: no beam hit anything between 0.5 and 30 m; no cloud to write")
    facts: dict[str, object] = {
        "file": output,
        "points": len(points),
        "scans_in_gaps": int((~found.available).sum()),
    }
    said = f"{len(points)} points in {output}; {facts['scans_in_gaps']} scans are in gaps."
    colours = None
    if images is not None and pictures is not None and camera_name is not None and lens:
        at = along_path(outcome, pictures[0], images)
        camera_pose = np.array(sensor_named(outcome, camera_name).pose)
        files = [pictures[1][row] for row in np.flatnonzero(at.available)]
        colours, seen = colour_points(
            points, _pictures(files), at.poses[at.available], camera_pose, lens_of(lens)
        )
        left_out = len(pictures[1]) - len(files)
        facts |= {"coloured": int(seen.sum()), "images": len(files), "images_in_gaps": left_out}
        said += (
            f" {facts['coloured']} of them are coloured by {len(files)} images; {left_out} images "
            "are in gaps. The others are grey."
        )
    write_files(output.parent, {output.name: ply(points, colours)})
    if picture is not None:
        from rtk_gt.sensors.figures import cloud_picture
        from validation.figures.writing import write_figure

        write_figure(picture, cloud_picture(points, colours))
    if as_json:
        print_json(facts)
    else:
        click.echo(said)


def _pictures(files: "list[Path]") -> "Iterator[Bytes]":
    """The images, red, green, blue, read one at a time."""
    import cv2
    import numpy as np

    from validation.errors import InputError, Problem

    shape = None
    for file in files:
        image = cv2.imread(str(file))
        if image is None:
            raise InputError([Problem(file, "no image that can be read")])
        shape = shape or image.shape
        if image.shape != shape:
            said = f"{image.shape[1]} x {image.shape[0]} pixels"
            expected = f"{shape[1]} x {shape[0]} like the first: one lens belongs to all images"
            raise InputError([Problem(file, f"{said}; expected {expected}")])
        yield np.asarray(image[:, :, ::-1], dtype=np.uint8)


COMMANDS: list[click.Command] = [cloud]
