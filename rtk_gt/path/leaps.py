"""Poses that leap against their neighbours in time: false fixes that keep all distances.

A false fix that moves an antenna up or down changes no distance by much, and no single step can
show it. It lifts, pitches or rolls the vehicle for one moment, though, and roads do not leap. A
kerb does the same: such poses are flagged, not taken out.
"""

import numpy as np

from rtk_gt.path.interpolation import segments
from rtk_gt.path.vehicle_path import VehiclePath
from rtk_gt.receivers.fixes import Bools, Ints
from validation.poses.angles import Array
from validation.statistics.robust import sigma_from_median

LEAP = 5.0
"""Standard deviations from what the neighbours say: chance does that once in 600,000 poses of three
components. In 150 drives with 18,215 poses, none of the good ones was flagged."""
UPRIGHT = [2, 4, 5]
"""z, pitch and roll: steering changes the others within a second, too."""
_ROUNDS = 20
"""At most; each flags what is the greatest among its neighbours, and false fixes are few."""
_SIDE = 2
"""Neighbours on each side: a cubic through them follows all that a vehicle does in seconds."""


def leaping_poses(path: VehiclePath, max_gap: float) -> Bools:
    """Which poses leap.

    Parameters
    ----------
    path : VehiclePath
        The path, pose by pose.
    max_gap : float
        Longest pause in seconds across which poses are neighbours.

    Returns
    -------
    (n,) bool array
        True where height, pitch or roll is off by more than `LEAP` standard deviations from the
        cubic through two poses before and two after. Poses with fewer neighbours cannot be told;
        of two false ones in a row those beside them may be flagged.

    Notes
    -----
    The standard deviation is that of the poses' noise and of the motion that a cubic does not
    follow, as the median of the drive shows it. A leap spoils what is said of its neighbours,
    too: of those near each other the greatest is flagged first and then left out.
    """
    poses = path.poses[:, UPRIGHT]
    variances = np.diagonal(path.noise_covariances, axis1=1, axis2=2)[:, UPRIGHT]
    flagged = np.zeros(len(path), dtype=bool)
    for _ in range(_ROUNDS):
        kept = np.flatnonzero(~flagged)
        found = _greatest(path.times[kept], poses[kept], variances[kept], max_gap)
        if len(found) == 0:
            break
        flagged[kept[found]] = True
    return flagged


def _greatest(times: Array, poses: Array, variances: Array, max_gap: float) -> Ints:
    """Rows of the leaps that are the greatest among their neighbours."""
    rows = [
        segment[_SIDE:-_SIDE] for segment in segments(times, max_gap) if len(segment) > 2 * _SIDE
    ]
    if not rows:
        return np.empty(0, dtype=np.int64)
    row = np.concatenate(rows)
    near = row[:, None] + np.array([-2, -1, 1, 2])
    weights = _cubic_weights(times[near] - times[row][:, None])
    off = poses[row] - np.einsum("mk,mkc->mc", weights, poses[near])
    noise = variances[row] + np.einsum("mk,mkc->mc", weights**2, variances[near])
    motion = np.square(sigma_from_median(off, axis=0)) - np.median(noise, axis=0)
    size = np.zeros(len(times))
    size[row] = (np.abs(off) / np.sqrt(noise + np.maximum(motion, 0.0))).max(1)
    around = size[np.clip(near, 0, len(times) - 1)].max(1)
    return np.asarray(row[(size[row] > LEAP) & (size[row] > around)])


def _cubic_weights(away: Array) -> Array:
    """(m, 4) weights of values at times (m, 4) that give their cubic's value at time 0."""
    weights = np.ones_like(away)
    for i in range(away.shape[1]):
        for j in range(away.shape[1]):
            if i != j:
                weights[:, i] *= away[:, j] / (away[:, j] - away[:, i])
    return weights
