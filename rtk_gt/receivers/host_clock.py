"""The clock of the computer that wrote a log, beside the satellites' time in its sentences."""

from dataclasses import dataclass

import numpy as np

from rtk_gt.receivers.fixes import Fixes
from validation.poses.angles import Array
from validation.statistics.robust import sigma_from_median

FEWEST = 20
"""Stamps that make an offset and a drift: a judgement."""


@dataclass(frozen=True)
class HostClock:
    """How a computer's clock runs beside the satellites' time.

    Parameters
    ----------
    ahead : float
        Seconds that its stamps are ahead of UTC in the middle of the log: its clock's error and the
        way of the message from the receiver, which no log tells apart.
    ahead_sigma : float
        Standard error, from the scatter of minutes.
    drift, drift_sigma : float
        Seconds per second that it gains, and its standard error; NaN for logs under two minutes.
    jitter : float
        Standard deviation of a single stamp about the line, seconds.
    stamps : int
        How many there are.
    """

    ahead: float
    ahead_sigma: float
    drift: float
    drift_sigma: float
    jitter: float
    stamps: int


def host_clock(record: Fixes) -> HostClock | None:
    """The clock of the computer that wrote a log; None where the log has no stamps of it.

    Parameters
    ----------
    record : Fixes
        With the stamps of its sentences in ``host``.

    Notes
    -----
    A line through the medians of each minute: stamps of one minute wait for the same things, and
    their scatter within the minute says nothing of the line's.
    """
    stamped = np.isfinite(record.host)
    if stamped.sum() < FEWEST:
        return None
    times, ahead = record.times[stamped], (record.host - record.times)[stamped]
    middle = (times[0] + times[-1]) / 2
    minute = np.floor((times - times[0]) / 60.0)
    at, medians = _medians(minute, times - middle, ahead)
    line = np.array([0.0, float(np.median(ahead))])
    sigmas = np.array([np.nan, float(sigma_from_median(ahead - np.median(ahead)))])
    if len(at) > 2:
        design = np.column_stack([at, np.ones_like(at)])
        line = np.linalg.lstsq(design, medians, rcond=None)[0]
        left = medians - design @ line
        variance = float(left @ left) / (len(at) - 2)
        sigmas = np.sqrt(variance * np.diagonal(np.linalg.inv(design.T @ design)))
    jitter = float(sigma_from_median(ahead - line[0] * (times - middle) - line[1]))
    drift = float(line[0]) if len(at) > 2 else float("nan")
    return HostClock(
        float(line[1]), float(sigmas[1]), drift, float(sigmas[0]), jitter, int(stamped.sum())
    )


def _medians(group: Array, times: Array, values: Array) -> tuple[Array, Array]:
    """Mean time and median value of each group."""
    kinds = np.unique(group)
    at = np.array([times[group == one].mean() for one in kinds])
    return at, np.array([float(np.median(values[group == one])) for one in kinds])
