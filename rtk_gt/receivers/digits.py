"""The last digits that receivers write, and what rounding to them does."""

from collections.abc import Sequence

import numpy as np

from rtk_gt.receivers.fixes import Fixes
from validation.poses.angles import Array

EARTH = 6.4e6
"""Metres from its centre, to a hundredth."""
FINER = 1e-5
"""Metres: finer steps are those of the arithmetic, not of a receiver."""
COARSE = 0.3
"""Share of the vertical noise above which what rounding does counts: it then adds 4 %."""
FEWEST_PLACES = 10
"""Different numbers that show to which decimal they are written."""
WHOLE = 1e-3
"""Of a digit: arithmetic leaves 1e-5 of the last of `DECIMALS`, and of finer numbers two in a
thousand are as near to a whole one by chance."""
DECIMALS = 8
"""Of degrees: a millimetre."""
UNIFORM = float(1 / np.sqrt(12))
"""Standard deviation of what is rounded to whole numbers."""


def last_digits(geodetic: Array) -> Array:
    """Metres of the last digit of latitude, longitude and height; 0 of those too fine to tell.

    Parameters
    ----------
    geodetic : (n, 3) array
        Radians, radians, metres.
    """
    if not len(geodetic):
        return np.zeros(3)
    metres = geodetic * [EARTH, EARTH * np.cos(geodetic[0, 0]), 1.0]
    apart = (np.diff(np.unique(column)) for column in metres.T)
    steps = np.array([np.min(one[one > FINER], initial=np.inf) for one in apart])
    return np.where(np.isfinite(steps), steps, 0.0)


def decimal_digit(columns: Array) -> float:
    """The last decimal place to which numbers are written, such as 1e-6; 0 where none is told.

    Parameters
    ----------
    columns : (n, k) array
        In the unit in which they were written, all columns with the same decimals. One that hardly
        changes tells nothing.
    """
    told = [one for one in columns.T if len(np.unique(one)) >= FEWEST_PLACES]
    for decimals in range(DECIMALS + 1) if told else ():
        scaled = np.array(told) * 10.0**decimals
        whole = np.rint(scaled)
        # Millimetres about a round degree are not written in degrees.
        places = min(len(np.unique(one)) for one in whole)
        if (np.abs(scaled - whole) < WHOLE).all() and places >= FEWEST_PLACES:
            return float(10.0**-decimals)
    return 0.0


def level_digit(geodetic: Array) -> float:
    """Metres of the last digit of latitudes and longitudes in degrees or minutes; 0 of fine ones.

    Parameters
    ----------
    geodetic : (n, 3) array
        Radians, radians, metres.
    """
    degrees = np.degrees(geodetic[:, :2])
    step = max(decimal_digit(degrees), decimal_digit(60 * degrees) / 60)
    return float(EARTH * np.radians(step))


def coarsest_level(records: Sequence[Fixes]) -> tuple[str, float]:
    """The receiver with the coarsest level positions, and their last digit in metres."""
    coarse = max(records, key=lambda one: one.level_digit)
    return coarse.receiver, coarse.level_digit


def coarsest(records: Sequence[Fixes]) -> tuple[str, float]:
    """The receiver with the coarsest heights, and their last digit in metres."""
    steps = {one.receiver: float(last_digits(one.geodetic[one.fixed])[2]) for one in records}
    name = max(steps, key=lambda one: steps[one])
    return name, steps[name]


def rounded_eta(records: Sequence[Fixes], sigma: float, eta: float) -> float:
    """Vertical noise over horizontal noise, with what rounding of heights adds where it counts.

    Parameters
    ----------
    records : sequence of Fixes
        Of all receivers.
    sigma : float
        Horizontal noise of one receiver, metres.
    eta : float
        As stated or assumed.
    """
    rounding = UNIFORM * coarsest(records)[1]
    if sigma <= 0 or rounding < COARSE * max(eta, 1.0) * sigma:
        return eta
    return float(np.hypot(eta, rounding / sigma))
