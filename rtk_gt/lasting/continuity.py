"""Whether a motion without a jump explains positions about an interval nearly as well as one.

Who brakes or turns in changes the acceleration within tenths of a second, and nothing of that kind
need be anywhere else on a calm road, so that it looks unlike all the drive. Therefore a jump that
only the motion tells is held against motions of any roughness: the acceleration wanders (a Wiener
process, Bar-Shalom, Li and Kirubarajan 2001, section 6.2.3), by as much as explains the positions
of some epochs before and after best.
"""

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array

EPOCHS = 12
"""Positions on each side that are looked at."""
_FEWEST = 5
"""On each side: of fewer a parabola leaves nothing."""
_PAUSE = 3.0
"""Times the usual spacing after which the positions are not of one motion."""
_ROUGHNESS = np.geomspace(1e-3, 1e7, 31)
"""Variance of the jerk's sum over one interval against that of the noise, spacing of 1: from motion
that is a parabola for all epochs to one that noise does not hide from one epoch to the next."""


def gain_over_motion(times: Array, places: Array, row: int) -> float:
    """Twice the log likelihood ratio of a jump after a row against motion of any roughness.

    Parameters
    ----------
    times : (n,) array
        Seconds.
    places : (n, 3) array
        East, north, up, metres; of several antennas that jump together their mean.
    row : int
        The last before the jump.

    Returns
    -------
    float
        0 where too few positions stand on either side.
    """
    about = _about(times, row)
    before = row - about[0] + 1
    if min(before, len(about) - before) < _FEWEST:
        return 0.0
    usual = float(np.median(np.diff(times[about])))
    at = (times[about] - times[about[0]]) / usual
    after = (np.arange(len(about)) >= before).astype(float)
    parabola = np.vander(at / at[-1], 3)
    wandering = _wandering(at)
    level, up = places[about, :2], places[about, 2:]
    gain = 0.0
    for part in (level - level.mean(0), up - up.mean(0)):
        smooth = _cost(parabola, wandering, part)
        jumped = _cost(np.column_stack([parabola, after]), wandering, part)
        gain += smooth - jumped
    return max(gain, 0.0)


def _about(times: Array, row: int) -> npt.NDArray[np.intp]:
    """Rows about the interval after a row, up to a pause on either side."""
    low, high = max(row - EPOCHS + 1, 0), min(row + EPOCHS + 1, len(times))
    rows = np.arange(low, high)
    spacing = np.diff(times[rows])
    pauses = np.flatnonzero(spacing > _PAUSE * np.median(spacing))
    first = max((int(k) + 1 for k in pauses if low + k < row), default=0)
    last = min((int(k) + 1 for k in pauses if low + k > row), default=len(rows))
    return rows[first:last]


def _wandering(at: Array) -> Array:
    """(n, n) covariance of places whose acceleration wanders from the first time on."""
    first, late = np.minimum(at[:, None], at), np.abs(at[:, None] - at)
    return np.asarray(first**5 / 20 + late * first**4 / 8 + late**2 * first**3 / 12)


def _cost(design: Array, wandering: Array, values: Array) -> float:
    """Least twice the negative log likelihood, over roughness and noise, of columns (n, c)."""
    n, columns = values.shape
    V = _ROUGHNESS[:, None, None] * wandering + np.eye(n)
    factor = np.linalg.cholesky(V)
    both = np.concatenate([design, values], axis=1)
    solved = np.linalg.solve(factor, np.broadcast_to(both, (len(V), *both.shape)))
    by, left = solved[..., : design.shape[1]], solved[..., design.shape[1] :]
    q, _ = np.linalg.qr(by)
    left = left - q @ (np.swapaxes(q, 1, 2) @ left)
    squares = np.square(left).sum((1, 2))
    level = 2 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(1)
    return float((n * columns * np.log(squares) + columns * level).min())
