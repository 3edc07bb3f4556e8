"""Epochs that one receiver of several has lost: its antenna goes with the vehicle meanwhile.

A logger loses a few sentences in a hundred. An epoch that one receiver lacks is none of all, and
next to it no motion would tell that something jumped.
"""

from dataclasses import replace

import numpy as np

from rtk_gt.receivers.fixes import RTK_FIXED, Bools, Ints
from rtk_gt.receivers.steps import Steps
from validation.poses.angles import Array

OFTEN = 0.6
"""Share of the fixes of the most frequent receiver that others must have to go with it."""
MOST_LOST = 3
"""Usual spacings between two fixes of a receiver within which it has lost some: a vehicle that
leans by a degree meanwhile moves an antenna by two hundredths of its arm, evenly."""


def with_lost_fixes(steps: Steps) -> Steps:
    """The steps with fixes where a receiver lacks few and another one has some.

    Only to look for errors: what stands between two fixes is no measurement.

    Parameters
    ----------
    steps : Steps
        As recorded; of receivers that write less often than others nothing is added.
    """
    fixed = steps.kinds == RTK_FIXED
    count = fixed.sum(0)
    columns = np.flatnonzero(count >= max(OFTEN * count.max(), 2))
    if len(columns) < 2:
        return steps
    headings = _headings(steps, fixed, columns)
    positions, kinds = steps.positions.copy(), steps.kinds.copy()
    for k in columns.tolist():
        rows, before, after = _lost(steps.times, fixed, columns, k)
        if len(rows) == 0 or headings is None:
            continue
        others = [j for j in columns.tolist() if j != k]
        told = np.full((len(rows), len(others), 3), np.nan)
        share = (steps.times[rows] - steps.times[before]) / (
            steps.times[after] - steps.times[before]
        )
        for n, j in enumerate(others):
            seen = fixed[rows, j] & fixed[before, j] & fixed[after, j]
            arms = [
                _turned(-headings[at], steps.positions[at, k] - steps.positions[at, j])
                for at in (before[seen], after[seen])
            ]
            arm = arms[0] + share[seen, None] * (arms[1] - arms[0])
            told[seen, n] = steps.positions[rows[seen], j] + _turned(headings[rows[seen]], arm)
        known = ~np.isnan(told[..., 0]).all(1)
        positions[rows[known], k] = np.nanmean(told[known], axis=1)
        kinds[rows[known], k] = RTK_FIXED
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


def _headings(steps: Steps, fixed: Bools, columns: Ints) -> Array | None:
    """(t,) headings of the longest baseline, between its fixes evenly; None where it has none."""
    level = np.where(fixed[:, columns, None], steps.positions[:, columns, :2], np.nan)
    apart = np.linalg.norm(level[:, :, None] - level[:, None], axis=-1)
    together = ~np.isnan(apart).all(0)
    reach = np.zeros(together.shape)
    reach[together] = np.nanmedian(apart[:, together], axis=0)
    i, j = divmod(int(reach.argmax()), len(columns))
    rows = np.flatnonzero(~np.isnan(apart[:, i, j]))
    if len(rows) < 2 or i == j:
        return None
    way = level[rows, j] - level[rows, i]
    seen = np.unwrap(np.arctan2(way[:, 1], way[:, 0]))
    return np.asarray(np.interp(steps.times, steps.times[rows], seen))


def _turned(angles: Array, vectors: Array) -> Array:
    """(n, 3) vectors turned about the vertical."""
    c, s = np.cos(angles), np.sin(angles)
    x, y, z = vectors.T
    return np.column_stack([c * x - s * y, s * x + c * y, z])
