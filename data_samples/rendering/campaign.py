"""The photographs of a vision campaign: what is taken, from where, under which name."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from data_samples.rendering.checks import check_scenes
from data_samples.rendering.image import Optics, Scene, Sheet, SunBlade, render
from data_samples.rendering.objects import (
    PAPER,
    bar_sheets,
    board_sheet,
    bystander,
    robot_sheets,
)
from data_samples.rooms.cameras import (
    BAR_BOARDS,
    BAR_GAP,
    CHESSBOARD,
    SIZE,
    VisionTruth,
    looking,
    reference_camera,
)
from validation.errors import GtvalError
from validation.pieces.processes import in_processes
from validation.poses.angles import Array
from vision_gt.optics.camera import Camera, inside_image, project
from vision_gt.patterns.boards import Board

_TRIES = 4000
_FACING = np.cos(np.deg2rad(62))
"""Boards are shown at angles of up to so much from the line of sight."""


@dataclass(frozen=True)
class Photograph:
    """One image to be rendered.

    Parameters
    ----------
    name : str
        Relative to the campaign folder.
    camera : Camera
        That takes it.
    T_world_camera : RigidTransform
        From where.
    sheets : sequence of Sheet
        What is there.
    optics : Optics
        Lens, light and sensor.
    blades : sequence of SunBlade
        Sunlight in the image.
    """

    name: str
    camera: Camera
    T_world_camera: RigidTransform
    sheets: Sequence[Sheet]
    optics: Optics
    blades: Sequence[SunBlade] = field(default_factory=tuple)


def all_photographs(truth: VisionTruth, rng: np.random.Generator) -> list[Photograph]:
    """Every image of the campaign.

    Raises
    ------
    GtvalError
        If two neighbours have no place where each sees one board of the double pattern.
    """
    return [
        *calibration_photographs(truth, rng),
        *network_photographs(truth, rng),
        *reference_photographs(truth),
        *movie_photographs(truth, rng),
        *robot_photographs(truth, rng),
        *steadiness_photographs(truth),
        *check_photographs(truth, rng.spawn(1)[0]),
    ]


def check_photographs(truth: VisionTruth, rng: np.random.Generator) -> list[Photograph]:
    """Of things at known places: vision/table, vision/survey_check, vision/displacement."""
    return [
        Photograph(name, truth.cameras[i], truth.T_gtv_camera[i], sheets, _optics(truth))
        for name, i, sheets in check_scenes(truth, rng)
    ]


def render_all(
    photographs: Sequence[Photograph],
    seed: int,
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Iterator[tuple[str, bytes]]:
    """Names and PNG files of photographs, in their order.

    Parameters
    ----------
    photographs : sequence of Photograph
        What to take.
    seed : int
        Of the noise; each image has a stream of its own, so that the number of workers does
        not matter.
    workers : int
        Processes.
    progress : callable, optional
        Told the share done.
    """
    seeds = np.random.SeedSequence(seed).spawn(len(photographs))
    jobs = list(zip(photographs, seeds, strict=True))
    return in_processes(_taken, jobs, workers, progress)


def _taken(job: tuple[Photograph, np.random.SeedSequence]) -> tuple[str, bytes]:
    photograph, seed = job
    cv2.setNumThreads(1)
    scene = Scene(photograph.sheets, blades=photograph.blades)
    image = render(
        photograph.camera,
        photograph.T_world_camera,
        scene,
        photograph.optics,
        np.random.default_rng(seed),
    )
    _, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    return photograph.name, data.tobytes()


def _optics(truth: VisionTruth) -> Optics:
    return Optics(blur=truth.settings.blur, noise=truth.settings.noise)


def calibration_photographs(truth: VisionTruth, rng: np.random.Generator) -> list[Photograph]:
    """The chessboard in all parts of the image, near and far, tilted: vision/calibration."""
    found = []
    for camera in (*truth.cameras, truth.movie_camera):
        for number in range(1, truth.settings.calibration + 1):
            T = _board_in_view(camera, number, rng)
            # The camera as the world, lifted and looking down, so that there is a floor.
            T_world_camera = looking(np.array([0.0, -2.0, 2.2]), np.zeros(3))
            found.append(
                Photograph(
                    f"vision/calibration/{camera.name}/{number:02d}.png",
                    camera,
                    T_world_camera,
                    [board_sheet(CHESSBOARD, T_world_camera * T)],
                    _optics(truth),
                )
            )
    return found


def _board_in_view(camera: Camera, number: int, rng: np.random.Generator) -> RigidTransform:
    """T_camera_board with the whole board in the image, its place going around with the number."""
    width, height = SIZE
    places = [
        (0.5, 0.5),
        (0.3, 0.35),
        (0.7, 0.35),
        (0.3, 0.65),
        (0.7, 0.65),
        (0.5, 0.3),
        (0.5, 0.7),
    ]
    u, v = places[number % len(places)]
    for attempt in range(_TRIES):
        push = min(1.0, attempt / 200)
        depth = rng.uniform(1.1, 2.6)
        tilt, towards = rng.uniform(0.1, 0.85), rng.uniform(-np.pi, np.pi)
        turn = Rotation.from_rotvec([0, 0, rng.uniform(-np.pi, np.pi)])
        lean = Rotation.from_rotvec(tilt * np.array([np.cos(towards), np.sin(towards), 0]))
        aim = np.array([u, v]) * (1 - push) + rng.uniform(0.25, 0.75, 2) * push
        direction = (aim * [width, height] - camera.parameters[2:4]) / camera.parameters[:2]
        centre = depth * np.append(direction, 1.0)
        T = RigidTransform.from_components(centre, lean * turn)
        T = T * RigidTransform.from_translation(-CHESSBOARD.corners.mean(0))
        if _sees(camera, RigidTransform.identity(), CHESSBOARD, T):
            return T
    raise GtvalError(f"camera {camera.name} cannot show the whole chessboard anywhere")


def _sees(
    camera: Camera, T_world_camera: RigidTransform, board: Board, T_world_board: RigidTransform
) -> bool:
    """Whether all of a board is in the image, well in front of the camera and facing it."""
    T = T_world_camera.inv() * T_world_board
    # The outer rim of the print too, so that no square is cut.
    corners = board.corners
    rim = corners + np.sign(corners - corners.mean(0)) * board.square * 1.2
    seen = T.apply(rim)
    if (seen[:, 2] < 0.5).any() or seen[:, 2].mean() > 4.6:
        return False
    centre = seen.mean(0)
    normal = T.rotation.as_matrix()[:, 2]
    if normal @ centre / np.linalg.norm(centre) < _FACING:
        return False
    straight = seen[:, :2] / seen[:, 2:]
    if (np.abs(straight) > 0.9).any():  # there the lens model folds back into the image
        return False
    return bool(inside_image(project(seen, camera.parameters), camera.size, 6).all())


def network_photographs(truth: VisionTruth, rng: np.random.Generator) -> list[Photograph]:
    """Snapshots of the double pattern: vision/network/2-1-4.png and vision/bar/2-1.png."""
    found = []
    for i in range(len(truth.cameras) - 1):
        j = i + 1
        a, b = truth.cameras[i], truth.cameras[j]
        for number in range(1, truth.settings.snapshots + 1):
            sheets = bar_sheets(truth, _bar_between(truth, i, j, rng))
            for one, other, index in ((a, b, i), (b, a, j)):
                name = f"vision/network/{one.name}-{other.name}-{number}.png"
                T = truth.T_gtv_camera[index]
                found.append(Photograph(name, one, T, sheets, _optics(truth)))
    for number in range(1, truth.settings.both + 1):
        sheets = bar_sheets(truth, _bar_between(truth, 0, 0, rng))
        camera, T = truth.cameras[0], truth.T_gtv_camera[0]
        name = f"vision/bar/{camera.name}-{number}.png"
        found.append(Photograph(name, camera, T, sheets, _optics(truth)))
    return found


def _bar_between(truth: VisionTruth, i: int, j: int, rng: np.random.Generator) -> RigidTransform:
    """T_gtv_first with the first board in camera i's image and the second in camera j's."""
    spots = [_axis_on_floor(truth.T_gtv_camera[k]) for k in (i, j)]
    middle = (spots[0] + spots[1]) / 2
    apart = spots[1] - spots[0]
    heading = np.arctan2(apart[1], apart[0]) if i != j else 0.0
    half = CHESSBOARD.columns * CHESSBOARD.square + BAR_GAP / 2
    centring = RigidTransform.from_translation([CHESSBOARD.square - half, -0.2, 0.0])
    for attempt in range(_TRIES):
        spread = 0.3 + 0.7 * min(1.0, attempt / 500)
        turn = rng.uniform(-1, 1) * np.pi * spread if i != j else rng.uniform(-np.pi, np.pi)
        tilt = 0.45 * rng.standard_normal(2)
        height = rng.uniform(0.1, 1.1) if i != j else rng.uniform(-0.8, 0.6)
        place = middle + spread * rng.uniform(-1.0, 1.0, 2)
        R = (
            Rotation.from_rotvec([0, 0, heading + turn])
            * Rotation.from_rotvec([*tilt, 0])
            * Rotation.from_rotvec([np.pi, 0, 0])
        )
        T_first = RigidTransform.from_components([*place, height], R) * centring
        T_second = T_first * truth.T_bar
        if _sees(truth.cameras[i], truth.T_gtv_camera[i], BAR_BOARDS[0], T_first) and _sees(
            truth.cameras[j], truth.T_gtv_camera[j], BAR_BOARDS[1], T_second
        ):
            return T_first
    names = f"{truth.cameras[i].name} and {truth.cameras[j].name}"
    raise GtvalError(f"cameras {names} have no place where each sees one board of the bar")


def _axis_on_floor(T_gtv_camera: RigidTransform) -> Array:
    """(2,) where a camera's axis meets the floor."""
    z = T_gtv_camera.rotation.as_matrix()[:, 2]
    t = T_gtv_camera.translation
    return np.asarray(t[:2] - t[2] / z[2] * z[:2])


