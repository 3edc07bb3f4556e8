"""Covariance of vehicle poses: from the receivers' noise, the offsets and the antenna positions.

All covariances are of (x, y, z, yaw, pitch, roll), metres and radians, in the local frame.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from rtk_gt.lasting.lasting_error import JumpErrors
from rtk_gt.offsets.noise import GpsNoise
from rtk_gt.path.alignment import align
from rtk_gt.path.orientation import angles_of, rotation_rates, skew
from validation.poses.angles import Array

_CHUNK = 8_000
"""Samples worked on at once: few enough to stay in the processor's cache."""
_AT_ONCE = 8192
"""Poses, likewise: an hour at 20 Hz has 72,000, whose Jacobians are 31 MB and are copied thrice."""


def pose_jacobian(antennas: Array, rotation: Array) -> Array:
    """Derivative (..., 6, 3 r) of a pose with respect to the measured antenna positions.

    Parameters
    ----------
    antennas : (r, 3) array
        In the vehicle frame, metres.
    rotation : (..., 3, 3) array
        Vehicle to local frame.

    Notes
    -----
    First order, at residuals of 0: the least-squares pose of Blanco 2009, Eq. 10, moves by
    (A'A)^-1 A' with A_i = [I, -[R p_i]x]. In the vehicle's own axes this is the same at every
    pose; rows and columns are turned into the local frame.
    """
    r = len(antennas)
    design = np.concatenate([np.tile(np.eye(3), (r, 1, 1)), -skew(antennas)], axis=-1)
    own = np.linalg.pinv(design.reshape(3 * r, 6)).reshape(2, 3, r, 3)
    # 'tij': rows i of position and rotation vector, turned; the columns turned back.
    moved = np.einsum("...ij,pjrk,...lk->...pirl", rotation, own, rotation)
    moved = moved.reshape(*rotation.shape[:-2], 2, 3, 3 * r)
    rates = rotation_rates(angles_of(rotation))
    by_angle = np.linalg.solve(rates, moved[..., 1, :, :])
    return np.concatenate([moved[..., 0, :, :], by_angle], axis=-2)


def piecewise(of: Callable[[Array], Array], values: Array) -> Array:
    """What a function of (n, ...) arrays gives, some rows at a time: its copies stay small.

    Parameters
    ----------
    of : callable
        Of some rows, or of one value without rows.
    values : (n, ...) or (3, 3) array
        Rotations or Jacobians.
    """
    if values.ndim == 2 or len(values) <= _AT_ONCE:
        return of(values)
    first = of(values[:_AT_ONCE])
    found = np.empty((len(values), *first.shape[1:]))
    found[:_AT_ONCE] = first
    for start in range(_AT_ONCE, len(values), _AT_ONCE):
        found[start : start + _AT_ONCE] = of(values[start : start + _AT_ONCE])
    return found


def noise_covariance(antennas: Array, rotation: Array, noise: GpsNoise) -> Array:
    """Covariance (..., 6, 6) of poses from the receivers' noise, directly at each orientation.

    Parameters
    ----------
    antennas, rotation
        As in `pose_jacobian`.
    noise : GpsNoise
        Of each receiver, independent, with its larger part along the local vertical.
    """
    spread = np.kron(np.eye(len(antennas)), noise.covariance)

    def of(some: Array) -> Array:
        J = pose_jacobian(antennas, some)
        return np.asarray(J @ spread @ np.swapaxes(J, -1, -2))

    return piecewise(of, rotation)


def reference_covariance(antennas: Array, noise: GpsNoise) -> Array:
    """W* (6, 6): covariance of the pose at the origin, to first order (Blanco 2009, Eq. 23)."""
    return noise_covariance(antennas, np.eye(3), noise)


def simulated_covariance(
    antennas: Array,
    noise: GpsNoise,
    samples: int,
    generator: np.random.Generator,
    workers: int = 2,
) -> Array:
    """W* (6, 6) from simulated measurements, as published with 10^7 of them.

    Parameters
    ----------
    antennas : (r, 3) array
        In the vehicle frame, metres.
    noise : GpsNoise
        Of each receiver.
    samples : int
        Number of simulations; the relative error of a variance is sqrt(2 / samples).
    generator : numpy.random.Generator
        Its children make the noise, so that the result does not depend on ``workers``.
    workers : int
        Threads.
    """
    sizes = [_CHUNK] * (samples // _CHUNK) + ([samples % _CHUNK] if samples % _CHUNK else [])
    sigmas = np.sqrt(np.diagonal(noise.covariance))

    def moments(job: tuple[int, np.random.Generator]) -> tuple[Array, Array]:
        size, own = job
        world = antennas + own.standard_normal((size, len(antennas), 3)) * sigmas
        rotation, translation = align(antennas, world)
        poses = np.concatenate([translation, angles_of(rotation)], axis=1)
        return poses.sum(0), poses.T @ poses

    with ThreadPoolExecutor(workers) as pool:
        parts = list(pool.map(moments, zip(sizes, generator.spawn(len(sizes)), strict=True)))
    mean = np.sum([part[0] for part in parts], axis=0) / samples
    second = np.sum([part[1] for part in parts], axis=0)
    return np.asarray((second - samples * np.outer(mean, mean)) / (samples - 1))


def systematic_jacobian(antennas: Array, rotation: Array, by_distance: Array) -> Array:
    """Derivative (..., 6, 3 (r - 1) + p) of poses with respect to offsets and distances.

    Parameters
    ----------
    antennas, rotation
        As in `pose_jacobian`.
    by_distance : (3 r, p) array
        Derivative of the antenna positions with respect to the distances.

    Notes
    -----
    An offset moves a measured position; a change of an antenna's place on the vehicle acts like
    the opposite movement of its measured position. These errors are the same at all poses of a
    drive; the published covariances leave them out.
    """
    r = len(antennas)
    places = by_distance.reshape(r, 3, -1)

    def of(some: Array) -> Array:
        J = pose_jacobian(antennas, some)
        turned = np.einsum("...ij,rjp->...rip", some, places)
        turned = turned.reshape(*some.shape[:-2], 3 * r, -1)
        return np.concatenate([J[..., 3:], -J @ turned], axis=-1)

    return piecewise(of, rotation)


def jump_jacobian(antennas: Array, rotation: Array, times: Array, jumps: JumpErrors) -> Array:
    """Derivative (n, 6, 3 j) of poses with respect to the sizes of jumps of some antennas.

    Parameters
    ----------
    antennas, rotation
        As in `pose_jacobian`; rotations (n, 3, 3).
    times : (n,) array
        Of the poses, seconds since 1970: before its start a jump moves nothing.
    jumps : JumpErrors
        Whose jumps, and from when on.
    """
    J = pose_jacobian(antennas, rotation).reshape(len(times), 6, len(antennas), 3)
    after = (times[:, None] >= jumps.starts - 1e-6).astype(float)
    return np.asarray(
        np.einsum("tj,jr,tcra->tcja", after, jumps.receivers, J).reshape(len(times), 6, -1)
    )
