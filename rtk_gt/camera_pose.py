"""Where a camera is on the vehicle, from points of the point clouds seen in its images."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from rtk_gt.orientation import angles_of, matrix_of, rotation_rates
from validation.angles import Array
from validation.errors import GtvalError


@dataclass(frozen=True)
class Lens:
    """Projection of a camera whose z axis looks ahead, x right and y down.

    Parameters
    ----------
    matrix : (3, 3) array
        Focal lengths and principal point in pixels, the top-left pixel's centre at (0, 0).
    distortion : (4,) array
        k1, k2, p1, p2, applied to normalised coordinates. (Eq. 16 to 19 of Blanco 2009 are
        written with the u and v of Eq. 13; with pixels in them a corner of the published images
        would move by 10^5 pixels.)
    """

    matrix: Array
    distortion: Array

    def project(self, points: Array) -> Array:
        """(..., 2) pixels of points (..., 3) in the camera frame; NaN behind the camera."""
        depth = np.where(points[..., 2:] > 1e-6, points[..., 2:], np.nan)
        x, y = np.moveaxis(points[..., :2] / depth, -1, 0)
        k1, k2, p1, p2 = self.distortion
        r2 = x * x + y * y
        radial = 1 + k1 * r2 + k2 * r2 * r2
        u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        K = self.matrix
        return np.stack([K[0, 0] * u + K[0, 2], K[1, 1] * v + K[1, 2]], axis=-1)


@dataclass(frozen=True)
class CameraPose:
    """Pose of a camera on the vehicle: x, y, z, yaw, pitch, roll, its covariance, and residuals.

    ``residuals`` (n, 2) are measured minus projected pixels; ``sigma`` is their standard
    deviation.
    """

    pose: Array
    covariance: Array
    residuals: Array
    sigma: float


def in_camera(points: Array, vehicle: Array, camera: Array) -> Array:
    """(n, 3) camera coordinates of points (n, 3) in the local frame.

    Parameters
    ----------
    points : (n, 3) array
        Local frame, metres.
    vehicle : (n, 6) or (6,) array
        Vehicle poses at the images.
    camera : (6,) array
        Pose of the camera on the vehicle.
    """
    vehicle = np.broadcast_to(vehicle, (len(points), 6))
    own = np.einsum("nji,nj->ni", matrix_of(vehicle[:, 3:]), points - vehicle[:, :3])
    return np.asarray((own - camera[:3]) @ matrix_of(camera[3:]))


def camera_pose(
    lens: Lens, points: Array, vehicle: Array, pixels: Array, start: Array
) -> CameraPose:
    """The camera pose that projects known points onto the pixels where they were seen.

    Parameters
    ----------
    lens : Lens
        The calibrated projection.
    points : (n, 3) array
        In the local frame, from point clouds.
    vehicle : (n, 6) array
        Vehicle poses at the images in which each point was seen.
    pixels : (n, 2) array
        Where.
    start : (6,) array
        Tape-measured pose.

    Raises
    ------
    GtvalError
        If there are fewer than four points, or they are behind the camera of ``start``.

    Notes
    -----
    Blanco 2009, section 5.4: Levenberg-Marquardt on the sum of squared pixel errors. Unknown
    are a shift and a rotation vector in the vehicle frame, which have no gimbal lock.
    """
    if len(points) < 4:
        raise GtvalError(f"{len(points)} points are too few for a camera pose; at least 4")

    def pose_at(change: Array) -> Array:
        turned = Rotation.from_rotvec(change[3:]).as_matrix() @ matrix_of(start[3:])
        return np.concatenate([start[:3] + change[:3], angles_of(turned)])

    def residuals(change: Array) -> Array:
        seen = lens.project(in_camera(points, vehicle, pose_at(change)))
        return np.asarray((pixels - seen).ravel())

    behind = int(np.isnan(residuals(np.zeros(6))).sum() // 2)
    if behind:
        raise GtvalError(
            f"{behind} of {len(points)} points are behind the camera: is its pose right? Cameras "
            "look along their z axis, x to the right and y down"
        )
    found = least_squares(residuals, np.zeros(6), method="lm", x_scale=[1, 1, 1, 0.1, 0.1, 0.1])
    left, slope = np.asarray(found.fun, dtype=float), np.asarray(found.jac, dtype=float)
    variance = float(left @ left) / max(2 * len(points) - 6, 1)
    pose = pose_at(np.asarray(found.x, dtype=float))
    J = np.eye(6)
    J[3:, 3:] = np.linalg.inv(rotation_rates(pose[3:]))
    covariance = variance * J @ np.linalg.inv(slope.T @ slope) @ J.T
    return CameraPose(pose, covariance, left.reshape(-1, 2), float(np.sqrt(variance)))
