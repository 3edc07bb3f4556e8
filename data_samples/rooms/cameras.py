"""The vision side of the synthetic room: four cameras on posts, boards, and a robot with markers.

All is the truth, in the GTV frame or on the robot; nothing here knows of images.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from data_samples.rooms.rooms import Room
from validation.errors import GtvalError
from validation.poses.angles import Array
from vision_gt.optics.camera import Camera, inside_image, project
from vision_gt.optics.transforms import perturbed, planar_transform
from vision_gt.patterns.boards import Board
from vision_gt.patterns.dictionaries import ARTOOLKITPLUS, Family
from vision_gt.robot.marker_poses import Layout

MARKER_SIDES = {3: 0.156, 6: 0.156, 14: 0.160, 30: 0.156, 89: 0.156, 200: 0.156}
"""Ids and sides (metres) of AD2.3; the side of 89 is not printed."""
DIMA_MARKER = 14
MARKER_FAMILY = Family(ARTOOLKITPLUS)
T_DIMA_MARKER = RigidTransform.from_components(
    [-0.143, 0.098, 0.018], Rotation.from_matrix([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
)
"""AD2.3, "Relative position between the markers": the dima-marker with respect to the dima."""

HAT = np.array([-0.47, -0.05, 0.0])
"""Middle of the robot's body in the robot frame; the dima lies in front of it."""


def robot_layout() -> Layout:
    """The six markers where the synthetic robot has them, exactly.

    Four look obliquely upwards around a hat, one lies on its top, and the dima-marker lies on
    the dima, as seen on the photographs of AD2.3.
    """
    places = {DIMA_MARKER: T_DIMA_MARKER}
    for number, side in ((6, 0.0), (30, 0.5), (200, 1.0), (3, 1.5)):
        around = Rotation.from_rotvec([0, 0, side * np.pi])
        outwards = around.apply([1.0, 0.0, 0.0])
        # Leaning back by 45 degrees: the marker's z axis points outwards and up.
        x = around.apply([0.0, 1.0, 0.0])
        z = (outwards + np.array([0.0, 0.0, 1.0])) / np.sqrt(2)
        R = Rotation.from_matrix(np.column_stack([x, np.cross(z, x), z]))
        centre = HAT + 0.21 * outwards + np.array([0.0, 0.0, 0.50 + 0.02 * side])
        places[number] = RigidTransform.from_components(centre, R)
    top = Rotation.from_rotvec([0, 0, 0.3])
    places[89] = RigidTransform.from_components(HAT + np.array([0.0, 0.0, 0.60]), top)
    numbers = tuple(sorted(places))
    return Layout(
        numbers,
        np.array([MARKER_SIDES[n] for n in numbers]),
        RigidTransform.concatenate([places[n] for n in numbers]),
        np.zeros((6 * len(numbers), 6 * len(numbers))),
    )


@dataclass(frozen=True)
class VisionSettings:
    """How many images are taken of what, and what is wrong with the world.

    Parameters
    ----------
    cameras : int
        Of the network, 1 to 4; they stand in a row and are named as in AD2.3: 2, 1, 4, 3.
    calibration : int
        Images of the chessboard for each camera.
    snapshots : int
        Of the double pattern for each pair of neighbours.
    both : int
        Images that show both boards of the bar.
    movie : int
        Images around the robot.
    table : int
        Images of a table over a stop, at most, for each camera.
    survey_check, displacement : bool
        Whether there are images of a board at known places on the floor, and of one that moved.
    focal : float
        Focal length, pixels.
    bar_error : (float, float)
        How wrong the bar was built: metres, radians.
    reference_sigma : (float, float)
        How well the reference pattern was laid: metres, radians.
    dima_sigma : (float, float)
        How well the dima-marker's place on the robot was measured: metres, radians.
    hand_sigma : (float, float)
        How well the other markers' places were measured by hand: metres, radians.
    floor_sigma : (float, float)
        Unevenness of the floor under the robot: metres, radians.
    blades, occlusions : float
        Share of the robot's images with a sun-blade, with something in the way.
    blur, noise : float
        Of the images, pixels and grey levels.
    """

    cameras: int = 4
    calibration: int = 14
    snapshots: int = 15
    both: int = 10
    movie: int = 36
    table: int = 1
    survey_check: bool = True
    displacement: bool = True
    focal: float = 1000.0
    bar_error: tuple[float, float] = (0.002, 0.0035)
    reference_sigma: tuple[float, float] = (0.0007, 0.0005)
    dima_sigma: tuple[float, float] = (0.0005, 0.001)
    hand_sigma: tuple[float, float] = (0.005, 0.02)
    floor_sigma: tuple[float, float] = (0.001, 0.002)
    blades: float = 0.15
    occlusions: float = 0.15
    blur: float = 0.7
    noise: float = 2.0


