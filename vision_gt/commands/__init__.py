"""The commands below ``gtval vision``."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import AS_JSON, CAMPAIGN, progress_bar

if TYPE_CHECKING:
    from vision_gt.patterns.boards import Board

PATH = click.Path(path_type=Path)
WORKERS = click.option(
    "--workers", type=click.IntRange(1), help="Processes; one for each processor by default."
)


class _WithDefault(click.Group):
    """A group whose first argument may be a campaign: then the command is `solve`."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and args[0] not in self.commands and not args[0].startswith("-"):
            args = ["solve", *args]
        return super().resolve_command(ctx, args)


@click.group(cls=_WithDefault)
def vision() -> None:
    """Robot poses from a camera network and markers.

    `gtval vision CAMPAIGN` is short for `gtval vision solve CAMPAIGN`.
    """


@vision.command()
@CAMPAIGN
@AS_JSON
@WORKERS
@click.option("--as-published/--not-as-published", default=None, help="Also the document's way.")
@click.option("--merge-cameras/--each-camera", default=None, help="One pose from all cameras.")
@click.option("--on-floor/--anywhere", default=None, help="The robot stands on the floor.")
@click.option("--dry-run", is_flag=True, help="Print only; write nothing.")
def solve(
    campaign: Path,
    *,
    as_json: bool,
    workers: int | None,
    as_published: bool | None,
    merge_cameras: bool | None,
    on_floor: bool | None,
    dry_run: bool,
) -> None:
    """Calibrate cameras, network and markers, and compute the robot's poses.

    Writes poses_vision.csv, vision_camera_poses.csv, vision_detections.csv, vision_cameras.csv,
    vision_layout.csv and a camera file for each camera to CAMPAIGN/results: all or none.
    """
    from validation.campaign.folder import load_campaign
    from validation.poses.pose_table import to_csv
    from validation.text_files.writing import write_files
    from vision_gt.campaign.solve import solve_campaign
    from vision_gt.choices import Choices
    from vision_gt.system import result_of, vision_facts

    loaded = load_campaign(campaign)
    choices = Choices(workers, as_published, merge_cameras, on_floor)
    with progress_bar("vision") as report:
        outcome = solve_campaign(loaded, report, choices)
    result = result_of(outcome, loaded)
    if not dry_run:
        tables = {f"poses_{table.system}.csv": to_csv(table) for table in result.tables}
        write_files(loaded.results, {**result.files, **tables})
    if as_json:
        from validation.report.terminal import print_json

        print_json({**vision_facts(outcome), "findings": result.findings})
        return
    from validation.report.terminal import print_findings, print_table
    from vision_gt.campaign.sections import camera_table, layout_table, pose_table

    for table in (camera_table(outcome), layout_table(outcome), pose_table(outcome)):
        print_table(table)
    print_findings(result.findings)
    if not dry_run:
        click.echo(f"\nResults: {loaded.results}")


@vision.command()
@click.argument("images", type=PATH)
@click.option("--columns", type=click.IntRange(3), default=10, show_default=True, help="Squares.")
@click.option("--rows", type=click.IntRange(3), default=6, show_default=True, help="Squares.")
@click.option("--square", type=click.FloatRange(0, min_open=True), default=0.1, show_default=True)
@click.option("--family", default="", help="Of a ChArUco board's markers, such as 4X4_100.")
@click.option("--write", "target", type=PATH, help="Camera file to write.")
@click.option(
    "--format",
    "file_format",
    type=click.Choice(["opencv", "ros", "kalibr", "bouguet"]),
    default="opencv",
    show_default=True,
)
@WORKERS
@AS_JSON
def calibrate(
    images: Path,
    *,
    columns: int,
    rows: int,
    square: float,
    family: str,
    target: Path | None,
    file_format: str,
    workers: int | None,
    as_json: bool,
) -> None:
    """Calibrate one camera from a folder of images of a board."""
    from vision_gt.commands.calibration import calibration_facts, calibration_of_folder

    with progress_bar("calibration") as report:
        board = _board(columns, rows, square, family)
        found = calibration_of_folder(images, board, workers, report)
    if target is not None:
        from validation.text_files.writing import write_files
        from vision_gt.optics.camera_files import write_camera

        content = write_camera(target.suffix, file_format, found.camera)
        write_files(target.parent, {target.name: content})
    from validation.report.terminal import print_json, print_table

    if as_json:
        print_json(calibration_facts(found))
        return
    from vision_gt.commands.calibration import image_table, parameters_table

    print_table(parameters_table(found))
    print_table(image_table(found))


