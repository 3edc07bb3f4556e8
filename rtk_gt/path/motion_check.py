"""Does the vehicle drive where its nose points? An independent check of yaw and pitch.

A vehicle on wheels moves along its own x axis. The direction of its motion, seen in the vehicle
frame, therefore shows errors of the offsets that no antenna distance can show: a vertical
offset that is wrong by 9 cm makes a nose that points 3 degrees above the road.
"""

from dataclasses import dataclass

import numpy as np

from rtk_gt.offsets.robust import autocorrelation_time
from rtk_gt.path.orientation import matrix_of
from rtk_gt.path.vehicle_path import VehiclePath
from validation.poses.angles import Array

SHORTEST = 0.5
"""Steps shorter than this many metres have no direction: noise of 1 cm at both ends turns
them by 1.6 degrees."""
STRAIGHT = 0.1
"""Steps on which the heading changes by more radians are left out: the body slips in curves. A
judgement; at 1 Hz and 10 m/s it is a curve of 100 m radius."""


@dataclass(frozen=True)
class MotionCheck:
    """Mean direction of motion in the vehicle frame.

    Parameters
    ----------
    left, up : float
        Radians to the left of, and above, the vehicle's x axis.
    left_sigma, up_sigma : float
        Standard errors from the scatter.
    steps : int
        Number of steps averaged.
    """

    left: float
    up: float
    left_sigma: float
    up_sigma: float
    steps: int


def motion_check(path: VehiclePath, max_gap: float) -> MotionCheck | None:
    """The mean direction of motion in the vehicle frame; None where it hardly moves.

    Parameters
    ----------
    path : VehiclePath
        The path.
    max_gap : float
        Pairs of poses farther apart in time are not used, in seconds.
    """
    motion = np.diff(path.poses[:, :3], axis=0)
    R = matrix_of(path.poses[:, 3:])
    both = R[:-1] + R[1:]
    own = np.einsum("tji,tj->ti", both / 2, motion)
    turn = np.abs(np.angle(np.exp(1j * np.diff(path.poses[:, 3]))))
    used = (np.diff(path.times) <= max_gap) & (turn < STRAIGHT)
    used &= np.linalg.norm(motion, axis=1) > SHORTEST
    own = own[used & (own[:, 0] > 0)]
    if len(own) < 10:
        return None
    angles = np.column_stack([np.arctan2(own[:, 1], own[:, 0]), np.arctan2(own[:, 2], own[:, 0])])
    mean, sigma = _mean(angles)
    return MotionCheck(float(mean[0]), float(mean[1]), float(sigma[0]), float(sigma[1]), len(own))


def _mean(angles: Array) -> tuple[Array, Array]:
    """Means and standard errors of two series, each with its own correlation in time."""
    taus = np.array([autocorrelation_time(angles[:, [k]]) for k in range(angles.shape[1])])
    sigma = angles.std(0, ddof=1) * np.sqrt(taus / len(angles))
    return angles.mean(0), sigma
