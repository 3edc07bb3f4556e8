"""Sensor poses from vehicle poses, with covariances of (x, y, z, yaw, pitch, roll).

The published appendix adds the angles of the two poses and has one term of the Jacobian wrong;
that form is kept under its own name, for comparison with published files.
"""

from typing import NamedTuple

import numpy as np

from rtk_gt.path.orientation import angles_of, matrix_of, rotation_rates, skew
from validation.poses.angles import Array, wrap


class Composed(NamedTuple):
    """Poses (..., 6) and their covariances (..., 6, 6); NaN at +-90 degrees of pitch."""

    poses: Array
    covariances: Array


def composition_jacobians(vehicle: Array, sensor: Array) -> tuple[Array, Array]:
    """Derivatives (..., 6, 6) of vehicle (+) sensor with respect to each.

    Parameters
    ----------
    vehicle : (..., 6) array
        Poses x, y, z, yaw, pitch, roll of the vehicle in the world.
    sensor : (..., 6) array
        Pose of the sensor on the vehicle; the same leading shape, or (6,).

    Notes
    -----
    What Eq. 33 and 34 of Blanco 2009 are meant to be, for the composition of rotations: a small
    turn of the vehicle turns the sensor by the same rotation vector, and one of the sensor on
    the vehicle by R times its own. The matrices of `rotation_rates` lead from angles to rotation
    vectors and back.
    """
    return _with_jacobians(np.asarray(vehicle, float), np.asarray(sensor, float))[1:]


def _with_jacobians(vehicle: Array, sensor: Array) -> tuple[Array, Array, Array]:
    """Poses of the sensor, and their derivatives."""
    R = matrix_of(vehicle[..., 3:])
    arm = np.einsum("...ij,...j->...i", R, sensor[..., :3])
    angles = angles_of(R @ matrix_of(sensor[..., 3:]))
    composed = np.concatenate([vehicle[..., :3] + arm, angles], axis=-1)
    vehicle_rates = rotation_rates(vehicle[..., 3:])
    sensor_rates = rotation_rates(sensor[..., 3:])
    composed_rates = rotation_rates(angles)
    by_vehicle = np.zeros((*composed.shape, 6))
    by_sensor = np.zeros((*composed.shape, 6))
    by_vehicle[..., :3, :3] = np.eye(3)
    by_vehicle[..., :3, 3:] = -skew(arm) @ vehicle_rates
    by_sensor[..., :3, :3] = R
    by_vehicle[..., 3:, 3:] = _solved(composed_rates, vehicle_rates)
    by_sensor[..., 3:, 3:] = _solved(composed_rates, R @ sensor_rates)
    return composed, by_vehicle, by_sensor


def _solved(rates: Array, right: Array) -> Array:
    """Inverse of the rates times a matrix; NaN where yaw and roll turn about one axis."""
    singular = np.abs(np.linalg.det(rates)) < 1e-9
    safe = np.where(singular[..., None, None], np.eye(3), rates)
    return np.asarray(np.where(singular[..., None, None], np.nan, np.linalg.solve(safe, right)))


def compose(
    vehicle: Array, vehicle_covariance: Array, sensor: Array, sensor_covariance: Array
) -> Composed:
    """Poses of a sensor on a vehicle, s = v (+) u, with covariances to first order.

    Parameters
    ----------
    vehicle : (..., 6) array
        Poses of the vehicle.
    vehicle_covariance : (..., 6, 6) array
        Their covariances.
    sensor : (6,) array
        Pose of the sensor on the vehicle.
    sensor_covariance : (6, 6) array
        Its covariance, independent of the vehicle's.

    Notes
    -----
    Blanco 2009, Eq. 26 and 32, with the rotations composed as rotations.
    """
    poses, by_vehicle, by_sensor = _with_jacobians(vehicle, sensor)
    covariance = _through(by_vehicle, vehicle_covariance) + _through(by_sensor, sensor_covariance)
    return Composed(poses, covariance)


def _like(sensor: Array, vehicle: Array) -> Array:
    return np.broadcast_to(sensor, np.shape(vehicle))


def _through(J: Array, covariance: Array) -> Array:
    return np.asarray(J @ covariance @ np.swapaxes(J, -1, -2))


def published_composition(
    vehicle: Array,
    vehicle_covariance: Array,
    sensor: Array,
    sensor_covariance: Array,
    *,
    as_printed: bool = True,
) -> Composed:
    """The published form, which adds angles: for comparison with published files only.

    It is right only where the vehicle turns about its vertical axis alone. Parameters as in
    `compose`; with ``as_printed`` the misprint in F14 is kept.

    Notes
    -----
    Blanco 2009, Eq. 30, 33 and 34.
    """
    vehicle = np.asarray(vehicle, dtype=float)
    sensor = np.asarray(_like(sensor, vehicle), dtype=float)
    R = matrix_of(vehicle[..., 3:])
    position = vehicle[..., :3] + np.einsum("...ij,...j->...i", R, sensor[..., :3])
    poses = np.concatenate([position, wrap(vehicle[..., 3:] + sensor[..., 3:])], axis=-1)
    by_vehicle = published_jacobian(vehicle, sensor, as_printed=as_printed)
    by_sensor = np.zeros((*vehicle.shape, 6))
    by_sensor[..., :3, :3] = R
    by_sensor[..., 3:, 3:] = np.eye(3)
    covariance = _through(by_vehicle, vehicle_covariance) + _through(by_sensor, sensor_covariance)
    return Composed(poses, covariance)


def published_jacobian(vehicle: Array, sensor: Array, *, as_printed: bool = True) -> Array:
    """Eq. 33 of Blanco 2009, (..., 6, 6), with F14 as printed or as it should be."""
    vehicle, sensor = np.broadcast_arrays(vehicle, sensor)
    arm = np.einsum("...ij,...j->...i", matrix_of(vehicle[..., 3:]), sensor[..., :3])
    F = np.broadcast_to(np.eye(6), (*vehicle.shape, 6)).copy()
    # The position block is that of the right composition; only F14 is printed differently.
    F[..., :3, 3:] = -skew(arm) @ rotation_rates(vehicle[..., 3:])
    if as_printed:
        yaw, pitch = vehicle[..., 3], vehicle[..., 4]
        right = -sensor[..., 0] * np.sin(yaw) * np.cos(pitch)
        printed = -sensor[..., 0] * np.sin(yaw) * np.cos(yaw)
        F[..., 0, 3] += printed - right
    return F
