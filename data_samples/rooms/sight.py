"""Which points of a room see each other."""

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array

Mask = npt.NDArray[np.bool_]

_ENDS = 1e-9
"""Share of a sight line, at either end, in which a crossing does not count."""


def sees(start: Array, end: Array, segments: Array) -> Mask:
    """Whether the straight line between two points crosses none of the segments.

    Parameters
    ----------
    start, end : (..., 2) array
        The two points, metres, in the frame of the segments. Both may lie on a segment (a
        point on a wall is seen from inside); only crossings between them count.
    segments : (k, 2, 2) array
        Walls and sides of obstacles, one a row, as two end points.

    Returns
    -------
    (...) array of bool
        A line that runs along a segment, or from a corner to a corner of it, is free.
    """
    start, end = (np.asarray(p, dtype=float)[..., None, :] for p in (start, end))
    segments = np.asarray(segments, dtype=float).reshape(-1, 2, 2)
    line, side = end - start, segments[:, 1] - segments[:, 0]
    gap = segments[:, 0] - start
    turn = _cross(line, side)
    parallel = np.abs(turn) < 1e-12
    turn = np.where(parallel, 1.0, turn)
    along_line, along_side = _cross(gap, side) / turn, _cross(gap, line) / turn
    crosses = (
        ~parallel
        & (along_line > _ENDS)
        & (along_line < 1 - _ENDS)
        & (along_side >= 0)
        & (along_side <= 1)
    )
    return np.asarray(~crosses.any(-1))


def outline_segments(corners: Array) -> Array:
    """The sides of closed outlines.

    Parameters
    ----------
    corners : (..., m, 2) array
        Corners in order, the last joined to the first.

    Returns
    -------
    (... m, 2, 2) array
        All sides in one list.
    """
    return np.stack([corners, np.roll(corners, -1, axis=-2)], axis=-2).reshape(-1, 2, 2)


def _cross(a: Array, b: Array) -> Array:
    """Third component of the cross product of plane vectors (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
