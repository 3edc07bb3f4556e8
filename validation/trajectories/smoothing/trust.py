"""How likely each frame is to be no outlier, and which headings are off by half a turn."""

import numpy as np

from validation.poses.angles import Array
from validation.poses.trajectory import Kind
from validation.trajectories.smoothing.geometry import difference, half_turn, lengths
from validation.trajectories.smoothing.problem import Frames, Mask, Rows

WIDE = 10.0
"""Standard deviations of an outlier over those of other frames. With a share of 2 % of outliers a
frame counts half at 4.6 standard deviations in the plane, which 8 in 100,000 good ones pass; of the
outliers that are less than 10 times the noise, which do little harm, some are missed."""
RANGE = (0.002, 0.3)
"""Shares of outliers that are assumed at least and at most: none seen so far is no proof."""


def trust(squares: Array, source: Rows, shares: Array, m: int) -> Array:
    """(f,) probability of each frame to be no outlier.

    Parameters
    ----------
    squares : (f,) array
        Squared residuals over their covariance: chi-square with m freedoms for good frames.
    source : (f,) array of int
        Source of each frame.
    shares : (q,) array
        Share of outliers of each source.
    m : int
        Numbers of a pose's error.
    """
    odds = np.log(shares / (1 - shares))[source] - m * np.log(WIDE)
    odds = odds + squares / 2 * (1 - WIDE**-2)
    return np.asarray(1 / (1 + np.exp(np.minimum(odds, 700.0))))


def outlier_shares(trusted: Array, source: Rows, count: int) -> Array:
    """(q,) share of outliers in each source."""
    frames = np.maximum(np.bincount(source, minlength=count), 1)
    return np.clip(np.bincount(source, 1 - trusted, count) / frames, *RANGE)


def flipped(kind: Kind, seen: Array) -> Mask:
    """(f,) whether residuals (f, m) have an angle nearer to half a turn than to none."""
    d = lengths(kind)
    if seen.shape[1] == d:
        return np.zeros(len(seen), dtype=bool)
    return np.asarray(np.linalg.norm(seen[:, d:], axis=1) > np.pi / 2)


def unflip(kind: Kind, frames: Frames, poses: Array) -> Mask:
    """(f,) whether half a turn about the moving Z axis brings a frame nearer to poses (f, k)."""
    off = flipped(kind, difference(kind, frames.poses, poses))
    rows = np.flatnonzero(off)
    if len(rows):
        turned = half_turn(kind, frames.poses[rows])
        off[rows] = ~flipped(kind, difference(kind, turned, poses[rows]))
    return off
