"""A reference pattern that was read from another corner, or another way round, than stated."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from validation.errors import GtvalError
from validation.poses.angles import Array, wrap
from validation.trajectories.alignment import umeyama
from vision_gt.optics.transforms import planar_pose
from vision_gt.patterns.boards import Board

_NEAR = 0.05, 0.04
"""Metres and radians within which a reading of the pattern explains where the poses are. A
judgement: a survey and a camera network are better, and corners of a pattern are farther apart."""
_LEAST_STOPS = 3
"""Two give a frame without a check."""


@dataclass(frozen=True)
class ReferenceTurn:
    """How the pattern lies, where the validation poses tell it.

    Parameters
    ----------
    corner : (float, float)
        Of the board, metres along its rows and columns: the inner corner at the stated place.
    quarters : int
        Quarter turns of the board about it.
    frame : (3,) array
        x, y, theta by which all poses are off: their frame in the GTV frame.
    stops : int
        Stops that tell it.
    scatter : float
        Of the stops about it, metres.
    """

    corner: tuple[float, float]
    quarters: int
    frame: Array
    stops: int
    scatter: float


def reference_turn(
    poses: Array, validation: Array, T_gtv_board: RigidTransform, board: Board
) -> ReferenceTurn | None:
    """The reading of the reference pattern that puts the poses where the survey has them.

    Parameters
    ----------
    poses, validation : (n, 3) arrays
        x, y, theta of the same stops, metres and radians.
    T_gtv_board : RigidTransform
        Where the pattern lies as it was stated.
    board : Board
        The pattern.

    Returns
    -------
    ReferenceTurn or None
        None if the stated reading is right, or none of the others explains the poses, or two do.
    """
    if len(poses) < _LEAST_STOPS:
        return None
    try:
        frame, scatter = _frame_between(poses, validation)
    except GtvalError:  # all stops are one place
        return None
    if not _far(frame, np.zeros(3)) or scatter > _NEAR[0]:
        return None
    found = [
        (corner, quarters, state)
        for corner, quarters, state in _readings(T_gtv_board, board)
        if _explains(state, frame, poses)
    ]
    if len(found) != 1:
        return None
    corner, quarters, state = found[0]
    return ReferenceTurn(corner, quarters, state, len(poses), scatter)


def _frame_between(poses: Array, validation: Array) -> tuple[Array, float]:
    """x, y, theta of the frame of poses in that of the validation, and the rms distance left."""
    one, other = poses[:, :2], validation[:, :2]
    R, shift, _ = umeyama(other, one)
    left = other - one @ R.T - shift
    frame = np.array([*shift, np.arctan2(R[1, 0], R[0, 0])])
    return frame, float(np.sqrt((left**2).sum(1).mean()))


def _readings(
    T_gtv_board: RigidTransform, board: Board
) -> Iterator[tuple[tuple[float, float], int, Array]]:
    """Other corners at the stated place, in every quarter turn: where the stated frame then is."""
    ends = board.corners.max(0)
    for x, y, quarters in product((0.0, float(ends[0])), (0.0, float(ends[1])), range(4)):
        if (x, y, quarters) == (0.0, 0.0, 0):
            continue
        turned = Rotation.from_rotvec([0, 0, quarters * np.pi / 2])
        T_board_read = RigidTransform.from_components([x, y, 0.0], turned)
        T = T_gtv_board * T_board_read.inv() * T_gtv_board.inv()
        yield (x, y), quarters, planar_pose(T)


def _far(a: Array, b: Array) -> bool:
    return bool(np.hypot(*(a - b)[:2]) > _NEAR[0] or abs(float(wrap(a[2] - b[2]))) > _NEAR[1])


def _explains(state: Array, frame: Array, poses: Array) -> bool:
    """Whether a frame is another one where the poses are, not only at its origin."""
    middle = poses[:, :2].mean(0)

    def at(one: Array) -> Array:
        c, s = np.cos(one[2]), np.sin(one[2])
        return np.array([*(np.array([[c, -s], [s, c]]) @ middle + one[:2]), one[2]])

    return not _far(at(state), at(frame))
