"""Planned cameras as cameras in the GTV frame, and the robot with its planned markers."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from validation.poses.angles import Array
from vision_gt.optics.camera import Camera
from vision_gt.robot.marker_poses import Layout


@dataclass(frozen=True)
class MountedCamera:
    """A camera where it will hang.

    Parameters
    ----------
    camera : Camera
        Its lens.
    T_gtv_camera : RigidTransform
        Where it hangs and looks.
    tilt : float
        How far it looks down from the horizontal, radians.
    needed_field : float or None
        Vertical field of view that the wanted depth asks for, radians; None where a tilt was
        stated.
    """

    camera: Camera
    T_gtv_camera: RigidTransform
    tilt: float
    needed_field: float | None = None

    @property
    def eye(self) -> Array:
        """(3,) its place."""
        return np.asarray(self.T_gtv_camera.translation)

    @property
    def vertical_field(self) -> float:
        """Angle that the middle column of its image spans, radians, without lens distortion."""
        fy, cy = self.camera.parameters[[1, 3]]
        height = self.camera.size[1]
        return float(np.arctan((cy + 0.5) / fy) + np.arctan((height - 0.5 - cy) / fy))


def pinhole(name: str, size: tuple[int, int], field: float) -> Camera:
    """A camera without distortion, its axis in the middle of the image.

    Parameters
    ----------
    name : str
        Of the camera.
    size : (int, int)
        Of its image, pixels.
    field : float
        Horizontal field of view, radians, from rim to rim.
    """
    width, height = size
    f = 0.5 * width / np.tan(0.5 * field)
    return Camera(name, size, np.array([f, f, (width - 1) / 2, (height - 1) / 2, *np.zeros(5)]))


def tilt_for_depth(height: float, depth: tuple[float, float]) -> tuple[float, float]:
    """Tilt that shows the floor from near to far, and the vertical field that this needs.

    Parameters
    ----------
    height : float
        Of the camera, metres.
    depth : (float, float)
        Nearest and farthest place, metres from the foot of the pole.

    Returns
    -------
    (float, float)
        Radians: the tilt halves the angle between the rays to both places, which is the field.

    Notes
    -----
    AD2.3, "Physical preparation of the system": the depth of the field of view was set 'from 2m
    to 5m, measured in an horizontal plane, from the camera pin-hole'.
    """
    near, far = np.arctan2(height, depth)
    return float(near + far) / 2, float(near - far)


def mounted(
    camera: Camera, position: Sequence[float], height: float, pan: float, tilt: float
) -> RigidTransform:
    """T_gtv_camera of a camera on a pole, its image upright.

    Parameters
    ----------
    camera : Camera
        Unused but for its principal point: the tilt is that of the ray through the middle of the
        image.
    position : (2,) sequence
        Foot of the pole, metres.
    height : float
        Metres.
    pan, tilt : float
        Direction in which it looks, from the x axis towards y, and down from the horizontal,
        radians.
    """
    # Camera axes in the GTV frame at pan 0, tilt 0: x is -y, y is -z, z is x.
    level = Rotation.from_matrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    fy, cy = camera.parameters[[1, 3]]
    middle = np.arctan(((camera.size[1] - 1) / 2 - cy) / fy)
    turned = Rotation.from_rotvec([0, 0, pan]) * Rotation.from_rotvec([0, tilt - middle, 0])
    return RigidTransform.from_components([*position, height], turned * level)


def planned_layout(count: int, side: float, height: float, lean: float, radius: float) -> Layout:
    """Markers evenly around the middle of the robot frame, known exactly.

    Parameters
    ----------
    count : int
        Of markers; the first stands in front.
    side, height, radius : float
        Side of each, height and distance of its middle from the robot's, metres.
    lean : float
        Angle between its face and the vertical through it: 0 faces up, a right angle outwards.
    """
    T = []
    for around in 2 * np.pi * np.arange(count) / count:
        turn = Rotation.from_rotvec([0, 0, around])
        # x to the left of who looks outwards, z outwards and up.
        own = Rotation.from_rotvec([0, lean, 0]) * Rotation.from_rotvec([0, 0, np.pi / 2])
        T.append(RigidTransform.from_components(turn.apply([radius, 0, height]), turn * own))
    numbers = tuple(range(count))
    nothing = np.zeros((6 * count, 6 * count))
    return Layout(numbers, np.full(count, side), RigidTransform.concatenate(T), nothing)
