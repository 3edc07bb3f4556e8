"""The commands below ``gtval vision``."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from validation.commands.options import (
    AS_JSON,
    AS_PUBLISHED,
    CAMPAIGN,
    FIGURE,
    PATH,
    STRICT,
    WORKERS,
    progress_bar,
)
from validation.commands.solve import CampaignGroup, solve_command
from vision_gt.commands.deciding import decide

if TYPE_CHECKING:
    from vision_gt.commands.looking import Drawn
    from vision_gt.patterns.boards import Board

MERGE_CAMERAS = click.option(
    "--merge-cameras/--each-camera", default=None, help="One pose from all cameras."
)
ON_FLOOR = click.option(
    "--on-floor/--anywhere", default=None, help="The robot stands on the floor."
)
FORMATS = click.Choice(["opencv", "ros", "kalibr", "bouguet"])
FORMAT_HELP = "Of the camera file to write."


def board_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options that say which board images show."""
    options = (
        click.option("--columns", type=click.IntRange(3), help="Squares along the board."),
        click.option(
            "--rows", type=click.IntRange(3), help="Across it; 4 or more without markers."
        ),
        click.option(
            "--square", type=click.FloatRange(0, min_open=True), help="Side of a square, metres."
        ),
        click.option("--family", default="", help="Of a ChArUco board's markers, such as 4X4_100."),
        click.option(
            "--marker",
            type=click.FloatRange(0, min_open=True),
            default=None,
            help="Side of such a marker, metres; by default three quarters of a square's.",
        ),
        click.option("--inverted", is_flag=True, help="The board is printed white on black."),
        click.option("--legacy", is_flag=True, help="Laid out as by OpenCV before 4.6."),
    )
    for option in reversed(options):
        command = option(command)
    return command


def _board(
    columns: int | None, rows: int | None, square: float | None, family: str, **more: Any
) -> "Board":
    """The board that the options describe."""
    if columns is None or rows is None or square is None:
        raise click.UsageError(
            "state the board that the images show, such as: --columns 10 --rows 6 --square 0.1"
        )
    from vision_gt.patterns.boards import Board
    from vision_gt.patterns.dictionaries import Family
    from vision_gt.settings import check_side

    check_side(max(square, more["marker"] or 0.0))
    more["marker"] = more["marker"] or 0.0
    return Board(columns, rows, square, Family(family) if family else None, **more)


@click.group(cls=CampaignGroup)
def vision() -> None:
    """Robot poses from a camera network and markers.

    `gtval vision CAMPAIGN` is short for `gtval vision solve CAMPAIGN`.
    """


vision.add_command(
    solve_command(
        "vision",
        """Calibrate cameras, network and markers, and compute the robot's poses.

        Writes poses_vision.csv, vision_camera_poses.csv, vision_detections.csv,
        vision_cameras.csv, vision_layout.csv and a camera file for each camera to
        CAMPAIGN/results: all or none.
        """,
        (WORKERS, AS_PUBLISHED, MERGE_CAMERAS, ON_FLOOR),
    )
)


