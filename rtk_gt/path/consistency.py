"""The measure of how well the measured antenna distances keep what a rigid vehicle allows."""

from dataclasses import dataclass

import numpy as np
from scipy import special

from rtk_gt.offsets.noise import (
    LEAST_SPREAD,
    GpsNoise,
    pair_incidence,
    squared_distance_covariance,
)
from rtk_gt.offsets.robust import autocorrelation_time
from rtk_gt.receivers.assumptions import CONFIDENCE
from rtk_gt.receivers.steps import pair_differences
from validation.poses.angles import Array


@dataclass(frozen=True)
class Consistency:
    """The measure q_t of each pose and what it says of the whole drive.

    Parameters
    ----------
    q : (t,) array
        Mahalanobis distance of the squared distances from what they should be.
    bound : float
        q stays below it with probability ``confidence`` at each single pose.
    confidence : float
        Of ``bound`` and of the flags.
    dof : int
        Degrees of freedom of q^2.
    share_beyond : float
        Share of the poses beyond the bound; 1 - confidence is expected.
    mean_square : float
        Mean of q^2 over its degrees of freedom; 1 is expected.
    mean_square_interval : (float, float)
        Where that mean falls with the confidence, for the autocorrelation found.
    correlation_time : float
        How many poses one independent pose is worth; 1 for white noise.
    bias : (p,) array
        Mean distance minus the constant one of each pair, metres.
    bias_sigma : (p,) array
        Its standard error, for the autocorrelation found.
    """

    q: Array
    bound: float
    confidence: float
    dof: int
    share_beyond: float
    mean_square: float
    mean_square_interval: tuple[float, float]
    correlation_time: float
    bias: Array
    bias_sigma: Array

    @property
    def biased(self) -> Array:
        """(p,) True where a distance is off by more than chance, all pairs counted."""
        limit = -special.ndtri((1 - self.confidence) / 2 / len(self.bias))
        return np.asarray(np.abs(self.bias) > limit * self.bias_sigma)


def consistency(
    positions: Array, distances: Array, noise: GpsNoise, confidence: float = CONFIDENCE
) -> Consistency:
    """The measure of Blanco 2009, Eq. 28, with the bound that a chi-squared variable has.

    Parameters
    ----------
    positions : (t, r, 3) array
        Corrected positions of the antennas, metres, local frame.
    distances : (p,) array
        The constant distances of the pairs, metres.
    noise : GpsNoise
        Of each receiver.
    confidence : float
        Of the bound and the flags.

    Notes
    -----
    The covariance is taken at each pose from the geometry there, so that slopes need no excuse.
    Noise makes squared distances too long by the trace of its covariance on average; this is
    taken off.
    """
    difference = pair_differences(positions)
    incidence = pair_incidence(positions.shape[1])
    too_long = np.diagonal(incidence @ incidence.T) * np.trace(noise.covariance)
    error = np.square(difference).sum(-1) - too_long - distances**2
    squares, dof = _normalised(error, squared_distance_covariance(positions, noise), noise)
    tau = autocorrelation_time(error)
    return _judged(squares, dof, error / (2 * distances), tau, confidence)


def _normalised(error: Array, covariance: Array, noise: GpsNoise) -> tuple[Array, int]:
    """Squared Mahalanobis distances (t,), and their degrees of freedom.

    Four and more antennas near one plane have combinations of distances that noise changes in
    second order only. They are far from Gaussian and left out: 5 of the 6 distances of four
    antennas count, 7 of the 10 of five.
    """
    spreads, directions = np.linalg.eigh(covariance)
    counted = (spreads > LEAST_SPREAD * spreads[:, -1:]).sum(1)
    dof = int(np.median(counted))
    along = np.einsum("tpk,tp->tk", directions[:, :, -dof:], error)
    pair = 2 * noise.covariance
    second = 2 * float(np.trace(pair @ pair))
    return np.asarray((along**2 / (spreads[:, -dof:] + second)).sum(1)), dof


def _judged(squares: Array, dof: int, error: Array, tau: float, confidence: float) -> Consistency:
    """Statistics of the squared measure and of the distances' errors."""
    t = len(squares)
    bound = float(np.sqrt(special.chdtri(dof, 1 - confidence)))
    q = np.sqrt(squares)
    free = max(t / tau, 1.0) * dof
    tail = (1 - confidence) / 2
    low, high = special.chdtri(free, [1 - tail, tail]) / free
    return Consistency(
        q=q,
        bound=bound,
        confidence=confidence,
        dof=dof,
        share_beyond=float(np.mean(q > bound)),
        mean_square=float(squares.mean() / dof),
        mean_square_interval=(float(low), float(high)),
        correlation_time=tau,
        bias=error.mean(0),
        bias_sigma=error.std(0, ddof=1) * np.sqrt(tau / t),
    )
