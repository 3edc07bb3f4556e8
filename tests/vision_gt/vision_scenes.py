"""Cameras, boards and robots with known truth, for the tests of the vision system."""

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from data_samples.rendering.image import Optics, Scene, Sheet, render
from data_samples.rooms.cameras import CHESSBOARD, looking, robot_layout
from vision_gt.images.markers import MarkerView
from vision_gt.network.adjustment import Network
from vision_gt.optics.camera import Camera, inside_image, project
from vision_gt.optics.transforms import perturbed
from vision_gt.patterns.board_views import BoardView
from vision_gt.patterns.boards import Board
from vision_gt.patterns.dictionaries import Family
from vision_gt.robot.robot_pose import Sighting

SIZE = (1280, 960)
LENS = np.array([1000.0, 1000.0, 639.5, 479.5, -0.2, 0.08, 0.0005, -0.0003, 0.0])
APRIL = Family("APRILTAG_36H11")
SIDE = 0.156
BAR_GAP = 0.5


def camera(name: str = "1") -> Camera:
    return Camera(name, SIZE, LENS)


def random_marker(rng: np.random.Generator, distance: float):
    """T_camera_marker at a distance, tilted by 10 to 55 degrees."""
    direction = np.array([rng.uniform(-0.25, 0.25), rng.uniform(-0.2, 0.2), 1.0])
    t = direction * distance / np.linalg.norm(direction)
    around, tilt = rng.uniform(-np.pi, np.pi), np.deg2rad(rng.uniform(10, 55))
    lean = Rotation.from_rotvec(tilt * np.array([np.cos(around), np.sin(around), 0]))
    turn = Rotation.from_rotvec([0, 0, rng.uniform(-np.pi, np.pi)])
    return RigidTransform.from_components(t, lean * turn)


def marker_image(
    rng: np.random.Generator,
    T_camera_marker: RigidTransform,
    number: int,
    optics: Optics | None = None,
    family: Family = APRIL,
    side: float = SIDE,
    taken_by: Camera | None = None,
):
    """A photograph of one marker, x right and y down on the print, and its true corners."""
    taken_by = taken_by or camera()
    cell = side / family.cells
    grey = np.pad(np.where(family.bits(number) > 0, 0.95, 0.05), 1, constant_values=0.95)
    outer = -side / 2 - cell
    sheet = Sheet(
        grey, (cell, cell), T_camera_marker * RigidTransform.from_translation([outer, outer, 0])
    )
    optics = optics or Optics(rays=64)
    image = render(taken_by, RigidTransform.identity(), Scene([sheet]), optics, rng)
    square = side / 2 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)
    return image, project(T_camera_marker.apply(square), taken_by.parameters)


FINE = 8
"""Samples a pixel along each side, of which `over_pixels` makes grey levels."""


def laid_out(texture, own, seen, size, outside):
    """A flat print through a homography, FINE times as large as the image, and that homography.

    The print's places ``own`` (4, 2) are seen at ``seen`` in an image of ``size`` (width, height).
    """
    there = (FINE * np.asarray(seen) + (FINE - 1) / 2).astype(np.float32)
    H = cv2.getPerspectiveTransform(np.asarray(own, dtype=np.float32), there)
    wide = (size[0] * FINE, size[1] * FINE)
    return cv2.warpPerspective(texture.astype(np.float32), H, wide, borderValue=outside), H


