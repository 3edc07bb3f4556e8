"""A drive as a campaign folder, with the truth beside it."""

import json
from dataclasses import asdict, replace
from pathlib import Path

from data_samples.motion.drive import EPOCH, SampleMotion
from data_samples.motion.laser import LaserDrive
from laser_gt.logs.scan_csv import scan_csv
from validation.poses.pose_table import to_csv
from validation.text_files.csv_text import csv_text
from validation.text_files.writing import write_files
from validation.trajectories.formats import trajectory_text

CAMPAIGN = """name = "A robot that drives"
description = "A synthetic drive through a room; what is true is in truth/."

[facts]
"motion capture" = "100 Hz, on the clock of the robot"
"cameras" = "10 Hz, each on a clock of its own"

[[published]]
system = "survey"
file = "gt/survey.csv"
source = "hand-held laser"

[[published]]
system = "mocap"
file = "gt/mocap.csv"
stops = "stops.csv"
{cameras}
[[published]]
system = "odometry"
file = "gt/odometry.csv"
frame = "own"
judged = false

[time]
reference = "mocap"
odometry = "odometry"
"""
CAMERA = """
[[published]]
system = "{name}"
file = "gt/{name}.csv"
judged = false
"""


LASER_CAMPAIGN = """name = "A robot that drives"
description = "A synthetic drive with a laser scanner; what is true is in truth/."

[facts]
"laser scanner" = "half a turn, 5 scans a second, on a clock of its own"

[laser_drive]
odometry = "laser/drive/odometry.csv"
reference = [{reference}]

[laser_drive.scanners.{name}]
mount = [{mount}]
mount_sigmas = [0.001, 0.001, 0.0005]
turn_time = 0.013333
interlaced = 2
"""


def write_laser_drive(folder: Path, drive: LaserDrive) -> list[Path]:
    """The paths of a campaign folder with a drive by a laser scanner.

    Every other surveyed stop holds the drive; the others judge it.

    Raises
    ------
    GtvalError
        If the folder cannot be written.
    """
    reference = ", ".join(f'"{name}"' for name in drive.survey.ids[::2])
    mount = ", ".join(f"{value:.5f}" for value in drive.stated_mount)
    epoch = drive.truth.epoch
    scans = [("", replace(scan, time=float(scan.time) + epoch)) for scan in drive.scans]
    stops = [[one.name, f"{one.start:.3f}", f"{one.end:.3f}"] for one in drive.stops]
    truth = {"delay_s": drive.delay_s, "mount": list(drive.scanner.mount)}
    toml = LASER_CAMPAIGN.format(reference=reference, name=drive.scanner.name, mount=mount)
    return write_files(
        folder,
        {
            "campaign.toml": toml,
            "survey/published_poses.csv": to_csv(drive.survey),
            "laser/drive/scans.csv": scan_csv(scans),
            "laser/drive/odometry.csv": trajectory_text(drive.odometry, "csv"),
            "laser/drive/stops.csv": csv_text(["pose", "from", "to"], stops),
            "truth/trajectory.csv": trajectory_text(drive.truth, "csv"),
            "truth/stops.csv": to_csv(drive.true_stops),
            "truth/laser.json": json.dumps(truth, indent=2) + "\n",
        },
    )


def write_motion(folder: Path, drive: SampleMotion) -> list[Path]:
    """The paths of a campaign folder that `gtval run` takes.

    Parameters
    ----------
    folder : Path
        Made if missing.
    drive : SampleMotion
        What is written.

    Raises
    ------
    GtvalError
        If the folder cannot be written.
    """
    sources = {"mocap": drive.reference, "odometry": drive.odometry, **drive.cameras}
    cameras = "".join(CAMERA.format(name=name) for name in drive.cameras)
    stops = [[stop.name, f"{stop.start:.3f}", f"{stop.end:.3f}"] for stop in drive.stops]
    clocks = {name: asdict(c) | {"at_s": c.at_s + EPOCH} for name, c in drive.clocks.items()}
    return write_files(
        folder,
        {
            "campaign.toml": CAMPAIGN.format(cameras=cameras),
            "stops.csv": csv_text(["pose", "from", "to"], stops),
            "gt/survey.csv": to_csv(drive.survey),
            **{f"gt/{name}.csv": trajectory_text(one, "csv") for name, one in sources.items()},
            "truth/trajectory.csv": trajectory_text(drive.truth, "csv"),
            "truth/stops.csv": to_csv(drive.true_stops),
            "truth/clocks.json": json.dumps({"clocks": clocks}, indent=2) + "\n",
        },
    )
