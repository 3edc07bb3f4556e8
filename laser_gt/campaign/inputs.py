"""What a campaign holds for laser GT: scans by stop, mounts, odometry, decisions, survey."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from laser_gt.logs.decision_file import read_decisions
from laser_gt.logs.decisions import Decision
from laser_gt.logs.motion import MovingStops, moving_stops
from laser_gt.logs.read import read_records
from laser_gt.logs.records import ScanRecord
from laser_gt.placing.anchors import Surveyed
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.planar import between, compose
from laser_gt.scans.scan import Sweep, merge
from laser_gt.settings import LaserSettings, ScannerSettings
from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array
from validation.poses.factored import Factored
from validation.poses.pose_table import PoseTable, from_csv
from validation.results import VALIDATION_SYSTEM
from validation.text_files.csv_tables import Column, read_csv

ASSUMED_SIGMAS = (0.002, 0.002, 0.003)
"""Standard deviations of a surveyed pose without covariance: 2 mm and 3 mrad. A judgement: a
hand laser good to 1.5 mm places a point to some 1 mm, a mark on the floor is as wide, and 2 mm
over the 0.6 m of a robot frame are 3 mrad. A finding says where they are used."""

EXACT_MOUNT = (1e-6, 1e-6, 1e-6)
"""Standard deviations of a mount that is zero by definition, the poses being the scanner's own: a
micrometre, a thousandth of any error that counts, and far enough from zero for the equations."""

UNKNOWN_MOUNT = (0.05, 0.05, 0.03)
"""The same where three surveyed stops or more may show that it is not zero: 5 cm and 30 mrad. A
judgement: a scanner stands within a hand's width of what is called the robot's pose, or its
place would have been stated."""

TELLING_STOPS = 3
"""Surveyed stops from which an unknown mount is found along with the placement."""

TAPE_MEASURE = (0.005, 0.005, 0.01)
"""Standard deviations of a stated mount of which none are stated: 5 mm and 10 mrad. A judgement:
a tape measure reads to 2 mm, and the middle of a scanner's mirror is guessed to a few; 2 mm over
the 0.2 m of a housing are 10 mrad."""

MOUNT_EXAMPLE = "mount = [0.178, 0.192, 1.571]  # x [m], y [m], theta [rad] in the robot frame"
SIGMAS_EXAMPLE = "mount_sigmas = [0.002, 0.002, 0.002]  # how well that was measured"

ByStop = dict[str, list[ScanRecord]]


@dataclass(frozen=True)
class LaserInputs:
    """Everything that laser GT reads of a campaign, the survey apart.

    Parameters
    ----------
    sweeps : tuple of Prepared
        One for each stop, in the order of the file, in the laser frame: that of the first scanner.
    mount, mount_sigmas : (3,) arrays
        Laser frame in the robot frame.
    odometry : (n, 3) array or None
        Robot poses in the odometry frame.
    decisions : mapping
        Of pairs of stops.
    left_out : tuple of str
        What the files hold and is not used, and what they were expected to hold, in sentences.
    assumed : tuple of str
        What is taken for granted of the mount, in sentences.
    moving : tuple of MovingStops
        Scans that were taken while the robot moved, by scanner.
    """

    sweeps: tuple[Prepared, ...]
    mount: Array
    mount_sigmas: Array
    odometry: Array | None
    decisions: Mapping[tuple[str, str], Decision]
    left_out: tuple[str, ...]
    assumed: tuple[str, ...] = ()
    moving: tuple[MovingStops, ...] = ()

    @property
    def stops(self) -> tuple[str, ...]:
        """Names of the stops."""
        return tuple(sweep.name for sweep in self.sweeps)

    @property
    def by_stop(self) -> dict[str, Prepared]:
        """The sweeps by the names of their stops."""
        return {sweep.name: sweep for sweep in self.sweeps}

    @property
    def laser_odometry(self) -> Array | None:
        """(n, 3) laser frames in the odometry frame."""
        return None if self.odometry is None else compose(self.odometry, self.mount)


def load_inputs(campaign: Campaign, settings: LaserSettings, surveyed: int = 0) -> LaserInputs:
    """Scans, mounts, odometry and decisions of a campaign.

    Parameters
    ----------
    campaign : Campaign
        The folder.
    settings : LaserSettings
        Its table.
    surveyed : int
        Number of surveyed stops that place the laser frame.

    Raises
    ------
    InputError
        Naming every bad place of the files, and every key of campaign.toml that is needed and
        not there.
    """
    records = read_records(campaign.folder, settings)
    sensors = list(dict.fromkeys(record.scan.sensor for record in records))
    _check_scanners(campaign, settings, sensors)
    known, assumed = _completed(settings, sensors, surveyed)
    settings = settings.model_copy(update={"scanners": known})
    records = [record for record in records if record.scan.sensor in known]
    by_stop = _rows(records) if settings.format == "csv" else _at_times(campaign, settings, records)
    first = next(iter(known.values()))
    mount, mount_sigmas = np.array(first.mount), np.array(first.mount_sigmas)
    stops = tuple(by_stop)
    odometry, unscanned = _odometry(campaign, settings, by_stop)
    return LaserInputs(
        sweeps=tuple(
            Prepared(_sweep(stop, scans, known, mount, settings)) for stop, scans in by_stop.items()
        ),
        mount=mount,
        mount_sigmas=mount_sigmas,
        odometry=odometry,
        decisions=read_decisions(campaign.folder / settings.decisions, stops),
        left_out=tuple(_left_out(campaign, settings, sensors, by_stop, unscanned)),
        assumed=assumed,
        moving=tuple(moving_stops(records, by_stop)) if settings.format != "csv" else (),
    )


def _completed(
    settings: LaserSettings, sensors: Sequence[str], surveyed: int
) -> tuple[dict[str, ScannerSettings], tuple[str, ...]]:
    """The scanners with what is assumed of their mounts, and that in sentences.

    One scanner whose mount is not stated, or is zero, is itself what is placed, as far as the
    surveyed stops do not show another. The sigmas of any other mount that states none are those
    of a tape measure.
    """
    known = dict(settings.scanners) or {sensors[0]: ScannerSettings()}
    name, first = next(iter(known.items()))
    if first.mount is not None and first.mount_sigmas is not None:
        return known, ()
    mount = first.mount or (0.0, 0.0, 0.0)
    exact = not any(mount)
    zero = UNKNOWN_MOUNT if surveyed >= TELLING_STOPS else EXACT_MOUNT
    sigmas = first.mount_sigmas or (zero if exact else TAPE_MEASURE)
    known[name] = first.model_copy(update={"mount": mount, "mount_sigmas": sigmas})
    where = f"below [laser.scanners.{name}] of campaign.toml"
    if first.mount is None:
        text = (
            f"it is not stated where the scanner '{name}' sits on the robot, so the poses are "
            "those of the scanner, and the surveyed poses are taken for such too. If they are the "
            f"robot's, write {where}, with your numbers: {MOUNT_EXAMPLE} and {SIGMAS_EXAMPLE}"
        )
    elif exact:
        text = (
            f"the mount of the scanner '{name}' is zero, so the poses are those of the scanner. "
            f"If it is a measured place on the robot, write {where}: {SIGMAS_EXAMPLE}"
        )
    else:
        text = (
            f"it is not stated how well the mount of the scanner '{name}' was measured. Standard "
            f"deviations of a tape measure are assumed, {TAPE_MEASURE[0] * 1e3:.0f} mm and "
            f"{TAPE_MEASURE[2] * 1e3:.0f} mrad; write {where}, with your numbers: {SIGMAS_EXAMPLE}"
        )
    return known, (text,)


def _check_scanners(campaign: Campaign, settings: LaserSettings, sensors: Sequence[str]) -> None:
    """Raise where facts of a scanner are needed and not stated, naming all keys at once."""
    known = settings.scanners
    problems = [
        Problem(campaign.toml, "there is no scan of this sensor", None, "laser.scanners", name)
        for name in known
        if name not in sensors
    ]
    needed = {name: known.get(name, ScannerSettings()) for name in sensors}
    if known and settings.format != "csv":  # of a log, the scanners that are stated are used
        needed = {name: needed[name] for name in known if name in needed}
    problems += [
        Problem(
            campaign.toml,
            "not stated, and the scans of several scanners are laid over each other through their "
            f"mounts; write below [laser.scanners.{name}], with your numbers: {MOUNT_EXAMPLE}",
            None,
            f"laser.scanners.{name}.mount",
        )
        for name, scanner in needed.items()
        if scanner.mount is None and len(needed) > 1
    ]
    if problems:
        raise InputError(problems)


def _left_out(
    campaign: Campaign,
    settings: LaserSettings,
    sensors: Sequence[str],
    by_stop: ByStop,
    unscanned: Sequence[str],
) -> Iterator[str]:
    """Sentences about what is not used, and what is missing without being needed."""
    for name in sensors:
        if name not in settings.scanners:
            yield f"the scans of '{name}' are not used: there is no table [laser.scanners.{name}]"
    for name, scanner in settings.scanners.items():
        mine = {
            stop: [record for record in scans if record.scan.sensor == name]
            for stop, scans in by_stop.items()
        }
        without = [stop for stop, scans in mine.items() if not scans]
        if without:
            yield f"there is no scan by '{name}' of the stops {', '.join(without)}"
        still = [s for s, scans in mine.items() if not all(one.undistorted for one in scans)]
        if scanner.turn_time is not None and still:
            yield (
                f"the scans by '{name}' of the stops {', '.join(still)} are not corrected for "
                "the motion of the robot: there is no odometry near their time"
            )
    stated = "decisions" in settings.model_fields_set
    if stated and not (campaign.folder / settings.decisions).exists():
        yield f"no decision is used: there is no file {settings.decisions} yet"
    if unscanned:
        yield f"the odometry of the stops {', '.join(unscanned)} is not used: they have no scan"


def _sweep(
    stop: str,
    records: Sequence[ScanRecord],
    known: Mapping[str, ScannerSettings],
    first: Array,
    settings: LaserSettings,
) -> Sweep:
    """All scans of a stop in the frame of the first scanner."""
    scans, mounts = [], []
    for name, scanner in known.items():
        for record in records:
            if record.scan.sensor == name:
                scan = record.scan
                scans.append(scan if scanner.sigma is None else replace(scan, sigma=scanner.sigma))
                mounts.append(between(first, np.array(scanner.mount)))
    return merge(scans, mounts, stop, settings.max_delay)


def _rows(records: Sequence[ScanRecord]) -> ByStop:
    """The scans of each stop, where the file names the stops."""
    stops: ByStop = {}
    for record in records:
        stops.setdefault(record.stop, []).append(record)
    return stops


def _at_times(campaign: Campaign, settings: LaserSettings, records: Sequence[ScanRecord]) -> ByStop:
    """The scans of each stop, one by every scanner, at the times of the stops in a log."""
    path = campaign.folder / settings.stops
    table = read_csv(path, (Column("pose"), Column("time", "number", unit="s")))
    table.flag_duplicates(["pose"])
    stops: ByStop = {}
    for row, stop in enumerate(table.text["pose"]):
        time = table.numbers["time"][row]
        if not np.isfinite(time):
            continue  # already a problem of the table
        stops[stop] = [_nearest_scan(records, name, time) for name in sorted(settings.scanners)]
        for one in stops[stop]:
            late = abs(one.scan.time - time)
            if late > settings.max_delay:
                table.flag(
                    row,
                    "time",
                    f"no scan of '{one.scan.sensor}' within {settings.max_delay} s of this time; "
                    f"the nearest is {late:.3f} s off (clocks that differ?)",
                )
    table.raise_problems()
    if not stops:
        raise InputError([Problem(path, "the file has a header but no stop", 1)])
    return stops


def _nearest_scan(records: Sequence[ScanRecord], sensor: str, time: float) -> ScanRecord:
    """The scan of a sensor that is nearest to a time."""
    mine = (record for record in records if record.scan.sensor == sensor)
    return min(mine, key=lambda record: abs(record.scan.time - time))


def _odometry(
    campaign: Campaign, settings: LaserSettings, by_stop: ByStop
) -> tuple[Array | None, list[str]]:
    """(n, 3) robot poses by odometry, None without; and stops that have odometry only.

    They come from their own file, or from the log.
    """
    path = campaign.folder / settings.odometry
    own = settings.odometry_format == "csv" and path.exists()
    if own:
        table = from_csv(path, "odometry")
        poses = dict(zip(table.ids, table.poses, strict=True))
    else:
        logged = {stop: scans[0].odometry for stop, scans in by_stop.items()}
        poses = {stop: pose for stop, pose in logged.items() if pose is not None}
    missing = [stop for stop in by_stop if stop not in poses]
    if not missing:
        unscanned = [stop for stop in poses if stop not in by_stop]
        return np.array([poses[stop] for stop in by_stop]), unscanned
    names = ", ".join(missing)
    if own:
        raise InputError([Problem(path, f"no odometry of the scanned stops {names}")])
    if settings.odometry_format == "rawseeds":
        text = f"no odometry within {settings.max_delay} s of the stops {names}"
        raise InputError([Problem(path, text, None, "time")])
    if "odometry" in settings.model_fields_set:
        raise InputError([Problem(path, "there is no such file; [laser] odometry names it")])
    return None, []


def surveyed_poses(campaign: Campaign) -> Surveyed:
    """The validation poses that the survey made of this campaign.

    Raises
    ------
    GtvalError
        If there is no survey, or it does not determine any pose.
    """
    known = campaign.solved.get(VALIDATION_SYSTEM)
    if known is None or not known.tables:
        raise GtvalError(
            f"{campaign.folder}: laser poses need at least one surveyed stop to place the laser "
            "frame; survey one (survey/readings.csv), or give survey/published_poses.csv"
        )
    return as_surveyed(known.tables[0])


def as_surveyed(table: PoseTable) -> Surveyed:
    """A pose table as surveyed stops; those without covariance get `ASSUMED_SIGMAS`."""
    stated = table.has_covariance
    if table.is_correlated and stated.all():
        known = Factored.of(table)
        if known.net is not None:  # equations of a graph take errors that are shared as unknowns
            known = Factored.of_matrix(known.matrix(), len(table.components))
        return Surveyed(table.ids, table.poses, known)
    own = np.where(stated[:, None, None], table.covariances, np.diag(ASSUMED_SIGMAS) ** 2)
    assumed = tuple(stop for stop, known in zip(table.ids, stated, strict=True) if not known)
    return Surveyed(table.ids, table.poses, Factored.alone(own), assumed)


def references(
    campaign: Campaign, settings: LaserSettings, stops: Sequence[str], survey: Surveyed
) -> Surveyed:
    """The surveyed stops that place the laser frame.

    Raises
    ------
    InputError
        Naming every stop that has no scan or no surveyed pose; if there is none that has both.
    """
    wanted = settings.reference or [stop for stop in stops if stop in survey.stops]
    problems = [
        Problem(campaign.toml, text, None, "laser.reference", stop)
        for text, known in (
            ("no scan of this stop", stops),
            ("this stop has no surveyed pose", survey.stops),
        )
        for stop in wanted
        if stop not in known
    ]
    if not wanted:
        problems = [Problem(campaign.toml, "no scanned stop has a surveyed pose", None, "laser")]
    if problems:
        raise InputError(problems)
    return survey.select(wanted)
