"""How a consumer GPS and an IMU on the vehicle compare with the ground truth."""

from dataclasses import dataclass

import numpy as np

from rtk_gt.offsets.robust import autocorrelation_time
from rtk_gt.path.interpolation import Interpolated
from rtk_gt.path.orientation import matrix_of
from rtk_gt.path.vehicle_path import VehiclePath
from rtk_gt.receivers.fixes import Fixes
from validation.errors import GtvalError
from validation.poses.angles import Array, wrap
from validation.poses.earth_frames import LocalFrame
from validation.poses.trajectory import Trajectory


@dataclass(frozen=True)
class PositionErrors:
    """Errors of a GPS receiver against the path, in the local frame.

    Parameters
    ----------
    errors : (n, 3) array
        Recorded minus true position of its antenna, metres.
    times : (n,) array
        Seconds since 1970.
    rmse_horizontal, rmse_vertical : float
        Root mean square errors, metres.
    bias : (3,) array
        Mean error.
    bias_sigma : (3,) array
        Its standard error, for the autocorrelation found. Of a record of fewer than some fifty
        correlation times this is too small: its mean has taken the slowest part of the errors.
    correlation_time : float
        How many fixes are worth one independent fix.
    """

    errors: Array
    times: Array
    rmse_horizontal: float
    rmse_vertical: float
    bias: Array
    bias_sigma: Array
    correlation_time: float


def position_errors(
    record: Fixes, found: Interpolated, antenna: Array, path: VehiclePath
) -> PositionErrors:
    """Errors of a receiver where there is ground truth (Blanco 2009, section 5.2).

    Parameters
    ----------
    record : Fixes
        The receiver's record.
    found : Interpolated
        Vehicle poses at its times.
    antenna : (3,) array
        Its antenna on the vehicle.
    path : VehiclePath
        For the local frame.

    Raises
    ------
    GtvalError
        If there is no common time.
    """
    rows = found.available
    if not rows.any():
        raise GtvalError(f"receiver {record.receiver} has no fix where there is ground truth")
    poses = found.poses[rows]
    true = poses[:, :3] + matrix_of(poses[:, 3:]) @ antenna
    errors = path.frame.from_geodetic(record.geodetic[rows]) - true
    tau = autocorrelation_time(errors)
    scatter = errors.std(0, ddof=1) if len(errors) > 1 else np.full(3, np.nan)
    return PositionErrors(
        errors=errors,
        times=record.times[rows],
        rmse_horizontal=float(np.sqrt(np.square(errors[:, :2]).sum(1).mean())),
        rmse_vertical=float(np.sqrt(np.square(errors[:, 2]).mean())),
        bias=errors.mean(0),
        bias_sigma=scatter * np.sqrt(tau / len(errors)),
        correlation_time=tau,
    )


def record_trajectory(record: Fixes, frame: LocalFrame) -> Trajectory:
    """All positions of a receiver in time, in the local frame."""
    epoch = int(np.floor(record.times[0]))
    return Trajectory(
        system=record.receiver,
        times=record.times - epoch,
        poses=frame.from_geodetic(record.geodetic),
        kind="points_space",
        epoch=epoch,
    )


@dataclass(frozen=True)
class RateErrors:
    """Errors of one angle's rate as an IMU gives it, radians per second.

    ``rmse``, and mean and greatest size of the true rate, as printed in Blanco 2009, section
    5.5; ``drift`` is the mean rate error with its standard error. ``times`` (n,) are the middles
    of the intervals, ``true`` and ``errors`` (n,) the path's rate and the IMU's error there.
    """

    name: str
    rmse: float
    mean_rate: float
    greatest_rate: float
    drift: float
    drift_sigma: float
    intervals: int
    times: Array
    true: Array
    errors: Array


def rate_errors(times: Array, angles: Array, path: VehiclePath, max_gap: float) -> list[RateErrors]:
    """Yaw, pitch and roll rates of an IMU against those of the path, between its poses.

    Parameters
    ----------
    times : (m,) array
        Of the IMU's readings, seconds since 1970, increasing.
    angles : (m, 3) array
        Its yaw, pitch and roll, radians.
    path : VehiclePath
        The ground truth.
    max_gap : float
        Pairs of poses farther apart are not used, seconds.

    Raises
    ------
    GtvalError
        If the IMU was not recording along the path.

    Notes
    -----
    Differences over whole intervals between poses: rates of the ground truth over less would be
    differences of noise.
    """
    inside = (path.times >= times[0]) & (path.times <= times[-1])
    pairs = np.flatnonzero(inside[:-1] & inside[1:] & (np.diff(path.times) <= max_gap))
    if len(pairs) < 3:
        raise GtvalError(
            f"the IMU has readings at {len(pairs)} pairs of neighbouring poses only: it recorded "
            f"from {times[0]:.3f} to {times[-1]:.3f}, the path is from {path.times[0]:.3f} to "
            f"{path.times[-1]:.3f} seconds since 1970 UTC. Are they of the same drive and clock?"
        )
    unwrapped = np.unwrap(angles, axis=0)
    at = np.column_stack([np.interp(path.times, times, unwrapped[:, k]) for k in range(3)])
    lasting = np.diff(path.times)[pairs, None]
    own = (at[pairs + 1] - at[pairs]) / lasting
    true = wrap(path.poses[pairs + 1, 3:] - path.poses[pairs, 3:]) / lasting
    errors = own - true
    found = []
    for column, name in enumerate(("yaw", "pitch", "roll")):
        error = errors[:, column]
        tau = autocorrelation_time(error[:, None])
        found.append(
            RateErrors(
                name=name,
                rmse=float(np.sqrt(np.mean(error**2))),
                mean_rate=float(np.abs(true[:, column]).mean()),
                greatest_rate=float(np.abs(true[:, column]).max()),
                drift=float(error.mean()),
                drift_sigma=float(error.std(ddof=1) * np.sqrt(tau / len(error))),
                intervals=len(error),
                times=(path.times[pairs] + path.times[pairs + 1]) / 2,
                true=true[:, column],
                errors=error,
            )
        )
    return found
