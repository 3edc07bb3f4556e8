"""The road under the wheels: a slightly bent surface that the vehicle carries with it."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from rtk_gt.path.orientation import matrix_of, rotation_rates
from rtk_gt.receivers.fixes import Ints
from rtk_gt.sensors.trajectory import Spline, pose_columns
from validation.poses.angles import Array

SPOT = 0.25
"""Points of one scan that are nearer to each other than so many metres share their pebbles and
patches: a judgement."""
ROAD = 5
"""Numbers of the road in the vehicle frame."""
_SLOWEST = 1.0
"""Below this speed in m/s the direction of motion says nothing: a second moves the vehicle by less
than 100 times the noise of a fix."""
_MARGIN = 2.0
"""Seconds to the ends of the path within which its angles are too uncertain for differences: four
knots of the finest curves."""


@dataclass(frozen=True)
class KnownGround:
    """The road in the vehicle frame: z = height + slope_x x + slope_y y + b y^2 / 2 + c y^3 / 6.

    Measured with the vehicle on a level floor: the height of the floor below the frame, and how
    far the frame of the antennas is from level. Where their heights were measured from that
    floor, the slopes are 0. ``sigma`` in metres and ``tilt_sigma`` in radians say how well this
    is known.

    Roads are bent across: b has the standard deviation ``curvature`` (1/m), c that of
    ``curvature_change`` (1/m^2), both in the mean of the drive, which the scans then show, and
    again from second to second. The springs move the body by ``heave`` metres and ``ride``
    radians from second to second. What is left of a road point is ``texture``. Points within
    ``reach`` metres beside the scanner and ``roughness`` of the road (metres, three standard
    deviations at most) are road. The body is parallel to the road between its wheels, ``wheels``
    metres ahead of the origin of the vehicle frame.
    """

    height: float
    sigma: float = 0.01
    slope_x: float = 0.0
    slope_y: float = 0.0
    tilt_sigma: float = float(np.radians(0.05))
    reach: float = 4.0
    roughness: float = 0.05
    heave: float = 0.01
    ride: float = float(np.radians(0.3))
    curvature: float = 0.02
    curvature_change: float = 0.002
    texture: float = 0.01
    wheels: float = 0.0

    @property
    def shape(self) -> Array:
        """(5,) height, slopes, b and c as they are known beforehand."""
        return np.array([self.height, self.slope_x, self.slope_y, 0.0, 0.0])

    @property
    def sigmas(self) -> Array:
        """(5,) their standard deviations."""
        return np.array(
            [self.sigma, self.tilt_sigma, self.tilt_sigma, self.curvature, self.curvature_change]
        )


def _above(points: Array, shape: Array) -> Array:
    """(n,) heights of points over the road."""
    x, y, z = points.T
    height, slope_x, slope_y, bend, change = shape
    return np.asarray(z - height - slope_x * x - slope_y * y - bend * y**2 / 2 - change * y**3 / 6)


def road_points(points: Array, places: Array, shape: Array, ground: KnownGround) -> Ints:
    """Rows of the points (n, 3), in the vehicle frame, that are on the road beside the vehicle.

    ``places`` is where they were seen from, (6,) of all or (n, 6).
    """
    beside = np.linalg.norm(points[:, :2] - places[..., :2], axis=1) < ground.reach
    return np.flatnonzero(beside & (np.abs(_above(points, shape)) < 6 * ground.roughness))


@dataclass(frozen=True)
class RoadPoints:
    """Points that may be on the road.

    Parameters
    ----------
    points : (n, 3) array
        In the vehicle frame when they were seen, metres.
    scanner : (n,) int array
        That saw each.
    times : (n,) array
        When, seconds; those of one scan have one time.
    beside : (n, 3) array
        As if the road went straight on between there and the wheels: x where they were seen, y
        and z where they are beside the wheels of a vehicle that moves along its x axis.
    """

    points: Array
    scanner: Ints
    times: Array
    beside: Array


def road_beside(
    points: Array, scanner: Ints, times: Array, spline: Spline, ground: KnownGround
) -> RoadPoints:
    """Road points, each where it was when the wheels passed it.

    A scanner looks at the road some way behind or before the wheels. On hills the road is twisted
    in between, by a tenth of a degree in a third of a metre, and always the same way at the same
    place: a drive that passes it again and again does not average that out. Over the moments
    until the wheels are there the path is smooth. Its mean slope in the vehicle frame is left out:
    that is an unknown of the road, and no better known than the pitch of the path.
    ``spline`` is best a path that does not depend on the scanners.
    """
    poses = spline.poses(times)
    R = matrix_of(poses[:, 3:])
    world = np.einsum("nij,nj->ni", R, points) + poses[:, :3]
    # All points of a scan together: beside each other they show how the road lies across.
    _, moment = np.unique(times, return_inverse=True)
    scan = moment * (int(scanner.max(initial=0)) + 1) + scanner
    away = (np.bincount(scan, points[:, 0]) / np.maximum(np.bincount(scan), 1))[scan]
    away -= ground.wheels
    ahead = np.einsum("ni,ni->n", spline.rates(times)[:, :3], R[:, :, 0])
    passing = times + away / np.maximum(ahead, _SLOWEST)
    known = spline.covers(passing - _MARGIN) & spline.covers(passing + _MARGIN)
    passing = np.where(known & (ahead > _SLOWEST), passing, times)
    poses = spline.poses(passing)
    turned = matrix_of(poses[:, 3:])
    found = np.einsum("nji,nj->ni", turned, world - poses[:, :3])
    # A wrong pitch tilts the plane in which points pass by, on straights and in turns alike.
    moved = found - points
    slope = float(moved[:, 0] @ moved[:, 2]) / max(float(moved[:, 0] @ moved[:, 0]), 1e-12)
    beside = np.column_stack([points[:, 0], found[:, 1], found[:, 2] - slope * moved[:, 0]])
    return RoadPoints(points, scanner, times, beside)


def ground_rows(
    road: RoadPoints, places: Array, shape: Array, ground: KnownGround
) -> tuple[Array, Array]:
    """Heights of the road points over the road, whitened, and their derivatives.

    Parameters
    ----------
    road : RoadPoints
        Those too far off are left out.
    places : (k, 6) array
        Poses of the scanners on the vehicle.
    shape : (5,) array
        Of the road, see `KnownGround`.
    ground : KnownGround
        What is a road point, and how rough roads are.

    Returns
    -------
    J : (m, 6 k + 5) array
        By each scanner's translation and rotation vector in the vehicle frame, and the shape.
    residual : (m,) array
        Over their standard deviations.
    """
    rows = road_points(road.beside, places[road.scanner], shape, ground)
    p, scanner = road.beside[rows], road.scanner[rows]
    y = p[:, 1]
    across = -(shape[2] + shape[3] * y + shape[4] * y**2 / 2)
    normals = np.column_stack([np.full(len(p), -shape[1]), across, np.ones(len(p))])
    # A scanner that is farther ahead waits less: it sees the same slope, not the turn meanwhile.
    by_place = np.zeros((len(p), len(places), 6))
    arms = road.points[rows] - places[scanner, :3]
    by_place[np.arange(len(p)), scanner] = np.hstack([normals, np.cross(arms, normals)])
    by_shape = -np.column_stack([np.ones(len(p)), p[:, :2], y**2 / 2, y**3 / 6])
    J = np.hstack([by_place.reshape(len(p), -1), by_shape])
    return _whitened(J, _above(p, shape), y, road.times[rows], ground)


def _whitened(
    J: Array, residual: Array, across: Array, times: Array, ground: KnownGround
) -> tuple[Array, Array]:
    """Rows in units of their noise, with what each second has of its own taken out.

    The covariance of a second's points is texture^2 I + Q S Q', with the columns 1, y, y^2 / 2
    and y^3 / 6 of Q for heave, ride and the bends: its inverse root comes from a thin
    decomposition.
    """
    shared = np.array([ground.heave, ground.ride, ground.curvature, ground.curvature_change])
    order = np.argsort(times, kind="stable")
    both = np.column_stack([J, residual])[order]
    across, times = across[order], times[order]
    seconds = np.floor(times)
    for rows in np.split(np.arange(len(order)), np.flatnonzero(np.diff(seconds)) + 1):
        y = across[rows]
        spots = np.unique(np.column_stack([times[rows], np.floor(y / SPOT)]), axis=0)
        noise = ground.texture * np.sqrt(len(rows) / len(spots)) if len(rows) else ground.texture
        Q = np.column_stack([np.ones(len(rows)), y, y**2 / 2, y**3 / 6]) * shared / noise
        U, spread, _ = np.linalg.svd(Q, full_matrices=False)
        part = both[rows] / noise
        both[rows] = part - U @ ((1 - 1 / np.sqrt(1 + spread**2))[:, None] * (U.T @ part))
    return both[:, :-1], both[:, -1]


def motion_rows(
    spline: Spline, shape: Array, ground: KnownGround
) -> tuple["sparse.csr_matrix", Array, Array]:
    """Angles between the direction of motion and the road, whitened, one a second.

    Returns
    -------
    by_path : sparse (m, 6 n)
        Derivative by the coefficients of the curves.
    by_shape : (m, 5) array
        By the shape of the road, see `KnownGround`; only its slopes under the vehicle matter.
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
    normal = R @ np.array([-shape[1], -shape[2], 1.0])
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
    by_shape = np.zeros((len(times), ROAD))
    by_shape[:, 1:3] = -own[:, :2] * scale[:, None]
    return by_path, by_shape, residual
