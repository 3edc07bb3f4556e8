"""The road under the wheels: a plane that the vehicle carries with it."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from rtk_gt.fixes import Ints
from rtk_gt.orientation import matrix_of, rotation_rates
from rtk_gt.trajectory import Spline, pose_columns
from validation.angles import Array

INDEPENDENT = 10
"""So many points of a second count."""
_SLOWEST = 1.0
"""Below this speed in m/s the direction of motion says nothing."""


@dataclass(frozen=True)
class KnownGround:
    """The plane of the road in the vehicle frame, z = height + slope_x x + slope_y y.

    Measured with the vehicle on a level floor: the height of the floor below the frame, and how
    far the frame of the antennas is from level. Where their heights were measured from that
    floor, the slopes are 0.

    ``sigma`` in metres and ``tilt_sigma`` in radians say how well this is known. From second to
    second the springs move the body by ``heave`` metres and ``ride`` radians, and the road is
    bent across by ``curvature`` (1/m), each with that standard deviation; what is left of a road
    point is ``texture``. Points within ``reach`` metres beside the scanner and ``roughness`` of
    the plane (metres, three standard deviations at most) are road.
    """

    height: float
    sigma: float = 0.01
    slope_x: float = 0.0
    slope_y: float = 0.0
    tilt_sigma: float = float(np.radians(0.05))
    reach: float = 3.0
    roughness: float = 0.05
    heave: float = 0.01
    ride: float = float(np.radians(0.3))
    curvature: float = 0.02
    texture: float = 0.01

    @property
    def plane(self) -> Array:
        """(3,) height and slopes."""
        return np.array([self.height, self.slope_x, self.slope_y])

    @property
    def sigmas(self) -> Array:
        """(3,) their standard deviations."""
        return np.array([self.sigma, self.tilt_sigma, self.tilt_sigma])


def road_points(points: Array, scanner: Array, plane: Array, ground: KnownGround) -> Ints:
    """Rows of the points (n, 3), in the vehicle frame, that are on the road beside the vehicle."""
    beside = np.linalg.norm(points[:, :2] - scanner[:2], axis=1) < ground.reach
    above = points[:, 2] - plane[0] - points[:, :2] @ plane[1:]
    return np.flatnonzero(beside & (np.abs(above) < 6 * ground.roughness))


def ground_rows(
    points: Array, scanner: Array, plane: Array, times: Array, ground: KnownGround
) -> tuple[Array, Array]:
    """Heights of the road points over the plane, whitened, and their derivatives.

    Parameters
    ----------
    points : (n, 3) array
        In the vehicle frame.
    scanner : (6,) array
        Pose of the scanner on the vehicle.
    plane : (3,) array
        Height and slopes of the road.
    times : (n,) array
        Of the points, seconds.
    ground : KnownGround
        What is a road point, and how rough roads are.

    Returns
    -------
    J : (m, 9) array
        By the scanner's translation and rotation vector in the vehicle frame, and the plane.
    residual : (m,) array
        Over their standard deviations.
    """
    rows = road_points(points, scanner, plane, ground)
    p = points[rows]
    residual = p[:, 2] - plane[0] - p[:, :2] @ plane[1:]
    normal = np.array([-plane[1], -plane[2], 1.0])
    J = np.hstack(
        [
            np.tile(normal, (len(p), 1)),
            np.cross(p - scanner[:3], normal),
            -np.ones((len(p), 1)),
            -p[:, :2],
        ]
    )
    return _whitened(J, residual, p[:, 1], np.floor(times[rows]), ground)


def _whitened(
    J: Array, residual: Array, across: Array, seconds: Array, ground: KnownGround
) -> tuple[Array, Array]:
    """Rows in units of their noise, with what each second has of its own taken out.

    The covariance of a second's points is texture^2 I + Q S Q', with the columns 1, y and y^2 / 2
    of Q for heave, ride and curvature: its inverse root comes from a thin decomposition.
    """
    shared = np.array([ground.heave, ground.ride, ground.curvature])
    order = np.argsort(seconds, kind="stable")
    both = np.column_stack([J, residual])[order]
    across, seconds = across[order], seconds[order]
    for rows in np.split(np.arange(len(order)), np.flatnonzero(np.diff(seconds)) + 1):
        y = across[rows]
        # Of the points of a second INDEPENDENT count: their texture is the same pebbles.
        noise = ground.texture * np.sqrt(max(len(rows) / INDEPENDENT, 1.0))
        Q = np.column_stack([np.ones(len(rows)), y, y**2 / 2]) * shared / noise
        U, spread, _ = np.linalg.svd(Q, full_matrices=False)
        part = both[rows] / noise
        both[rows] = part - U @ ((1 - 1 / np.sqrt(1 + spread**2))[:, None] * (U.T @ part))
    return both[:, :-1], both[:, -1]


def motion_rows(
    spline: Spline, plane: Array, ground: KnownGround
) -> tuple["sparse.csr_matrix", Array, Array]:
    """Angles between the direction of motion and the road, whitened, one a second.

    Returns
    -------
    by_path : sparse (m, 6 n)
        Derivative by the coefficients of the curves.
    by_plane : (m, 3) array
        By height and slopes of the road.
    residual : (m,) array
        Angle over its standard deviation.
    """
    times = np.concatenate(
        [
            start + np.arange(0.5, spacing * count, 1.0)
            for start, spacing, count in zip(
                spline.starts, spline.spacings, spline.counts, strict=True
            )
        ]
    )
    velocity = spline.rates(times)[:, :3]
    speed = np.linalg.norm(velocity, axis=1)
    times, velocity, speed = (a[speed > _SLOWEST] for a in (times, velocity, speed))
    angles = spline.poses(times)[:, 3:]
    R = matrix_of(angles)
    normal = R @ np.array([-plane[1], -plane[2], 1.0])
    scale = 1 / (speed * ground.ride)
    residual = (normal * velocity).sum(1) * scale
    own = np.einsum("mji,mj->mi", R, velocity)
    by_velocity, by_angles = np.zeros((2, len(times), 1, 6))
    along = (normal * velocity).sum(1) / speed**2
    by_velocity[:, 0, :3] = (normal - along[:, None] * velocity) * scale[:, None]
    # d(R' v) = R' (v x omega), with omega = E d(angles).
    turned = np.einsum("mj,mjk->mk", np.cross(normal, velocity), rotation_rates(angles))
    by_angles[:, 0, 3:] = turned * scale[:, None]
    by_path = pose_columns(spline, times, by_velocity, 1) + pose_columns(spline, times, by_angles)
    by_plane = np.column_stack([np.zeros(len(times)), -own[:, :2] * scale[:, None]])
    return by_path, by_plane, residual