MOVIE_CAMERA = "hand"
"""The camera that is carried around the robot."""
SIZE = (1280, 960)
CHESSBOARD = Board(columns=10, rows=6, square=0.1)
BAR_BOARDS = (
    replace(CHESSBOARD, family=Family("4X4_100")),
    replace(CHESSBOARD, family=Family("4X4_100"), first_id=30),
)
BAR_GAP = 0.5
T_BAR_NOMINAL = RigidTransform.from_translation(
    [CHESSBOARD.columns * CHESSBOARD.square + BAR_GAP, 0.0, 0.0]
)
REFERENCE_SHIFT = 2 * CHESSBOARD.square
"""The reference pattern lies two squares from the Vframe's origin, along its x axis."""
_NAMES = ("2", "1", "4", "3")
_HEIGHT = 2.3
_IN_FRONT = 1.9
"""Metres from a camera to where its axis meets the floor, and so to the middle of its area."""


@dataclass(frozen=True)
class VisionTruth:
    """Everything that is true of the vision system.

    Parameters
    ----------
    settings : VisionSettings
        What it was made from.
    cameras : tuple of Camera
        Of the network, in their row.
    T_gtv_camera : RigidTransform
        Stack in the same order.
    movie_camera : Camera
        The one that is carried.
    T_bar : RigidTransform
        The second board seen from the first.
    T_gtv_reference : RigidTransform
        Where the reference pattern really lies.
    layout : Layout
        The markers on the robot.
    T_gtv_robot : RigidTransform
        Stack of the robot's poses in space, stop by stop.
    """

    settings: VisionSettings
    cameras: tuple[Camera, ...]
    T_gtv_camera: RigidTransform
    movie_camera: Camera
    T_bar: RigidTransform
    T_gtv_reference: RigidTransform
    layout: Layout
    T_gtv_robot: RigidTransform


def nominal_reference() -> RigidTransform:
    """T_gtv_reference as intended: face up, rows along the Vframe's x axis."""
    face_up = Rotation.from_rotvec([np.pi, 0, 0])
    return RigidTransform.from_components([REFERENCE_SHIFT, 0.0, 0.0], face_up)


def looking(position: Array, target: Array) -> RigidTransform:
    """T_world_camera of a camera at a position, its image upright, looking at a target."""
    z = np.asarray(target, dtype=float) - position
    z = z / np.linalg.norm(z)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x = x / np.linalg.norm(x)
    R = np.column_stack([x, np.cross(z, x), z])
    return RigidTransform.from_components(position, Rotation.from_matrix(R))


def make_vision(room: Room, settings: VisionSettings, rng: np.random.Generator) -> VisionTruth:
    """Cameras, boards and robot drawn for a room.

    Parameters
    ----------
    room : Room
        Its stops and its path; the cameras stand on both long sides of the path in turn.
    settings : VisionSettings
        Counts and errors.
    rng : numpy.random.Generator
        Source of all that is drawn.

    Raises
    ------
    GtvalError
        If no camera sees the whole reference pattern; draw another room.
    """
    T_gtv_camera = _posts(room, settings.cameras, rng)
    names = _NAMES[: settings.cameras]
    cameras = tuple(draw_camera(name, settings.focal, rng) for name in names)
    truth = VisionTruth(
        settings,
        cameras,
        T_gtv_camera,
        draw_camera(MOVIE_CAMERA, settings.focal, rng),
        perturbed(T_BAR_NOMINAL, _of_length(settings.bar_error, rng)),
        perturbed(nominal_reference(), _normal(settings.reference_sigma, rng)),
        _true_layout(settings, rng),
        _on_floor(room.stops, settings, rng),
    )
    if reference_camera(truth) is None:
        raise GtvalError("no camera sees the reference pattern")
    return truth


