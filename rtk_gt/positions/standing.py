"""The noise of a receiver that stands, and how much larger it is upwards (Blanco 2009, 6.1)."""

from dataclasses import dataclass

import numpy as np
from scipy import special

from rtk_gt.offsets.robust import autocorrelation_time
from rtk_gt.receivers.fix_checks import check_fixes
from rtk_gt.receivers.fixes import Fixes
from rtk_gt.receivers.frozen import repeats
from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array
from validation.poses.earth_frames import LocalFrame

FEWEST = 30
"""Fixes below which nothing is said: a standard deviation to 13 % if they were independent."""
MOVED = 0.25
"""Metres between the 5 and 95 % of a level coordinate beyond which the receiver moved: a judgement,
ten times the noise of fixed ambiguities."""
CONFIDENCE = 0.95
HUNG = 30
"""Fixes in a row that are the same to the last digit: noise of 5 mm that changes in 30 s only goes
by 1.6 mm in so many fixes at 20 Hz, and its last digit is 1 mm in three coordinates."""
USUAL = (0.5, 6.0)
"""Eta of receivers: heights are worse than level places by the sky alone, 1.5 to 3 times; a factor
of two more on either side is a judgement."""


@dataclass(frozen=True)
class StandingNoise:
    """Noise of a standing receiver about its mean.

    Parameters
    ----------
    receiver : str
        Its name.
    fixes : int
        RTK-fixed positions.
    seconds : float
        From the first to the last.
    sigmas : (3,) array
        Standard deviations east, north and up, metres.
    eta, low, high : float
        Sigma upwards over that of a level coordinate, with its interval of 95 %.
    worth : (2,) array
        Fixes that are worth one independent one: level, upwards.
    """

    receiver: str
    fixes: int
    seconds: float
    sigmas: Array
    eta: float
    low: float
    high: float
    worth: Array

    @property
    def remark(self) -> str | None:
        """What a reader should know about eta, if it is not as receivers have it."""
        if self.low <= USUAL[1] and self.high >= USUAL[0]:
            return None
        return (
            f"{self.receiver}: eta of {self.eta:.3g} ({self.low:.3g} to {self.high:.3g}) is not "
            "that of a receiver, which is 1 to 3: see whether heights are metres, whether all "
            "positions are fixed, and whether its level digits are fine enough"
        )


def standing_noise(record: Fixes) -> StandingNoise:
    """Noise of a receiver that stood, from its RTK-fixed positions.

    Raises
    ------
    GtvalError
        If there are too few, or the receiver moved.
    InputError
        If times leap by days or positions by kilometres, or the receiver hung.

    Notes
    -----
    Errors of neighbours are alike: so many fixes count as the record's autocorrelation says, and
    the interval is that of a ratio of two variances of so many freedoms (F). What lasts as long as
    the record is no noise of it: record for half an hour at least.
    """
    fixed = record.select(record.fixed)
    if len(fixed) < FEWEST:
        raise GtvalError(
            f"{record.source}: {len(fixed)} RTK-fixed positions; at least {FEWEST} are needed"
        )
    check_fixes([record])
    _check_changes(fixed)
    latitude, longitude, height = np.median(fixed.geodetic, axis=0).tolist()
    places = LocalFrame(latitude, longitude, height).from_geodetic(fixed.geodetic)
    spread = np.diff(np.quantile(places[:, :2], [0.05, 0.95], axis=0), axis=0).max()
    if spread > MOVED:
        raise GtvalError(
            f"{record.source}: the receiver moved by {spread:.2f} m; its noise is that of a "
            "standing record. Cut the record to where it stood"
        )
    left = places - places.mean(0)
    n = len(left)
    worth = np.array([autocorrelation_time(left[:, :2]), autocorrelation_time(left[:, 2:])])
    # The mean has taken a part of the slowest errors: of n worth one it took 1 / n of the variance.
    free = np.maximum(n / worth - 1, 1.0)
    variances = np.square(left).sum(0) / np.maximum(n - worth[[0, 0, 1]], 1.0)
    ratio = float(variances[2] / variances[:2].mean())
    tail = (1 - CONFIDENCE) / 2
    ends = special.fdtri(free[1], 2 * free[0], [1 - tail, tail])
    low, high = np.sqrt(ratio / ends).tolist()
    return StandingNoise(
        record.receiver, n, float(np.ptp(fixed.times)), np.sqrt(variances), float(np.sqrt(ratio)),
        float(low), float(high), worth,
    )  # fmt: skip


def _check_changes(fixed: Fixes) -> None:
    """Raise for positions that repeat to the last digit, and coordinates that never change."""
    for column, name in enumerate(("latitude", "longitude", "height")):
        if (fixed.geodetic[:, column] == fixed.geodetic[0, column]).all():
            raise GtvalError(
                f"{fixed.source}: the {name} of all {len(fixed)} RTK-fixed positions is the same "
                "to the last digit: that is no noise. Record with more digits, or the receiver hung"
            )
    problems = [
        Problem(
            fixed.source,
            f"the receiver hung: {last - first + 1} positions of "
            f"{fixed.times[last] - fixed.times[first]:.0f} s are the same to the last digit; cut "
            "them out",
            int(fixed.lines[first]),
            "position",
        )
        for first, last in repeats(fixed.geodetic, HUNG).tolist()
    ]
    if problems:
        raise InputError(problems)
