"""What a single receiver states of its errors, beside how it scatters where it stands."""

from dataclasses import dataclass

import numpy as np

from rtk_gt.path.common_errors import CLEARLY
from rtk_gt.receivers.fixes import Fixes
from validation.poses.angles import Array

WINDOW = 30
"""Fixes in a row that are looked at together: a standard deviation to 9 % of two coordinates."""
CREPT = 0.1
"""Metres along the line through a window within which the receiver stood: a judgement. A start
that goes so far bends the line by 0.1 / sqrt(180) m = 7 mm rms, and windows of starts are few."""
FEWEST_WINDOWS = 3
"""Windows of standing below which nothing is said: their median outlives a start and a stop."""
HOLE = 1.5
"""Usual intervals beyond which fixes are not in a row."""


@dataclass(frozen=True)
class Scatter:
    """Noise of a receiver where it stood in a drive.

    Parameters
    ----------
    fixes : int
        That it rests on.
    seen, stated : (2,) array
        Standard deviations in metres: of a level coordinate, and up.
    """

    fixes: int
    seen: Array
    stated: Array

    @property
    def factors(self) -> Array:
        """(2,) by which stated standard deviations are too small, level and up; 1 if they are not.

        What is seen is a lower bound: errors that last longer than a window are not in it.
        """
        ratio = self.seen / self.stated
        return np.asarray(np.where(ratio > CLEARLY, ratio, 1.0))


def scatter_beside_stated(record: Fixes, positions: Array) -> Scatter | None:
    """How a receiver scatters where it stands; None where it never does or states nothing.

    Parameters
    ----------
    record : Fixes
        Of one receiver.
    positions : (n, 3) array
        Of its fixes, east, north and up, metres.
    """
    known = np.flatnonzero(record.fixed & np.isfinite(record.covariances).all((1, 2)))
    count = len(known) // WINDOW
    if count < FEWEST_WINDOWS:
        return None
    rows = known[: count * WINDOW].reshape(count, WINDOW)
    times = record.times[rows]
    usual = float(np.median(np.diff(record.times)))
    in_row = np.diff(times, axis=1).max(1) < HOLE * usual
    along = times - times.mean(1, keepdims=True)
    places = positions[rows]
    places = places - places.mean(1, keepdims=True)
    slopes = np.einsum("wk,wka->wa", along, places) / np.square(along).sum(1)[:, None]
    way = np.linalg.norm(slopes[:, :2], axis=1) * np.ptp(times, axis=1)
    stood = in_row & (way < CREPT)
    if stood.sum() < FEWEST_WINDOWS:
        return None
    left = (places - along[..., None] * slopes[:, None])[stood]
    variances = np.square(left).sum(1) / (WINDOW - 2)
    own = np.diagonal(record.covariances[rows[stood]], axis1=-2, axis2=-1)
    seen = np.median([variances[:, :2].mean(1), variances[:, 2]], axis=1)
    stated = np.median([own[..., :2].mean(-1).ravel(), own[..., 2].ravel()], axis=1)
    if not (stated > 0).all():
        return None
    return Scatter(int(stood.sum()) * WINDOW, np.sqrt(seen), np.sqrt(stated))
