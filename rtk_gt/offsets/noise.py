"""The noise of RTK fixes: one sigma for the plane, a larger one for the height."""

from dataclasses import dataclass

import numpy as np

from rtk_gt.receivers.assumptions import ETA
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
    eta: float = ETA

    @property
    def covariance(self) -> Array:
        """(3, 3) covariance of a position in a local frame, m^2."""
        return np.diag(np.array([1.0, 1.0, self.eta**2]) * self.sigma**2)


LEAST_SPREAD = 0.02
"""Combinations of distances with less than this share of the greatest variance do not count: noise
changes them in the second order only. Of four and five antennas on the roof of the simulated
vehicle such shares are below 0.0004, those of all other combinations above 0.15."""
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
