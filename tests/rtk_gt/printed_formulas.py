"""Formulas as Blanco 2009 prints them, where the toolkit departs from them."""

import numpy as np

from validation.poses.angles import Array


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


def rotated_covariance(reference: Array, rotation: Array) -> Array:
    """W* turned to an orientation (..., 6, 6), as published (Blanco 2009, Eq. 24 and 25).

    The positions' block is turned, the angles' is not. On slopes this turns the noise with the
    vehicle, although it belongs to the vertical; `noise_covariance` does not.
    """
    J = np.zeros((*rotation.shape[:-2], 6, 6))
    J[..., :3, :3] = rotation
    J[..., 3:, 3:] = np.eye(3)
    return np.asarray(J @ reference @ np.swapaxes(J, -1, -2))