def over_pixels(large):
    """Means over the areas of pixels."""
    height, width = (length // FINE for length in large.shape)
    return large.reshape(height, FINE, width, FINE).mean((1, 3))


def close_up(rng: np.random.Generator, T_camera_marker: RigidTransform, number: int):
    """The part of the photograph around a marker: its camera, the image, the true corners.

    The camera is the same with the rest of its image cut off, so the lens is the same too.
    """
    middle = project(T_camera_marker.translation, LENS)
    half = int(0.9 * LENS[0] * SIDE / T_camera_marker.translation[2]) + 30
    parameters = LENS.copy()
    parameters[2:4] -= np.round(middle) - half
    part = Camera("1", (2 * half, 2 * half), parameters)
    image, true = marker_image(rng, T_camera_marker, number, taken_by=part)
    return part, image, true


def board_view(
    T_world_camera: RigidTransform,
    name: str,
    board: Board,
    T_world_board: RigidTransform,
    body: str,
    part: int,
    noise: float,
    rng: np.random.Generator,
) -> BoardView | None:
    """A board's corners with normal noise; None where they are not all in the image."""
    seen = T_world_camera.inv().apply(T_world_board.apply(board.corners))
    pixels = project(seen, LENS)
    if (seen[:, 2] < 0.3).any() or not inside_image(pixels, SIZE, 5).all():
        return None
    pixels = pixels + noise * rng.standard_normal(pixels.shape)
    return BoardView(name, body, part, board, np.arange(len(pixels)), pixels, body)


class CameraRow:
    """A row of cameras that look at the floor, 4 m apart, with double-pattern snapshots.

    The first camera stands at the origin of what is compared; the reference pattern lies in
    its view.
    """

    def __init__(
        self,
        seed: int,
        cameras: int = 2,
        snapshots: int = 40,
        noise: float = 0.1,
        bar_error: tuple[float, float] = (0.0, 0.0),
        both: int = 0,
        spacing: float = 4.0,
        board: Board | None = None,
    ) -> None:
        rng = np.random.default_rng(seed)
        self.board = board or CHESSBOARD
        self.noise, self.rng = noise, rng
        self.cameras = [camera(str(i + 1)) for i in range(cameras)]
        self.T_gtv_camera = [
            looking(np.array([spacing * i, -2.2, 2.2]), np.array([spacing * i, 0.0, 0.0]))
            for i in range(cameras)
        ]
        length = self.board.columns * self.board.square + BAR_GAP
        self.nominal_bar = RigidTransform.from_translation([length, 0, 0])
        off = rng.standard_normal((2, 3))
        off *= np.array(bar_error)[:, None] / np.linalg.norm(off, axis=1, keepdims=True)
        self.bar = perturbed(self.nominal_bar, off.ravel())
        self.T_gtv_reference = RigidTransform.from_components(
            [-0.4, 0.2, 0], Rotation.from_rotvec([np.pi, 0, 0])
        )
        self.snapshots = [
            view
            for i in range(cameras - 1)
            for k in range(snapshots)
            for view in self._pair(i, i + 1, spacing * (i + 0.5), f"{i + 1}-{i + 2}-{k}")
        ]
        self.both = [
            view for k in range(both) for view in self._pair(0, 0, 0.0, f"both-{k}", near=True)
        ]
        reference = board_view(
            self.T_gtv_camera[0], "1", self.board, self.T_gtv_reference, "reference", 0, noise, rng
        )
        assert reference is not None
        self.reference = reference

    def _pair(self, i: int, j: int, x: float, body: str, *, near: bool = False):
        rng = self.rng
        half = self.board.columns * self.board.square + BAR_GAP / 2
        for _ in range(3000):
            height = rng.uniform(-1.0, 0.8) if near else rng.uniform(0.0, 0.8)
            middle = np.array([x + near * rng.uniform(-0.5, 0.5), rng.uniform(-0.4, 0.9), height])
            angles = [
                rng.uniform(-0.6, 0.6),
                rng.uniform(-0.4, 0.4),
                np.pi - 0.6 + rng.uniform(-0.5, 0.5),
            ]
            T = RigidTransform.from_components(middle, Rotation.from_euler("ZYX", angles))
            T = T * RigidTransform.from_translation([self.board.square - half, -0.2, 0])
            pair = [
                board_view(
                    self.T_gtv_camera[k],
                    str(k + 1),
                    self.board,
                    where,
                    body,
                    part,
                    self.noise,
                    rng,
                )
                for k, part, where in ((i, 0, T), (j, 1, T * self.bar))
            ]
            if pair[0] is not None and pair[1] is not None:
                return pair
        raise AssertionError("no place for the bar")


def exact_network(T_gtv_camera: RigidTransform, covariance=None) -> Network:
    """One camera with a known place."""
    return Network(
        (camera(),),
        RigidTransform.concatenate([T_gtv_camera]),
        np.zeros((15, 15)) if covariance is None else covariance,
        RigidTransform.identity(),
        np.zeros((6, 6)),
        0.1,
    )


def seen_robot(
    T_gtv_camera: RigidTransform,
    T_gtv_robot: RigidTransform,
    noise: float,
    rng: np.random.Generator,
    only: tuple[int, ...] | None = None,
    layout=None,
) -> Sighting:
    """The markers of the robot that face a camera, their corners with normal noise."""
    layout = layout or robot_layout()
    views = []
    for i, number in enumerate(layout.numbers):
        if only is not None and number not in only:
            continue
        T = T_gtv_camera.inv() * T_gtv_robot * layout.T_robot_marker[i]
        towards = T.translation / np.linalg.norm(T.translation)
        if T.rotation.as_matrix()[:, 2] @ towards > -0.17:
            continue
        pixels = project(T.apply(layout.corners(number)), LENS)
        if inside_image(pixels, SIZE, 3).all():
            pixels = pixels + noise * rng.standard_normal(pixels.shape)
            covariances = np.broadcast_to(noise**2 * np.eye(2), (4, 2, 2))
            views.append(MarkerView(number, pixels, covariances))
    return Sighting("1", tuple(views))


def random_robot(rng: np.random.Generator) -> RigidTransform:
    heading = Rotation.from_rotvec([0, 0, rng.uniform(-np.pi, np.pi)])
    return RigidTransform.from_components([*rng.uniform(-0.3, 0.3, 2), 0], heading)


def camera_at(distance: float) -> RigidTransform:
    """45 degrees above the floor, at a distance from the robot."""
    h = distance * np.sin(np.pi / 4)
    return looking(np.array([0.0, -h, h]), np.array([0.0, 0.0, 0.2]))


def opencv_markers(image, family: Family, refinement: str) -> dict[int, np.ndarray]:
    """Corners (4, 2) by id as OpenCV refines them: "none", "subpix" or "apriltag"."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = getattr(cv2.aruco, f"CORNER_REFINE_{refinement.upper()}")
    parameters.markerBorderBits = family.border
    found, ids, _ = cv2.aruco.ArucoDetector(family.dictionary, parameters).detectMarkers(image)
    # OpenCV's AprilTag refinement counts pixels from the corner of the top-left one.
    offset = 0.5 if refinement == "apriltag" else 0.0
    numbers = [] if ids is None else np.ravel(ids).tolist()
    return {n: c.reshape(4, 2) - offset for n, c in zip(numbers, found, strict=True)}
