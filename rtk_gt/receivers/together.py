"""Whether the records of a drive belong together: fixes at common times, on one vehicle."""

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from itertools import permutations

import numpy as np

from rtk_gt.receivers.assumptions import FEWEST_STEPS, VEHICLE_SIZE
from rtk_gt.receivers.fixes import FIX_NAMES, Fixes
from rtk_gt.receivers.steps import Steps, receiver_pairs
from validation.errors import GtvalError
from validation.poses.angles import Array

FOOT = 0.3048
"""Metres."""
LEAST_CLIMB, ALIKE = 0.2, 0.97
"""Standard deviation of the heights (m), and their correlation, from which on two receivers tell
whether their heights have one unit: noise of 1 cm and tilts of some centimetres change the factor
between them by less than the 3 % that it may be off."""
_SHIFTS = np.arange(-40.0, 41.0)
"""Seconds by which clocks are tried to differ: GPS time is 18 s ahead of UTC, and there and back
of two such mistakes fits in."""


def check_together(records: Sequence[Fixes], steps: Steps, tolerance: float) -> None:
    """Raise if there are too few common times, or the receivers do not move together.

    Parameters
    ----------
    records : sequence of Fixes
        Of all receivers.
    steps : Steps
        The same brought together.
    tolerance : float
        Stamps within so many seconds were taken as one time.

    Raises
    ------
    GtvalError
        Saying which receiver it is, as far as can be told, and what to look at.
    """
    count = int(steps.complete.sum())
    if count < FEWEST_STEPS:
        reasons = "; ".join(_reasons(records, tolerance))
        raise GtvalError(
            f"all receivers are RTK-fixed together at {count} times only; at least "
            f"{FEWEST_STEPS} are needed to find their offsets{': ' if reasons else ''}{reasons}"
        )
    together = steps.select(steps.complete).positions
    _check_feet(records, together[..., 2])
    for i, j in receiver_pairs(len(records)):
        apart = _spread(together[:, j] - together[:, i])
        if apart > 2 * VEHICLE_SIZE:
            raise GtvalError(_not_together(records, steps, (i, j), apart))


def _check_feet(records: Sequence[Fixes], heights: Array) -> None:
    """Raise where the heights (t, r) of a receiver change as those of another do, in feet."""
    changes = heights - heights.mean(0)
    spread = changes.std(0)
    for small, large in permutations(range(len(records)), 2):
        if not spread[small] > LEAST_CLIMB:
            continue
        slope = float(changes[:, small] @ changes[:, large] / np.square(changes[:, small]).sum())
        alike = slope * spread[small] / spread[large]
        if alike > ALIKE and abs(slope * FOOT - 1) < 1 - ALIKE:
            one, other = records[large], records[small]
            raise GtvalError(
                f"the heights of {one.receiver} ({one.source.name}) change {slope:.2f} times as "
                f"much as those of {other.receiver}: they are in feet, whatever the file calls "
                "them. Set the receiver to metres, or multiply its altitudes by 0.3048"
            )


def _reasons(records: Sequence[Fixes], tolerance: float) -> Iterator[str]:
    fixed = [record for record in records if record.fixed.any()]
    for record in records:
        if record.fixed.any():
            continue
        kinds = sorted({FIX_NAMES[int(kind)] for kind in record.kinds})
        yield (
            f"{record.receiver} is never RTK-fixed in {record.source} (its {len(record)} fixes "
            f"are {', '.join(kinds)})"
        )
    for record in fixed[1:]:
        first, own = fixed[0].times[fixed[0].fixed], record.times[record.fixed]
        if own[0] > first[-1] or own[-1] < first[0]:
            yield (
                f"{record.receiver} was recorded from {_clock(own[0])} to {_clock(own[-1])}, "
                f"{fixed[0].receiver} from {_clock(first[0])} to {_clock(first[-1])}; a log "
                'without a date needs `date = "YYYY-MM-DD"` in its [[rtk.receivers]]'
            )
            continue
        nearest = float(np.median(_nearest(own, first)))
        if nearest > tolerance:
            yield (
                f"the times of {record.receiver} and {fixed[0].receiver} are {nearest:.3f} s apart"
                f" at best (median), more than `simultaneous = {tolerance:g}` of [rtk]; raise it "
                "only if the clocks differ by less than the vehicle notices"
            )


def _nearest(times: Array, others: Array) -> Array:
    """Seconds from each of ``times`` or ``others``, whichever are fewer, to the nearest."""
    few, many = (times, others) if len(times) < len(others) else (others, times)
    right = np.clip(np.searchsorted(many, few), 1, max(len(many) - 1, 1))
    before, after = many[right - 1], many[np.minimum(right, len(many) - 1)]
    return np.asarray(np.minimum(np.abs(few - before), np.abs(after - few)))


def _clock(time: float) -> str:
    return f"{datetime.fromtimestamp(time, tz=UTC):%Y-%m-%d %H:%M:%S}"


def _spread(differences: Array) -> float:
    """Distance of vectors (t, 3) from their median that a quarter exceed.

    Of a rod that turns it is below twice its length; false fixes are less than a quarter.
    """
    away = np.linalg.norm(differences - np.median(differences, axis=0), axis=1)
    return float(np.quantile(away, 0.75))


def _not_together(
    records: Sequence[Fixes], steps: Steps, pair: tuple[int, int], apart: float
) -> str:
    first, second = (records[k] for k in pair)
    shift, left = _shift_between(first, second, steps)
    text = (
        f"{first.receiver} ({first.source.name}) and {second.receiver} ({second.source.name}) do "
        f"not move together: the difference of their positions changes by {apart:.0f} m, and "
        f"antennas on one vehicle are less than {VEHICLE_SIZE:.0f} m apart. "
    )
    if left < 0.3 * apart:  # a judgement: the shift explains most of it
        late = second if shift > 0 else first
        text += (
            f"With the clock of {late.receiver} set back by about {abs(shift):.0f} s they do. "
            "The number is uncertain by the time in which the vehicle drives its own length. GPS "
            "time is 18 s ahead of UTC since 2017. Correct the times of that file"
        )
    else:
        text += "Are both files of this vehicle and this drive?"
    return text


def _shift_between(first: Fixes, second: Fixes, steps: Steps) -> tuple[float, float]:
    """By how many seconds the second clock seems ahead, and the spread that is then left."""
    times, there = (
        first.times[first.fixed],
        steps.frame.from_geodetic(first.geodetic[first.fixed]),
    )
    own, places = (
        second.times[second.fixed],
        steps.frame.from_geodetic(second.geodetic[second.fixed]),
    )
    best = (0.0, np.inf)
    for shift in _SHIFTS:
        inside = (times + shift >= own[0]) & (times + shift <= own[-1])
        if inside.sum() < FEWEST_STEPS:
            continue
        wanted = times[inside] + shift
        moved = np.column_stack([np.interp(wanted, own, places[:, k]) for k in range(3)])
        left = _spread(moved - there[inside])
        if left < best[1]:
            best = (float(shift), left)
    return best