@vision.command()
@click.argument("images", type=PATH)
@board_options
@click.option("--write", "target", type=PATH, help="Camera file to write.")
@click.option(
    "--format",
    "file_format",
    type=FORMATS,
    default="opencv",
    show_default=True,
    help=FORMAT_HELP,
)
@click.option(
    "--figures", type=PATH, help="Folder for pictures: boards in space, corners on the images."
)
@WORKERS
@AS_JSON
def calibrate(
    images: Path,
    *,
    target: Path | None,
    figures: Path | None,
    file_format: str,
    workers: int | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Calibrate one camera from a folder of images, or a video, of a board."""
    from validation.report.terminal import print_json, print_table, print_text
    from vision_gt.commands.calibration import (
        calibration_facts,
        calibration_of_images,
        image_table,
        parameters_table,
        remark_lines,
    )
    from vision_gt.network.verdict import calibration_verdict
    from vision_gt.optics.written_cameras import check_suffix

    board = _board(**options)
    if target is not None:
        check_suffix(target.suffix, file_format)
    with progress_bar("calibration") as report:
        found, looks = calibration_of_images(images, board, workers, report)
    if target is not None:
        from validation.text_files.writing import write_files
        from vision_gt.optics.written_cameras import write_camera

        content = write_camera(target.suffix, file_format, found.camera)
        write_files(target.parent, {target.name: content})
    if figures is not None:
        from validation.text_files.writing import write_files
        from vision_gt.commands.calibration import calibration_figures

        write_files(figures, calibration_figures(found, looks))
    if as_json:
        print_json(calibration_facts(found, looks))
        return
    print_table(parameters_table(found))
    print_table(image_table(found))
    for line in remark_lines(looks):
        click.echo(line)
    print_text(calibration_verdict(found).text)


@vision.command("convert-camera")
@click.argument("source", type=PATH)
@click.argument("target", type=PATH)
@click.option("--format", "file_format", type=FORMATS, required=True, help=FORMAT_HELP)
@click.option("--camera", help="Name of the camera, in a file that has several.")
@AS_JSON
def convert_camera(
    source: Path, target: Path, *, file_format: str, camera: str | None, as_json: bool
) -> None:
    """Turn a camera file of one program into that of another."""
    from vision_gt.optics.camera_files import camera_of
    from vision_gt.optics.written_cameras import write_camera

    content = write_camera(target.suffix, file_format, camera_of(source, camera))
    _write(target.parent, {target.name: content}, as_json=as_json)


@vision.command("check-table")
@CAMPAIGN
@AS_JSON
@WORKERS
@STRICT
def check_table_command(
    campaign: Path, *, as_json: bool, workers: int | None, strict: bool
) -> None:
    """Check the cameras with a board or a marker on a table, put over validated poses.

    Needs the results of `gtval run` and images CAMPAIGN/vision/table/CAMERA/poseX.png. Without
    images it shows what [vision.printed] says of such a table.
    """
    from validation.campaign.folder import load_campaign
    from validation.commands.output import tell_check
    from vision_gt.campaign.check_sections import reading_table, statistics_table
    from vision_gt.campaign.printed import printed_table_alone
    from vision_gt.commands.checks import check_of_campaign

    loaded = load_campaign(campaign)
    printed = printed_table_alone(loaded)
    if printed is not None:
        tell_check(
            printed.facts, printed.overview, printed.findings, as_json=as_json, strict=strict
        )
        return
    checks, findings = check_of_campaign("table", loaded, workers)
    tables = [reading_table(checks.table), statistics_table(checks.table)]
    tell_check({"readings": checks.table}, tables, findings, as_json=as_json, strict=strict)


@vision.command("check-survey")
@CAMPAIGN
@AS_JSON
@WORKERS
@STRICT
def check_survey_command(
    campaign: Path, *, as_json: bool, workers: int | None, strict: bool
) -> None:
    """Check the survey by a camera: a board at known places on the floor.

    Needs the results of `gtval run`, [vision.survey_check] in campaign.toml, and images
    CAMPAIGN/vision/survey_check/CAMERA/PLACE.png.
    """
    from validation.campaign.folder import load_campaign
    from validation.commands.output import tell_check
    from vision_gt.campaign.check_sections import survey_table
    from vision_gt.commands.checks import check_of_campaign

    checks, findings = check_of_campaign("survey_check", load_campaign(campaign), workers)
    tables = [survey_table(checks.survey)]
    tell_check({"readings": checks.survey}, tables, findings, as_json=as_json, strict=strict)


@vision.command("check-displacement")
@click.argument("camera_file", type=PATH)
@click.argument("first", type=PATH)
@click.argument("second", type=PATH)
@click.argument("distance", type=click.FloatRange(0, min_open=True))
@board_options
@click.option(
    "--sigma",
    type=click.FloatRange(0, min_open=True),
    default=0.001,
    show_default=True,
    help="Standard deviation of DISTANCE, metres.",
)
@AS_JSON
@STRICT
def check_displacement(
    camera_file: Path,
    first: Path,
    second: Path,
    distance: float,
    *,
    sigma: float,
    as_json: bool,
    strict: bool,
    **options: Any,
) -> None:
    """Check a camera with a board in two places at a known DISTANCE (metres).

    The verdict is a finding; with --strict the status is 3 where the camera is wrong.
    """
    from validation.commands.output import tell_check
    from vision_gt.campaign.check_sections import displacement_table
    from vision_gt.campaign.checks import displacement_verdict
    from vision_gt.commands.checks import displacement_of_images
    from vision_gt.optics.camera_files import read_cameras

    board = _board(**options)
    camera = read_cameras(camera_file)[0]
    moved = displacement_of_images((first, second), board, camera, distance, sigma)
    facts = {**vars(moved), "off": moved.off, "p_value": moved.p_value, "agrees": moved.agrees}
    verdict = displacement_verdict(moved)
    table = displacement_table([moved])
    tell_check(facts, [table], [verdict], as_json=as_json, strict=strict)


@vision.command()
@click.argument("photo", type=PATH)
@click.option("--intrinsics", type=PATH, required=True, help="Camera file of who took it.")
@click.option("--camera", help="Name of the camera, in a file that has several.")
@click.option("--markers", help="Family of the markers, such as APRILTAG_36H11.")
@click.option("--side", type=click.FloatRange(0, min_open=True), help="Of a marker, metres.")
@click.option("--border", type=click.IntRange(1, 4), default=1, help="Black cells around a code.")
@board_options
@click.option("--picture", type=PATH, help="JPEG file to draw what was found to.")
@AS_JSON
def pose(
    photo: Path,
    *,
    intrinsics: Path,
    camera: str | None,
    markers: str | None,
    side: float | None,
    border: int,
    picture: Path | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Poses of the markers, or of the board, in one PHOTO, in the frame of its camera.

    With standard deviations from corners and lens; --json has the covariances.
    """
    from validation.report.terminal import print_json, print_table
    from vision_gt.commands.photo import photo_of_board, photo_of_markers
    from vision_gt.optics.camera_files import camera_of
    from vision_gt.patterns.dictionaries import Family

    chosen = camera_of(intrinsics, camera)
    if markers is None:
        found = photo_of_board(photo, chosen, _board(**options))
    elif side is None:
        raise click.UsageError("state the side of the markers in metres, such as: --side 0.156")
    else:
        found = photo_of_markers(photo, chosen, Family(markers, border), side)
    if picture is not None:
        from validation.text_files.writing import write_files
        from vision_gt.looks.told import picture_bytes

        write_files(picture.parent, {picture.name: picture_bytes((found.look, Path()))})
    if as_json:
        print_json(found.facts)
        return
    print_table(found.table)
    for remark in found.remarks:
        click.echo(f"{photo.name}: {remark}")


@vision.command()
@CAMPAIGN
@click.option("--stop", "stops", multiple=True, help="A stop; may be given several times.")
@click.option("--camera", "cameras", multiple=True, help="A camera; the same.")
@click.option("--image", "images", type=PATH, multiple=True, help="One image, a frame too.")
@click.option("--all", "everything", is_flag=True, help="Also boards that were used, and the walk.")
@click.option("--output", type=PATH, help="Folder for the pictures; CAMPAIGN/results/vision.")
@WORKERS
@AS_JSON
def look(
    campaign: Path, *, output: Path | None, workers: int | None, as_json: bool, **choice: Any
) -> None:
    """Draw what the cameras saw: outlines found and expected, and what was not used, and why.

    Every stop, and each image of boards that was left out, as a JPEG file. Markers and boards are
    expected where the results of `gtval run` have them; without results what is found is drawn.
    """
    from validation.campaign.folder import load_campaign
    from vision_gt.commands.looking import looks_drawn

    with progress_bar("images") as report:
        drawn = looks_drawn(load_campaign(campaign), output, workers, report, **choice)
    _told(drawn, as_json=as_json)


vision.add_command(decide)


@vision.command()
@CAMPAIGN
@AS_JSON
@FIGURE
@STRICT
def plan(campaign: Path, *, as_json: bool, figure: Path | None, strict: bool) -> None:
    """Predict what cameras will see, and how well, before they are hung.

    From [vision.plan] of campaign.toml: shares of the floor and of the stops seen by one and by
    two cameras, holes, the size of a marker in the images, the accuracy of the robot's pose, and
    how large a marker has to be at a distance.
    """
    from validation.campaign.folder import load_campaign
    from validation.commands.output import tell_check
    from vision_gt.planning.inputs import load_plan
    from vision_gt.planning.plan import work_out
    from vision_gt.planning.telling import plan_facts, plan_findings, plan_tables
    from vision_gt.settings import VisionSettings

    loaded = load_campaign(campaign)
    worked_out = work_out(load_plan(loaded, loaded.section("vision", VisionSettings)))
    if figure is not None:
        from validation.figures.writing import write_figure
        from vision_gt.planning.figures import plan_picture

        write_figure(figure, plan_picture(worked_out, loaded.settings.room.walls))
    tell_check(
        plan_facts(worked_out),
        plan_tables(worked_out),
        plan_findings(worked_out),
        as_json=as_json,
        strict=strict,
        more="" if figure is None else f"Picture: {figure}",
    )


@vision.command("print-patterns")
@click.argument("folder", type=PATH)
@click.option("--campaign", type=PATH, help="Print this campaign's patterns.")
@click.option("--pdf/--svg", default=True, show_default=True)
@AS_JSON
def print_patterns(folder: Path, *, campaign: Path | None, pdf: bool, as_json: bool) -> None:
    """Write boards and markers to FOLDER, to be printed at 100 %.

    Without a campaign they are an example, with the lines of campaign.toml that describe it.
    """
    from vision_gt.commands.patterns import EXAMPLE, example_settings, pattern_files
    from vision_gt.settings import VisionSettings

    settings = example_settings()
    if campaign is not None:
        from validation.campaign.folder import load_campaign

        settings = load_campaign(campaign).section("vision", VisionSettings)
    _write(folder, pattern_files(settings, ".pdf" if pdf else ".svg"), as_json=as_json)
    if campaign is None and not as_json:
        click.echo(f"\nThese lines of campaign.toml describe them:\n\n{EXAMPLE}")


def _write(folder: Path, files: "dict[str, str | bytes]", *, as_json: bool) -> None:
    """Write files and say so."""
    from validation.report.terminal import print_json
    from validation.text_files.writing import write_files

    written = write_files(folder, files)
    if as_json:
        print_json({"written": [str(path) for path in written]})
        return
    for path in written:
        click.echo(f"Written: {path}")


def _told(drawn: "Drawn", *, as_json: bool) -> None:
    """Say which pictures were drawn."""
    from validation.report.terminal import print_json, print_table

    if as_json:
        print_json(drawn.facts)
        return
    print_table(drawn.table)
    for line in drawn.remarks:
        click.echo(line)
    click.echo(f"Pictures: {drawn.folder}")


COMMANDS: list[click.Command] = [vision]
