"""Antennas seen from the vehicle: where it heads, and where an antenna is between its fixes."""

import numpy as np

from rtk_gt.receivers.fixes import Ints
from validation.poses.angles import Array


def turned(angles: Array, vectors: Array) -> Array:
    """(n, ..., 3) vectors turned about the vertical by angles (n,), radians, counterclockwise."""
    shape = (-1, *[1] * (vectors.ndim - 2))
    c, s = np.cos(angles).reshape(shape), np.sin(angles).reshape(shape)
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([c * x - s * y, s * x + c * y, z], axis=-1)


def baseline_headings(times: Array, positions: Array) -> Array | None:
    """Headings of the longest baseline, without leaps of a turn, radians.

    Parameters
    ----------
    times : (n,) array
        Seconds.
    positions : (n, r, 3) array
        Of the antennas, metres; NaN where one has no fix.

    Returns
    -------
    (n,) array
        Evenly between the epochs at which both of its ends have a fix; the same before the first
        and after the last. None of fewer than two such epochs.
    """
    level = positions[..., :2]
    apart = np.linalg.norm(level[:, :, None] - level[:, None], axis=-1)
    together = ~np.isnan(apart).all(0)
    reach = np.zeros(together.shape)
    reach[together] = np.nanmedian(apart[:, together], axis=0)
    i, j = divmod(int(reach.argmax()), len(reach))
    rows = np.flatnonzero(~np.isnan(apart[:, i, j]))
    if len(rows) < 2 or i == j:
        return None
    way = level[rows, j] - level[rows, i]
    seen = np.unwrap(np.arctan2(way[:, 1], way[:, 0]))
    return np.asarray(np.interp(times, times[rows], seen))


def carried(
    times: Array,
    positions: Array,
    headings: Array,
    who: tuple[int, tuple[int, ...]],
    rows: tuple[Ints, Ints, Ints],
) -> Array:
    """Where an antenna is between its fixes: it goes with the vehicle.

    Parameters
    ----------
    times : (n,) array
        Seconds.
    positions : (n, r, 3) array
        Of the antennas, metres; NaN where one has no fix.
    headings : (n,) array
        Of the vehicle, radians.
    who : (int, tuple of int)
        The antenna, and others that tell where it is.
    rows : three (m,) int arrays
        Epochs at which it is wanted, and its own fixes before and after each; where these are one
        it keeps its place on the vehicle.

    Returns
    -------
    (m, 3) array
        Metres; the mean of what the others tell, NaN where none has a fix at all three epochs.

    Notes
    -----
    Where it is, seen from the vehicle, changes evenly from fix to fix: as much as the vehicle leans
    and nods meanwhile is wrong.
    """
    own, others = who
    at, before, after = rows
    share = (times[at] - times[before]) / np.maximum(times[after] - times[before], 1e-9)
    told = np.full((len(at), len(others), 3), np.nan)
    for n, other in enumerate(others):
        first, last = (
            turned(-headings[end], positions[end, own] - positions[end, other])
            for end in (before, after)
        )
        arm = first + share[:, None] * (last - first)
        told[:, n] = positions[at, other] + turned(headings[at], arm)
    found = np.full((len(at), 3), np.nan)
    known = ~np.isnan(told[..., 0]).all(1)
    found[known] = np.nanmean(told[known], axis=1)
    return found
