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
    rows: Sequence[int],
) -> list[bool]:
    """Whether other lifts are near those after some rows.

    Parameters
    ----------
    times, positions, headings, causes
        As of `find_jumps`, with the lifts after these rows taken out.
    rows : sequence of int
        Of the last epochs before them.
    """
    middle = (times[1:] + times[:-1]) / 2
    most = np.zeros(len(middle))
    near = np.zeros(len(middle), dtype=bool)
    for row in rows:
        near |= np.abs(middle - middle[row]) < SOON
    for sides in sides_of(times, positions):
        seen = contrasts(times, positions, headings, sides) if sides.guessed else None
        if seen is None:
            continue
        at = np.flatnonzero(near & seen.moving)
        for cause in causes:
            gains, sizes = gains_of(seen, cause, at)
            most[at] = np.maximum(most[at], np.where(upwards(sizes), gains, 0.0))
    found = []
    for row in rows:
        beside = np.abs(middle - middle[row]) < SOON
        beside[max(row - UNSURE, 0) : row + UNSURE + 1] = False
        found.append(bool((most[beside] > ANOTHER).any()))
    return found
