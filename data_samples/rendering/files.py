"""The vision side of a simulated campaign as files: the [vision] table, the truth, the images."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform

from data_samples.rendering.campaign import all_photographs, render_all
from data_samples.rendering.checks import (
    CHECK_BOARD,
    DISPLACEMENT,
    DISPLACEMENT_SIGMA,
    SURVEY_SIGMAS,
    TABLE_CORNER,
    TABLE_HEIGHT,
    TABLE_MARKER,
    TABLE_MARKER_MIDDLE,
    TABLE_MARKER_SIDE,
    TABLE_SIGMAS,
    survey_places,
    table_stops,
)
from data_samples.rooms.cameras import (
    BAR_BOARDS,
    CHESSBOARD,
    DIMA_MARKER,
    MARKER_FAMILY,
    REFERENCE_SHIFT,
    T_BAR_NOMINAL,
    T_DIMA_MARKER,
    VisionSettings,
    VisionTruth,
    make_vision,
    reference_camera,
)
from data_samples.rooms.rooms import Room, RoomSettings, make_room
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.text_files.writing import write_files
from vision_gt.optics.camera import project
from vision_gt.optics.transforms import perturbed
from vision_gt.optics.written_cameras import write_camera
from vision_gt.patterns.boards import Board

_ROOMS = 60
"""Rooms tried before it is said that none has a place for all cameras."""
_CLICK = 3.0
"""Pixels by which a person misses the corner that they point at."""
_BAR_SIGMAS = (0.003, 0.004)
"""Metres and radians: a bar measured with a tape, as campaign.toml then states it."""


def make_room_with_cameras(
    room: RoomSettings, vision: VisionSettings, rng: np.random.Generator
) -> tuple[Room, VisionTruth]:
    """A room in which a camera sees the reference pattern, and its cameras.

    Parameters
    ----------
    room : RoomSettings
        Of the room.
    vision : VisionSettings
        Of its cameras.
    rng : numpy.random.Generator
        Source of all that is drawn.

    Raises
    ------
    GtvalError
        If no such room is found.
    """
    for _ in range(_ROOMS):
        made = make_room(room, rng)
        try:
            return made, make_vision(made, vision, rng)
        except GtvalError:
            continue
    raise GtvalError("no room was found in which a camera sees the reference pattern")


def vision_texts(truth: VisionTruth, rng: np.random.Generator) -> dict[str, str]:
    """The [vision] table for campaign.toml and the files of the truth.

    Parameters
    ----------
    truth : VisionTruth
        What is true.
    rng : numpy.random.Generator
        Source of the errors of what a person measures by hand.
    """
    files = {
        "campaign.toml": _vision_table(truth, rng),
        "truth/vision_cameras.csv": _poses_csv(
            "camera", [c.name for c in truth.cameras], truth.T_gtv_camera
        ),
        "truth/vision_layout.csv": _poses_csv(
            "marker", [str(n) for n in truth.layout.numbers], truth.layout.T_robot_marker
        ),
        "truth/vision_bar.csv": _poses_csv(
            "part", ["second"], RigidTransform.concatenate([truth.T_bar])
        ),
        "truth/vision_robot.csv": _poses_csv(
            "pose", [str(i + 1) for i in range(len(truth.T_gtv_robot))], truth.T_gtv_robot
        ),
    }
    for camera in (*truth.cameras, truth.movie_camera):
        content = write_camera(".yaml", "opencv", camera).decode()
        files[f"truth/camera_{camera.name}.yaml"] = content
    return files


def images_of(
    truth: VisionTruth,
    rng: np.random.Generator,
    workers: int,
    progress: Callable[[float], None] | None = None,
) -> dict[str, bytes]:
    """The images as PNG files below vision/, by their names relative to the campaign.

    Parameters
    ----------
    truth : VisionTruth
        What is photographed.
    rng : numpy.random.Generator
        Source of all that is drawn.
    workers : int
        Processes.
    progress : callable, optional
        Told the share done.

    Raises
    ------
    GtvalError
        If they cannot be rendered.
    """
    photographs = all_photographs(truth, rng)
    return dict(render_all(photographs, int(rng.integers(2**31)), workers, progress))


def write_images(
    folder: Path,
    truth: VisionTruth,
    rng: np.random.Generator,
    workers: int,
    progress: Callable[[float], None] | None = None,
) -> None:
    """Render the images of a campaign and write them below ``folder``/vision; see `images_of`."""
    write_files(folder, images_of(truth, rng, workers, progress))


def _poses_csv(kind: str, names: list[str], poses: RigidTransform) -> str:
    """Translations and rotation vectors by name."""
    lines = [f"{kind},x,y,z,rx,ry,rz"]
    for i, name in enumerate(names):
        numbers = [*poses[i].translation, *poses[i].rotation.as_rotvec()]
        lines.append(",".join([name, *(repr(float(v)) for v in numbers)]))
    return "\n".join(lines) + "\n"


def _vision_table(truth: VisionTruth, rng: np.random.Generator) -> str:
    """What a lab knows of its cameras, boards and markers."""
    settings = truth.settings
    i = reference_camera(truth)
    if i is None:
        raise GtvalError("no camera sees the reference pattern")
    corner = truth.T_gtv_reference.apply(CHESSBOARD.corners[:1])
    seen = project(truth.T_gtv_camera[i].inv().apply(corner), truth.cameras[i].parameters)[0]
    click = np.rint(seen + _CLICK * rng.standard_normal(2)).astype(int)
    names = ", ".join(f'"{camera.name}"' for camera in truth.cameras)
    length, angle = settings.reference_sigma
    dima_length, dima_angle = settings.dima_sigma
    height, tilt = settings.floor_sigma
    sides = ", ".join(
        f'"{n}" = {float(s):g}'
        for n, s in zip(truth.layout.numbers, truth.layout.sides, strict=True)
    )
    blocks = [
        "",
        "[vision]",
        f"cameras = [{names}]",
        "as_published = true  # also the document's way, for comparison",
        "",
        "[vision.board]  # for the intrinsic parameters",
        *_board_lines(CHESSBOARD),
        "",
        "[vision.bar]  # the double pattern, as built",
        f"sigmas = {_six(*_BAR_SIGMAS)}",
        f"second_on_first = {_placement(T_BAR_NOMINAL)}",
        f"first = {{ {', '.join(_board_lines(BAR_BOARDS[0]))} }}",
        f"second = {{ {', '.join(_board_lines(BAR_BOARDS[1]))} }}",
        "",
        "[vision.reference]  # the chessboard on the Vframe",
        f"board = {{ {', '.join(_board_lines(CHESSBOARD))} }}",
        f"position = [{REFERENCE_SHIFT:g}, 0.0]",
        f"sigmas = {_six(length, angle)}",
        f"origin_near = [{click[0]}, {click[1]}]",
        "",
        "[vision.floor]",
        f"height = {max(height, 1e-4):g}",
        f"tilt = {max(tilt, 1e-4):g}",
        "",
        *_check_lines(truth),
        "[vision.markers]",
        f'family = "{MARKER_FAMILY.name}"',
        f"sides = {{ {sides} }}",
        f"dima = {DIMA_MARKER}",
        f"dima_on_robot = {_placement(T_DIMA_MARKER)}",
        f"dima_sigmas = {_six(dima_length, dima_angle)}",
        "",
        "[vision.markers.hand_measured]",
        *_hand_measured(truth, rng),
    ]
    return "\n".join(blocks) + "\n"


def _check_lines(truth: VisionTruth) -> list[str]:
    """What a lab states of the things that it laid at known places."""
    board = f"board = {{ {', '.join(_board_lines(CHECK_BOARD))} }}"
    lines: list[str] = []
    if any(table_stops(truth).values()):
        lines += [
            "[vision.table]  # a board and a marker on a table over stops",
            board,
            f"height = {TABLE_HEIGHT:g}",
            f"corner = {list(TABLE_CORNER)}",
            f"marker = {TABLE_MARKER}",
            f"marker_side = {TABLE_MARKER_SIDE:g}",
            f"marker_middle = {list(TABLE_MARKER_MIDDLE)}",
            f"sigmas = {list(TABLE_SIGMAS)}",
            "",
        ]
    if places := survey_places(truth):
        lines += [
            "[vision.survey_check]  # the same board on the floor",
            board,
            f"sigmas = {list(SURVEY_SIGMAS)}",
            "",
            "[vision.survey_check.places]",
            *(
                f"{place.name} = {{ corner = {list(place.corner)}"
                + (f', stop = "{place.stop}" }}' if place.stop else " }")
                for place in places
            ),
            "",
        ]
    if truth.settings.displacement:
        lines += [
            "[vision.displacement]  # the calibration board, moved",
            f"distance = {DISPLACEMENT:g}",
            f"sigma = {DISPLACEMENT_SIGMA:g}",
            "",
        ]
    return lines


def _board_lines(board: Board) -> list[str]:
    """What a campaign states of a board."""
    lines = [f"columns = {board.columns}", f"rows = {board.rows}", f"square = {board.square:g}"]
    if board.family is not None:
        lines += [f'family = "{board.family.name}"', f"first_id = {board.first_id}"]
    return lines


def _six(length: float, angle: float) -> str:
    return "[" + ", ".join(f"{v:g}" for v in (length,) * 3 + (angle,) * 3) + "]"


def _hand_measured(truth: VisionTruth, rng: np.random.Generator) -> list[str]:
    """The other markers' places as measured by ruler and plumb-line."""
    lines = []
    length, angle = truth.settings.hand_sigma
    for i, number in enumerate(truth.layout.numbers):
        if number == DIMA_MARKER:
            continue
        off = np.repeat([length, angle], 3) * rng.standard_normal(6)
        lines.append(f'"{number}" = {_placement(perturbed(truth.layout.T_robot_marker[i], off))}')
    return lines


def _placement(T: RigidTransform) -> str:
    """A transform as an inline table."""
    return f"{{ translation = {_row(T.translation)}, rotation = [{_rows(T)}] }}"


def _rows(T: RigidTransform) -> str:
    return ", ".join(_row(row) for row in T.rotation.as_matrix())


def _row(values: Array) -> str:
    return "[" + ", ".join(f"{float(v) + 0.0:.6f}" for v in values) + "]"
