"""Frame numbers of a source that has a rate, and its stamps without the jitter of their receipt."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array

FEWEST_FRAMES = 50
"""A line through fewer stamps is known no better than the motion tells the delay; a judgement."""
RATE_RANGE = 0.04
"""Share by which the period may differ from the median interval, in which a late frame or a lost
one counts like any other. With 30 ms of skewed jitter at 10 Hz the median is off by 1 % to 2 %."""
LEAST_RESULTANT = 0.25
"""Length of the mean phase (1: all stamps on a multiple of the period) below which there is no
rate. Exponential latency of 0.3 periods gives 0.47, of 0.5 periods 0.30; stamps at random give
1/sqrt(n), and the best of a thousand periods about 2.6/sqrt(n), 0.25 where n is 100."""
MOST_WANDER = 1.3
"""Standard deviation of the stamps about their line over that which neighbours show among
themselves. White jitter gives 1, with a spread of 1/sqrt(n); a rate that changes, or frames counted
wrong, gives more."""


@dataclass(frozen=True)
class FrameLine:
    """Stamps as frame numbers on a line: ``stamp = start + period * number + latency``.

    Parameters
    ----------
    times : (n,) array
        The line's times, mean latency included, in seconds as the stamps.
    numbers : (n,) array of int
        Frame numbers; those left out are frames lost.
    period : float
        Seconds of the stamps' clock.
    jitter : float
        Standard deviation of the stamps about the line, seconds.
    covariance : (2, 2) array
        Of the line's value at the mean stamp, s, and of its slope, s/s.
    """

    times: Array
    numbers: npt.NDArray[np.int64]
    period: float
    jitter: float
    covariance: Array


def frame_line(stamps: Array) -> FrameLine | None:
    """The line through the stamps of a source with a rate; None where there is no rate.

    Parameters
    ----------
    stamps : (n,) array
        Increasing, in seconds.

    Notes
    -----
    The period is that whose phases of all stamps agree best, so that gaps of any length carry over.
    Latency has one sign and a tail: a frame that comes later than half a period is first counted
    as the next one, and pushed back by the next one's own coming. The line is by least squares, not
    by a robust fit, so that it holds the mean latency and not the most frequent one.
    """
    n = len(stamps)
    if n < FEWEST_FRAMES:
        return None
    middle = stamps.mean()
    t = stamps - middle
    period = _period(t)
    if period is None:
        return None
    phase = np.angle(np.exp(2j * np.pi * t / period).mean()) / (2 * np.pi)
    line = np.array([phase * period, period])
    for _ in range(4):
        numbers = _numbers(t, line)
        columns = np.column_stack([np.ones(n), numbers])
        line = np.linalg.lstsq(columns, t, rcond=None)[0]
    residuals = t - columns @ line
    jitter = float(residuals.std() * np.sqrt(n / (n - 2)))
    nearby = float(np.sqrt(np.mean(np.diff(residuals) ** 2) / 2))
    # Stamps are written to a microsecond or so, of which no line need be better.
    if jitter > MOST_WANDER * nearby + 2e-6 or jitter > 0.5 * line[1]:
        return None
    times = columns @ line
    spread = float(np.sum((times - times.mean()) ** 2))
    covariance = jitter**2 * np.diag([1 / n, 1 / spread])
    return FrameLine(times + middle, numbers, float(line[1]), jitter, covariance)


def _period(t: Array) -> float | None:
    """The period at which the phases of all stamps agree best."""
    typical = float(np.median(np.diff(t)))
    if typical <= 0:
        return None
    span = t[-1] - t[0]
    step = 0.2 / span
    reach = RATE_RANGE / typical
    count = min(int(np.ceil(reach / step)), 4000)
    rates = 1 / typical + np.arange(-count, count + 1) * step
    some = t if len(t) <= 3000 else t[:: len(t) // 1500]
    lengths = np.abs(_resultants(some, rates))
    best = rates[int(np.argmax(lengths))]
    fine = best + np.linspace(-step, step, 41)
    resultants = np.abs(_resultants(t, fine))
    place = int(np.argmax(resultants))
    if resultants[place] < max(LEAST_RESULTANT, 3.5 / np.sqrt(len(t))):
        return None
    return float(1 / fine[place])


def _resultants(t: Array, rates: Array) -> npt.NDArray[np.complex128]:
    """(m,) mean of the phases of all stamps at each rate; the rates are evenly spaced."""
    turn = np.exp(2j * np.pi * (rates[1] - rates[0]) * t)
    phase = np.exp(2j * np.pi * rates[0] * t)
    found = np.empty(len(rates), dtype=complex)
    for place in range(len(rates)):
        found[place] = phase.mean()
        phase *= turn
    return found


def _numbers(t: Array, line: Array) -> npt.NDArray[np.int64]:
    """Strictly increasing frame numbers; of two in one place the earlier is the late one."""
    nearest = np.round((t - line[0]) / line[1]).astype(np.int64)
    order = np.arange(len(t))
    return np.asarray(np.minimum.accumulate((nearest - order)[::-1])[::-1] + order)
