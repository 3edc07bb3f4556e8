"""The last digits that receivers write, and what rounding to them does."""

from collections.abc import Sequence

import numpy as np

from rtk_gt.receivers.fixes import Fixes

FINER = 1e-5
"""Metres: finer steps are those of the arithmetic, not of a receiver."""
COARSE = 0.3
"""Share of the vertical noise above which what rounding does counts: it then adds 4 %."""
UNIFORM = float(1 / np.sqrt(12))
"""Standard deviation of what is rounded to whole numbers."""


def height_step(record: Fixes) -> float:
    """Metres of the last digit of a receiver's heights; 0 if they are too fine to tell.

    Parameters
    ----------
    record : Fixes
        Of one receiver.
    """
    apart = np.diff(np.unique(record.geodetic[record.fixed, 2]))
    apart = apart[apart > FINER]
    return float(apart.min()) if len(apart) else 0.0


def coarsest(records: Sequence[Fixes]) -> tuple[str, float]:
    """The receiver with the coarsest heights, and their last digit in metres."""
    steps = {record.receiver: height_step(record) for record in records}
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