def reference_photographs(truth: VisionTruth) -> list[Photograph]:
    """The chessboard on the Vframe, from each camera that sees all of it: vision/reference."""
    sheets = [board_sheet(CHESSBOARD, truth.T_gtv_reference)]
    i = reference_camera(truth)
    if i is None:
        raise GtvalError("no camera sees the reference pattern")
    name = f"vision/reference/{truth.cameras[i].name}.png"
    return [Photograph(name, truth.cameras[i], truth.T_gtv_camera[i], sheets, _optics(truth))]


def movie_photographs(truth: VisionTruth, rng: np.random.Generator) -> list[Photograph]:
    """A walk around the robot: vision/layout/CAMERA/001.png, ..."""
    found = []
    count = truth.settings.movie
    robot = RigidTransform.identity()
    for number in range(1, count + 1):
        around = 2 * np.pi * number / count
        distance, height = rng.uniform(0.9, 1.5), rng.uniform(0.9, 1.6)
        middle = np.array([-0.35, 0.0, 0.3])
        eye = middle + distance * np.array([np.cos(around), np.sin(around), 0.0])
        eye[2] = height
        T = looking(eye, middle + rng.uniform(-0.1, 0.1, 3))
        roll = Rotation.from_rotvec([0, 0, rng.uniform(-0.3, 0.3)])
        T = T * RigidTransform.from_rotation(roll)
        sheets = robot_sheets(truth.layout, robot, eye)
        name = f"vision/layout/{truth.movie_camera.name}/{number:03d}.png"
        found.append(Photograph(name, truth.movie_camera, T, sheets, _optics(truth)))
    return found


