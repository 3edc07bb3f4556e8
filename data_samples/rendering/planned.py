"""The cameras of a room as they were planned: the table [vision.plan]."""

import numpy as np

from data_samples.rooms.cameras import VisionTruth
from validation.poses.angles import Array


def planned_cameras(truth: VisionTruth, stops: Array) -> str:
    """Where cameras were to hang, to 10 cm and to a degree, as text for campaign.toml.

    Parameters
    ----------
    truth : VisionTruth
        With the cameras as they do hang.
    stops : (n, 3) array
        Poses that are to be seen: the floor is the rectangle around them and half a metre more.
    """
    first = truth.cameras[0]
    across, down = first.size
    field = 2 * np.degrees(np.arctan(across / 2 / first.parameters[0]))
    (left, near), (right, far) = stops[:, :2].min(0) - 0.5, stops[:, :2].max(0) + 0.5
    corners = ((left, near), (right, near), (right, far), (left, far))
    heights = truth.layout.T_robot_marker.translation[:, 2]
    lines = [
        "\n[vision.plan]  # the cameras as they were planned, for `gtval vision plan`",
        f"resolution = [{across}, {down}]",
        f"field_of_view_deg = {field:.0f}.0",
        f"marker_side = {truth.layout.sides.min():.3f}",
        f"marker_height = {np.median(heights):.2f}",
        f"floor = [{', '.join(f'[{x:.1f}, {y:.1f}]' for x, y in corners)}]",
    ]
    for camera, T in zip(truth.cameras, truth.T_gtv_camera, strict=True):
        x, y, height = T.translation
        axis = T.rotation.as_matrix()[:, 2]
        lines += [
            "\n[[vision.plan.cameras]]",
            f'name = "{camera.name}"',
            f"position = [{x:.1f}, {y:.1f}]",
            f"height = {height:.1f}",
            f"pan_deg = {np.degrees(np.arctan2(axis[1], axis[0])):.0f}.0",
            f"tilt_deg = {np.degrees(np.arcsin(-axis[2])):.0f}.0",
        ]
    return "\n".join(lines) + "\n"
