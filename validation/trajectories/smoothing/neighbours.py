"""Noise that lasts from frame to frame: what a pose is worth among its neighbours."""

from dataclasses import replace

import numpy as np

from validation.poses.angles import Array
from validation.trajectories.smoothing.geometry import lengths
from validation.trajectories.smoothing.noise import Noise
from validation.trajectories.smoothing.problem import Mask, Problem, State, frame_residuals

MOST_LAGS = 20
"""Frames back that a correlation is followed: two seconds at 10 Hz."""
SIGNIFICANT, LEAST = 2.5, 0.08
"""Standard deviations of a correlation of white noise, 1/sqrt(n), and the correlation at which
following ends. Residuals of white noise are correlated by some hundredths, because the fused
trajectory's own error is in them: on drives with white noise that alone grew variances by a
fifth."""
LEAST_GROWTH = 1.4
"""Below, residuals are taken as those of white noise; cameras alone reach 1.2 with it."""
MOST_GROWTH = 25.0
"""Of a variance: a noise that lasts longer than a dozen frames is an error of the source, which no
average of its frames makes smaller."""


def grown_by_neighbours(problem: Problem, state: State, noise: Noise, good: Mask) -> Noise:
    """Noise as large as independent frames would need it to be worth as much.

    Parameters
    ----------
    problem, state : Problem, State
        Where the residuals are taken.
    noise : Noise
        Of single frames.
    good : (f,) array of bool
        Frames that are no outliers.

    Notes
    -----
    A mean over many frames with correlations r_k has the variance of one times
    ``1 + 2 sum r_k`` over their number; each frame's covariance is multiplied by it. The
    correlations are followed until the first that white noise could have.
    """
    seen, _, _ = frame_residuals(problem, state)
    d, times = lengths(problem.kind), problem.times[problem.frames.knot]
    position, angle = noise.position.copy(), noise.angle.copy()
    for source in range(problem.count):
        rows = np.flatnonzero((problem.frames.source == source) & good)
        if len(rows) < 2 * MOST_LAGS:
            continue
        position[source] *= np.sqrt(_growth(times[rows], seen[rows, :d]))
        if seen.shape[1] > d:
            angle[source] *= np.sqrt(_growth(times[rows], seen[rows, d:]))
    return replace(noise, position=position, angle=angle)


def _growth(times: Array, values: Array) -> float:
    """One plus twice the sum of the correlations of (f, c) residuals in time."""
    interval = float(np.median(np.diff(times)))
    variance = float(np.mean(values**2))
    if variance == 0:  # poses that fit to the last digit
        return 1.0
    total = 0.0
    for lag in range(1, MOST_LAGS + 1):
        near = times[lag:] - times[:-lag] < (lag + 0.5) * interval
        count = int(near.sum())
        if count < MOST_LAGS:
            break
        products = (values[lag:] * values[:-lag])[near]
        correlation = float(products.mean()) / variance
        if correlation < max(SIGNIFICANT / np.sqrt(products.size), LEAST):
            break
        total += correlation
    growth = 1 + 2 * total
    return min(growth, MOST_GROWTH) if growth > LEAST_GROWTH else 1.0
