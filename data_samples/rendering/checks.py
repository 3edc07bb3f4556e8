"""Photographs for the checks: a table over stops, a board at known places, a board that moved."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from data_samples.rendering.image import Sheet
from data_samples.rendering.objects import board_sheet, marker_sheet
from data_samples.rooms.cameras import CHESSBOARD, MARKER_FAMILY, VisionTruth
from validation.poses.angles import Array
from vision_gt.optics.camera import inside_image, project
from vision_gt.optics.transforms import perturbed, planar_pose, planar_transform
from vision_gt.patterns.boards import Board

CHECK_BOARD = Board(columns=8, rows=5, square=0.06)
"""Small, as AD2.3's on the table; it does not look the same turned."""
TABLE_HEIGHT, TABLE_CORNER = 0.72, (0.05, 0.05)
TABLE_MARKER, TABLE_MARKER_SIDE, TABLE_MARKER_MIDDLE = 15, 0.16, (0.25, 0.32)
TABLE_SIGMAS = (0.002, 0.002, 0.001, 0.005)
"""How well things are laid on the table: x, y, height in metres, heading in radians."""
SURVEY_SIGMAS = (0.001, 0.001, 0.001, 0.003)
DISPLACEMENT, DISPLACEMENT_SIGMA = 0.6, 0.001
_TOP, _WOOD = ((-0.15, 0.5), (0.75, 0.75)), 0.45
"""Corner (x, y in the robot frame) and size of the table's top, metres, and its grey."""
_RIM = 20
"""Pixels from the rim of the image that the things on a table keep."""


@dataclass(frozen=True)
class Place:
    """Where a board is laid to check the survey.

    Parameters
    ----------
    name, camera : str
        Of the place, and of the camera that sees it.
    corner : (float, float)
        Of its first inner corner, metres; its rows lie along the x axis.
    stop : str
        In whose robot frame that is; '' for the GTV frame.
    """

    name: str
    camera: str
    corner: tuple[float, float]
    stop: str = ""


def lying(x: float, y: float, height: float, heading: float = 0.0) -> RigidTransform:
    """T of a board that lies face up."""
    turn = Rotation.from_rotvec([0, 0, heading]) * Rotation.from_rotvec([np.pi, 0, 0])
    return RigidTransform.from_components([x, y, height], turn)


def stop_frame(truth: VisionTruth, stop: int) -> RigidTransform:
    """The robot frame of a stop as it is marked on the floor."""
    return planar_transform(planar_pose(truth.T_gtv_robot[stop]))


def _shows(truth: VisionTruth, camera: int, points: Array, margin: float = _RIM) -> bool:
    """Whether points (n, 3) are in a camera's image, not far from its axis."""
    seen = truth.T_gtv_camera[camera].inv().apply(points)
    straight = seen[:, :2] / np.maximum(seen[:, 2:], 1e-9)
    if (seen[:, 2] < 0.3).any() or (np.abs(straight) > 0.85).any():
        return False
    one = truth.cameras[camera]
    return bool(inside_image(project(seen, one.parameters), one.size, margin).all())


def _rim_of(board: Board) -> Array:
    """(4, 3) outer corners of a board's print in its own frame."""
    q, c, r = board.square, board.columns, board.rows
    return np.array([[x, y, 0.0] for x in (-q, (c - 1) * q) for y in (-q, (r - 1) * q)])


def table_stops(truth: VisionTruth) -> dict[str, list[int]]:
    """Stops over which a camera has the table whole in its image, the nearest ones first."""
    x, y = TABLE_MARKER_MIDDLE
    half = TABLE_MARKER_SIDE / 2 + 0.02
    marker = np.array([[x + a, y + b, TABLE_HEIGHT] for a in (-half, half) for b in (-half, half)])
    board = lying(*TABLE_CORNER, TABLE_HEIGHT).apply(_rim_of(CHECK_BOARD))
    things = np.vstack([board, marker])
    found: dict[str, list[int]] = {}
    for i, camera in enumerate(truth.cameras):
        seen = [
            stop
            for stop in range(len(truth.T_gtv_robot))
            if _shows(truth, i, stop_frame(truth, stop).apply(things))
        ]
        eye = truth.T_gtv_camera[i].translation
        away = np.linalg.norm(truth.T_gtv_robot[seen].translation - eye, axis=1) if seen else []
        nearest = [seen[k] for k in np.argsort(away, kind="stable")]
        found[camera.name] = nearest[: truth.settings.table]
    return found


