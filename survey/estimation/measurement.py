"""The measurement equation of a distance, and its derivatives.

A reading d between a known point v and a point p of a frame (x, y, theta) says

    h = |v - p|^2 - d^2 = 0,    p = (x, y) + Rot(theta) r

with r in the robot frame; a world point is the case r = 0. H is the derivative of h by the
unknowns, W that by what was measured: d, v and r. AD2.3, listings of the two filters.
"""

from dataclasses import dataclass

import numpy as np

from survey.estimation.geometry import rotate
from validation.poses.angles import Array


@dataclass(frozen=True)
class Linearised:
    """h and its derivatives at given unknowns, for m readings.

    Parameters
    ----------
    h : (..., m) array
        Square metres.
    H : (..., m, 3) array
        Its derivative by x, y, theta. Each of the three lies in memory in one piece, which is
        what makes large batches quick.
    squared_range : (..., m) array
        |v - p|^2, square metres.
    distance : (..., m) array
        Measured, metres.
    theta : (...) array
        Heading, radians.
    """

    h: Array
    H: Array
    squared_range: Array
    distance: Array
    theta: Array

    @property
    def H_position(self) -> Array:
        """(..., m, 2) derivative by x, y."""
        return self.H[..., :2]

    @property
    def H_heading(self) -> Array:
        """(..., m) derivative by theta."""
        return self.H[..., 2]

    @property
    def W_distance(self) -> Array:
        """(..., m) derivative by the distance."""
        return -2 * self.distance

    @property
    def W_known(self) -> Array:
        """(..., m, 2) derivative by the known point."""
        return -self.H_position

    @property
    def W_body(self) -> Array:
        """(..., m, 2) derivative by the rig point, in the robot frame."""
        return rotate(-self.theta[..., None], self.H_position)


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
    theta = state[..., 2]
    arm = rotate(theta[..., None], body)
    dx = known[..., 0] - (state[..., 0, None] + arm[..., 0])
    dy = known[..., 1] - (state[..., 1, None] + arm[..., 1])
    squared_range = dx * dx + dy * dy
    H = np.empty((3, *dx.shape))
    np.multiply(dx, -2.0, out=H[0])
    np.multiply(dy, -2.0, out=H[1])
    np.multiply(H[1], arm[..., 0], out=H[2])
    H[2] -= H[0] * arm[..., 1]
    return Linearised(
        h=squared_range - distance**2,
        H=np.moveaxis(H, 0, -1),
        squared_range=squared_range,
        distance=np.asarray(distance),
        theta=theta,
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

    Notes
    -----
    |W_known|^2 = |W_body|^2 = 4 |v - p|^2, a turn changing no length.
    """
    of_points = 4 * (np.square(known_sigma) + np.square(body_sigma))
    return np.asarray((2 * at.distance * sigma) ** 2 + at.squared_range * of_points)
