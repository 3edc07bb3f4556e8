"""Rigid motions in the plane, (x, y, theta) with a leading batch axis.

A pose ``T_a_b = (x, y, theta)`` maps coordinates in b to coordinates in a. Covariances of poses
are in (x, y, theta) along the axes of a, to first order.
"""

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array, wrap

CONTRADICTION = 16.27
"""Squared distance of two poses in standard deviations, beyond which they contradict each other:
the 99.9 % quantile of chi-squared with 3 degrees of freedom."""


def wrapped(pose: npt.ArrayLike) -> Array:
    """Poses, or differences of poses, (..., 3), with their angles in (-pi, pi]."""
    result = np.array(pose, dtype=float)
    result[..., 2] = wrap(result[..., 2])
    return result


def rotation(theta: npt.ArrayLike) -> Array:
    """(..., 2, 2) rotation matrices of angles in radians."""
    result = np.empty((*np.shape(theta), 2, 2))
    result[..., 0, 0] = result[..., 1, 1] = np.cos(theta)
    result[..., 1, 0] = np.sin(theta)
    result[..., 0, 1] = -result[..., 1, 0]
    return result


def transform(pose: Array, points: Array) -> Array:
    """Points in b, given in a.

    Parameters
    ----------
    pose : (..., 3) array
        T_a_b.
    points : (n, 2) or (..., n, 2) array
        Coordinates in b, in metres.

    Returns
    -------
    (..., n, 2) array
        Coordinates in a.
    """
    pose = np.asarray(pose, dtype=float)
    cosine, sine = np.cos(pose[..., 2, None]), np.sin(pose[..., 2, None])
    x, y = points[..., 0], points[..., 1]
    result = np.empty((*np.broadcast_shapes(cosine.shape, x.shape), 2))
    result[..., 0] = cosine * x - sine * y + pose[..., 0, None]
    result[..., 1] = sine * x + cosine * y + pose[..., 1, None]
    return result


def compose(first: npt.ArrayLike, second: npt.ArrayLike) -> Array:
    """T_a_c from T_a_b and T_b_c, each (..., 3); the angle is in (-pi, pi]."""
    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    cosine, sine = np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack(
        [
            a[..., 0] + cosine * b[..., 0] - sine * b[..., 1],
            a[..., 1] + sine * b[..., 0] + cosine * b[..., 1],
            wrap(a[..., 2] + b[..., 2]),
        ],
        axis=-1,
    )


def inverse(pose: npt.ArrayLike) -> Array:
    """T_b_a from T_a_b, (..., 3)."""
    a = np.asarray(pose, dtype=float)
    cosine, sine = np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack(
        [
            -cosine * a[..., 0] - sine * a[..., 1],
            sine * a[..., 0] - cosine * a[..., 1],
            wrap(-a[..., 2]),
        ],
        axis=-1,
    )


def between(first: npt.ArrayLike, second: npt.ArrayLike) -> Array:
    """T_b_c from T_a_b and T_a_c: where the second is, seen from the first."""
    return compose(inverse(first), second)


def compose_jacobians(first: npt.ArrayLike, second: npt.ArrayLike) -> tuple[Array, Array]:
    """Derivatives of `compose` by its first and by its second argument.

    Returns
    -------
    (..., 3, 3), (..., 3, 3) arrays
        Rows x, y, theta of the result.
    """
    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    cosine, sine = np.cos(a[..., 2]), np.sin(a[..., 2])
    shape = np.broadcast_shapes(a.shape, b.shape)[:-1]
    by_first = np.zeros((*shape, 3, 3))
    by_first[..., range(3), range(3)] = 1.0
    by_first[..., 0, 2] = -sine * b[..., 0] - cosine * b[..., 1]
    by_first[..., 1, 2] = cosine * b[..., 0] - sine * b[..., 1]
    by_second = np.zeros((*shape, 3, 3))
    by_second[..., :2, :2] = rotation(a[..., 2])
    by_second[..., 2, 2] = 1.0
    return by_first, by_second


def inverse_jacobian(pose: npt.ArrayLike) -> Array:
    """(..., 3, 3) derivative of `inverse`."""
    a = np.asarray(pose, dtype=float)
    cosine, sine = np.cos(a[..., 2]), np.sin(a[..., 2])
    result = np.zeros((*a.shape[:-1], 3, 3))
    result[..., 0, 0] = result[..., 1, 1] = -cosine
    result[..., 0, 1] = -sine
    result[..., 1, 0] = sine
    result[..., 0, 2] = sine * a[..., 0] - cosine * a[..., 1]
    result[..., 1, 2] = cosine * a[..., 0] + sine * a[..., 1]
    result[..., 2, 2] = -1.0
    return result


def inverse_covariance_of(pose: npt.ArrayLike, covariance: Array) -> Array:
    """Covariance of `inverse` of a pose, (..., 3, 3), to first order."""
    jacobian = inverse_jacobian(pose)
    return jacobian @ covariance @ np.swapaxes(jacobian, -1, -2)
