"""Epochs at which some receivers have no fix: lost ones, and receivers that write less often.

Their antennas go with the vehicle meanwhile. A logger loses a few sentences in a hundred: an epoch
that one receiver lacks is none of all, and next to it no motion would tell that something jumped.
Receivers that write less often are looked at on the epochs of those that write most often.
"""

from dataclasses import replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from rtk_gt.lasting.seen_from_vehicle import MOST_LOST, baseline_headings, carried
from rtk_gt.receivers.fixes import RTK_FIXED, Bools, Ints
from rtk_gt.receivers.steps import Steps, receiver_pairs
from validation.poses.angles import Array

T = TypeVar("T", bound=np.generic)

SPACING = 0.2
"""Seconds between the epochs that are looked at, of those that are nearer: all tell no more of what
lasts for seconds, and a vehicle goes only so far in that time."""
OFTEN = 0.6
"""Share of the fixes of the most frequent receiver that others must have to go with it."""
LEANS = 0.03
"""Metres by which an antenna moves on the vehicle over lost fixes at least where it jumped, that of
a degree at an arm of 1.8 m: a jump in the middle of them would be two of half its size."""


def spaced_rows(steps: Steps) -> Ints:
    """Rows of the steps that are `SPACING` apart, or as far as they are.

    Of several such choices the one with most fixes: a receiver that writes ten times a second then
    goes with those that write five times, and none seems to write seldom beside it.
    """
    apart = np.diff(steps.times)
    # The mean of the usual ones: stamps may be rounded, and an hour has a hundred thousand.
    usual = apart[apart < 1.5 * np.median(apart)] if len(apart) else apart
    every = float(usual.mean()) if len(usual) else SPACING
    stride = max(round(SPACING / every), 1)
    place = np.rint((steps.times - steps.times[:1]) / every).astype(int) % stride
    fixes = np.bincount(place, (steps.kinds == RTK_FIXED).sum(1), stride)
    return np.flatnonzero(place == int(fixes.argmax()))


def with_lost_fixes(steps: Steps) -> Steps:
    """The steps with fixes where a receiver lacks few and another one has some.

    Only to look for errors: what stands between two fixes is no measurement.

    Parameters
    ----------
    steps : Steps
        Offsets added as far as known; of receivers that write less often than others nothing is
        added.
    """
    fixed = steps.kinds == RTK_FIXED
    count = fixed.sum(0)
    columns = np.flatnonzero(count >= max(OFTEN * count.max(), 2))
    if len(columns) < 2:
        return steps
    seen = np.where(fixed[..., None], steps.positions, np.nan)
    headings = baseline_headings(steps.times, seen[:, columns])
    if headings is None:
        return steps
    positions, kinds = steps.positions.copy(), steps.kinds.copy()
    for k in columns.tolist():
        others = tuple(j for j in columns.tolist() if j != k)
        rows = _lost(steps.times, fixed, columns, k)
        told = carried(steps.times, seen, headings, (k, others), rows, LEANS)
        known = ~np.isnan(told[:, 0])
        positions[rows[0][known], k] = told[known]
        kinds[rows[0][known], k] = RTK_FIXED
    return replace(steps, positions=positions, kinds=kinds)


def _lost(times: Array, fixed: Bools, columns: Ints, k: int) -> tuple[Ints, Ints, Ints]:
    """Rows that a receiver lacks and another one has, with its own fixes before and after."""
    own = np.flatnonzero(fixed[:, k])
    rows = np.flatnonzero(fixed[:, columns].any(1) & ~fixed[:, k])
    place = np.searchsorted(own, rows)
    inside = (place > 0) & (place < len(own))
    rows, place = rows[inside], place[inside]
    before, after = own[place - 1], own[place]
    usual = float(np.median(np.diff(times[own])))
    short = times[after] - times[before] < (MOST_LOST + 0.5) * usual
    return rows[short], before[short], after[short]


def found_again(steps: Steps, receiver: int) -> Array:
    """(m,) times at which a receiver has a fix again after it lacked more than it loses singly."""
    own = steps.times[steps.kinds[:, receiver] == RTK_FIXED]
    apart = np.diff(own)
    if len(apart) == 0:
        return np.zeros(0)
    return np.asarray(own[1:][apart > (MOST_LOST + 0.5) * np.median(apart)])


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
