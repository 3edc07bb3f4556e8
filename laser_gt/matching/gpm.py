"""The document's normal-based association: every pair of points votes for a pose.

Censi, "Scan matching in a probabilistic framework" (2006), as AD2.3 describes it ("Automatic
Matching Procedure"): if a point of one scan and a point of the other are the same place of a
wall, the difference of their normals is the rotation and the difference of the turned points the
translation. All associations are tried; the pose that most of them agree on wins. It needs no
good guess, is coarse, and starts the local matcher.
"""

import numpy as np
import numpy.typing as npt

from laser_gt.scans.evidence import Prepared
from laser_gt.scans.planar import rotation, wrapped
from validation.poses.angles import Array, wrap

CELL = 0.1
"""Edge of a cell of the vote in x and y, metres. A judgement: a third of what the local matcher,
which starts from the result, can be off by."""
ANGLE_CELL = np.deg2rad(3.0)
"""Of the vote in heading, radians: at 2 m, where most walls are, as long as a cell."""
POINTS = 150
"""Points of either scan that vote. A judgement: some five for each metre of a room's walls, and no
more than 22,500 associations."""


def associate(
    reference: Prepared,
    moving: Prepared,
    guess: npt.ArrayLike = (0.0, 0.0, 0.0),
    window: tuple[float, float] = (1.0, float(np.deg2rad(45))),
    count: int = 3,
) -> Array:
    """The poses that most associations agree on.

    Parameters
    ----------
    reference, moving : Prepared
        The two sweeps.
    guess : (3,) array_like
        Middle of the window.
    window : (float, float)
        Half widths in x and y (metres) and heading (radians).
    count : int
        Number of poses.

    Returns
    -------
    (count, 3) array
        Moving frame in the reference frame, the most voted first.
    """
    from scipy.ndimage import gaussian_filter  # noqa: PLC0415  (loaded when used)

    guess = np.asarray(guess, dtype=float)
    votes = _votes(reference, moving, guess, window)
    bins = [
        max(round(2 * window[0] / CELL), 1),
        max(round(2 * window[0] / CELL), 1),
        max(round(2 * window[1] / ANGLE_CELL), 1),
    ]
    half = np.array([window[0], window[0], window[1]])
    histogram, edges = np.histogramdd(votes, bins, list(zip(-half, half, strict=True)))
    smooth = gaussian_filter(histogram, 1.0, mode="constant")
    peaks = []
    for _ in range(count):
        where = np.unravel_index(int(smooth.argmax()), smooth.shape)
        peaks.append([(edge[i] + edge[i + 1]) / 2 for edge, i in zip(edges, where, strict=True)])
        around = tuple(slice(max(i - 3, 0), i + 4) for i in where)
        smooth[around] = 0
    return wrapped(guess + np.array(peaks))


def _votes(
    reference: Prepared, moving: Prepared, guess: Array, window: tuple[float, float]
) -> Array:
    """(v, 3) poses less the guess, one for each association inside the window."""
    target, source = reference.surface, moving.surface
    ours = _some(target.flat)
    theirs = _some(source.flat)
    ours_angle = np.arctan2(target.normals[ours, 1], target.normals[ours, 0])
    theirs_angle = np.arctan2(source.normals[theirs, 1], source.normals[theirs, 0])
    turn = wrap(ours_angle[:, None] - theirs_angle[None] - guess[2])
    turned = np.einsum("abij,bj->abi", rotation(turn + guess[2]), source.points[theirs])
    shift = target.points[ours][:, None] - turned - guess[:2]
    near = (np.abs(turn) < window[1]) & (np.abs(shift) < window[0]).all(-1)
    return np.concatenate([shift[near], turn[near][:, None]], axis=1)


def _some(flat: npt.NDArray[np.bool_]) -> npt.NDArray[np.intp]:
    """About `POINTS` of the points that have a normal, evenly spaced."""
    index = np.flatnonzero(flat)
    return index[:: max(len(index) // POINTS, 1)]