def survey_places(truth: VisionTruth) -> list[Place]:
    """A board with its top right corner at a point of the Vframe, and one beside a stop.

    AD2.3, "Validation poses": parallel to the x axis of the Vframe, its top right corner at the
    origin. Where no camera sees that, another corner or another point of the Vframe is taken.
    """
    if not truth.settings.survey_check:
        return []
    q, c, r = CHECK_BOARD.square, CHECK_BOARD.columns, CHECK_BOARD.rows
    # From the outer corner at the Vframe's point to the first inner corner: rows run along x,
    # columns against y.
    corners = {
        "top right": (-(c - 1) * q, -q),
        "top left": (q, -q),
        "bottom right": (-(c - 1) * q, (r - 1) * q),
        "bottom left": (q, (r - 1) * q),
    }
    found: list[Place] = []
    points = {"O": (0.0, 0.0), "X": (2.5, 0.0), "Y": (0.0, 2.5), "XY": (2.5, 2.5)}
    trials = [
        (name, px + dx, py + dy) for name, (px, py) in points.items() for dx, dy in corners.values()
    ]
    for name, x, y in trials:
        i = _first_camera(truth, lying(x, y, 0.0))
        if i is not None:
            found.append(Place(name, truth.cameras[i].name, (round(x, 6), round(y, 6))))
            break
    for stop in range(len(truth.T_gtv_robot)):
        i = _first_camera(truth, stop_frame(truth, stop) * lying(0.1, 0.1, 0.0))
        if i is not None:
            name = f"stop{stop + 1}"
            found.append(Place(name, truth.cameras[i].name, (0.1, 0.1), str(stop + 1)))
            break
    return found


def _first_camera(truth: VisionTruth, T_gtv_board: RigidTransform) -> int | None:
    """The first camera that has a check board whole in its image."""
    rim = T_gtv_board.apply(_rim_of(CHECK_BOARD))
    return next((i for i in range(len(truth.cameras)) if _shows(truth, i, rim)), None)


def _laid(sigmas: tuple[float, float, float, float], rng: np.random.Generator) -> Array:
    """(6,) small change of a thing that is laid so well."""
    x, y, height, heading = np.array(sigmas) * rng.standard_normal(4)
    return np.array([x, y, height, 0.0, 0.0, heading])


def check_scenes(
    truth: VisionTruth, rng: np.random.Generator
) -> Iterator[tuple[str, int, list[Sheet]]]:
    """Name of each image, number of its camera, and what is there."""
    yield from _table_scenes(truth, rng)
    numbers = {camera.name: i for i, camera in enumerate(truth.cameras)}
    stops = [stop_frame(truth, stop) for stop in range(len(truth.T_gtv_robot))]
    for place in survey_places(truth):
        frame = stops[int(place.stop) - 1] if place.stop else RigidTransform.identity()
        T = perturbed(frame * lying(*place.corner, 0.0), _laid(SURVEY_SIGMAS, rng))
        name = f"vision/survey_check/{place.camera}/{place.name}.png"
        yield name, numbers[place.camera], [board_sheet(CHECK_BOARD, T)]
    if truth.settings.displacement:
        yield from _displaced(truth, rng)


def _table_scenes(
    truth: VisionTruth, rng: np.random.Generator
) -> Iterator[tuple[str, int, list[Sheet]]]:
    """A table with a board and a marker over stops."""
    (left, top), size = _TOP
    face = RigidTransform.from_rotation(Rotation.from_rotvec([np.pi, 0, 0]))
    for i, camera in enumerate(truth.cameras):
        for stop in table_stops(truth)[camera.name]:
            frame = stop_frame(truth, stop)
            board = frame * lying(*TABLE_CORNER, TABLE_HEIGHT)
            middle = RigidTransform.from_translation([*TABLE_MARKER_MIDDLE, TABLE_HEIGHT])
            wood = frame * RigidTransform.from_translation([left, top, TABLE_HEIGHT - 0.001]) * face
            sheets = [
                Sheet(np.full((1, 1), _WOOD), size, wood),
                board_sheet(CHECK_BOARD, perturbed(board, _laid(TABLE_SIGMAS, rng))),
                marker_sheet(
                    MARKER_FAMILY,
                    TABLE_MARKER,
                    TABLE_MARKER_SIDE,
                    perturbed(frame * middle, _laid(TABLE_SIGMAS, rng)),
                ),
            ]
            yield f"vision/table/{camera.name}/pose{stop + 1}.png", i, sheets


def _displaced(
    truth: VisionTruth, rng: np.random.Generator
) -> Iterator[tuple[str, int, list[Sheet]]]:
    """The calibration board before and after it was moved, on the floor ahead of each camera."""
    for i, camera in enumerate(truth.cameras):
        R, eye = truth.T_gtv_camera[i].rotation.as_matrix(), truth.T_gtv_camera[i].translation
        spot = eye[:2] - eye[2] / R[2, 2] * R[:2, 2]
        heading = float(np.arctan2(R[1, 0], R[0, 0]))
        ahead = planar_transform(np.array([*spot, heading]))
        middle = RigidTransform.from_translation(-CHESSBOARD.corners.mean(0))
        apart = DISPLACEMENT + DISPLACEMENT_SIGMA * rng.standard_normal()
        for name, along in (("first", -apart / 2), ("second", apart / 2)):
            T = ahead * lying(along, 0.0, 0.0) * middle
            path = f"vision/displacement/{camera.name}/{name}.png"
            yield path, i, [board_sheet(CHESSBOARD, T)]
