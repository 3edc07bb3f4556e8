"""Closed forms in the plane: circles that meet, positions from distances, rigid alignment."""

import numpy as np

from validation.poses.angles import Array

ELLIPSE_SIGMAS = 3.0
"""Ellipses are shown at so many standard deviations, as in the document."""


def circle_intersections(centres: Array, radii: Array) -> Array:
    """Both points at which two circles meet.

    Parameters
    ----------
    centres : (..., 2, 2) array
        The two centres, one a row, in metres, in the Vframe.
    radii : (..., 2) array
        Their radii, in metres.

    Returns
    -------
    (..., 2, 2) array
        The two solutions, mirror images in the line through the centres. Where noise keeps the
        circles apart, both are the point of the line nearest to the two circles.

    Raises
    ------
    ValueError
        If the centres coincide: any point of the circle would do.

    Notes
    -----
    Initial guess for the world points, AD2.3, "Determination of the coordinates of the
    world-points". Error of the solution grows without bound as the three points line up.
    """
    centres, radii = np.asarray(centres, dtype=float), np.asarray(radii, dtype=float)
    base = centres[..., 1, :] - centres[..., 0, :]
    length = np.linalg.norm(base, axis=-1)
    if (length == 0).any():
        raise ValueError("the centres of two circles coincide")
    along = (length**2 + radii[..., 0] ** 2 - radii[..., 1] ** 2) / (2 * length)
    across = np.sqrt(np.maximum(radii[..., 0] ** 2 - along**2, 0.0))
    unit = base / length[..., None]
    normal = np.stack([-unit[..., 1], unit[..., 0]], axis=-1)
    foot = centres[..., 0, :] + along[..., None] * unit
    offset = across[..., None] * normal
    return np.stack([foot + offset, foot - offset], axis=-2)


def multilaterate(centres: Array, distances: Array) -> Array:
    """The position that fits distances to three or more points, without a first guess.

    Parameters
    ----------
    centres : (..., m, 2) array
        Known points, metres.
    distances : (..., m) array
        Measured distances to them, metres.

    Returns
    -------
    (..., 2) array
        Metres. Where the centres lie on a line, the point of the line nearest to the two mirror
        solutions.

    Notes
    -----
    Subtracting the mean of the equations |c_i - p|^2 = d_i^2 leaves linear ones in p, solved by
    least squares. Noise is weighted as it comes, so the result is a first guess only.
    """
    mean = centres.mean(-2, keepdims=True)
    c = centres - mean
    right = ((c**2).sum(-1) - distances**2) / 2
    right = right - right.mean(-1, keepdims=True)
    solution = np.linalg.pinv(c, rcond=1e-6) @ right[..., None]
    return np.asarray(solution[..., 0] + mean[..., 0, :])


def rigid_alignment(body: Array, world: Array) -> Array:
    """The planar pose that carries body points onto world points best.

    Parameters
    ----------
    body, world : (..., m, 2) array
        Matching points, m >= 2, in the robot frame and in the Vframe, metres.

    Returns
    -------
    (..., 3) array
        x, y, theta of the robot frame in the Vframe. Handedness is kept: a mirrored triangle is
        never turned over to fit.

    Notes
    -----
    Closed form of the orthogonal Procrustes problem in the plane.
    """
    body_mean, world_mean = body.mean(-2), world.mean(-2)
    b, w = body - body_mean[..., None, :], world - world_mean[..., None, :]
    cross = (b[..., 0] * w[..., 1] - b[..., 1] * w[..., 0]).sum(-1)
    dot = (b * w).sum((-2, -1))
    theta = np.arctan2(cross, dot)
    origin = world_mean - rotate(theta, body_mean)
    return np.concatenate([origin, theta[..., None]], axis=-1)


def rotate(theta: Array, points: Array) -> Array:
    """Points turned about the origin.

    Parameters
    ----------
    theta : (...) array
        Radians, counter-clockwise.
    points : (..., 2) array
        Metres; leading axes broadcast against ``theta``.
    """
    c, s = np.cos(theta), np.sin(theta)
    x, y = points[..., 0], points[..., 1]
    return np.moveaxis(np.stack([c * x - s * y, s * x + c * y]), 0, -1)


def mirror_in_line(points: Array, line_points: Array) -> Array:
    """Points mirrored in the principal axis of a set of points.

    Parameters
    ----------
    points : (..., 2) array
        Metres.
    line_points : (m, 2) array
        Points whose principal axis is the mirror.
    """
    mean = line_points.mean(0)
    _, _, axes = np.linalg.svd(line_points - mean)
    normal = axes[1]
    return np.asarray(points - 2 * ((points - mean) @ normal)[..., None] * normal)


def ellipse_axes(covariance: Array) -> tuple[float, float, float]:
    """Half axes and direction of the 1-sigma ellipse of x and y.

    Parameters
    ----------
    covariance : (k, k) array
        Its first two rows are x and y, square metres.

    Returns
    -------
    tuple of float
        Long and short half axis in metres, and the direction of the long one in radians.
    """
    values, vectors = np.linalg.eigh(covariance[:2, :2])
    short, long = np.sqrt(np.maximum(values, 0.0))
    return float(long), float(short), float(np.arctan2(vectors[1, 1], vectors[0, 1]))
