"""Small changes, means and covariances of transforms in space.

A small change of a transform T_a_b is six numbers (tau, phi): tau moves the origin of b by so
many metres along the axes of a, phi turns b by a rotation vector (radians) given in a. So the
first, second and sixth of them are dx, dy and the change of heading of a body that stands on
the floor of a. Covariances of transforms are covariances of these six numbers.
"""

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from validation.poses.angles import Array


def stacked(R: Array, t: Array) -> RigidTransform:
    """Transforms with rotations (..., 3, 3) and translations (..., 3)."""
    return RigidTransform.from_components(t, Rotation.from_matrix(R))


def perturbed(T_a_b: RigidTransform, change: Array) -> RigidTransform:
    """The transform after a small change.

    Parameters
    ----------
    T_a_b : RigidTransform
        One, or a stack.
    change : (..., 6) array
        tau in metres, phi in radians, in a.
    """
    turned = Rotation.from_rotvec(change[..., 3:]) * T_a_b.rotation
    return RigidTransform.from_components(T_a_b.translation + change[..., :3], turned)


def change_between(T_a_b: RigidTransform, reference: RigidTransform) -> Array:
    """The change (..., 6) that makes ``T_a_b`` of ``reference``: inverse of `perturbed`."""
    turn = (T_a_b.rotation * reference.rotation.inv()).as_rotvec()
    return np.concatenate([T_a_b.translation - reference.translation, turn], -1)


def rotation_matrices(rotvec: Array) -> Array:
    """(..., 3, 3) rotations by rotation vectors (..., 3): Rodrigues' formula."""
    angle = np.linalg.norm(rotvec, axis=-1)[..., None, None]
    K = cross_matrix(rotvec)
    # sinc is the derivative of the sine at 0, so that small angles need no special case.
    half = np.sinc(angle / (2 * np.pi))
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * half**2 * K @ K)


def rotation_vectors(matrices: Array) -> Array:
    """(..., 3) rotation vectors of rotations by clearly less than half a turn."""
    R = np.asarray(matrices)
    skew = 0.5 * np.stack(
        [
            R[..., 2, 1] - R[..., 1, 2],
            R[..., 0, 2] - R[..., 2, 0],
            R[..., 1, 0] - R[..., 0, 1],
        ],
        -1,
    )
    sine = np.linalg.norm(skew, axis=-1)
    angle = np.arctan2(sine, 0.5 * (np.trace(R, axis1=-2, axis2=-1) - 1))
    return np.asarray(
        skew * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-300), 1.0)[..., None]
    )


def mean_transform(transforms: RigidTransform) -> RigidTransform:
    """Mean of the elements of the matrices, its rotation made orthogonal again.

    Parameters
    ----------
    transforms : RigidTransform
        A stack of n.

    Notes
    -----
    AD2.3, "Calibration of the camera network": averaging of the elements of the
    roto-translation matrices. The document does not say how a rotation was made of the mean;
    here it is the rotation nearest to it (Frobenius norm).
    """
    matrices = transforms.as_matrix()
    mean = np.average(matrices, axis=0)
    rotation = Rotation.from_matrix(nearest_rotation(mean[:3, :3]))
    return RigidTransform.from_components(mean[:3, 3], rotation)


def nearest_rotation(matrix: Array) -> Array:
    """The rotation (..., 3, 3) nearest to a matrix in the Frobenius norm."""
    u, _, vt = np.linalg.svd(matrix)
    u[..., :, 2] *= np.sign(np.linalg.det(u @ vt))[..., None]
    return np.asarray(u @ vt)


def cross_matrix(vector: Array) -> Array:
    """(..., 3, 3) matrices [v]x with [v]x w = v x w."""
    v = np.asarray(vector, dtype=float)
    K = np.zeros((*v.shape, 3))
    K[..., 2, 1], K[..., 0, 2], K[..., 1, 0] = v[..., 0], v[..., 1], v[..., 2]
    return K - np.swapaxes(K, -1, -2)


def composition_jacobians(T_a_b: RigidTransform, T_b_c: RigidTransform) -> tuple[Array, Array]:
    """Derivatives (6, 6) of the change of T_a_c = T_a_b T_b_c by the changes of the two.

    Notes
    -----
    tau_ac = tau_ab - [R_ab t_bc]x phi_ab + R_ab tau_bc and phi_ac = phi_ab + R_ab phi_bc.
    """
    R = T_a_b.rotation.as_matrix()
    first, second = np.eye(6), np.zeros((6, 6))
    first[:3, 3:] = -cross_matrix(R @ T_b_c.translation)
    second[:3, :3] = second[3:, 3:] = R
    return first, second


def planar_pose(T_a_b: RigidTransform) -> Array:
    """x, y and the heading of b's x axis in the plane of a: (..., 3), metres and radians."""
    return planar_pose_of(T_a_b.rotation.as_matrix(), T_a_b.translation)


def planar_pose_of(R: Array, t: Array) -> Array:
    """The same from a rotation (..., 3, 3) and a translation (..., 3)."""
    heading = np.arctan2(R[..., 1, 0], R[..., 0, 0])
    return np.stack([t[..., 0], t[..., 1], heading], -1)


def planar_jacobian(R: Array) -> Array:
    """Derivative (3, 6) of the planar pose by the small change, from the rotation (3, 3)."""
    e = R[:, 0]
    jacobian = np.zeros((3, 6))
    jacobian[0, 0] = jacobian[1, 1] = 1.0
    # d e = phi x e = -[e]x phi, and the heading is atan2(e_y, e_x).
    by_axis = np.array([-e[1], e[0], 0.0]) / (e[0] ** 2 + e[1] ** 2)
    jacobian[2, 3:] = -by_axis @ cross_matrix(e)
    return jacobian


def planar_transform(pose: Array) -> RigidTransform:
    """The transform of a body that stands upright at (x, y, theta)."""
    x, y, theta = pose
    return RigidTransform.from_components([x, y, 0.0], Rotation.from_rotvec([0.0, 0.0, theta]))


def angle_between(a: RigidTransform, b: RigidTransform) -> Array:
    """Angle (...) by which the rotations of two transforms differ, radians."""
    return np.asarray((a.rotation * b.rotation.inv()).magnitude())
