"""Poses in the frame of one camera, which stands nowhere: of markers, and of a robot with them."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import RigidTransform

from vision_gt.images.markers import MarkerView
from vision_gt.network.adjustment import Network
from vision_gt.optics.camera import Camera
from vision_gt.robot.marker_poses import Layout
from vision_gt.robot.robot_pose import Floor, RobotPose, Sighting, robot_pose

_ANY_FLOOR = Floor(1.0, 1.0)
"""There is no floor in the frame of a camera: nothing is concluded from it."""


def alone(camera: Camera) -> Network:
    """A network of one camera, whose frame is the world; it errs by its lens only."""
    covariance = np.zeros((15, 15))
    covariance[6:, 6:] = camera.covariance
    still = RigidTransform.identity()
    stack = RigidTransform.concatenate([still])
    return Network((camera,), stack, covariance, still, np.zeros((6, 6)), 0.0)


def pose_in_camera(camera: Camera, views: Sequence[MarkerView], layout: Layout) -> RobotPose | None:
    """T_camera_robot by the markers of a layout that one image shows; None if there is none.

    Parameters
    ----------
    camera : Camera
        That took the image.
    views : sequence of MarkerView
        Markers in it; those that the layout does not have are left out.
    layout : Layout
        Markers on the robot.
    """
    known = tuple(view for view in views if view.number in layout.numbers)
    if not known:
        return None
    return robot_pose([Sighting(camera.name, known)], alone(camera), layout, _ANY_FLOOR)


def marker_in_camera(camera: Camera, view: MarkerView, side: float) -> RobotPose | None:
    """T_camera_marker of one marker: x to the right of the print, y up, z towards the viewer.

    Parameters
    ----------
    camera : Camera
        That took the image.
    view : MarkerView
        The marker.
    side : float
        Of the marker, metres.
    """
    itself = RigidTransform.concatenate([RigidTransform.identity()])
    single = Layout((view.number,), np.array([side]), itself, np.zeros((6, 6)))
    return pose_in_camera(camera, [view], single)
