"""Delays at which the rates of two paths look alike, whatever their frames and mounts are."""

from dataclasses import dataclass

import numpy as np
from scipy import fft

from validation.poses.angles import Array
from validation.trajectories.clock.continuous import ContinuousPath

STEP = 0.05
"""Seconds of the grid: a twentieth of the second in which a robot changes its rates."""
LEAST_OVERLAP = 5.0
"""Seconds that both paths must have in common; shorter pieces of two paths look alike by chance."""
INDEPENDENT = 1.0
"""Seconds after which rates are counted as new information."""
LEAST_SCORE = 0.15
"""Of the highest, below which a peak is no start. On ordinary drives chance makes 0.005 to 0.03 of
it, and laps that repeat make 0.5 and more."""


@dataclass(frozen=True)
class Peaks:
    """Delays at which rates agree, the best first.

    Parameters
    ----------
    delays : (k,) array
        Seconds.
    scores : (k,) array
        Log likelihood ratio against no relation, roughly.
    """

    delays: Array
    scores: Array


def starting_peaks(
    reference: ContinuousPath, source: ContinuousPath, window: float, most: int = 8
) -> Peaks:
    """Delays within the window at which speeds and turn rates of two paths agree.

    Parameters
    ----------
    reference, source : ContinuousPath
        On the same scale of time.
    window : float
        Seconds, to both sides of zero.
    most : int
        Peaks wanted.

    Notes
    -----
    Correlation with the means of the common part taken out, over what both have: gaps do not
    count. Turn rates are the same in every frame and on every mount; speeds nearly so.
    """
    start = min(reference.times[0], source.times[0] - window)
    stop = max(reference.times[-1], source.times[-1] + window)
    if stop - start > 40 * 3600:
        # Only the part of the longer record that the window can reach.
        start = max(start, source.times[0] - 2 * window)
        stop = min(stop, source.times[-1] + 2 * window)
    grid = np.arange(start, stop, STEP)
    if len(grid) < 2:
        return Peaks(np.empty(0), np.empty(0))
    size = fft.next_fast_len(2 * len(grid), real=True)
    lags = int(window / STEP)
    one, two = _rates(reference, grid), _rates(source, grid)
    total = np.zeros(2 * lags + 1)
    for a, b in zip(one, two, strict=True):
        if a is None or b is None:
            continue
        total += _score(a, b, size, lags)
    delays = np.asarray(np.arange(-lags, lags + 1) * STEP)
    return _highest(delays, total, most)


def _rates(path: ContinuousPath, grid: Array) -> list[tuple[Array, Array] | None]:
    """Turn rate and speed on the grid, each with its mask."""
    mask = path.supported(grid)
    values = np.zeros((len(grid), 3))
    values[mask] = path.at(grid[mask])[1]
    turn = (np.clip(values[:, 2], -4, 4), mask.astype(float)) if path.has_heading else None
    speed = np.clip(np.hypot(values[:, 0], values[:, 1]), 0, 50)
    return [turn, (speed, mask.astype(float)) if path.has_position else None]


def _score(one: tuple[Array, Array], two: tuple[Array, Array], size: int, lags: int) -> Array:
    """Likelihood ratio of each delay of the second signal."""
    (a, ma), (b, mb) = one, two
    fa = [fft.rfft(part, size) for part in (ma, a * ma, a * a * ma)]
    fb = [np.conj(fft.rfft(part, size)) for part in (mb, b * mb, b * b * mb)]

    def lagged(i: int, j: int) -> Array:
        full = fft.irfft(fa[i] * fb[j], size)
        return np.concatenate([full[-lags:] if lags else full[:0], full[: lags + 1]])

    count = np.maximum(lagged(0, 0), 1e-9)
    ea, eb = lagged(1, 0) / count, lagged(0, 1) / count
    va = np.maximum(lagged(2, 0) / count - ea**2, 1e-12)
    vb = np.maximum(lagged(0, 2) / count - eb**2, 1e-12)
    rho = np.clip((lagged(1, 1) / count - ea * eb) / np.sqrt(va * vb), 0, 0.9999)
    rho[count * STEP < LEAST_OVERLAP] = 0.0
    return np.asarray(-0.5 * count * STEP / INDEPENDENT * np.log(1 - rho**2))


def _highest(delays: Array, score: Array, most: int) -> Peaks:
    """The highest local maxima, at least half a second apart."""
    padded = np.concatenate([[-np.inf], score, [-np.inf]])
    tops = np.flatnonzero((score >= padded[:-2]) & (score > padded[2:]) & (score > 0))
    found: list[int] = []
    for place in tops[np.argsort(score[tops])[::-1]]:
        if all(abs(delays[place] - delays[other]) >= 0.5 for other in found):
            found.append(int(place))
        if len(found) == most or score[place] < LEAST_SCORE * score[found[0]]:
            break
    return Peaks(delays[found], score[found])