@vision.command("convert-camera")
@click.argument("source", type=PATH)
@click.argument("target", type=PATH)
@click.option(
    "--format",
    "file_format",
    type=click.Choice(["opencv", "ros", "kalibr", "bouguet"]),
    required=True,
)
@click.option("--camera", help="Name of the camera, in a file that has several.")
def convert_camera(source: Path, target: Path, *, file_format: str, camera: str | None) -> None:
    """Turn a camera file of one program into that of another."""
    from validation.errors import GtvalError
    from validation.text_files.writing import write_files
    from vision_gt.optics.camera_files import read_cameras, write_camera

    found = read_cameras(source)
    chosen = [one for one in found if camera is None or one.name == camera]
    if len(chosen) != 1:
        names = ", ".join(one.name for one in found)
        raise GtvalError(f"{source} has the cameras {names}; choose one with --camera")
    content = write_camera(target.suffix, file_format, chosen[0])
    write_files(target.parent, {target.name: content})
    click.echo(f"Written: {target}")


@vision.command("check-table")
@CAMPAIGN
@AS_JSON
@WORKERS
def check_table_command(campaign: Path, *, as_json: bool, workers: int | None) -> None:
    """Check the cameras with a board on a table, put over validated poses.

    Needs the results of `gtval run` and images CAMPAIGN/vision/table/CAMERA/poseX.png.
    """
    from validation.campaign.folder import load_campaign
    from vision_gt.commands.table import table_readings
    from vision_gt.network.table_check import reading_table, statistics_table

    readings = table_readings(load_campaign(campaign), workers)
    from validation.report.terminal import print_json, print_table

    if as_json:
        print_json(
            {
                "readings": [
                    {
                        "pose": one.pose,
                        "camera": one.camera,
                        "validation": one.validation,
                        "board": one.board,
                        "difference": one.difference,
                    }
                    for one in readings
                ]
            }
        )
        return
    print_table(reading_table(readings))
    print_table(statistics_table(readings))


@vision.command("check-displacement")
@click.argument("camera_file", type=PATH)
@click.argument("first", type=PATH)
@click.argument("second", type=PATH)
@click.argument("distance", type=click.FloatRange(0, min_open=True))
@click.option("--columns", type=click.IntRange(3), default=10, show_default=True, help="Squares.")
@click.option("--rows", type=click.IntRange(3), default=6, show_default=True, help="Squares.")
@click.option("--square", type=click.FloatRange(0, min_open=True), default=0.1, show_default=True)
@click.option("--family", default="", help="Of a ChArUco board's markers, such as 4X4_100.")
@AS_JSON
def check_displacement(
    camera_file: Path,
    first: Path,
    second: Path,
    distance: float,
    *,
    columns: int,
    rows: int,
    square: float,
    family: str,
    as_json: bool,
) -> None:
    """Check a camera with a board in two places at a known DISTANCE (metres)."""
    from vision_gt.commands.calibration import displacement_of_images
    from vision_gt.optics.camera_files import read_cameras

    camera = read_cameras(camera_file)[0]
    board = _board(columns, rows, square, family)
    measured, angle = displacement_of_images(first, second, board, camera)
    if as_json:
        from validation.report.terminal import print_json

        print_json({"measured": measured, "expected": distance, "angle": angle})
        return
    click.echo(
        f"measured {measured:.4f} m, expected {distance:.4f} m: off by "
        f"{1e3 * (measured - distance):+.1f} mm; the board turned by {angle:.4f} rad"
    )


@vision.command("print-patterns")
@click.argument("folder", type=PATH)
@click.option("--campaign", type=PATH, help="Print this campaign's patterns.")
@click.option("--pdf/--svg", default=True, show_default=True)
def print_patterns(folder: Path, *, campaign: Path | None, pdf: bool) -> None:
    """Write boards and markers to FOLDER, to be printed at 100 %."""
    from validation.text_files.writing import write_files
    from vision_gt.commands.patterns import pattern_files
    from vision_gt.settings import VisionSettings

    settings = VisionSettings()
    if campaign is not None:
        from validation.campaign.folder import load_campaign

        settings = load_campaign(campaign).section("vision", VisionSettings)
    files = pattern_files(settings, ".pdf" if pdf else ".svg")
    for path in write_files(folder, files):
        click.echo(f"Written: {path}")


def _board(columns: int, rows: int, square: float, family: str) -> "Board":
    """The board that the options describe."""
    from vision_gt.patterns.boards import Board
    from vision_gt.patterns.dictionaries import Family

    return Board(columns, rows, square, Family(family) if family else None)


COMMANDS: list[click.Command] = [vision]
