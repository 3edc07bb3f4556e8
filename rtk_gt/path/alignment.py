"""The rotation and translation that bring points of a body onto measured places, in batches."""

from typing import NamedTuple

import numpy as np

from validation.poses.angles import Array

_NEWTON_ROUNDS = 30
"""At most: where two roots coincide each round halves what is left, to 1e-9 of it after thirty."""


class Alignment(NamedTuple):
    """Rotations (n, 3, 3), body to world, and translations (n, 3) in metres."""

    rotation: Array
    translation: Array


def align(body: Array, world: Array) -> Alignment:
    """Least-squares poses of a body whose points were measured, without a start value.

    Parameters
    ----------
    body : (r, 3) array
        Points in the body's frame, metres; not all in one line.
    world : (n, r, 3) array
        Where they were measured.

    Notes
    -----
    Blanco 2009, Eq. 10, by Horn's unit quaternion (J. Opt. Soc. Am. A 4, 629, 1987): the
    eigenvector of the largest eigenvalue of a symmetric 4 x 4 matrix. The eigenvalue is found
    by Newton's method on the characteristic polynomial, from an upper bound, and the vector
    from the adjugate (Theobald, Acta Cryst. A 61, 478, 2005): element-wise, so that millions of
    poses take seconds.
    """
    centre = world.mean(-2)
    inner = body - body.mean(0)
    outer = world - centre[:, None, :]
    # M[a, b]: sums of body_a world_b, with the batch last so that it lies together in memory.
    M = np.ascontiguousarray(np.tensordot(inner.T, outer, ((1,), (1,))).transpose(0, 2, 1))
    N = _quaternion_matrix(M)
    bound = (np.square(inner).sum() + np.square(outer).sum((1, 2))) / 2
    rotation = _rotation_of(_eigenvector(N, *_largest_eigenvalue(M, N, bound)))
    return Alignment(rotation, centre - rotation @ body.mean(0))


def _quaternion_matrix(M: Array) -> Array:
    """Horn's symmetric matrix (4, 4, n) of the sums of products (3, 3, n)."""
    N = np.empty((4, 4, M.shape[-1]))
    N[0, 0] = M[0, 0] + M[1, 1] + M[2, 2]
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        N[0, a + 1] = N[a + 1, 0] = M[b, c] - M[c, b]
        N[a + 1, a + 1] = M[a, a] - M[b, b] - M[c, c]
        N[a + 1, b + 1] = N[b + 1, a + 1] = M[a, b] + M[b, a]
    return N


def _largest_eigenvalue(M: Array, N: Array, bound: Array) -> tuple[Array, Array]:
    """(n,) largest root of det(N - lambda), from the bound above it, and the slope there."""
    c2 = -2 * np.square(M).sum((0, 1))
    c1 = -8 * _det3(M)
    c0 = sum(cofactor * element for cofactor, element in zip(_cofactors(N, 0), N[0], strict=True))
    x = bound
    for _ in range(_NEWTON_ROUNDS):
        square = x * x
        value = square * square + c2 * square + c1 * x + c0
        slope = 4 * square * x + 2 * c2 * x + c1
        step = value / np.where(slope == 0, 1.0, slope)
        x = x - step
        if np.abs(step).max() <= 1e-12 * np.abs(x).max():  # the next would be 1e-24
            break
    return np.asarray(x), np.asarray(4 * x * x * x + 2 * c2 * x + c1)


def _det3(M: Array) -> Array:
    """(n,) determinants of (3, 3, n)."""
    return np.asarray(
        M[0, 0] * (M[1, 1] * M[2, 2] - M[1, 2] * M[2, 1])
        + M[0, 1] * (M[1, 2] * M[2, 0] - M[1, 0] * M[2, 2])
        + M[0, 2] * (M[1, 0] * M[2, 1] - M[1, 1] * M[2, 0])
    )


def _cofactors(N: Array, row: int) -> list[Array]:
    """The four cofactors of a row of (4, 4, n)."""
    a, b, c = (N[k] for k in range(4) if k != row)
    # Minors of the last two of the other rows, by their columns.
    m01, m02, m03 = (b[0] * c[k] - b[k] * c[0] for k in (1, 2, 3))
    m12, m13 = (b[1] * c[k] - b[k] * c[1] for k in (2, 3))
    m23 = b[2] * c[3] - b[3] * c[2]
    sign = 1.0 if row % 2 == 0 else -1.0
    return [
        sign * (a[1] * m23 - a[2] * m13 + a[3] * m12),
        -sign * (a[0] * m23 - a[2] * m03 + a[3] * m02),
        sign * (a[0] * m13 - a[1] * m03 + a[3] * m01),
        -sign * (a[0] * m12 - a[1] * m02 + a[2] * m01),
    ]


def _eigenvector(N: Array, value: Array, slope: Array) -> Array:
    """(4, n) unit eigenvectors q: rows of the adjugate of N - lambda, which is -slope q q'."""
    shifted = N.copy()
    for k in range(4):
        shifted[k, k] -= value
    vector = np.stack(_cofactors(shifted, 0))
    length = np.square(vector).sum(0)
    # The first row serves unless the body is turned by nearly 180 degrees.
    weak = np.flatnonzero(length < 1e-2 * slope**2)
    if len(weak):
        rows = np.stack([np.stack(_cofactors(shifted[..., weak], row)) for row in range(4)])
        longest = np.square(rows).sum(1).argmax(0)
        vector[:, weak] = rows[longest, :, np.arange(len(weak))].T
        length = np.square(vector).sum(0)
    return np.asarray(vector / np.sqrt(length))


def _rotation_of(q: Array) -> Array:
    """(n, 3, 3) matrices of unit quaternions (w, x, y, z), (4, n)."""
    w, x, y, z = q
    R = np.empty((q.shape[1], 3, 3))
    R[:, 0, 0] = 1 - 2 * (y * y + z * z)
    R[:, 0, 1] = 2 * (x * y - w * z)
    R[:, 0, 2] = 2 * (x * z + w * y)
    R[:, 1, 0] = 2 * (x * y + w * z)
    R[:, 1, 1] = 1 - 2 * (x * x + z * z)
    R[:, 1, 2] = 2 * (y * z - w * x)
    R[:, 2, 0] = 2 * (x * z - w * y)
    R[:, 2, 1] = 2 * (y * z + w * x)
    R[:, 2, 2] = 1 - 2 * (x * x + y * y)
    return R
