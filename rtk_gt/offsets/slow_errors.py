"""White errors of receivers with slow ones beside them, and what these do to sums over a drive."""

from dataclasses import dataclass

import numpy as np

from validation.poses.angles import Array

MOST_NUMBERS = 600
"""Means of blocks of distances that are weighed together: their covariance is inverted some sixty
times, which takes a second."""


FEWEST_WORTH = 16
"""Independent fixes that a record is worth at least: of straight roads of eight memories five of
six were solved rightly with it, and all refused with 4."""


@dataclass(frozen=True)
class ErrorModel:
    """Errors of each receiver: white, and slow ones that lose their memory.

    Parameters
    ----------
    white : float
        Horizontal sigma of what is new at each epoch, metres.
    slow : (k,) array
        Horizontal sigma of a first-order process, of each of k models that fit, metres.
    memory : (k,) array
        Seconds in which it loses 63 % of its memory.
    weights : (k,) array
        Of the models; their sum is 1.
    """

    white: float
    slow: Array
    memory: Array
    weights: Array

    @property
    def slow_sigma(self) -> float:
        """Sigma of the slow part, the geometric mean of the models', metres."""
        return float(np.exp(self.weights @ np.log(self.slow)))

    @property
    def sigma(self) -> float:
        """Of one fix, metres."""
        return float(np.hypot(self.white, self.slow_sigma))

    @property
    def white_share(self) -> float:
        """Share of the variance of a fix that is new at each epoch."""
        return (self.white / self.sigma) ** 2

    def worth(self, times: Array) -> float:
        """How many fixes one independent one is worth, for what changes slowly.

        What the residuals show of that is too little in a short record, as offsets were fitted.
        """
        every = float(np.median(np.diff(times)))
        found = 1 + (1 - self.white_share) * 2 * self.lasting / every
        return float(np.clip(found, 1.0, len(times) / FEWEST_WORTH))

    @property
    def lasting(self) -> float:
        """Seconds that the slow part lasts: the mean of the models' logarithms, by variance."""
        share = self.weights * self.slow**2
        return float(np.exp(share @ np.log(self.memory) / share.sum()))


def mean_memory(length: float, memory: float) -> tuple[float, float]:
    """Variance of the mean of a first-order process over a block, for a variance of 1.

    The second number is what the exponential of the distance of two blocks' middles is multiplied
    by for the covariance of their means.
    """
    y = length / memory
    if y < 1e-3:
        return 1 - y / 3, 1.0
    return float(2 * (y - 1 + np.exp(-y)) / y**2), float((np.sinh(y / 2) / (y / 2)) ** 2)


def summed_covariance(times: Array, scores: Array, model: ErrorModel) -> Array:
    """Covariance (k, k) of sums over time of scores times the slow errors of the receivers.

    Parameters
    ----------
    times : (t,) array
        Seconds, increasing.
    scores : (t, k, c) array
        Scores of c independent errors of a sigma of 1.
    model : ErrorModel
        With the slow errors' sigmas and memories.
    """
    count = min(MOST_NUMBERS, len(times))
    edges = np.arange(count) * len(times) // count
    sums = np.add.reduceat(scores, edges, axis=0)
    sizes = np.diff(np.append(edges, len(times)))
    middle = np.add.reduceat(times, edges) / sizes
    length = float(np.median(np.diff(middle))) if count < len(times) else 0.0
    lags = np.abs(middle[:, None] - middle)
    found = np.zeros((scores.shape[1], scores.shape[1]))
    for slow, memory, weight in zip(model.slow, model.memory, model.weights, strict=True):
        same, other = mean_memory(length, memory)
        kept = np.where(np.eye(count) > 0, same, other * np.exp(-lags / memory))
        found += weight * slow**2 * np.einsum("bkc,bd,dlc->kl", sums, kept, sums, optimize=True)
    return found
