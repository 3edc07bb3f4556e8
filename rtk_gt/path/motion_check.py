"""Does the vehicle drive where its nose points? An independent check of yaw and pitch.

A vehicle on wheels moves along its own x axis. The direction of its motion, seen in the vehicle
frame, therefore shows errors of the offsets that no antenna distance can show: a vertical
offset that is wrong by 9 cm makes a nose that points 3 degrees above the road.
"""

import math
from dataclasses import dataclass

import numpy as np

from rtk_gt.offsets.robust import autocorrelation_time
from rtk_gt.path.orientation import matrix_of
from rtk_gt.path.vehicle_path import VehiclePath
from rtk_gt.receivers.fixes import Ints
from validation.poses.angles import Array

SHORTEST = 0.5
"""Metres of a step that has a direction: noise of 1 cm at both ends turns it by 1.6 degrees."""
STRAIGHT = 0.1
"""Steps on which the heading changes by more radians are left out: the body slips in curves. A
judgement; at 1 Hz and 10 m/s it is a curve of 100 m radius."""

FEWEST = 10
"""Steps that make a mean direction: a judgement."""


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

    Notes
    -----
    A vehicle that reverses for less than half of its way is seen where it drives forward; one whose
    nose points backwards all the way shows as half a turn.
    """
    own, turn = _own_motion(path, max_gap)
    own = own[turn < STRAIGHT]
    if len(own) == 0:
        return None
    mostly = np.sign(own[:, 0].sum()) or 1.0
    own = own[own[:, 0] * mostly > 0]
    if len(own) < FEWEST:
        return None
    # About the way that most of the motion goes, so that no angle is near half a turn.
    angles = np.arctan2(mostly * own[:, 1:], mostly * own[:, :1])
    mean, sigma = _mean(angles)
    half = 0.0 if mostly > 0 else np.pi
    left = float(np.angle(np.exp(1j * (mean[0] + half))))
    up = float(mean[1] if mostly > 0 else -mean[1])
    return MotionCheck(left, up, float(sigma[0]), float(sigma[1]), len(own))


def forward_share(path: VehiclePath, max_gap: float) -> float | None:
    """Way along the nose over the whole way, -1 to 1; None where the vehicle hardly moves.

    Parameters
    ----------
    path, max_gap
        As in `motion_check`.
    """
    own, _ = _own_motion(path, max_gap)
    if len(own) < FEWEST:
        return None
    return float(own[:, 0].sum() / np.linalg.norm(own, axis=1).sum())


def _own_motion(path: VehiclePath, max_gap: float) -> tuple[Array, Array]:
    """Steps (n, 3) of at least `SHORTEST` in the vehicle's axes, and how far it turns (n,)."""
    start, end = strides(path.times, path.poses[:, :3], max_gap)
    motion = path.poses[end, :3] - path.poses[start, :3]
    R = matrix_of(path.poses[:, 3:])
    own = np.einsum("tji,tj->ti", (R[start] + R[end]) / 2, motion)
    turn = path.poses[end, 3] - path.poses[start, 3]
    return own, np.abs(np.angle(np.exp(1j * turn)))


def strides(at: Array, positions: Array, max_gap: float) -> tuple[Ints, Ints]:
    """Rows at which strides begin and end: the first position that is `SHORTEST` away.

    Parameters
    ----------
    at : (n,) array
        Times in seconds.
    positions : (n, 3) array
        Metres.
    max_gap : float
        No stride goes over a longer pause, in seconds.
    """
    places, times = positions.tolist(), at.tolist()
    start: list[int] = []
    end: list[int] = []
    anchor = 0
    for row in range(1, len(times)):
        if times[row] - times[row - 1] > max_gap:
            anchor = row
        elif math.dist(places[row], places[anchor]) > SHORTEST:
            start.append(anchor)
            end.append(row)
            anchor = row
    return np.array(start, dtype=np.int64), np.array(end, dtype=np.int64)


def _mean(angles: Array) -> tuple[Array, Array]:
    """Means and standard errors of two series, each with its own correlation in time."""
    taus = np.array([autocorrelation_time(angles[:, [k]]) for k in range(angles.shape[1])])
    sigma = angles.std(0, ddof=1) * np.sqrt(taus / len(angles))
    return angles.mean(0), sigma
