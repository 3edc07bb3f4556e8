"""Differences and small motions of poses of every kind, with one tangent for all of them.

A small motion of a pose is added in the fixed frame: metres along X, Y(, Z), and in space a
rotation vector about the fixed axes, from the left.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from validation.poses.angles import Array, wrap
from validation.poses.trajectory import FREEDOMS, Kind


def lengths(kind: Kind) -> int:
    """How many of the numbers of an error are lengths; the others are angles."""
    return {"plane": 2, "space": 3, "points_plane": 2, "points_space": 3}[kind]


def strength_groups(kind: Kind) -> list[list[int]]:
    """Freedoms that share one strength of the prior.

    A robot on a floor moves in X, Y and turns about Z, and hardly in the others.
    """
    return {
        "plane": [[0, 1], [2]],
        "space": [[0, 1], [2], [3, 4], [5]],
        "points_plane": [[0, 1]],
        "points_space": [[0, 1], [2]],
    }[kind]


def difference(kind: Kind, ends: Array, starts: Array) -> Array:
    """(..., m) the small motion that leads from starts to ends, both (..., k)."""
    if kind == "space":
        moved = ends[..., :3] - starts[..., :3]
        turned = Rotation.from_quat(ends[..., 3:]) * Rotation.from_quat(starts[..., 3:]).inv()
        return np.concatenate([moved, turned.as_rotvec()], axis=-1)
    found = np.asarray(ends - starts)
    if kind == "plane":
        found[..., 2] = wrap(found[..., 2])
    return found


def advance(kind: Kind, poses: Array, motions: Array) -> Array:
    """(..., k) poses after small motions (..., m)."""
    if kind == "space":
        turned = Rotation.from_rotvec(motions[..., 3:]) * Rotation.from_quat(poses[..., 3:])
        return np.concatenate([poses[..., :3] + motions[..., :3], turned.as_quat()], axis=-1)
    return np.asarray(poses + motions)


def cross_matrices(vectors: Array) -> Array:
    """(n, 3, 3) matrices that take the vector product with vectors (n, 3) from the left."""
    x, y, z = vectors.T
    o = np.zeros_like(x)
    return np.stack([o, -z, y, z, o, -x, -y, x, o], axis=-1).reshape(-1, 3, 3)


def step_jacobians(kind: Kind, motions: Array) -> tuple[Array, Array]:
    """How `difference` changes with its ends and its starts, two (n, m, m).

    In space these are the inverse Jacobians of the rotation vector from the left and, with a minus,
    from the right, to the second order of the angle.
    """
    n, m = motions.shape
    ends = np.broadcast_to(np.eye(m), (n, m, m))
    if kind != "space":
        return ends, -ends
    cross = cross_matrices(motions[:, 3:])
    even = np.eye(3) + cross @ cross / 12
    ends, starts = ends.copy(), -ends
    ends[:, 3:, 3:] = even - cross / 2
    starts[:, 3:, 3:] = -(even + cross / 2)
    return ends, starts


def axes(kind: Kind, poses: Array) -> Array:
    """(n, m, m) from a small motion in the moving frame to one in the fixed frame."""
    m = FREEDOMS[kind]
    turned = np.zeros((len(poses), m, m))
    if kind == "space":
        turned[:, :3, :3] = turned[:, 3:, 3:] = Rotation.from_quat(poses[:, 3:]).as_matrix()
        return turned
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    turned[:, 0, 0] = turned[:, 1, 1] = c
    turned[:, 0, 1], turned[:, 1, 0] = -s, s
    turned[:, 2, 2] = 1.0
    return turned


def turning(kind: Kind, motions: Array) -> Array:
    """(n, m, m) how a motion that is fixed to the robot changes with a small motion of the robot.

    Parameters
    ----------
    motions : (n, m) array
        As seen in the fixed frame.
    """
    n, m = motions.shape
    found = np.zeros((n, m, m))
    if kind == "plane":
        found[:, 0, 2], found[:, 1, 2] = -motions[:, 1], motions[:, 0]
    elif kind == "space":
        found[:, :3, 3:] = -cross_matrices(motions[:, :3])
        found[:, 3:, 3:] = -cross_matrices(motions[:, 3:])
    return found


def half_turn(kind: Kind, poses: Array) -> Array:
    """The poses turned by half a turn about the moving Z axis."""
    turned = poses.copy()
    if kind == "plane":
        turned[:, 2] = wrap(turned[:, 2] + np.pi)
    elif kind == "space":
        about_z = Rotation.from_rotvec([0.0, 0.0, np.pi])
        turned[:, 3:] = (Rotation.from_quat(poses[:, 3:]) * about_z).as_quat()
    return turned
