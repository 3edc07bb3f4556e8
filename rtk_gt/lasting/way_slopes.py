"""The plane through the antennas beside the way: a vehicle leans forward as its road does.

A receiver whose height is wrong tilts the plane for as long as it is, while the way stays as steep
as it was. Springs, humps and slow errors make them differ, too, which the drive itself shows.
"""

from dataclasses import dataclass

import numpy as np

from rtk_gt.lasting.contrasts import antenna_planes
from rtk_gt.receivers.fixes import Bools
from validation.poses.angles import Array

SIDE = 1.0
"""Seconds to both sides over which a way is as steep as it is: at a metre a second noise of a
centimetre is then half a degree."""
SLOWEST = 1.0
"""Metres a second below which a way has no slope."""
FEWEST = 100
"""Epochs with one, at least."""


@dataclass(frozen=True)
class WaySlopes:
    """Slopes of the antennas' plane along the way minus those of the way, at n epochs.

    Parameters
    ----------
    values : (n,) array
        Metres a metre; 0 where there are none.
    moving : (n,) bool array
        Where there are some.
    by_height : (n, r) array
        What a metre of each antenna's height adds, 1/m.
    ahead : (n, 2) array
        The way's direction along and across the first baseline: what a constant lean adds.
    """

    values: Array
    moving: Bools
    by_height: Array
    ahead: Array


def way_slopes(times: Array, positions: Array) -> WaySlopes | None:
    """Of positions (n, r, 3), metres, at times (n,); None of two antennas or too few epochs."""
    n, r = positions.shape[:2]
    every = float(np.median(np.diff(times)))
    side = max(round(SIDE / every), 1)
    if r < 3 or n < FEWEST:
        return None
    centre = positions.mean(1)
    way, took = np.zeros((n, 3)), np.full(n, np.inf)
    way[side:-side] = centre[2 * side :] - centre[: -2 * side]
    took[side:-side] = times[2 * side :] - times[: -2 * side]
    length = np.hypot(way[:, 0], way[:, 1])
    # Over a pause the way may go up and down.
    moving = (took < 3 * side * every) & (length > SLOWEST * took)
    if moving.sum() < FEWEST:
        return None
    course = way[:, :2] / np.maximum(length, 1e-3)[:, None]
    inverse, arms, slopes = antenna_planes(positions)
    along = (slopes * course).sum(1)
    values = np.where(moving, along - way[:, 2] / np.maximum(length, 1e-3), 0.0)
    by_height = np.einsum("ni,nij,nrj->nr", course, inverse, arms) * moving[:, None]
    first = positions[:, 1, :2] - positions[:, 0, :2]
    first = first / np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-3)
    ahead = np.column_stack(
        [(course * first).sum(1), first[:, 0] * course[:, 1] - first[:, 1] * course[:, 0]]
    )
    return WaySlopes(values, moving, by_height, ahead * moving[:, None])
