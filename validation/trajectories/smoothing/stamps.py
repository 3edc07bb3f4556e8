"""Stamps of frames that come at a rate, freed from the jitter of receipt."""

from dataclasses import dataclass

import numpy as np

from validation.poses.angles import Array

FEWEST = 30
"""Frames; from fewer the period is not known to a fraction of the jitter."""
SHARPEST = 4.0
"""A rate is one if the mean of the phases is longer than so many times that of random phases,
1/sqrt(n); of the 20 or so frequencies tried a step, random ones pass this in 20 exp(-16)."""
FIRST = 256
"""Frames from which the search starts. With a latency that is spread over a third of the period
the phases agree to 0.36 only; the best of some hundred wrong frequencies reaches 2.5/sqrt(256),
0.16."""


@dataclass(frozen=True)
class Regular:
    """Stamps on a grid.

    Parameters
    ----------
    times : (n,) array
        Phase and period times the number of the frame, seconds.
    jitter : float
        Standard deviation of the stamps about them, seconds.
    period : float
        Seconds.
    """

    times: Array
    jitter: float
    period: float


def regular(times: Array, rate: float | None = None) -> Regular | None:
    """The grid that the stamps keep to, or None where they keep to none.

    Parameters
    ----------
    times : (n,) array
        Stamps in seconds, increasing; frames may be lost.
    rate : float, optional
        Frames a second, as stated.

    Returns
    -------
    Regular or None
        Its times have the mean of the stamps: the mean latency stays in them.

    Notes
    -----
    The frequency is the one whose phases agree best (a periodogram of the stamps), first over
    few frames and in steps over twice as many. Ten percent of a period of jitter leave phases 0.8
    long, thirty percent 0.17.
    """
    n = len(times)
    if n < FEWEST:
        return None
    period = 1 / rate if rate else float(np.median(np.diff(times)))
    frequency, width = 1 / period, 0.03 / period
    count = min(FIRST, n)
    while True:
        rows = times[:count] if count <= 4096 else times[: count : count // 4096]
        span = max(float(rows[-1] - rows[0]), period)
        tried = frequency + np.arange(-width, width + 1e-12, 0.2 / span)
        tried = tried if len(tried) < 4000 else np.linspace(-width, width, 4000) + frequency
        phases = np.exp(2j * np.pi * np.outer(tried, rows - rows[0])).mean(1)
        best = int(np.argmax(np.abs(phases)))
        frequency, width = float(tried[best]), 1.0 / span
        if count == n:
            break
        count = min(2 * count, n)
    if abs(phases[best]) < SHARPEST / np.sqrt(len(rows)):
        return None
    return _line(times, 1 / frequency, float(np.angle(phases[best])) / (2 * np.pi))


def _line(times: Array, period: float, phase: float) -> Regular:
    """The line of stamps over frame numbers, by least squares: it holds the mean latency."""
    since = times - times[0]
    line = np.array([period, phase * period])
    order = np.arange(len(times))
    for _ in range(4):
        nearest = np.round((since - line[1]) / line[0])
        # Of two frames in one place the earlier is the late one.
        numbers = np.minimum.accumulate((nearest - order)[::-1])[::-1] + order
        line = np.polyfit(numbers, since, 1)
    grid = np.polyval(line, numbers)
    return Regular(times[0] + grid, float((since - grid).std()), float(line[0]))
