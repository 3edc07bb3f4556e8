"""Positions that a receiver repeats to the last digit while the vehicle drives on."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rtk_gt.receivers.digits import last_digits
from rtk_gt.receivers.fixes import ESTIMATED, Fixes, Frozen, Ints
from validation.poses.angles import Array
from validation.poses.earth_frames import ecef_from_geodetic

FEWEST_SAME = 3
"""Positions in a row: that two are the same happens by chance where digits are coarse."""
LEAPT = 0.25
"""Metres of a leap that noise of fixed ambiguities and a receiver that holds its position while it
stands do not make: a judgement, as for a standing receiver that moved."""
STARTING = 10.0
"""m/s^2 that no vehicle starts with: wheels slip."""
DIGITS = 3.0
"""Last digits that a leap must exceed: slower vehicles go from one to the next."""


def repeats(geodetic: Array, fewest: int) -> Ints:
    """(k, 2) first and last rows of stretches of at least so many positions that are the same.

    Parameters
    ----------
    geodetic : (n, 3) array
        To be compared to the last digit.
    fewest : int
        Positions.
    """
    same = np.r_[False, (np.diff(geodetic, axis=0) == 0).all(1), False]
    ends = np.flatnonzero(np.diff(same.astype(int))).reshape(-1, 2)
    return np.asarray(ends[ends[:, 1] - ends[:, 0] + 1 >= fewest])


def frozen_stretches(record: Fixes) -> tuple[list[Frozen], Ints]:
    """Stretches in which a receiver hung, and the rows of its repeated positions.

    A receiver that holds its position while it stands begins slowly where it ends. One that hung
    leaps as far as the vehicle drove meanwhile: farther than a start with `STARTING` explains.

    Parameters
    ----------
    record : Fixes
        Of one receiver.
    """
    fixed = np.flatnonzero(record.fixed)
    places = record.geodetic[fixed]
    digit = float(last_digits(places).max())
    found, rows = [], [np.empty(0, dtype=np.int64)]
    for first, last in repeats(places, FEWEST_SAME).tolist():
        if last + 1 == len(fixed):
            continue  # nothing tells whether it stood
        here, there = ecef_from_geodetic(places[[last, last + 1]])
        leap = float(np.linalg.norm(there - here))
        seconds = float(record.times[fixed[last + 1]] - record.times[fixed[last]])
        if leap < max(LEAPT, DIGITS * digit, STARTING * seconds**2 / 2):
            continue
        row = int(fixed[first])
        begin, end = record.times[row], record.times[fixed[last]]
        count = last - first + 1
        found.append(Frozen(float(begin), float(end), count, leap, int(record.lines[row])))
        rows.append(fixed[first + 1 : last + 1])
    return found, np.concatenate(rows)


def without_frozen(records: Sequence[Fixes]) -> list[Fixes]:
    """The records with positions that hung no longer called fixed, and these stretches in them.

    The first position of a stretch was right when it was written, and stays.
    """
    found = []
    for record in records:
        stretches, rows = frozen_stretches(record)
        kinds = record.kinds.copy()
        kinds[rows] = ESTIMATED
        found.append(replace(record, kinds=kinds, frozen=tuple(stretches)))
    return found
