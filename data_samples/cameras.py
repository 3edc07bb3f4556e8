"""The vision side of the synthetic room: four cameras on posts, boards, and a robot with markers.

All is the truth, in the GTV frame or on the robot; nothing here knows of images.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from validation.angles import Array
from vision_gt.layout import Layout

MARKER_SIDES = {3: 0.156, 6: 0.156, 14: 0.160, 30: 0.156, 89: 0.156, 200: 0.156}
"""Ids and sides (metres) of AD2.3; the side of 89 is not printed."""
DIMA_MARKER = 14
T_DIMA_MARKER = RigidTransform.from_components(
    [-0.143, 0.098, 0.018], Rotation.from_matrix([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
)
"""AD2.3, "Relative position between the markers": the dima-marker with respect to the dima."""

_HAT = np.array([-0.47, -0.05, 0.0])
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
        z = (outwards + [0, 0, 1]) / np.sqrt(2)
        R = Rotation.from_matrix(np.column_stack([x, np.cross(z, x), z]))
        centre = _HAT + 0.21 * outwards + [0, 0, 0.50 + 0.02 * side]
        places[number] = RigidTransform.from_components(centre, R)
    top = Rotation.from_rotvec([0, 0, 0.3])
    places[89] = RigidTransform.from_components(_HAT + [0, 0, 0.60], top)
    numbers = tuple(sorted(places))
    return Layout(
        numbers,
        np.array([MARKER_SIDES[n] for n in numbers]),
        RigidTransform.concatenate([places[n] for n in numbers]),
        np.zeros((6 * len(numbers), 6 * len(numbers))),
    )
