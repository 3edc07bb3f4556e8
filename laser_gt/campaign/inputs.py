"""What a campaign holds for laser GT: scans by stop, mounts, odometry, decisions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from laser_gt.logs.decisions import Decision, read_decisions
from laser_gt.logs.read import read_records
from laser_gt.logs.records import ScanRecord
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.planar import between, compose
from laser_gt.scans.scan import Sweep, merge
from laser_gt.settings import LaserSettings, ScannerSettings
from validation.campaign.folder import Campaign
from validation.errors import InputError, Problem
from validation.poses.angles import Array
from validation.poses.pose_table import from_csv
from validation.text_files.csv_tables import Column, read_csv


@dataclass(frozen=True)
class LaserInputs:
    """Everything that laser GT reads of a campaign.

    Parameters
    ----------
    stops : tuple of str
        In the order of the file.
    sweeps : tuple of Prepared
        One for each stop, in the laser frame: the frame of the first scanner.
    mount, mount_sigmas : (3,) arrays
        Laser frame in the robot frame.
    odometry : (n, 3) array or None
        Robot poses in the odometry frame.
    decisions : mapping
        Of pairs of stops.
    has_mount : bool
        Whether the campaign states a mount.
    """

    stops: tuple[str, ...]
    sweeps: tuple[Prepared, ...]
    mount: Array
    mount_sigmas: Array
    odometry: Array | None
    decisions: Mapping[tuple[str, str], Decision]
    has_mount: bool

    @property
    def laser_odometry(self) -> Array | None:
        """(n, 3) laser frames in the odometry frame."""
        return None if self.odometry is None else compose(self.odometry, self.mount)


def load_inputs(campaign: Campaign, settings: LaserSettings) -> LaserInputs:
    """Scans, mounts, odometry and decisions of a campaign.

    Raises
    ------
    InputError
        Naming every bad place of the files.
    """
    records = read_records(campaign.folder, settings)
    by_stop, logged = _by_stop(campaign, settings, records)
    names = list(dict.fromkeys(r.scan.sensor for scans in by_stop.values() for r in scans))
    order = [name for name in settings.scanners if name in names] or names
    if settings.scanners:
        _check_scanners(campaign, settings, names)
    known = {name: settings.scanners.get(name, ScannerSettings()) for name in order}
    if len(order) > 1 and not settings.scanners:
        text = f"the scans are of several sensors ({', '.join(order)}); state [laser.scanners.NAME]"
        raise InputError([Problem(campaign.toml, text + " with the mount of each", None, "laser")])
    first = np.array(known[order[0]].mount)
    sweeps = [
        Prepared(_sweep(stop, scans, known, first, settings)) for stop, scans in by_stop.items()
    ]
    stops = tuple(by_stop)
    return LaserInputs(
        stops=stops,
        sweeps=tuple(sweeps),
        mount=first,
        mount_sigmas=np.array(known[order[0]].mount_sigmas),
        odometry=_odometry(campaign, settings, stops, logged),
        decisions=read_decisions(campaign.folder / settings.decisions, stops),
        has_mount=bool(settings.scanners),
    )


def _check_scanners(campaign: Campaign, settings: LaserSettings, names: Sequence[str]) -> None:
    """Raise where scans and stated scanners do not name the same sensors."""
    unknown = [name for name in names if name not in settings.scanners]
    if unknown:
        raise InputError(
            Problem(
                campaign.toml,
                "the scans name a sensor without a table [laser.scanners.NAME]",
                None,
                "laser.scanners",
                name,
            )
            for name in unknown
        )
    if not set(settings.scanners) & set(names):
        raise InputError(
            [
                Problem(
                    campaign.toml,
                    "no scan of any of these sensors",
                    None,
                    "laser.scanners",
                    ", ".join(settings.scanners),
                )
            ]
        )


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


def _by_stop(
    campaign: Campaign, settings: LaserSettings, records: Sequence[ScanRecord]
) -> tuple[dict[str, list[ScanRecord]], dict[str, Array]]:
    """The scans of each stop, and the odometry logged with them."""
    stops: dict[str, list[ScanRecord]] = {}
    logged: dict[str, Array] = {}
    if settings.format == "csv":
        for record in records:
            stops.setdefault(record.stop, []).append(record)
            if record.odometry is not None:
                logged.setdefault(record.stop, record.odometry)
        return stops, logged
    path = campaign.folder / settings.stops
    table = read_csv(path, (Column("pose"), Column("time", "number", unit="s")))
    table.flag_duplicates(["pose"])
    present = {record.scan.sensor for record in records}
    sensors = sorted(present & set(settings.scanners) or present)
    for row, stop in enumerate(table.text["pose"]):
        time = table.numbers["time"][row]
        if not np.isfinite(time):
            continue  # already a problem of the table
        chosen = [_nearest_scan(records, sensor, time) for sensor in sensors]
        late = [one for one in chosen if abs(one.scan.time - time) > settings.max_delay]
        for one in late:
            table.flag(
                row,
                "time",
                f"no scan of '{one.scan.sensor}' within {settings.max_delay} s of this time; the "
                f"nearest is {abs(one.scan.time - time):.3f} s off (clocks that differ?)",
            )
        if late:
            continue
        stops[stop] = chosen
        if chosen[0].odometry is not None:
            logged[stop] = chosen[0].odometry
    table.raise_problems()
    if not stops:
        raise InputError([Problem(path, "the file has a header but no stop", 1)])
    return stops, logged


def _nearest_scan(records: Sequence[ScanRecord], sensor: str, time: float) -> ScanRecord:
    """The scan of a sensor that is nearest to a time."""
    mine = (record for record in records if record.scan.sensor == sensor)
    return min(mine, key=lambda record: abs(record.scan.time - time))


def _odometry(
    campaign: Campaign, settings: LaserSettings, stops: Sequence[str], logged: Mapping[str, Array]
) -> Array | None:
    """(n, 3) robot poses by odometry, from their own file or from the log; None without."""
    path = campaign.folder / settings.odometry
    if settings.odometry_format == "rawseeds":
        missing = [stop for stop in stops if stop not in logged]
        if missing:
            text = f"no odometry within {settings.max_delay} s of the stops {', '.join(missing)}"
            raise InputError([Problem(path, text, None, "time")])
    elif path.exists():
        table = from_csv(path, "odometry")
        missing = [stop for stop in stops if stop not in table.ids]
        if missing:
            raise InputError(
                [Problem(path, f"no odometry of the scanned stops {', '.join(missing)}")]
            )
        return table.select(stops).poses
    if set(stops) <= set(logged):
        return np.array([logged[stop] for stop in stops])
    return None
