"""A synthetic drive as a campaign folder: NMEA logs, campaign.toml, and the truth beside it."""

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

import cv2
import numpy as np

from data_samples.drives.drive import (
    LEFT_CAMERA,
    LEFT_SCANNER,
    RIGHT_SCANNER,
    Drive,
)
from data_samples.drives.images import camera_images, image_times
from data_samples.drives.sensors import (
    LENS,
    consumer_fixes,
    corner_sightings,
    imu_angles,
    standing_fixes,
)
from rtk_gt.receivers.fixes import Fixes
from rtk_gt.sensors.scans import LineScans
from validation.poses.angles import Array
from validation.poses.pose_table import SPATIAL, PoseTable, to_csv
from validation.text_files.writing import write_files

SCANNERS = {"left_scanner": LEFT_SCANNER, "right_scanner": RIGHT_SCANNER}
HAND_SIGMAS = np.array([0.02, 0.02, 0.02, *np.radians([2.0, 2.0, 2.0])])
"""How well a scanner's place is measured by hand."""
EXACT_SIGMAS = np.array([0.002, 0.002, 0.002, 0.001745, 0.001745, 0.001745])
"""What campaign.toml states of sensors whose true places it has: 2 mm and 0.1 degrees."""


def write_drive(
    folder: Path,
    drive: Drive,
    scans: Mapping[str, LineScans] | None = None,
    *,
    other_sensors: bool = False,
    images: bool = False,
) -> list[Path]:
    """Write a drive as a campaign folder; returns the paths of its files.

    The truth goes to ``truth/``: the vehicle's pose at every second, the offsets, and where the
    sensors are. Scanners with scans go to ``scans/``, and campaign.toml has their places as
    measured by hand, with the errors that this has. With ``other_sensors`` the records of a
    consumer GPS, an IMU, the left camera and a receiver that stands go to ``sensors/``, with
    ``images`` those of the left camera, too, listed in ``sensors/left_camera_images.csv``.
    """
    files: dict[str, str | bytes] = {
        f"rtk/{record.receiver}.nmea": nmea_text(record) for record in drive.records
    }
    generator = np.random.default_rng([drive.seed, 1])
    sensors = {"left_camera": LEFT_CAMERA, **SCANNERS}
    sigmas = dict.fromkeys(sensors, EXACT_SIGMAS)
    rows = [",".join([name, *(repr(float(v)) for v in pose)]) for name, pose in sensors.items()]
    files["truth/sensors.csv"] = "\n".join(["sensor,x,y,z,yaw,pitch,roll", *rows]) + "\n"
    if images:
        files.update(image_files(drive))
    if other_sensors:
        files.update(sensor_files(drive))
        sensors["left_camera"] = LEFT_CAMERA + HAND_SIGMAS * generator.standard_normal(6)
        sigmas["left_camera"] = HAND_SIGMAS
    for name, read in (scans or {}).items():
        files[f"scans/{name}.csv"] = scan_text(read)
        sensors[name] = sensors[name] + HAND_SIGMAS * generator.standard_normal(6)
        sigmas[name] = HAND_SIGMAS
    files["campaign.toml"] = _toml(drive, sensors, sigmas)
    files["truth/poses_truth.csv"] = to_csv(true_poses(drive))
    rows = [
        ",".join([record.receiver, *(repr(float(v)) for v in value)])
        for record, value in zip(drive.records, drive.offsets.values, strict=True)
    ]
    files["truth/offsets.csv"] = "\n".join(["receiver,x,y,z", *rows]) + "\n"
    return write_files(folder, files)


def true_poses(drive: Drive) -> PoseTable:
    """The vehicle's poses at the times of the first receiver, by which they are named."""
    times = drive.records[0].times
    names = tuple(f"{time:.3f}" for time in times)
    return PoseTable("truth", names, drive.poses(times), components=SPATIAL)


def sensor_files(drive: Drive) -> dict[str, str]:
    """What other sensors and a receiver that stands record, as the commands read it."""
    generator = np.random.default_rng([drive.seed, 2])
    times, angles = imu_angles(drive, generator)
    seen, points, pixels = corner_sightings(drive, generator)
    return {
        "sensors/consumer.nmea": nmea_text(consumer_fixes(drive, generator)),
        "sensors/standing.nmea": nmea_text(
            standing_fixes(drive, np.random.default_rng([drive.seed, 3]))
        ),
        "sensors/imu.csv": _csv("time,yaw,pitch,roll", np.column_stack([times, angles])),
        "sensors/left_camera_points.csv": _csv(
            "time,x,y,z,u,v", np.column_stack([seen, points, pixels])
        ),
        LENS_FILE: lens_text(),
    }


LENS_FILE = "sensors/left_camera_lens.txt"


def lens_text() -> str:
    """The left camera's fx fy cx cy k1 k2 p1 p2, as the commands take them."""
    numbers = (*LENS.matrix[[0, 1, 0, 1], [0, 1, 2, 2]], *LENS.distortion)
    return " ".join(f"{value:.10g}" for value in numbers) + "\n"


