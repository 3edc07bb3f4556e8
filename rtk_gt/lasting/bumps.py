"""Lifts that a bump of the road makes: the wheels come down again at once, or others follow.

Three antennas have three heights, and a vehicle has a height, a pitch and a roll: a lift of any of
them may be its motion. On a rough road the drive itself shows how far it is thrown. On a calm one
nothing does: a speed bump or a kerb lifts it by a decimetre within two fixes, unlike all the rest.
But the front wheels go up and down, and so do the rear ones a moment later, while an error of a
receiver that lasts begins once.
"""

from collections.abc import Sequence

import numpy as np

from rtk_gt.lasting.causes import UNSURE, gains_of
from rtk_gt.lasting.contrasts import contrasts, sides_of
from rtk_gt.receivers.fixes import Bools
from validation.poses.angles import Array

SOON = 4.0
"""Seconds within which another lift follows or precedes: less than the 5 s of the shortest error
that lasts; a vehicle of 3 m at walking pace is over a bump in that time."""
ANOTHER = 25.0
"""Gain of another lift; of normal numbers chance makes that in one of 700 spells of 8 s at 5 Hz."""


def upwards(sizes: Array) -> Bools:
    """(...) whether jumps (..., 3) go upwards, more than twice as far as level."""
    return np.asarray(np.abs(sizes[..., 2]) > 2 * np.linalg.norm(sizes[..., :2], axis=-1))


def followed(
    times: Array,
    positions: Array,
    headings: Array,
    causes: Sequence[tuple[int, ...]],
    lifts: Sequence[tuple[int, tuple[int, ...]]],
) -> list[bool]:
    """Whether other lifts are near some.

    Parameters
    ----------
    times, positions, headings, causes
        As of `find_jumps`, with the lifts taken out.
    lifts : sequence of (int, tuple of int)
        The last epoch before each, and its receivers.
    """
    middle = (times[1:] + times[:-1]) / 2
    most, whose = np.zeros(len(middle)), np.full(len(middle), -1)
    near = np.zeros(len(middle), dtype=bool)
    for row, _ in lifts:
        near |= np.abs(middle - middle[row]) < SOON
    for sides in sides_of(times, positions):
        seen = contrasts(times, positions, headings, sides) if sides.guessed else None
        if seen is None:
            continue
        at = np.flatnonzero(near & seen.moving)
        for k, cause in enumerate(causes):
            gains, sizes = gains_of(seen, cause, at)
            better = upwards(sizes) & (gains > most[at])
            most[at[better]], whose[at[better]] = gains[better], k
    found = []
    for row, receivers in lifts:
        beside = (np.abs(middle - middle[row]) < SOON) & (most > ANOTHER)
        beside[row] = False
        # What is left of one that was a fix earlier or later is its own receivers'.
        close = slice(max(row - UNSURE, 0), row + UNSURE + 1)
        own = causes.index(receivers) if receivers in causes else -1
        beside[close] &= whose[close] != own
        found.append(bool(beside.any()))
    return found
