"""The noise of RTK fixes: one sigma for the plane, a larger one for the height."""

from dataclasses import dataclass

import numpy as np

from rtk_gt.receivers.steps import pair_differences, receiver_pairs
from validation.poses.angles import Array


@dataclass(frozen=True)
class GpsNoise:
    """Standard deviations of one receiver's position.

    Parameters
    ----------
    sigma : float
        Of x and of y, in metres (sigma_0 of Blanco 2009, Eq. 20).
    eta : float
        How many times larger that of z is.
    """

    sigma: float
    eta: float = 1.75

    @property
    def covariance(self) -> Array:
        """(3, 3) covariance of a position in a local frame, m^2."""
        return np.diag(np.array([1.0, 1.0, self.eta**2]) * self.sigma**2)


PUBLISHED_NOISE = GpsNoise(0.0064, 1.02 / 0.64)
"""Blanco 2009, Eq. 22: 0.64 cm and 1.02 cm. Their ratio is 1.59, not the eta = 1.75 of the text."""


def pair_incidence(receivers: int) -> Array:
    """(p, r) matrix S of pair differences: -1 at the first, +1 at the second receiver."""
    pairs = receiver_pairs(receivers)
    incidence = np.zeros((len(pairs), receivers))
    for row, (first, second) in enumerate(pairs):
        incidence[row, first], incidence[row, second] = -1.0, 1.0
    return incidence


def squared_distance_covariance(positions: Array, noise: GpsNoise) -> Array:
    """First-order covariance (..., p, p) of the squared distances between receivers, m^4.

    Parameters
    ----------
    positions : (..., r, 3) array
        True positions, or good estimates, in the local frame.
    noise : GpsNoise
        Of each receiver, independent.

    Notes
    -----
    F diag(sigma^2) F' of Blanco 2009, section 6.4, without the approximation that the receivers
    are at one height. For them at one height its (d12, d23) element is
    4 sigma_0^2 d12 d23 cos(angle at receiver 2), positive for an acute angle; the printed
    matrix has it negative.
    """
    difference = pair_differences(positions)
    incidence = pair_incidence(positions.shape[-2])
    shared = incidence @ incidence.T
    inner = np.einsum("...pa,ab,...qb->...pq", difference, noise.covariance, difference)
    return np.asarray(4 * shared * inner)


def published_squared_distance_covariance(distances: Array, sigma: float) -> Array:
    """The matrix printed after Eq. 27 of Blanco 2009 for three receivers, (3, 3), m^4.

    Parameters
    ----------
    distances : (3,) array
        d12, d13, d23 in the plane, in metres.
    sigma : float
        sigma_0.

    Notes
    -----
    For comparison only: with the angle at the shared receiver, as the text defines it, the
    printed sign of the (d12, d23) element is wrong.
    """
    d12, d13, d23 = distances
    at1 = (d12**2 + d13**2 - d23**2) / 2  # d12 d13 cos of the angle at receiver 1
    at2 = (d12**2 + d23**2 - d13**2) / 2
    at3 = (d13**2 + d23**2 - d12**2) / 2
    return (
        4
        * sigma**2
        * np.array([[2 * d12**2, at1, -at2], [at1, 2 * d13**2, at3], [-at2, at3, 2 * d23**2]])
    )


def sigma_from_distances(positions: Array, distances: Array, eta: float) -> tuple[float, float]:
    """sigma_0 from the scatter of squared distances, and its standard error; metres.

    Parameters
    ----------
    positions : (t, r, 3) array
        Corrected positions of t steps.
    distances : (p,) array
        The distances that the pairs should have.
    eta : float
        Ratio of the vertical to the horizontal sigma.

    Notes
    -----
    Blanco 2009, Eq. 21: the variance of d^2 is a function of sigma_0 and the geometry. It is
    known in closed form, 4 d'Cd + 2 tr(C^2) with C the covariance of the difference, so that no
    simulation is needed. Solved by fixed point; the pairs are pooled.
    """
    difference = pair_differences(positions)
    error = np.square(difference).sum(-1) - distances**2
    unit = np.diag([1.0, 1.0, eta**2])
    slope = 8 * np.einsum("tpa,ab,tpb->p", difference, unit, difference) / len(positions)
    squares = float(np.mean(error**2))
    variance = 0.0
    for _ in range(20):
        # Second moment about d^2: variance of first and second order, and the mean tr(C) squared.
        second = 2 * np.trace(4 * unit @ unit) + np.trace(2 * unit) ** 2
        noise_part = float(np.mean(slope)) + second * variance
        # The differences themselves hold noise, which the slope counts in.
        noise_part -= 8 * np.trace(2 * unit @ unit) * variance
        variance = squares / noise_part
    effective = max(len(positions) * min(len(distances), 3), 1)
    sigma = float(np.sqrt(variance))
    return sigma, sigma / np.sqrt(2 * effective)
