"""Paths of the vehicle and of its sensors as the tables that all systems share."""

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from rtk_gt.campaign.outcome import RtkOutcome
from rtk_gt.path.composition import compose, published_composition
from rtk_gt.path.interpolation import Interpolated
from rtk_gt.path.orientation import rotation_rates
from rtk_gt.path.vehicle_path import VehiclePath
from rtk_gt.receivers.fixes import Bools
from rtk_gt.settings import Sensor
from validation.poses.angles import Array
from validation.poses.pose_table import ROWS, SPATIAL, PoseTable
from validation.poses.trajectory import Clock, Trajectory


def vehicle_table(
    path: VehiclePath, leaps: Bools | None = None, corrected: Bools | None = None
) -> PoseTable:
    """The path of the vehicle; the stops are named by their times.

    Poses that leap against their neighbours, or from which a jump was taken out, say so in their
    source.
    """
    none = np.zeros(len(path), dtype=bool)
    return PoseTable(
        system="rtk",
        ids=_names(path.times),
        poses=path.poses,
        covariances=path.covariances,
        components=SPATIAL,
        sources=_sources(
            none if leaps is None else leaps, none if corrected is None else corrected
        ),
        factor=path.shared_factor,
        provenance={"frame": str(path.frame), "published_as": "times are seconds UTC since 1970"},
    )


def _names(times: Array) -> tuple[str, ...]:
    return tuple(f"{time:.3f}" for time in times.tolist())


def _sources(leaps: Bools, corrected: Bools) -> tuple[str, ...]:
    said = zip(leaps.tolist(), corrected.tolist(), strict=True)
    return tuple(
        f"RTK fixed{', jump taken out' if jump else ''}{', leaps' if leap else ''}"
        for leap, jump in said
    )


def vehicle_trajectory(path: VehiclePath, max_gap: float) -> Trajectory:
    """The path of the vehicle as poses in time, for a comparison with what else moves.

    Covariances of yaw, pitch and roll become those of a small rotation about the fixed axes.
    """
    epoch = int(np.floor(path.times[0]))
    covariances = path.covariances
    rates = rotation_rates(path.poses[:, 3:])
    covariances[:, 3:] = rates @ covariances[:, 3:]
    covariances[:, :, 3:] = covariances[:, :, 3:] @ np.swapaxes(rates, -1, -2)
    turned = Rotation.from_euler("ZYX", path.poses[:, 3:]).as_quat()
    return Trajectory(
        system="rtk",
        times=path.times - epoch,
        poses=np.column_stack([path.poses[:, :3], turned]),
        kind="space",
        covariances=covariances,
        epoch=epoch,
        clock=Clock(stamps="capture"),
        longest_interval=max_gap,
        frame=str(path.frame),
    )


def sensor_pieces(outcome: RtkOutcome, sensor: Sensor) -> Iterator[PoseTable]:
    """The path of a sensor, some poses after the other: an hour at 20 Hz is 25 MB."""
    own = np.array(sensor.pose), np.diag(np.square(sensor.sigmas))
    corrected = outcome.corrected
    for start in range(0, len(outcome.path), ROWS):
        rows = np.arange(start, min(start + ROWS, len(outcome.path)))
        path = outcome.path.select(rows)
        poses, covariances = compose(path.poses, path.covariances, *own)
        yield PoseTable(
            system=f"rtk_{sensor.name}",
            ids=_names(path.times),
            poses=poses,
            covariances=covariances,
            components=SPATIAL,
            sources=_sources(outcome.leaps[rows], corrected[rows]),
        )


def table_at(
    vehicle: Interpolated, sensor: Sensor | None = None, *, additive_angles: bool = False
) -> PoseTable:
    """Poses of a sensor at the times of its data, where there is ground truth.

    Parameters
    ----------
    vehicle : Interpolated
        Poses of the vehicle at those times; ``available`` says which are in gaps.
    sensor : Sensor, optional
        By default the poses are those of the vehicle.
    additive_angles : bool
        Compose as published, by adding angles; the sources of the poses then say so.
    """
    rows = vehicle.available
    system, source = "rtk", "interpolated"
    poses, covariances = vehicle.poses[rows], vehicle.covariances[rows]
    if sensor is not None:
        system = f"rtk_{sensor.name}"
        source += ", angles added" if additive_angles else ""
        composed = published_composition if additive_angles else compose
        own = np.diag(np.square(sensor.sigmas))
        poses, covariances = composed(poses, covariances, np.array(sensor.pose), own)
    return PoseTable(
        system=system,
        ids=tuple(f"{time:.6f}" for time in vehicle.times[rows]),
        poses=poses,
        covariances=covariances,
        components=SPATIAL,
        sources=(source,) * int(rows.sum()),
        provenance={"methods": dict(vehicle.methods)},
    )
