"""What a campaign holds for a drive: a log of scans, odometry, stops, mounts."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from laser_gt.campaign.inputs import MOUNT_EXAMPLE, SIGMAS_EXAMPLE, surveyed_poses
from laser_gt.driving.log import DriveInputs, SurveyedStop
from laser_gt.driving.odometer import Odometer
from laser_gt.driving.sweeps import Sensor
from laser_gt.logs.bags import odometry_in
from laser_gt.logs.motion import MirrorTiming, SteadyTiming, Timing
from laser_gt.logs.read import LOGS
from laser_gt.logs.records import ScanRecord
from laser_gt.placing.anchors import Surveyed
from laser_gt.scans.scan import Scan
from laser_gt.settings import DriveSettings, LaserSettings, ScannerSettings
from validation.campaign.folder import Campaign
from validation.errors import InputError, Problem
from validation.poses.trajectory import Trajectory
from validation.results import VALIDATION_SYSTEM
from validation.trajectories.formats import read_trajectory
from validation.trajectories.stops import Stop, read_stops

ANGLE_OPEN = "an angle of more than two turns, which may be degrees"
FEWEST = 2
"""Poses of odometry that are a motion."""

Records = Mapping[str, Sequence[ScanRecord]]


def drive_inputs(campaign: Campaign) -> tuple[DriveInputs, list[Stop]]:
    """The log of a campaign, and all stops of the drive.

    Raises
    ------
    InputError
        Naming every bad place of the files, and every key of campaign.toml that is needed and
        not there.
    """
    settings = campaign.section("laser_drive", DriveSettings)
    scanners = settings.scanners or campaign.section("laser", LaserSettings).scanners
    path = campaign.folder / settings.scans
    records = _by_sensor(campaign, path, LOGS[settings.format](path), scanners)
    first = next(iter(records))
    epoch = int(np.floor(min(each[0].scan.time for each in records.values())))
    odometry = _odometry(campaign, settings, path)
    own_clock = odometry is not None
    odometer = _logged(records[first], epoch) if odometry is None else _of(odometry, epoch)
    stops = _stops(campaign, settings)
    mount_sigmas = scanners[first].mount_sigmas
    assert mount_sigmas is not None  # told in _check
    return (
        DriveInputs(
            scans={
                name: [_scan(one, scanners[name], epoch) for one in each]
                for name, each in records.items()
            },
            sensors={
                name: Sensor(np.array(scanners[name].mount), _timing(scanners[name], each))
                for name, each in records.items()
            },
            mount_sigmas=np.array(mount_sigmas),
            odometer=odometer,
            own_clock=own_clock,
            stops=_surveyed_stops(campaign, settings, stops, epoch),
            epoch=epoch,
            max_delay=settings.max_delay,
        ),
        stops,
    )


def _by_sensor(
    campaign: Campaign,
    path: Path,
    records: Sequence[ScanRecord],
    scanners: Mapping[str, ScannerSettings],
) -> Records:
    """The records of each stated scanner in the order of time, what is needed of it stated."""
    sensors = list(dict.fromkeys(record.scan.sensor for record in records))
    used = [name for name in scanners if name in sensors] or sensors[:1]
    problems = []
    for number, name in enumerate(used):
        scanner = scanners.get(name, ScannerSettings())
        missing = [] if scanner.mount else [("mount", MOUNT_EXAMPLE)]
        if number == 0 and not scanner.mount_sigmas:
            missing.append(("mount_sigmas", SIGMAS_EXAMPLE))
        problems += [
            Problem(
                campaign.toml,
                "not stated, and different on every robot; write below "
                f"[laser_drive.scanners.{name}], with your numbers: {example}",
                None,
                f"laser_drive.scanners.{name}.{key}",
            )
            for key, example in missing
        ]
    timeless = [one for one in records if not np.isfinite(one.scan.time)]
    if timeless:
        what = "the scan has no time stamp, which a drive needs"
        problems.append(Problem(path, what, timeless[0].line, "time"))
    if problems:
        raise InputError(problems)
    found = {name: [one for one in records if one.scan.sensor == name] for name in used}
    return {name: sorted(each, key=lambda one: one.scan.time) for name, each in found.items()}


def _scan(record: ScanRecord, scanner: ScannerSettings, epoch: int) -> Scan:
    """The scan with its time since the epoch, and the stated noise."""
    scan = replace(record.scan, time=record.scan.time - epoch)
    return scan if scanner.sigma is None else replace(scan, sigma=scanner.sigma)


def _timing(scanner: ScannerSettings, records: Sequence[ScanRecord]) -> Timing | None:
    """When the beams are fired: as stated, or as the log tells it."""
    if scanner.turn_time is not None:
        return MirrorTiming(scanner.turn_time, scanner.interlaced)
    increment = float(np.median([one.increment for one in records]))
    return SteadyTiming(increment) if increment else None


def _odometry(campaign: Campaign, settings: DriveSettings, log: Path) -> Trajectory | None:
    """Odometry of a file of its own, or of the bag that holds the scans."""
    path, topic, body = log, settings.odometry_topic, settings.odometry_body
    if settings.odometry is not None:
        path = campaign.folder / settings.odometry
    elif settings.format != "bag":
        return None
    elif topic is None and body is None:
        told = odometry_in(log)
        if told is None:
            return None
        topic, body = told
    degrees = settings.odometry_degrees
    try:
        found = read_trajectory(path, system="odometry", topic=topic, body=body, degrees=degrees)
    except InputError as error:
        if degrees is None and any(one.field == "angle" for one in error.problems):
            key = "say in campaign.toml, below [laser_drive], odometry_degrees = true, or false"
            problems = [replace(one, expected=f"{ANGLE_OPEN}: {key}") for one in error.problems]
            raise InputError(problems) from None
        raise
    found = found.planar()
    if not found.has_orientation:
        raise InputError([Problem(path, "odometry needs headings; these are positions only")])
    if len(found) < FEWEST:
        raise InputError([Problem(path, "odometry needs two poses at least")])
    return found


def _of(odometry: Trajectory, epoch: int) -> Odometer:
    """Odometry since the epoch of the scans."""
    return Odometer(odometry.times_since(epoch), odometry.poses)


def _logged(records: Sequence[ScanRecord], epoch: int) -> Odometer | None:
    """The odometry that came along with each scan."""
    known = [one for one in records if one.odometry is not None]
    if len(known) < FEWEST:
        return None
    times = np.array([one.scan.time - epoch for one in known])
    return Odometer(times, np.array([one.odometry for one in known], dtype=float))


def _stops(campaign: Campaign, settings: DriveSettings) -> list[Stop]:
    """When the robot stood where; none without the file, if that is not stated."""
    path = campaign.folder / settings.stops
    stated = "stops" in settings.model_fields_set
    return read_stops(path) if stated or path.exists() else []


def _surveyed_stops(
    campaign: Campaign, settings: DriveSettings, stops: Sequence[Stop], epoch: int
) -> list[SurveyedStop]:
    """The stops that hold the drive: those named as reference, or all with a surveyed pose."""
    if not stops or VALIDATION_SYSTEM not in campaign.solved:
        return []
    survey: Surveyed = surveyed_poses(campaign)
    by_name = {stop.name: stop for stop in stops}
    problems = [
        Problem(campaign.toml, text, None, "laser_drive.reference", name)
        for name in settings.reference
        for text, known in (
            ("this stop is not in the file of stops", by_name),
            ("this stop has no surveyed pose", survey.stops),
        )
        if name not in known
    ]
    if problems:
        raise InputError(problems)
    wanted = settings.reference or [name for name in by_name if name in survey.stops]
    if not wanted:
        return []
    known = survey.select(wanted)
    return [
        SurveyedStop(
            name,
            by_name[name].start - epoch,
            by_name[name].end - epoch,
            pose,
            spread,
            name in known.assumed,
        )
        for name, pose, spread in zip(wanted, known.poses, known.covariance.blocks, strict=True)
    ]
