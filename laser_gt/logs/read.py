"""The scans of a campaign as records, whatever files and formats they come in."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from laser_gt.logs.bags import read_bag
from laser_gt.logs.breezyslam import read_breezyslam
from laser_gt.logs.carmen import read_carmen
from laser_gt.logs.csm_json import read_csm
from laser_gt.logs.motion import MirrorTiming, undistorted_records
from laser_gt.logs.rawlog import read_rawlog
from laser_gt.logs.rawseeds import (
    read_rawseeds_hokuyo,
    read_rawseeds_odometry,
    read_rawseeds_sick,
)
from laser_gt.logs.records import ScanRecord
from laser_gt.logs.scan_csv import read_scan_csv
from laser_gt.scans.planar import wrapped
from laser_gt.settings import LaserSettings
from validation.errors import InputError, Problem
from validation.poses.angles import Array

READERS: dict[str, Callable[[Path], list[ScanRecord]]] = {
    "csv": read_scan_csv,
    "carmen": read_carmen,
    "rawseeds_sick": read_rawseeds_sick,
    "rawseeds_hokuyo": read_rawseeds_hokuyo,
    "bag": read_bag,
    "csm": read_csm,
    "breezyslam": read_breezyslam,
    "rawlog": read_rawlog,
}
LOGS = READERS | {"csv": partial(read_scan_csv, stops=False)}
"""Readers of the logs of drives."""


def read_records(folder: Path, settings: LaserSettings) -> list[ScanRecord]:
    """All scans of a campaign, with odometry and corrected for motion where that is asked for.

    Parameters
    ----------
    folder : Path
        Of the campaign.
    settings : LaserSettings
        Which files and formats.

    Raises
    ------
    InputError
        Naming every bad place of a file.
    """
    records = _read(folder, settings)
    if settings.odometry_format == "rawseeds":
        times, poses = read_rawseeds_odometry(folder / settings.odometry)
        records = with_odometry(records, times, poses, settings.max_delay)
    timings = {
        name: MirrorTiming(scanner.turn_time, scanner.interlaced)
        for name, scanner in settings.scanners.items()
        if scanner.turn_time is not None
    }
    mounts = {name: np.array(settings.scanners[name].mount) for name in timings}
    return undistorted_records(records, timings, mounts) if timings else records


def _read(folder: Path, settings: LaserSettings) -> list[ScanRecord]:
    """The scans of one file for all scanners, or of one for each."""
    read = READERS[settings.format]
    if not settings.own_files:
        return read(folder / settings.scans)
    records = []
    for name, file in settings.own_files.items():
        found = read(folder / file)
        sensors = dict.fromkeys(record.scan.sensor for record in found)
        if len(sensors) > 1:
            text = f"scans of several sensors ({', '.join(sensors)}) in the file of '{name}' alone"
            raise InputError([Problem(folder / file, text)])
        records += [replace(one, scan=replace(one.scan, sensor=name)) for one in found]
    return records


def with_odometry(
    records: Sequence[ScanRecord], times: Array, poses: Array, max_delay: float
) -> list[ScanRecord]:
    """Records with the odometry of their time, from a log of poses.

    Parameters
    ----------
    records : sequence of ScanRecord
        Any.
    times : (n,) array
        Seconds, on the clock of the scans.
    poses : (n, 3) array
        Robot poses.
    max_delay : float
        Scans further than this from both poses around them, in seconds, get none.

    Returns
    -------
    list of ScanRecord
        Positions and headings in between are interpolated linearly.
    """
    order = np.argsort(times, kind="stable")
    times, poses = times[order], poses[order]
    asked = np.array([record.scan.time for record in records])
    after = np.clip(np.searchsorted(times, asked), 0, len(times) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.minimum(np.abs(times[after] - asked), np.abs(times[before] - asked))
    track = np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])
    found = wrapped(np.column_stack([np.interp(asked, times, column) for column in track.T]))
    return [
        replace(record, odometry=pose) if near <= max_delay else record
        for record, pose, near in zip(records, found, nearest, strict=True)
    ]
