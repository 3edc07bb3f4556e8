"""Where a vertical scanner is on the vehicle, along a path without errors.

Blanco 2009, section 5.3: the best pose of the scanner is the one that makes the point clouds of
several passes over the same area match. Here matching points are paired with the plane around
their partner from another pass, and the six numbers are found by Gauss-Newton; hand-measured
values keep what the drive does not show. On a measured path this is only where
`rtk_gt.sensors.scanner_calibration` begins.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from rtk_gt.path.orientation import angles_of, matrix_of, rotation_rates
from rtk_gt.receivers.fixes import Bools, Ints
from rtk_gt.sensors.ground import KnownGround, road_points
from rtk_gt.sensors.scans import Cloud
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.statistics.robust import sigma_from_median

NEIGHBOURS = 10
"""Points that make a plane: a judgement; three would do without noise."""
FEWEST_PAIRS = 200
"""Pairs below which no place is found: a judgement."""


@dataclass(frozen=True)
class MatchingSettings:
    """How points of passes are matched.

    ``apart``: passes are at least so many seconds apart. ``gates``: largest distances of
    partners in metres, from round to round. ``block``: seconds whose points share one
    independent error. ``flat``: ratio of the smallest to the middle spread
    of a neighbourhood that counts as a plane. ``sources``: at most so many points are matched.

    Judgements: after 8 s a vehicle comes from elsewhere and its errors have changed; the gates go
    from what a hand-measured place is off at 20 m down to the noise of path and scanner; within a
    second a vehicle's errors are the same; more points cost time and no longer change the result.
    """

    apart: float = 8.0
    gates: tuple[float, ...] = (1.0, 0.7, 0.5, 0.4, 0.3, 0.3, 0.3, 0.3)
    block: float = 1.0
    flat: float = 0.1
    sources: int = 12_000


@dataclass(frozen=True)
class ScannerCalibration:
    """The scanner's pose on the vehicle.

    Parameters
    ----------
    pose : (6,) array
        x, y, z, yaw, pitch, roll, metres and radians.
    covariance : (6, 6) array
        Of x, y, z and a rotation vector in the vehicle frame; see ``pose_covariance``.
    sigmas : (6,) array
        Standard deviations of x, y, z and rotations about the vehicle's x, y, z axes.
    from_drive : (6,) array
        Share of the information that is the drive's own, the rest being hand-measured.
    pairs : int
        Points matched in the last round.
    rms_before, rms_after : float
        Root mean square distance of matched points from their partners' planes, metres.
    settled : bool
        Whether choosing the points anew left the pose where it was.
    left_out : int
        Scans at times without a path, which were not used.
    """

    pose: Array
    covariance: Array
    sigmas: Array
    from_drive: Array
    pairs: int
    rms_before: float
    rms_after: float
    settled: bool = True
    left_out: int = 0

    @property
    def pose_covariance(self) -> Array:
        """(6, 6) covariance of x, y, z, yaw, pitch, roll."""
        J = np.eye(6)
        J[3:, 3:] = np.linalg.inv(rotation_rates(self.pose[3:]))
        return np.asarray(J @ self.covariance @ J.T)


class MatchedPasses(NamedTuple):
    """A scanner's pose (6,) at which passes agree: x, y, z, yaw, pitch, roll.

    ``rms_before`` and ``rms_after`` are the root mean square distances of matched points from
    their partners' planes, metres.
    """

    pose: Array
    rms_before: float
    rms_after: float


@dataclass(frozen=True)
class _Pairs:
    """Points, their partners and the partners' normals."""

    source: Ints
    target: Ints
    normals: Array


