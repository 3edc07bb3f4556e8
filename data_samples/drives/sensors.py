"""What the other sensors of a synthetic drive record: a consumer GPS, an IMU, a camera."""

from pathlib import Path

import numpy as np

from data_samples.drives.drive import LEFT_CAMERA, START, Drive, DriveSettings
from rtk_gt.path.orientation import matrix_of
from rtk_gt.receivers.fixes import RTK_FIXED, Bools, Fixes
from rtk_gt.sensors.camera_pose import Lens, in_camera
from validation.poses.angles import Array

LENS = Lens(
    np.array([[923.5295, 0, 507.2222], [0, 922.2418, 383.5822], [0, 0, 1]]),
    np.array([-0.353754, 0.162014, 1.643379e-3, 3.655471e-4]),
)
"""Left camera of Blanco 2009, Table 4; its images have 1024 x 768 pixels."""
WIDTH, HEIGHT = 1024, 768
CONSUMER_ANTENNA = np.array([-0.25, 0.0, 0.1])
"""Metres, on the vehicle: beside none of the three receivers, so that its offset shows."""
DGPS = 2
"""Quality of a differential fix in NMEA 0183, sentence GGA."""


def consumer_fixes(drive: Drive, generator: np.random.Generator) -> Fixes:
    """A differential GPS, once a second: white noise of 1 m and a slow error of 1.5 m."""
    times = START + np.arange(0.0, drive.duration)
    n = len(times)
    slow = np.empty((n, 3))
    slow[0] = generator.standard_normal(3)
    for row in range(1, n):  # it takes a minute to change
        slow[row] = slow[row - 1] * np.exp(-1 / 60)
        slow[row] += np.sqrt(1 - np.exp(-2 / 60)) * generator.standard_normal(3)
    error = (1.5 * slow + generator.standard_normal((n, 3))) * [1.0, 1.0, 1.75]
    true = drive.T_local_vehicle(times).apply(np.tile(CONSUMER_ANTENNA, (n, 1)))
    sigmas = np.hypot(1.5, 1.0) * np.array([1.0, 1.0, 1.75])
    return Fixes(
        receiver="consumer",
        times=times,
        geodetic=drive.frame.to_geodetic(true + error),
        kinds=np.full(n, DGPS),
        satellites=np.full(n, 7),
        hdop=np.full(n, 1.5),
        covariances=np.tile(np.diag(sigmas**2), (n, 1, 1)),
        lines=np.arange(1, n + 1),
        source=Path("consumer.nmea"),
    )


def standing_fixes(drive: Drive, generator: np.random.Generator) -> Fixes:
    """A receiver that stands at the origin for half an hour before the drive, once a second."""
    n = 1800
    times = START - 2 * n + np.arange(float(n))
    covariance = DriveSettings().noise.covariance
    return Fixes(
        receiver="standing",
        times=times,
        geodetic=drive.frame.to_geodetic(
            generator.standard_normal((n, 3)) @ np.sqrt(covariance)  # it is diagonal
        ),
        kinds=np.full(n, RTK_FIXED),
        satellites=np.full(n, 12),
        hdop=np.full(n, 0.9),
        covariances=np.tile(covariance, (n, 1, 1)),
        lines=np.arange(1, n + 1),
        source=Path("standing.nmea"),
    )


def imu_angles(drive: Drive, generator: np.random.Generator) -> tuple[Array, Array]:
    """Times (n,) and yaw, pitch, roll (n, 3) at 20 Hz; its yaw drifts by 0.02 degrees a second."""
    times = START + np.arange(0.0, drive.duration - 1, 0.05)
    angles = drive.poses(times)[:, 3:]
    angles[:, 0] += np.radians(0.02) * (times - START)
    return times, angles + np.radians(0.02) * generator.standard_normal(angles.shape)


def corner_sightings(drive: Drive, generator: np.random.Generator) -> tuple[Array, Array, Array]:
    """Corners of buildings in the left camera's images, one every 2 s.

    Returns
    -------
    times : (n,) array
        Of the image.
    points : (n, 3) array
        The corner in the local frame, to 2 cm, as a person reads it from a point cloud.
    pixels : (n, 2) array
        Where it is seen, to half a pixel.
    """
    corners = drive.campus.corners()
    times, points, pixels = [], [], []
    for time in START + np.arange(1.0, drive.duration - 1, 2.0):
        pose = drive.poses(np.array([time]))[0]
        own = in_camera(corners, pose, LEFT_CAMERA)
        seen = LENS.project(own)
        # Beyond 35 degrees from the axis the polynomial of the distortion is none any more.
        near = (own[:, 2] > 1) & (own[:, 2] < 30)
        near &= np.hypot(own[:, 0], own[:, 1]) < 0.7 * own[:, 2]
        inside = near & (seen > 0).all(1) & (seen < [WIDTH, HEIGHT]).all(1)
        rows = np.flatnonzero(inside)
        rows = rows[_in_sight(drive, pose, corners[rows])]
        times.append(np.full(len(rows), time))
        points.append(corners[rows] + 0.02 * generator.standard_normal((len(rows), 3)))
        pixels.append(seen[rows] + 0.5 * generator.standard_normal((len(rows), 2)))
    return np.concatenate(times), np.concatenate(points), np.concatenate(pixels)


def _in_sight(drive: Drive, pose: Array, corners: Array) -> Bools:
    """True for corners that nothing hides from the camera."""
    if len(corners) == 0:
        return np.zeros(0, dtype=bool)
    eye = pose[:3] + matrix_of(pose[3:]) @ LEFT_CAMERA[:3]
    away = corners - eye
    distance = np.linalg.norm(away, axis=1)
    hit = drive.campus.cast(np.tile(eye, (len(corners), 1)), away / distance[:, None], reach=60.0)
    return np.asarray(hit > distance - 0.1)
