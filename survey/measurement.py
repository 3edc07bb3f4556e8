"""The measurement equation of a distance, and its derivatives.

A reading d between a known point v and a point p of a frame (x, y, theta) says

    h = |v - p|^2 - d^2 = 0,    p = (x, y) + Rot(theta) r

with r in the robot frame; a world point is the case r = 0. H is the derivative of h by the
unknowns, W that by what was measured: d, v and r. AD2.3, listings of the two filters.
"""

from typing import NamedTuple

import numpy as np

from survey.geometry import rotate
from validation.angles import Array


class Linearised(NamedTuple):
    """h and its derivatives at given unknowns, for m readings.

    ``h`` (..., m); ``H_position`` (..., m, 2) and ``H_heading`` (..., m) by the unknowns;
    ``W_distance`` (..., m), ``W_known`` (..., m, 2) and ``W_body`` (..., m, 2) by d, v and r.
    """

    h: Array
    H_position: Array
    H_heading: Array
    W_distance: Array
    W_known: Array
    W_body: Array


def linearise(state: Array, known: Array, body: Array, distance: Array) -> Linearised:
    """The implicit distance equation and its derivatives.

    Parameters
    ----------
    state : (..., 3) array
        x, y in metres, theta in radians, in the Vframe.
    known : (..., m, 2) array
        The known point of each reading, Vframe, metres.
    body : (..., m, 2) array
        The rig point of each reading, robot frame, metres.
    distance : (..., m) array
        Metres.

    Notes
    -----
    With delta = v - p: dh/d(x, y) = -2 delta, dh/dtheta = -2 delta . dp/dtheta,
    dh/dd = -2 d, dh/dv = 2 delta, dh/dr = -2 Rot(theta)^T delta.
    """
    theta = state[..., 2, None]
    arm = rotate(theta, body)
    delta = known - state[..., None, :2] - arm
    h = (delta**2).sum(-1) - distance**2
    by_heading = -2 * (delta[..., 1] * arm[..., 0] - delta[..., 0] * arm[..., 1])
    return Linearised(
        h, -2 * delta, by_heading, -2 * distance, 2 * delta, -2 * rotate(-theta, delta)
    )


def independent_variance(
    at: Linearised, sigma: Array, known_sigma: Array | float, body_sigma: Array | float
) -> Array:
    """Variance of h, every reading on its own: diag(W R W^T).

    Parameters
    ----------
    at : Linearised
        Derivatives.
    sigma : (m,) array
        Standard deviation of the distances, metres.
    known_sigma, body_sigma : (m,) array or float
        Standard deviation of each coordinate of the known and of the rig points, metres.

    Returns
    -------
    (..., m) array
        Square metres squared.
    """
    known = (at.W_known**2).sum(-1) * np.square(known_sigma)
    body = (at.W_body**2).sum(-1) * np.square(body_sigma)
    return np.asarray(at.W_distance**2 * np.square(sigma) + known + body)