def robot_photographs(truth: VisionTruth, rng: np.random.Generator) -> list[Photograph]:
    """The robot at its stops, from every camera that has it in view: vision/poses/2/pose7.png."""
    found = []
    for stop in range(len(truth.T_gtv_robot)):
        T_robot = truth.T_gtv_robot[stop]
        for camera, T in zip(truth.cameras, truth.T_gtv_camera, strict=True):
            centre = T.inv().apply(T_robot.apply(np.array([-0.35, 0.0, 0.4])))
            if centre[2] < 0.3 or (np.abs(centre[:2] / centre[2]) > 0.8).any():
                continue
            pixel = project(centre, camera.parameters)
            if not inside_image(pixel, camera.size, 30):
                continue
            sheets = robot_sheets(truth.layout, T_robot, T.translation)
            if rng.uniform() < truth.settings.occlusions:
                sheets.append(_someone(T_robot, T.translation, rng))
            blades = [sun_blade(pixel, rng)] if rng.uniform() < truth.settings.blades else []
            name = f"vision/poses/{camera.name}/pose{stop + 1}.png"
            found.append(Photograph(name, camera, T, sheets, _optics(truth), blades))
    return found


def _someone(T_robot: RigidTransform, eye: Array, rng: np.random.Generator) -> Sheet:
    """A leg on the line of sight to the robot, a little beside it."""
    robot = T_robot.apply(np.array([-0.35, 0.0, 0.0]))[:2]
    back = eye[:2] - robot
    back = back / np.linalg.norm(back)
    beside = np.array([-back[1], back[0]])
    return bystander(robot + 0.6 * back + rng.uniform(-0.25, 0.25) * beside, eye, height=0.5)


