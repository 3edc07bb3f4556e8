"""Errors that all receivers share: what is stated, beside what the distances of the antennas show.

An error of the base station or of the air above moves all antennas alike, and no distance shows it.
What receivers state of themselves holds it; what the distances show does not. Where a receiver
states clearly more, the difference is such an error.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rtk_gt.offsets.noise import GpsNoise
from rtk_gt.receivers.fixes import Fixes
from rtk_gt.receivers.steps import Steps
from validation.poses.angles import Array

CLEARLY = 1.3
"""Stated over found sigma above which the difference is taken as common, and below the inverse of
which what is stated is said to be too small: found ones are known to some percent."""

NEAR = 0.02
"""Seconds within which a fix is that of a step: less than half of the interval at 20 Hz."""


@dataclass(frozen=True)
class CommonErrors:
    """What is taken of errors that all receivers share.

    Parameters
    ----------
    source : {"setting", "stated", "base", "none"}
        From campaign.toml, from the receivers, from a moving base, or not known.
    covariances : (t, 3, 3) array, optional
        At each step, m^2; None where nothing is known.
    sigma : float
        Median horizontal sigma, metres; 0 where nothing is known.
    stated : float
        Median horizontal sigma that the receivers state of their fixes; NaN where they do not.
    """

    source: Literal["setting", "stated", "base", "none"]
    covariances: Array | None
    sigma: float
    stated: float


def common_errors(
    records: Sequence[Fixes],
    steps: Steps,
    noise: GpsNoise,
    setting: float | None,
    base: Fixes | None = None,
) -> CommonErrors:
    """Errors that all receivers share at each step.

    Parameters
    ----------
    records : sequence of Fixes
        With what the receivers state.
    steps : Steps
        The same brought together.
    noise : GpsNoise
        Of one receiver, as the distances show it.
    setting : float, optional
        Horizontal sigma that campaign.toml states, metres.
    base : Fixes, optional
        Of the receiver that all others are told from: its whole error is in all of them, and the
        distances show nothing of it.
    """
    stated = _stated(records if base is None else [base], steps)
    level = np.sqrt(np.trace(stated[:, :2, :2], axis1=1, axis2=2) / 2)
    known = np.isfinite(level) & steps.complete
    median = float(np.median(level[known])) if known.any() else np.nan
    if setting is not None:
        own = np.tile(GpsNoise(setting, noise.eta).covariance, (len(steps), 1, 1))
        return CommonErrors("setting", own, setting, median)
    if not (known.any() if base is not None else median > CLEARLY * noise.sigma):
        return CommonErrors("none", None, 0.0, median)
    own = noise.covariance if base is None else np.zeros((3, 3))
    values, axes = np.linalg.eigh(np.where(known[:, None, None], stated, 0.0) - own)
    found = (axes * np.maximum(values, 0.0)[:, None]) @ np.swapaxes(axes, 1, 2)
    # Where nothing is stated it is as usual.
    found[~known] = np.median(found[known], axis=0)
    sigma = np.sqrt(np.trace(found[known][:, :2, :2], axis1=1, axis2=2) / 2)
    source: Literal["stated", "base"] = "stated" if base is None else "base"
    return CommonErrors(source, found, float(np.median(sigma)), median)


def _stated(records: Sequence[Fixes], steps: Steps) -> Array:
    """(t, 3, 3) mean over the receivers of the covariances stated at each step; NaN without any."""
    total = np.zeros((len(steps), 3, 3))
    count = np.zeros(len(steps))
    for record in records:
        rows = np.clip(np.searchsorted(record.times, steps.times), 1, max(len(record) - 1, 1))
        rows = rows - (
            steps.times - record.times[rows - 1] < np.abs(record.times[rows] - steps.times)
        )
        near = np.abs(record.times[rows] - steps.times) < NEAR
        own = record.covariances[rows]
        good = near & np.isfinite(own).all((1, 2)) & record.fixed[rows]
        total[good] += own[good]
        count += good
    return np.where((count > 0)[:, None, None], total / np.maximum(count, 1)[:, None, None], np.nan)
