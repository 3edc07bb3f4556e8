"""Lenses beside Brown's: the rational one, and Kannala and Brandt's for fisheye lenses.

Their parameters are thirteen: the nine of Brown's lens; which lens it is (0: rational, 1: fisheye);
and k4, k5, k6 of the rational one, which adjustments hold fixed. A fisheye lens has its k1, k2, k3
and k4 in the places of Brown's k1, k2, p1 and p2, and nothing in that of k3. Image points are those
of a plane, so what is seen 90 degrees off the axis and more has none.
"""

from typing import Literal

import numpy as np

from validation.poses.angles import Array

LensName = Literal["brown", "rational", "fisheye"]
COUNT = 13
"""Parameters of these lenses, with the nine that all have in front."""
KIND = 9
"""Which of them says whether it is a fisheye lens."""
_NEAR_AXIS = 1e-8
"""Squared distance from the axis below which the series is as good as doubles are."""
_STEPS = 30
_MISS = 1e-12
"""Radians."""


def thirteen(parameters: Array) -> Array:
    """(..., 13) parameters of Brown's lens, or of any, with all that the others have."""
    values = np.asarray(parameters, dtype=float)
    if values.shape[-1] == COUNT:
        return values
    more = np.zeros((*values.shape[:-1], COUNT - values.shape[-1]))
    return np.concatenate([values, more], axis=-1)


def lens_of(parameters: Array) -> LensName:
    """Which lens parameters (9,) or (13,) are of."""
    if len(parameters) < COUNT or not parameters[KIND:].any():
        return "brown"
    return "fisheye" if parameters[KIND] else "rational"


def fisheye_parameters(focal: Array, coefficients: Array) -> Array:
    """(13,) of fx, fy, cx, cy and k1 to k4."""
    return np.concatenate([focal, coefficients, [0.0, 1.0, 0.0, 0.0, 0.0]])


def rational_parameters(focal: Array, coefficients: Array) -> Array:
    """(13,) of fx, fy, cx, cy and k1, k2, p1, p2, k3, k4, k5, k6."""
    return np.concatenate([focal, coefficients[:5], [0.0], coefficients[5:8]])


def is_fisheye(coefficients: Array) -> Array:
    """(...) whether coefficients (..., 9), without focal lengths and centre, are a fisheye's."""
    return np.asarray(coefficients[..., KIND - 4] > 0)


def denominator(r2: Array, coefficients: Array) -> tuple[Array, Array]:
    """What the rational lens divides by, 1 + k4 r^2 + k5 r^4 + k6 r^6, and its slope by r^2."""
    k4, k5, k6 = (coefficients[..., i] for i in (6, 7, 8))
    return 1 + r2 * (k4 + r2 * (k5 + r2 * k6)), k4 + r2 * (2 * k5 + 3 * k6 * r2)


def fisheye(normalised: Array, coefficients: Array) -> tuple[Array, Array, Array]:
    """Where a fisheye lens puts undistorted image points, and its derivatives.

    Parameters
    ----------
    normalised : (..., 2) array
        Undistorted image coordinates x / z, y / z.
    coefficients : (..., 4 or more) array
        k1, k2, k3, k4 first.

    Returns
    -------
    points : (..., 2) array
        Distorted coordinates.
    slopes : (..., 2, 2) array
        Their derivative by the undistorted ones.
    by_coefficients : (..., 2, 5) array
        Their derivative by the coefficients; the fifth is none.

    Notes
    -----
    With r = tan(theta) a point is put at theta (1 + k1 theta^2 + ... + k4 theta^8) from the axis.
    J. Kannala and S. Brandt, PAMI 28 (2006), equation 6, as OpenCV, Kalibr and ROS have it.
    """
    x, y = normalised[..., 0], normalised[..., 1]
    r2 = x * x + y * y
    near = r2 < _NEAR_AXIS
    r = np.sqrt(np.where(near, 1.0, r2))
    theta = np.arctan(r)
    reached, slope = _theta(theta, coefficients)
    first = coefficients[..., 0] - 1 / 3
    scale = np.where(near, 1 + first * r2, reached / r)
    bend = np.where(near, 2 * first, (slope / (1 + r2) - reached / r) / np.where(near, 1.0, r2))
    slopes = bend[..., None, None] * normalised[..., None] * normalised[..., None, :]
    slopes = slopes + scale[..., None, None] * np.eye(2)
    powers = [np.where(near, r2**i, theta ** (2 * i + 1) / r) for i in (1, 2, 3, 4)]
    by = np.stack([*powers, np.zeros_like(r2)], axis=-1)
    return scale[..., None] * normalised, slopes, normalised[..., None] * by[..., None, :]


def without_fisheye(points: Array, coefficients: Array) -> Array:
    """Undistorted image points (..., 2) of distorted ones; NaN 90 degrees off the axis and more.

    Parameters
    ----------
    points : (..., 2) array
        Distorted coordinates.
    coefficients : (..., 4 or more) array
        k1, k2, k3, k4 first.
    """
    radius = np.hypot(points[..., 0], points[..., 1])
    theta = np.minimum(radius, np.pi / 2)
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            reached, slope = _theta(theta, coefficients)
            change = (radius - reached) / slope
            theta = np.clip(theta + change, 0.0, np.pi / 2)
            if not np.nanmax(np.abs(change), initial=0.0) > _MISS:
                break
        reached, slope = _theta(theta, coefficients)
        bad = ~((np.abs(reached - radius) < 1e-9) & (slope > 0) & (theta < np.pi / 2))
        scale = np.where(radius > 0, np.tan(theta) / np.where(radius > 0, radius, 1.0), 1.0)
    return np.where(bad[..., None], np.nan, scale[..., None] * points)


def _theta(theta: Array, coefficients: Array) -> tuple[Array, Array]:
    """How far from the axis a fisheye lens puts an angle, and the derivative."""
    k1, k2, k3, k4 = (coefficients[..., i] for i in range(4))
    t2 = theta * theta
    reached = theta * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
    return reached, 1 + t2 * (3 * k1 + t2 * (5 * k2 + t2 * (7 * k3 + 9 * t2 * k4)))
