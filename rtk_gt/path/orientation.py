"""Yaw, pitch and roll: rotations about z, then the new y, then the new x.

Blanco 2009, section 2.3: R = Rz(yaw) Ry(pitch) Rx(roll), so that pitch is positive nose down for
x forward and z up.
"""

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from validation.poses.angles import Array


def angles_of(rotation: Array) -> Array:
    """(..., 3) yaw, pitch, roll in radians of rotation matrices (..., 3, 3).

    Pitch is within +-90 degrees; at its ends only yaw - roll has a meaning.
    """
    yaw = np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0])
    across = np.hypot(rotation[..., 0, 0], rotation[..., 1, 0])
    pitch = np.arctan2(-rotation[..., 2, 0], across)
    roll = np.arctan2(rotation[..., 2, 1], rotation[..., 2, 2])
    return np.stack([yaw, pitch, roll], axis=-1)


def matrix_of(angles: Array) -> Array:
    """Rotation matrices (..., 3, 3) of yaw, pitch, roll (..., 3) in radians."""
    angles = np.asarray(angles, dtype=float)
    flat = Rotation.from_euler("ZYX", angles.reshape(-1, 3)).as_matrix()
    return np.asarray(flat.reshape(*angles.shape, 3))


def transform_of(poses: Array) -> RigidTransform:
    """T_a_b of poses (..., 6): x, y, z, yaw, pitch, roll."""
    poses = np.asarray(poses, dtype=float)
    rotation = Rotation.from_euler("ZYX", poses[..., 3:])
    return RigidTransform.from_components(poses[..., :3], rotation)


def pose_of(transform: RigidTransform) -> Array:
    """(..., 6) x, y, z, yaw, pitch, roll of a transform or a stack of them."""
    angles = angles_of(transform.rotation.as_matrix())
    return np.concatenate([transform.translation, angles], axis=-1)


def rotation_rates(angles: Array) -> Array:
    """(..., 3, 3) matrix E: a small rotation vector in the outer frame = E d(yaw, pitch, roll).

    Its columns are the axes about which each angle turns. Its determinant is -cos(pitch): at
    +-90 degrees of pitch yaw and roll turn about one axis.
    """
    yaw, pitch = angles[..., 0], angles[..., 1]
    zero, one = np.zeros_like(yaw), np.ones_like(yaw)
    about_z = np.stack([zero, zero, one], axis=-1)
    about_y = np.stack([-np.sin(yaw), np.cos(yaw), zero], axis=-1)
    about_x = np.stack(
        [np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), -np.sin(pitch)], axis=-1
    )
    return np.stack([about_z, about_y, about_x], axis=-1)


def skew(vectors: Array) -> Array:
    """(..., 3, 3) matrices [v]x with [v]x w = v x w, of vectors (..., 3)."""
    x, y, z = np.moveaxis(np.asarray(vectors, dtype=float), -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
