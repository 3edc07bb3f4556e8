"""Epochs that one receiver of several has lost: its antenna goes with the vehicle meanwhile.

A logger loses a few sentences in a hundred. An epoch that one receiver lacks is none of all, and
next to it no motion would tell that something jumped.
"""

from dataclasses import replace

import numpy as np

from rtk_gt.lasting.seen_from_vehicle import baseline_headings, carried
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
    seen = np.where(fixed[..., None], steps.positions, np.nan)
    headings = baseline_headings(steps.times, seen[:, columns])
    if headings is None:
        return steps
    positions, kinds = steps.positions.copy(), steps.kinds.copy()
    for k in columns.tolist():
        others = tuple(j for j in columns.tolist() if j != k)
        rows = _lost(steps.times, fixed, columns, k)
        told = carried(steps.times, seen, headings, (k, others), rows)
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