def sun_blade(pixel: Array, rng: np.random.Generator) -> SunBlade:
    """Sunlight across the robot."""
    point = pixel + rng.uniform(-60, 60, 2)
    width = float(rng.uniform(6, 25))
    return SunBlade((float(point[0]), float(point[1])), rng.uniform(0, np.pi), width)


def steadiness_photographs(truth: VisionTruth) -> list[Photograph]:
    """Each camera's view of a chessboard before and after: vision/steadiness/before/2.png."""
    found = []
    for camera, T in zip(truth.cameras, truth.T_gtv_camera, strict=True):
        spot = _axis_on_floor(T)
        ahead = T.rotation.as_matrix()[:2, 0]
        heading = np.arctan2(ahead[1], ahead[0])
        turn = Rotation.from_rotvec([0, 0, heading]) * Rotation.from_rotvec([np.pi, 0, 0])
        middle = CHESSBOARD.corners.mean(0)
        board = RigidTransform.from_components([*spot, 0.0], turn)
        board = board * RigidTransform.from_translation(-middle)
        marks = _furniture(spot, T.translation)
        for when in ("before", "after"):
            name = f"vision/steadiness/{when}/{camera.name}.png"
            sheets = [*marks, board_sheet(CHESSBOARD, board)]
            found.append(Photograph(name, camera, T, sheets, _optics(truth)))
    return found


def _furniture(spot: Array, eye: Array) -> list[Sheet]:
    """Paper strips on the floor, which stay where they are."""
    away = (spot - eye[:2]) / np.linalg.norm(spot - eye[:2])
    beside = np.array([-away[1], away[0]])
    sheets = []
    for along, across, turn in (
        (0.9, -1.0, 0.3),
        (1.2, 0.9, 1.1),
        (-0.7, -0.9, 2.0),
        (-0.6, 0.9, 0.6),
    ):
        place = spot + along * away + across * beside
        R = Rotation.from_rotvec([0, 0, turn]) * Rotation.from_rotvec([np.pi, 0, 0])
        T = RigidTransform.from_components([*place, 0.0], R)
        sheets.append(Sheet(np.full((1, 1), PAPER), (0.6, 0.06), T))
    return sheets
