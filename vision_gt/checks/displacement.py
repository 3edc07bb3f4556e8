"""A board in two places at a known distance, to see whether a camera is calibrated right."""

from dataclasses import dataclass

import numpy as np
from scipy import special
from scipy.spatial.transform import RigidTransform

from validation.poses.angles import Array
from vision_gt.checks.known_places import LEVEL, thing_covariance
from vision_gt.optics.camera import Camera
from vision_gt.optics.transforms import cross_matrix
from vision_gt.patterns.board_views import BoardView, camera_pose_of_board


@dataclass(frozen=True)
class Displacement:
    """How far a board moved, as a camera saw it.

    Parameters
    ----------
    camera : str
        That saw it.
    measured, sigma : float
        Distance and its standard deviation from the corners and the lens, metres.
    expected, expected_sigma : float
        As it was moved, metres.
    angle : float
        By which it turned, radians.
    """

    camera: str
    measured: float
    sigma: float
    expected: float
    expected_sigma: float
    angle: float

    @property
    def off(self) -> float:
        """Measured less expected, metres."""
        return self.measured - self.expected

    @property
    def off_sigma(self) -> float:
        """Of the difference, metres."""
        return float(np.hypot(self.sigma, self.expected_sigma))

    @property
    def p_value(self) -> float:
        """How likely so large a difference is by chance."""
        return float(2 * special.ndtr(-abs(self.off) / self.off_sigma))

    @property
    def agrees(self) -> bool:
        """Whether chance explains the difference."""
        return self.p_value >= LEVEL


def known_displacement(
    first: BoardView,
    second: BoardView,
    camera: Camera,
    expected: float,
    expected_sigma: float,
) -> Displacement | None:
    """How far a board moved between two images; None if one gives no pose.

    Parameters
    ----------
    first, second : BoardView
        The same board.
    camera : Camera
        That took both, with the covariance of its parameters where it is known.
    expected, expected_sigma : float
        As it was moved, metres.

    Notes
    -----
    AD2.3, "Single camera calibration": the board is put in two places at a known distance, and
    the distance of the two poses is compared with it. A board that looks the same turned is
    taken as turned by less than a quarter. The distance is that of the board's middle, so that
    turning the board about itself is no displacement.
    """
    T_first = camera_pose_of_board(first, camera)
    candidates = [(view, camera_pose_of_board(view, camera)) for view in second.readings()]
    known = [(view, T) for view, T in candidates if T is not None]
    if T_first is None or not known:
        return None
    reading, T_second = min(known, key=lambda one: _turned(T_first, one[1]))
    middle = first.board.corners.mean(0)
    ends = [T.apply(middle) for T in (T_first, T_second)]
    apart = ends[1] - ends[0]
    distance = float(np.linalg.norm(apart))
    along = apart / distance if distance > 0 else np.array([1.0, 0.0, 0.0])
    parts = [
        _middle_part(view, T, middle, camera, along)
        for view, T in ((first, T_first), (reading, T_second))
    ]
    # The lens is the same in both images: what it adds to both places partly cancels.
    by_lens = parts[1][1] - parts[0][1]
    variance = parts[0][0] + parts[1][0] + float(by_lens @ camera.covariance @ by_lens)
    angle = _turned(T_first, T_second)
    name = camera.name
    return Displacement(name, distance, float(np.sqrt(variance)), expected, expected_sigma, angle)


def _turned(first: RigidTransform, second: RigidTransform) -> float:
    """Angle between two poses, radians."""
    return float((first.inv() * second).rotation.magnitude())


def _middle_part(
    view: BoardView, T: RigidTransform, middle: Array, camera: Camera, along: Array
) -> tuple[float, Array]:
    """Variance of the middle's place along a direction, and its derivative (9,) by the lens."""
    noise = view.stated_sigmas[:, None, None] ** 2 * np.eye(2)
    own, by_lens = thing_covariance(view.points, view.pixels, noise, T, camera.parameters)
    turned = T.rotation.as_matrix() @ middle
    row = along @ np.hstack([np.eye(3), -cross_matrix(turned)])
    return float(row @ own @ row), row @ by_lens
