"""What is drawn of an image: outlines as found, where they are expected, what was not used."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import RigidTransform

from validation.poses.angles import Array
from vision_gt.images.markers import FACING, LEAST_CELL, MarkerView, shortest_widths
from vision_gt.network.adjustment import Network
from vision_gt.optics.camera import Camera, inside_image, project
from vision_gt.patterns.rejections import Rejection
from vision_gt.robot.marker_poses import Layout
from vision_gt.robot.robot_pose import Floor

NOWHERE = np.zeros((0, 2))
_STEPS = 12
"""Points on each side of an outline: a wide lens bends it."""


@dataclass(frozen=True)
class Outline:
    """A marker or board in an image.

    Parameters
    ----------
    name : str
        '6', or 'first board'.
    found : (k, 2) array
        Outline as detected, pixels; empty where it was not.
    expected : (m, 2) array
        Outline as reprojected, pixels; empty where no pose is known.
    corners : (n, 2) array
        Corners of a board as detected; empty for a marker.
    off : float
        Median distance of the corners found from where they are expected, pixels; NaN where one
        of the two is missing.
    axes : (4, 2) array
        Of a board: its origin, and the tips of its x, y and -z axes, pixels; empty for a marker.
    """

    name: str
    found: Array
    expected: Array
    corners: Array = field(default_factory=lambda: NOWHERE)
    off: float = float("nan")
    axes: Array = field(default_factory=lambda: NOWHERE)


@dataclass(frozen=True)
class Known:
    """What is known of cameras and markers as images are drawn.

    Parameters
    ----------
    cameras : mapping of str to Camera
        By name; of some it may not be known where they are.
    network : Network or None
        Where cameras are.
    layout : Layout or None
        Markers on the robot.
    floor : Floor
        On which it stands.
    cells : int
        Along a side of a marker, with its border.
    bar : RigidTransform
        Stack of two: the patterns of the bar.
    """

    cameras: Mapping[str, Camera]
    network: Network | None
    layout: Layout | None
    floor: Floor
    cells: int
    bar: RigidTransform

    def place(self, name: str) -> RigidTransform | None:
        """T_gtv_camera; None where it is not known."""
        if self.network is None or name not in self.network.names:
            return None
        return self.network.T_gtv_camera[self.network.index(name)]


@dataclass(frozen=True)
class Look:
    """An image with all that is drawn on it.

    Parameters
    ----------
    image : str
        Its file, relative to the campaign.
    title : str
        'stop 7, camera 2'.
    verdict : str
        What became of it.
    outlines : tuple of Outline
        Markers and boards.
    rejections : tuple of Rejection
        What was not used, or is rough; of the whole image those without a place.
    flagged : bool
        Whether something is to be looked at.
    """

    image: str
    title: str
    verdict: str
    outlines: tuple[Outline, ...] = ()
    rejections: tuple[Rejection, ...] = ()
    flagged: bool = False

    @property
    def became(self) -> str:
        """The verdict, and what is said of the whole image."""
        whole = [one.reason for one in self.rejections if one.kind == "image"]
        return "; ".join(dict.fromkeys([*whole, self.verdict]))


def marker_outlines(
    views: Sequence[MarkerView],
    camera: Camera | None,
    layout: Layout | None,
    T_camera_robot: RigidTransform | None,
    cells: int,
) -> tuple[Outline, ...]:
    """Markers as they were found, and where the pose of the robot has all that could be read.

    Parameters
    ----------
    views : sequence of MarkerView
        As detected.
    camera : Camera or None
        That took the image.
    layout : Layout or None
        Markers on the robot.
    T_camera_robot : RigidTransform or None
        Pose of the robot.
    cells : int
        Along a side of a marker, with its border.

    Notes
    -----
    A marker that was not found is expected where it faces the camera, is inside the image and is
    large enough to be read. Whether something stands in front of it is not known.
    """
    found = {view.number: view.corners for view in views}
    expected: dict[int, tuple[Array, Array]] = {}
    if camera is not None and layout is not None and T_camera_robot is not None:
        for number in layout.numbers:
            corners, outline, readable = _marker_seen(camera, layout, number, T_camera_robot, cells)
            if number in found or readable:
                expected[number] = (corners, outline)
    return tuple(
        Outline(
            str(number),
            found.get(number, NOWHERE),
            expected[number][1] if number in expected else NOWHERE,
            off=median_off(found.get(number), expected[number][0] if number in expected else None),
        )
        for number in sorted({*found, *expected})
    )


def _marker_seen(
    camera: Camera, layout: Layout, number: int, T_camera_robot: RigidTransform, cells: int
) -> tuple[Array, Array, bool]:
    """Corners and bent outline of a marker in an image, and whether it could be read there."""
    T = T_camera_robot * layout.T_robot_marker[layout.index(number)]
    own = layout.corners(number)
    with np.errstate(invalid="ignore"):
        corners = project(T.apply(own), camera.parameters)
        outline = project(T.apply(closed(own)), camera.parameters)
    middle, normal = T.translation, T.rotation.as_matrix()[:, 2]
    facing = -float(normal @ middle) / float(np.linalg.norm(middle)) > FACING
    large = bool(shortest_widths(corners) >= LEAST_CELL * cells)
    return corners, outline, facing and large and bool(inside_image(corners, camera.size).all())


def closed(corners: Array) -> Array:
    """Points along the sides of a polygon (k, d), the first one again at the end."""
    along = np.linspace(0, 1, _STEPS, endpoint=False)[:, None]
    ends = np.roll(corners, -1, axis=0)
    sides = [start + along * (end - start) for start, end in zip(corners, ends, strict=True)]
    return np.concatenate([*sides, corners[:1]])


def median_off(found: Array | None, expected: Array | None) -> float:
    """Median distance of corners from where they should be, pixels."""
    if found is None or expected is None:
        return float("nan")
    return float(np.median(np.linalg.norm(found - expected, axis=-1)))


def by_image(
    rejections: Sequence[tuple[str, Rejection]],
) -> Mapping[str, tuple[Rejection, ...]]:
    """Rejections by the image that they are of."""
    found: dict[str, list[Rejection]] = {}
    for image, one in rejections:
        found.setdefault(image, []).append(one)
    return {image: tuple(some) for image, some in found.items()}