def draw_camera(name: str, focal: float, rng: np.random.Generator) -> Camera:
    """A camera of 1280 x 960 pixels whose lens differs a little from all others."""
    width, height = SIZE
    f = focal * (1 + 0.01 * rng.standard_normal())
    centre = [
        (width - 1) / 2 + 6 * rng.standard_normal(),
        (height - 1) / 2 + 6 * rng.standard_normal(),
    ]
    lens = [-0.20 + 0.02 * rng.standard_normal(), 0.09 + 0.01 * rng.standard_normal()]
    skewed = (4e-4 * rng.standard_normal(2)).tolist()
    return Camera(name, SIZE, np.array([f, f * 1.001, *centre, *lens, *skewed, -0.015]))


def reference_camera(truth: VisionTruth) -> int | None:
    """The camera that sees the reference pattern largest; None if none sees all of it."""
    corners = truth.T_gtv_reference.apply(CHESSBOARD.corners)
    best, largest = None, 0.0
    for i, camera in enumerate(truth.cameras):
        pixels = project(truth.T_gtv_camera[i].inv().apply(corners), camera.parameters)
        if inside_image(pixels, camera.size, 60).all():
            a, b = pixels[8] - pixels[0], pixels[-9] - pixels[0]
            area = abs(float(a[0] * b[1] - a[1] * b[0]))
            if area > largest:
                best, largest = i, area
    return best


def _posts(room: Room, count: int, rng: np.random.Generator) -> RigidTransform:
    """Cameras along the path, on its two sides in turn, tilted down by about 45 degrees."""
    along = room.path[1] - room.path[0]
    along = along / np.linalg.norm(along)
    across = np.array([-along[1], along[0]])
    frame = np.column_stack([along, across])
    spots = room.path @ frame
    low, high = spots.min(0), spots.max(0)
    middle = (low[1] + high[1]) / 2
    posts = []
    for i in range(count):
        u = low[0] + (high[0] - low[0]) * (i + 0.5) / count
        side = 1 if i % 2 else -1
        foot = np.array([u, middle + side * (_IN_FRONT + 0.3)])
        aim = np.array(
            [u + 0.15 * rng.standard_normal(), middle + side * (_IN_FRONT + 0.3 - _HEIGHT)]
        )
        height = _HEIGHT + 0.05 * rng.standard_normal()
        posts.append(looking(np.append(frame @ foot, height), np.append(frame @ aim, 0.0)))
    return RigidTransform.concatenate(posts)


def _true_layout(settings: VisionSettings, rng: np.random.Generator) -> Layout:
    """The markers as they really are: each a little off its drawing."""
    drawn = robot_layout()
    off = np.array([_normal((0.004, 0.01), rng) for _ in drawn.numbers])
    off[drawn.index(DIMA_MARKER)] = _normal(settings.dima_sigma, rng)
    return replace(drawn, T_robot_marker=perturbed(drawn.T_robot_marker, off))


def _on_floor(stops: Array, settings: VisionSettings, rng: np.random.Generator) -> RigidTransform:
    """The robot at its stops, as the floor lets it stand."""
    height, tilt = settings.floor_sigma
    poses = []
    for stop in stops:
        off = np.zeros(6)
        off[2] = height * rng.standard_normal()
        off[3:5] = tilt * rng.standard_normal(2)
        poses.append(perturbed(planar_transform(stop), off))
    return RigidTransform.concatenate(poses)


def _normal(sigmas: tuple[float, float], rng: np.random.Generator) -> Array:
    """(6,) normal change with standard deviations of each length and each angle."""
    return np.repeat(sigmas, 3) * rng.standard_normal(6)


def _of_length(sizes: tuple[float, float], rng: np.random.Generator) -> Array:
    """(6,) change of given length and angle in directions drawn at random."""
    drawn = rng.standard_normal((2, 3))
    drawn /= np.linalg.norm(drawn, axis=1, keepdims=True)
    return np.asarray((drawn * np.array(sizes)[:, None]).ravel())