def match_passes(
    cloud: Cloud,
    times: Array,
    vehicle: Array,
    start: Array,
    sigmas: Array,
    *,
    settings: MatchingSettings | None = None,
    ground: KnownGround | None = None,
) -> MatchedPasses:
    """The pose of a scanner on the vehicle at which passes agree.

    Parameters
    ----------
    cloud : Cloud
        Points of all scans.
    times : (s,) array
        Of the scans.
    vehicle : (s, 6) array
        Poses of the vehicle at those times.
    start : (6,) array
        Hand-measured pose: x, y, z, yaw, pitch, roll.
    sigmas : (6,) array
        How well it was measured: x, y, z in metres, rotations about the vehicle's axes in
        radians. It keeps its weight.
    settings : MatchingSettings, optional
        How to match.
    ground : KnownGround, optional
        The height of the road under the wheels. Passes over the same ground hardly tell how
        high the scanner is, this does.

    Raises
    ------
    GtvalError
        If too few points have a partner from another pass.

    Notes
    -----
    The path is taken as exact. An error that it has at all poses alike (a wrong vertical offset
    tilts the whole vehicle frame) comes back as the opposite turn of the scanner, and noise of
    the angles of a degree, as three receivers on a small roof give it, moves the result by
    centimetres. `rtk_gt.sensors.scanner_calibration.calibrate_scanners` has neither fault.
    """
    settings = settings or MatchingSettings()
    rows = times[cloud.scan]
    pose = np.array(start, dtype=float)
    prior = np.diag(1 / np.square(sigmas))
    first_rms = np.nan
    for gate in settings.gates:
        pairs = _matched(cloud, rows, vehicle, pose, gate, settings)
        residual, J = _equations(cloud, vehicle, pose, pairs)
        scale = max(float(sigma_from_median(residual)), 1e-4)
        if np.isnan(first_rms):
            first_rms = float(np.sqrt(np.mean(residual**2)))
        weights = weights_of(residual)
        # Points of one moment share the error of the path there: they count together.
        information = (J * weights[:, None]).T @ J / scale**2
        pull = -(J * weights[:, None]).T @ residual / scale**2
        share = _independent_share(rows[pairs.source], settings.block, len(residual))
        data, right = information * share, pull * share
        if ground is not None:
            more, toward = _ground_equations(cloud, pose, ground)
            data, right = data + more, right + toward
        moved = change_from(start, pose)
        change: Array = np.asarray(
            np.linalg.solve(data + prior, right - prior @ moved), dtype=float
        )
        pose = perturbed(pose, change)
    pairs = _matched(cloud, rows, vehicle, pose, settings.gates[-1], settings)
    residual, _ = _equations(cloud, vehicle, pose, pairs)
    return MatchedPasses(pose, first_rms, float(np.sqrt(np.mean(residual**2))))


def weights_of(residual: Array) -> Array:
    """Geman-McClure weights of residuals, scaled by their median."""
    scale = max(float(sigma_from_median(residual)), 1e-4)
    return np.asarray(1 / (1 + (residual / (2 * scale)) ** 2) ** 2)


def _independent_share(times: Array, block: float, count: int) -> float:
    return min(len(np.unique(np.floor(times / block))) * 20 / max(count, 1), 1.0)


def perturbed(pose: Array, change: Array) -> Array:
    """The pose after a translation and a rotation vector, both in the vehicle frame."""
    turned = Rotation.from_rotvec(change[3:]).as_matrix() @ matrix_of(pose[3:])
    return np.concatenate([pose[:3] + change[:3], angles_of(turned)])


def change_from(start: Array, pose: Array) -> Array:
    """(6,) change in the vehicle frame that makes ``pose`` of ``start``."""
    turn = matrix_of(pose[3:]) @ matrix_of(np.asarray(start)[3:]).T
    return np.concatenate([pose[:3] - start[:3], Rotation.from_matrix(turn).as_rotvec()])


