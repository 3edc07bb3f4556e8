"""The vehicle's path: a pose with covariance wherever all receivers are RTK-fixed together."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag

from rtk_gt.lasting.lasting_error import JumpErrors
from rtk_gt.offsets.estimate import Offsets
from rtk_gt.offsets.noise import GpsNoise
from rtk_gt.offsets.slow_errors import ErrorModel
from rtk_gt.path.alignment import align
from rtk_gt.path.antennas import Antennas, check_antennas
from rtk_gt.path.covariance import (
    jump_jacobian,
    noise_covariance,
    piecewise,
    systematic_jacobian,
)
from rtk_gt.path.orientation import angles_of, matrix_of
from rtk_gt.receivers.steps import Steps
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.earth_frames import LocalFrame
from validation.shown import Shown


@dataclass(frozen=True, repr=False)
class VehiclePath(Shown):
    """Poses of the vehicle in the local frame.

    Parameters
    ----------
    times : (n,) array
        Seconds since 1970 UTC.
    poses : (n, 6) array
        x, y, z in metres, yaw, pitch, roll in radians.
    noise_covariances : (n, 6, 6) array
        From the receivers' noise that is new at each pose.
    lasting_covariances : (n, 6, 6) array
        From errors that neighbours in time share: slow ones of the receivers, and of all together.
    systematic_factors : (n, 6, k) array
        F: F F^T is what the errors of offsets and distances, the same for the whole drive, do to
        each pose.
    systematic_covariance : (k, k) array
        Covariance of offsets and distances.
    frame : LocalFrame
        The local frame.
    """

    times: Array
    poses: Array
    noise_covariances: Array
    lasting_covariances: Array
    systematic_factors: Array
    systematic_covariance: Array
    frame: LocalFrame

    def __len__(self) -> int:
        return len(self.times)

    @property
    def systematic_covariances(self) -> Array:
        """(n, 6, 6) part of each pose's covariance that all poses share."""
        return piecewise(lambda F: F @ np.swapaxes(F, -1, -2), self.systematic_factors)

    @property
    def covariances(self) -> Array:
        """(n, 6, 6) covariance of each pose, noise, lasting errors and offsets together."""
        found = self.systematic_covariances
        found += self.noise_covariances
        found += self.lasting_covariances
        return found

    @property
    def shared_factor(self) -> Array:
        """(6 n, k) F: F F^T is what the errors of offsets and distances do to all poses."""
        return self.systematic_factors.reshape(6 * len(self), -1)

    def select(self, rows: npt.NDArray[np.bool_] | npt.NDArray[np.int64]) -> "VehiclePath":
        """The chosen poses."""
        return replace(
            self,
            times=self.times[rows],
            poses=self.poses[rows],
            noise_covariances=self.noise_covariances[rows],
            lasting_covariances=self.lasting_covariances[rows],
            systematic_factors=self.systematic_factors[rows],
        )


def vehicle_path(
    steps: Steps,
    offsets: Offsets,
    antennas: Antennas,
    noise: GpsNoise | None = None,
    *,
    jumps: JumpErrors | None = None,
    model: ErrorModel | None = None,
    common: Array | None = None,
) -> VehiclePath:
    """The path from recorded steps.

    Parameters
    ----------
    steps : Steps
        As recorded; steps at which not all receivers are RTK-fixed give no pose.
    offsets : Offsets
        Of the receivers, with the covariance of offsets and distances.
    antennas : Antennas
        Where the antennas are on the vehicle.
    noise : GpsNoise, optional
        Of each receiver; that of the offsets' residuals by default.
    jumps : JumpErrors, optional
        What is left of the errors of jumps that were taken out of the steps.
    model : ErrorModel, optional
        Which share of the noise lasts; without it none.
    common : (t, 3, 3) array, optional
        Covariance of an error that all receivers share at each step, m^2.

    Raises
    ------
    GtvalError
        If no step is complete, the antennas are in one line, the offsets belong to another
        frame, or the vehicle comes out upside down.

    Notes
    -----
    Blanco 2009, Eq. 10. All antennas weigh the same, as published.
    """
    check_antennas(antennas.positions)
    used = steps.select(steps.complete).corrected(offsets.offsets)
    if len(used) == 0:
        raise GtvalError("at no time are all receivers RTK-fixed together: there is no path")
    rotation, translation = align(antennas.positions, used.positions)
    angles = angles_of(rotation)
    if np.median(np.cos(angles[:, 2])) < 0:
        raise GtvalError(
            "the vehicle comes out upside down: are front left and front right exchanged? The "
            "receivers must be listed as rear, front left, front right"
        )
    noise = noise or GpsNoise(offsets.sigma, offsets.eta)
    own = noise_covariance(antennas.positions, rotation, noise)
    lasting = np.broadcast_to(np.zeros((6, 6)), own.shape)
    if model is not None:
        lasting = own * (1 - model.white_share)
        own -= lasting
    if common is not None:
        lasting = lasting.copy()
        lasting[:, :3, :3] += common[steps.complete]
    systematic = systematic_jacobian(antennas.positions, rotation, antennas.by_distance)
    covariance = offsets.covariance
    if jumps is not None:
        by_jump = jump_jacobian(antennas.positions, rotation, used.times, jumps)
        systematic = np.concatenate([systematic, systematic @ jumps.by_offsets - by_jump], axis=-1)
        covariance = block_diag(covariance, jumps.covariance)
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return VehiclePath(
        times=used.times,
        poses=np.concatenate([translation, angles], axis=1),
        noise_covariances=own,
        lasting_covariances=lasting,
        systematic_factors=piecewise(lambda J: J @ root, systematic),
        systematic_covariance=covariance,
        frame=steps.frame,
    )


def heading_span(path: VehiclePath) -> float:
    """Smallest arc in radians that holds all headings; 2 pi for a full turn."""
    yaw = np.sort(np.mod(path.poses[:, 3], 2 * np.pi))
    if len(yaw) < 2:
        return 0.0
    gaps = np.append(np.diff(yaw), yaw[0] + 2 * np.pi - yaw[-1])
    return float(2 * np.pi - gaps.max())


def tilt_spread(path: VehiclePath) -> float:
    """Spread of pitch and roll in radians beyond what noise explains, as a standard deviation."""
    up = matrix_of(path.poses[:, 3:])[:, :, 2]
    spread = np.square(up[:, :2] - up[:, :2].mean(0)).sum(1).mean()
    noise = path.noise_covariances[:, [4, 5], [4, 5]].sum(1).mean()
    return float(np.sqrt(max(spread - noise, 0.0)))
