"""Where a camera is on the vehicle, from points of the point clouds seen in its images."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares

from rtk_gt.offsets.noise import GpsNoise
from rtk_gt.path.antennas import Antennas
from rtk_gt.path.covariance import noise_covariance, systematic_jacobian
from rtk_gt.path.orientation import matrix_of, rotation_rates
from rtk_gt.receivers.fixes import Bools, Ints
from rtk_gt.sensors.pass_matching import perturbed
from validation.errors import GtvalError
from validation.poses.angles import Array


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

    def shows(self, points: Array) -> Bools:
        """(...,) True where the polynomial of the radial distortion still leads outwards.

        Farther from the axis it turns back, and a point far outside of the image would be
        projected into it.
        """
        depth = np.where(points[..., 2] > 1e-6, points[..., 2], np.nan)
        r2 = np.square(points[..., :2]).sum(-1) / depth**2
        k1, k2 = self.distortion[:2]
        # Of r + k1 r^3 + k2 r^5 the derivative 1 + 3 k1 r^2 + 5 k2 r^4 turns at its first root.
        roots = np.roots([5 * k2, 3 * k1, 1.0])
        turns = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)]
        return np.asarray(r2 < min(turns, default=np.inf))


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


@dataclass(frozen=True)
class VehicleErrors:
    """How wrong the vehicle poses of the points may be.

    Parameters
    ----------
    images : (n,) int array
        The image of each point: points of one image share the noise of its pose.
    noise : (n, 6, 6) array
        Covariance of that noise.
    systematic : (n, 6, k) array
        How an error of offsets and distances, the same in all images, moves each pose.
    systematic_covariance : (k, k) array
        Its covariance.
    point_sigma : float
        Of each coordinate of each point, metres.
    """

    images: Ints
    noise: Array
    systematic: Array
    systematic_covariance: Array
    point_sigma: float = 0.0


def vehicle_errors(
    times: Array,
    poses: Array,
    antennas: Antennas,
    noise: GpsNoise,
    offset_covariance: Array,
    point_sigma: float = 0.0,
) -> VehicleErrors:
    """Errors of vehicle poses (n, 6) at the times (n,) of the images of n points.

    Between two poses of the path the noise is smaller than this says, and that of images taken
    within the same second is partly the same: images should be seconds apart.
    """
    rotation = matrix_of(poses[:, 3:])
    return VehicleErrors(
        np.unique(times, return_inverse=True)[1],
        noise_covariance(antennas.positions, rotation, noise),
        systematic_jacobian(antennas.positions, rotation, antennas.by_distance),
        offset_covariance,
        point_sigma,
    )


PIXEL_SIGMA = 0.5
"""What a person clicks on, or a detector finds, is off by about so much, pixels: a judgement."""


def camera_pose(
    lens: Lens,
    points: Array,
    vehicle: Array,
    pixels: Array,
    start: Array,
    errors: VehicleErrors | None = None,
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
    errors : VehicleErrors, optional
        Of the vehicle poses. Without them the poses are taken as exact and the noise is that of
        the pixels.

    Raises
    ------
    GtvalError
        If there are fewer than four points, or they are behind the camera of ``start``.

    Notes
    -----
    Blanco 2009, section 5.4: Levenberg-Marquardt on the sum of squared pixel errors. Unknown
    are a shift and a rotation vector in the vehicle frame, which have no gimbal lock. The paper
    takes the path as exact; but half a degree of a pose is several pixels, the same for all
    points of its image. With ``errors`` the residuals are weighted by the covariance of all of
    them together, which the result's covariance then holds.
    """
    if len(points) < 4:
        raise GtvalError(f"{len(points)} points are too few for a camera pose; at least 4")

    def pose_at(change: Array) -> Array:
        return perturbed(start, change)

    def residuals(change: Array) -> Array:
        seen = lens.project(in_camera(points, vehicle, pose_at(change)))
        return np.asarray((pixels - seen).ravel())

    behind = int(np.isnan(residuals(np.zeros(6))).sum() // 2)
    if behind:
        raise GtvalError(
            f"{behind} of {len(points)} points are behind the camera: is its pose right? Cameras "
            "look along their z axis, x to the right and y down"
        )
    scale = [1, 1, 1, 0.1, 0.1, 0.1]
    found = least_squares(residuals, np.zeros(6), method="lm", x_scale=scale)
    if errors is not None:
        root = np.linalg.cholesky(
            _pixel_covariance(lens, points, vehicle, pose_at(np.asarray(found.x)), errors)
        )
        found = least_squares(
            lambda change: solve_triangular(root, residuals(change), lower=True),
            np.asarray(found.x), method="lm", x_scale=scale,
        )  # fmt: skip
    left = residuals(np.asarray(found.x))
    whitened, slope = np.asarray(found.fun, dtype=float), np.asarray(found.jac, dtype=float)
    variance = float(whitened @ whitened) / max(2 * len(points) - 6, 1)
    if errors is not None:  # what is known of the path is not made better by a lucky fit
        variance = max(variance, 1.0)
    pose = pose_at(np.asarray(found.x, dtype=float))
    J = np.eye(6)
    J[3:, 3:] = np.linalg.inv(rotation_rates(pose[3:]))
    covariance = variance * J @ np.linalg.inv(slope.T @ slope) @ J.T
    sigma = float(np.sqrt(left @ left / max(2 * len(points) - 6, 1)))
    return CameraPose(pose, covariance, left.reshape(-1, 2), sigma)


def _pixel_covariance(
    lens: Lens, points: Array, vehicle: Array, camera: Array, errors: VehicleErrors
) -> Array:
    """(2 n, 2 n) covariance of the residuals: pixels, the poses of images, offsets."""
    n = len(points)
    by_pose = np.empty((n, 2, 6))
    for k, step in enumerate(1e-6 * np.eye(6)):
        ahead = lens.project(in_camera(points, vehicle + step, camera))
        behind = lens.project(in_camera(points, vehicle - step, camera))
        by_pose[:, :, k] = (ahead - behind) / 2e-6
    shared = (by_pose @ errors.systematic).reshape(2 * n, -1)
    total = np.ascontiguousarray(shared @ errors.systematic_covariance @ shared.T)
    together = errors.images[:, None] == errors.images
    own = np.einsum("nik,nkl,mjl->nimj", by_pose, errors.noise, by_pose)
    total += (own * together[:, None, :, None]).reshape(2 * n, 2 * n)
    # A point moves against its image as the vehicle does, the other way.
    by_point = errors.point_sigma**2 * by_pose[:, :, :3] @ np.swapaxes(by_pose[:, :, :3], 1, 2)
    each = total.reshape(n, 2, n, 2)
    each[np.arange(n), :, np.arange(n)] += by_point + PIXEL_SIGMA**2 * np.eye(2)
    return total