def _matched(
    cloud: Cloud, times: Array, vehicle: Array, pose: Array, gate: float, settings: MatchingSettings
) -> _Pairs:
    """Points with their nearest partner from another pass, where that is on a plane."""
    world = cloud.in_world(vehicle, pose)
    seen_from = vehicle[:, :3] + matrix_of(vehicle[:, 3:]) @ pose[:3]
    step = max(len(world) // settings.sources, 1)
    chosen = np.arange(0, len(world), step)
    blocks = np.floor((times - times.min()) / settings.apart).astype(np.int64)
    sources, targets, normals = [], [], []
    for block in np.unique(blocks):
        own = chosen[blocks[chosen] == block]
        other = np.flatnonzero(np.abs(blocks - block) > 1)
        if len(own) == 0 or len(other) < NEIGHBOURS:
            continue
        tree = cKDTree(world[other])
        distance, near = map(
            np.asarray, tree.query(world[own], NEIGHBOURS, distance_upper_bound=3 * gate)
        )
        full = np.isfinite(distance).all(1) & (distance[:, 0] < gate)
        partners = other[np.where(full[:, None], near, 0)]
        normal, flat = _planes(world[partners], settings.flat)
        # Both passes must have seen the plane from the same side: no wall is infinitely thin.
        side = np.einsum("ni,ni->n", normal, world[own] - seen_from[cloud.scan[own]])
        other_side = np.einsum(
            "ni,ni->n", normal, world[partners[:, 0]] - seen_from[cloud.scan[partners[:, 0]]]
        )
        good = full & flat & (side * other_side > 0)
        sources.append(own[good])
        targets.append(partners[good, 0])
        normals.append(normal[good])
    count = sum(len(part) for part in sources)
    if count < FEWEST_PAIRS:
        raise GtvalError(
            f"only {count} points are seen from two passes at least {settings.apart:g} s apart; "
            "drive past the same places again, in another direction"
        )
    return _Pairs(np.concatenate(sources), np.concatenate(targets), np.concatenate(normals))


def _planes(groups: Array, flat: float) -> tuple[Array, Bools]:
    """Normals (n, 3) of groups of points (n, k, 3), and which groups are planes."""
    centred = groups - groups.mean(1, keepdims=True)
    spreads: Array = np.swapaxes(centred, 1, 2) @ centred
    values, vectors = np.linalg.eigh(spreads)
    spread = values[:, 1] > 1e-4
    return vectors[:, :, 0], np.asarray(spread & (values[:, 0] < flat**2 * values[:, 1] * 4))


def _equations(cloud: Cloud, vehicle: Array, pose: Array, pairs: _Pairs) -> tuple[Array, Array]:
    """Distances from the partners' planes (n,), and their derivative (n, 6)."""
    world = cloud.in_world(vehicle, pose)
    arms = cloud.own @ matrix_of(pose[3:]).T
    R = matrix_of(vehicle[:, 3:])
    residual = np.einsum("ni,ni->n", pairs.normals, world[pairs.source] - world[pairs.target])
    J = np.zeros((len(residual), 6))
    for rows, sign in ((pairs.source, 1.0), (pairs.target, -1.0)):
        own_normal = np.einsum("nij,ni->nj", R[cloud.scan[rows]], pairs.normals)
        J[:, :3] += sign * own_normal
        J[:, 3:] += sign * np.cross(arms[rows], own_normal)
    return residual, J


def _ground_equations(cloud: Cloud, pose: Array, ground: KnownGround) -> tuple[Array, Array]:
    """Information (6, 6) and right-hand side of the road under the wheels.

    The points of one scan err together (camber, curvature), and all of them with the stated
    height: the mean over the scans is known no better than ``sigma``.
    """
    points = cloud.in_vehicle(pose)
    rows = road_points(points, pose, ground.shape, ground)
    if len(rows) < 20:
        return np.zeros((6, 6)), np.zeros(6)
    points = points[rows]
    residual = points[:, 2] - ground.height
    up = np.array([0.0, 0.0, 1.0])
    J = np.hstack([np.tile(up, (len(rows), 1)), np.cross(points - pose[:3], up)])
    scans = len(np.unique(cloud.scan[rows]))
    white = J.T @ J * (scans / len(rows)) / ground.roughness**2
    right = -J.T @ residual * (scans / len(rows)) / ground.roughness**2
    mean = J.mean(0)
    # An error of the stated height is common to all: it is marginalised (Woodbury).
    bound = 1 / (ground.sigma**-2 + scans / ground.roughness**2)
    weight = scans / ground.roughness**2 * mean
    lost = np.outer(weight, weight) * bound
    pulled = weight * bound * (-residual.mean() * scans / ground.roughness**2)
    return white - lost, right - pulled


def height_histogram(cloud: Cloud, pose: Array, bins: Array, reach: float = np.inf) -> Array:
    """Share of the points in each bin of height in the vehicle frame.

    Blanco 2009, Fig. 15: on level ground the better pose has the narrower peak. On hills only
    points within ``reach`` metres beside the vehicle are at one height.
    """
    points = cloud.in_vehicle(pose)
    near = np.linalg.norm(points[:, :2], axis=1) < reach
    return np.asarray(np.histogram(points[near, 2], bins)[0] / max(int(near.sum()), 1))
