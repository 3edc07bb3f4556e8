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
