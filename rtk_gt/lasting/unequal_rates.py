"""Receivers that do not all write at one rate, on the epochs of those that write most often."""

from typing import TypeVar

import numpy as np
import numpy.typing as npt

from rtk_gt.lasting.seen_from_vehicle import carried
from rtk_gt.receivers.fixes import Ints
from rtk_gt.receivers.steps import receiver_pairs
from validation.poses.angles import Array

T = TypeVar("T", bound=np.generic)


def has_fix(positions: Array) -> npt.NDArray[np.bool_]:
    """(n, r) True where a receiver has a position, of (n, r, 3) with NaN where not."""
    return np.asarray(~np.isnan(positions[..., 0]))


def often(positions: Array) -> Ints:
    """Columns of the receivers that have a position at every epoch."""
    return np.flatnonzero(has_fix(positions).all(0))


def fixed_rows(positions: Array) -> list[tuple[Ints, Ints]]:
    """Epochs at which receivers have a position, and the columns of those that share them."""
    return _alike(has_fix(positions))


def together_rows(positions: Array) -> list[tuple[Ints, Ints]]:
    """The same of the pairs of receivers."""
    seen = has_fix(positions)
    first, second = np.array(receiver_pairs(seen.shape[1]), dtype=int).reshape(-1, 2).T
    return _alike(seen[:, first] & seen[:, second])


def _alike(seen: npt.NDArray[np.bool_]) -> list[tuple[Ints, Ints]]:
    """Rows and columns of the groups of columns (n, c) that are True at the same rows."""
    groups: dict[bytes, list[int]] = {}
    for column in range(seen.shape[1]):
        groups.setdefault(seen[:, column].tobytes(), []).append(column)
    return [(np.flatnonzero(seen[:, some[0]]), np.array(some)) for some in groups.values()]


def spread_over(rows: Ints, values: npt.NDArray[T], n: int) -> npt.NDArray[T]:
    """(n, ...) of each interval what the interval between ``rows`` shows that contains it.

    Parameters
    ----------
    rows : (m + 1,) int array
        Epochs at which there are fixes.
    values : (m, ...) array
        Of the intervals between them.
    n : int
        Intervals between all epochs; those before the first and after the last fix have 0.
    """
    if len(values) == n:
        return values
    found = np.zeros((n, *values.shape[1:]), dtype=values.dtype)
    at = np.searchsorted(rows, np.arange(n), side="right") - 1
    inside = (at >= 0) & (at < len(values))
    found[inside] = values[at[inside]]
    return found


def filled(times: Array, positions: Array, headings: Array) -> Array:
    """Positions (n, r, 3) without gaps: between its fixes an antenna goes with the vehicle.

    Parameters
    ----------
    times : (n,) array
        Seconds.
    positions : (n, r, 3) array
        NaN where there is none; of one receiver at least there are all.
    headings : (n,) array
        Of the vehicle, radians.

    Notes
    -----
    As it leans and nods meanwhile this is good enough for slopes and directions (`carried`).
    """
    seen = has_fix(positions)
    whole = positions.copy()
    others = tuple(often(positions).tolist())
    for k in np.flatnonzero(~seen.all(0)).tolist():
        own, between = np.flatnonzero(seen[:, k]), np.flatnonzero(~seen[:, k])
        place = np.searchsorted(own, between)
        before = own[np.maximum(place - 1, 0)]
        after = own[np.minimum(place, len(own) - 1)]
        whole[between, k] = carried(
            times, positions, headings, (k, others), (between, before, after)
        )
    return whole


def own_interval(positions: Array, receivers: tuple[int, ...], row: int) -> tuple[int, int]:
    """Epochs between which some receivers jumped if they did after a row: those of their fixes.

    Where one of them has a position at every epoch it is the row and the next.
    """
    rows = np.flatnonzero(has_fix(positions)[:, list(receivers)].any(1))
    before = rows[rows <= row]
    after = rows[rows > row]
    return int(before[-1]) if len(before) else row, int(after[0]) if len(after) else row + 1