def image_files(drive: Drive) -> dict[str, str | bytes]:
    """The left camera's images as PNG files, with their list ``time,file`` and the lens."""
    times = image_times(drive)
    files: dict[str, str | bytes] = {LENS_FILE: lens_text()}
    rows = ["time,file"]
    for time, image in zip(times, camera_images(drive, times), strict=True):
        name = f"left_camera/{time:.3f}.png"
        files[f"sensors/{name}"] = cv2.imencode(".png", image[:, :, ::-1])[1].tobytes()
        rows.append(f"{time:.3f},{name}")
    files["sensors/left_camera_images.csv"] = "\n".join(rows) + "\n"
    return files


def _csv(head: str, rows: Array) -> str:
    lines = [",".join([f"{row[0]:.3f}", *(f"{value:.6f}" for value in row[1:])]) for row in rows]
    return "\n".join([head, *lines]) + "\n"


def scan_text(scans: LineScans) -> str:
    """Line scans as the CSV file that ``gtval rtk scanner`` reads."""
    step = float(scans.angles[1] - scans.angles[0])
    lines = [
        f"{time:.6f},{float(scans.angles[0])!r},{step!r},"
        + " ".join(f"{r:.3f}" if np.isfinite(r) else "nan" for r in ranges)
        for time, ranges in zip(scans.times, scans.ranges, strict=True)
    ]
    return "\n".join(["time,first_angle,angle_step,ranges", *lines]) + "\n"


def nmea_text(record: Fixes) -> str:
    """RMC once, then GGA and GST of every fix, as a receiver writes them."""
    lines = []
    for row in range(len(record)):
        clock = datetime.fromtimestamp(round(record.times[row], 3), tz=UTC)
        time = clock.strftime("%H%M%S.") + f"{clock.microsecond // 10000:02d}"
        latitude, longitude, height = record.geodetic[row]
        place = f"{_minutes(latitude, 2, 'NS')},{_minutes(longitude, 3, 'EW')}"
        if row == 0:
            lines.append(_sentence(f"GPRMC,{time},A,{place},0.0,0.0,{clock:%d%m%y},,,A"))
        lines.append(
            _sentence(
                f"GPGGA,{time},{place},{record.kinds[row]},{record.satellites[row]:02d},"
                f"{record.hdop[row]:.2f},{height - 45.0:.4f},M,45.0,M,1.0,0001"
            )
        )
        east, north, up = np.sqrt(np.diagonal(record.covariances[row]))
        lines.append(
            _sentence(
                f"GPGST,{time},0.02,{max(east, north):.4f},{min(east, north):.4f},0.0,"
                f"{north:.4f},{east:.4f},{up:.4f}"
            )
        )
    return "\r\n".join(lines) + "\r\n"


def _minutes(angle: float, digits: int, sides: str) -> str:
    """An angle in radians as dddmm.mmmmmmm and its hemisphere: 0.2 mm."""
    total = round(abs(float(np.degrees(angle))) * 60, 7)
    degrees, minutes = divmod(total, 60)
    return f"{int(degrees):0{digits}d}{minutes:010.7f},{sides[0] if angle >= 0 else sides[1]}"


def _sentence(body: str) -> str:
    value = 0
    for character in body:
        value ^= ord(character)
    return f"${body}*{value:02X}"


def _toml(drive: Drive, sensors: Mapping[str, Array], sigmas: Mapping[str, Array]) -> str:
    frame = drive.frame
    origin = (
        (
            f"{{ latitude = {np.degrees(frame.latitude)!r}, longitude = "
            f"{np.degrees(frame.longitude)!r}, height = {frame.height} }}"
        )
        .replace("np.float64(", "")
        .replace(")", "")
    )
    parts = [
        'name = "Synthetic campus drive"',
        'description = "Three RTK-GPS receivers on a vehicle; made by a simulation."',
        "",
        "[rtk]",
        f'up = "{frame.up}"',
        f"origin = {origin}",
        f"eta = {drive.settings.noise.eta}",
    ]
    for row, (record, antenna) in enumerate(zip(drive.records, drive.antennas, strict=True)):
        parts += ["", "[[rtk.receivers]]", f'name = "{record.receiver}"']
        parts += [f'file = "rtk/{record.receiver}.nmea"', f"height = {antenna[2]}"]
        if row >= 3:
            parts.append(f"position = {_numbers(np.round(antenna, 1))}")
    for name, pose in sensors.items():
        parts += ["", "[[rtk.sensors]]", f'name = "{name}"', f"pose = {_numbers(pose)}"]
        parts.append(f"sigmas = {_numbers(sigmas[name])}")
    return "\n".join(parts) + "\n"


def _numbers(values: Array) -> str:
    return "[" + ", ".join(f"{float(value):.6f}" for value in values) + "]"
