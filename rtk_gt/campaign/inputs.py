"""A campaign's records of all receivers, and what it states beforehand."""

import gzip
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rtk_gt.offsets.estimate import distance_names
from rtk_gt.offsets.prior import OffsetPrior
from rtk_gt.path.antennas import Places
from rtk_gt.receivers.fix_checks import check_fixes
from rtk_gt.receivers.fix_csv import read_fix_csv
from rtk_gt.receivers.fixes import Fixes
from rtk_gt.receivers.nmea import read_nmea
from rtk_gt.receivers.rawlog import Rawlog, read_rawlog
from rtk_gt.receivers.rtklib import read_pos
from rtk_gt.receivers.steps import Steps, common_steps
from rtk_gt.settings import Receiver, RtkSettings
from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError, Problem
from validation.poses.earth_frames import FrameVectors, LocalFrame

ENDINGS = {
    ".nmea": "nmea",
    ".txt": "nmea",
    ".log": "nmea",
    ".pos": "rtklib",
    ".rawlog": "rawlog",
    ".csv": "csv",
}


@dataclass(frozen=True)
class DriveRecords:
    """What a campaign holds of a drive.

    Parameters
    ----------
    settings : RtkSettings
        The table [rtk].
    records : tuple of Fixes
        Of all receivers, in the order of campaign.toml.
    steps : Steps
        The same brought together in the local frame, as recorded.
    """

    settings: RtkSettings
    records: tuple[Fixes, ...]
    steps: Steps


def load_drive(campaign: Campaign) -> DriveRecords:
    """The records of a campaign's receivers, brought together.

    Raises
    ------
    GtvalError
        If campaign.toml names no receivers, or the files are bad.
    """
    settings = campaign.section("rtk", RtkSettings)
    if not settings.receivers:
        raise GtvalError(f"{campaign.toml} names no [[rtk.receivers]]")
    records = read_records(campaign, settings)
    frame = local_frame(settings, records)
    steps = common_steps(records, frame, settings.simultaneous)
    return DriveRecords(settings, tuple(records), steps)


def check_places(campaign: Campaign) -> None:
    """Raise where campaign.toml does not say where antennas are on the vehicle.

    Raises
    ------
    InputError
        Naming every key that is missing, with an example.
    """
    receivers = campaign.section("rtk", RtkSettings).receivers
    if len(receivers) == 1:
        return  # positions are those of its antenna
    wanted = [
        (one, "height", "z of its antenna on the vehicle")
        for one in receivers[:3]
        if one.position is None and one.height is None
    ]
    wanted += [(one, "position", "x, y, z on the vehicle, to 0.1 m") for one in receivers[3:]]
    examples = {"height": "height = 0.132", "position": "position = [0.9, 0.6, 0.1]"}
    problems = [
        Problem(
            campaign.toml,
            f"not stated; write the {what} in metres, such as `{examples[key]}`",
            field=f"rtk.receivers.{one.name}.{key}",
        )
        for one, key, what in wanted
        if getattr(one, key) is None
    ]
    if problems:
        raise InputError(problems)


def read_records(campaign: Campaign, settings: RtkSettings) -> list[Fixes]:
    """The fixes of all receivers, in the order of campaign.toml.

    Raises
    ------
    InputError
        With the bad places of all files.
    """
    problems: list[Problem] = []
    records: list[Fixes] = []
    rawlogs: dict[Path, Rawlog] = {}
    for receiver in settings.receivers:
        try:
            records.append(_read(campaign, receiver, settings, rawlogs))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(dict.fromkeys(problems))
    check_fixes(records, stated_frame(settings))
    return records


def _read(
    campaign: Campaign, receiver: Receiver, settings: RtkSettings, rawlogs: dict[Path, Rawlog]
) -> Fixes:
    path = campaign.folder / receiver.file
    kind = receiver.format if receiver.format != "auto" else _kind_of(path)
    if kind == "rawlog":
        if path not in rawlogs:
            rawlogs[path] = read_rawlog(path)
        label = receiver.label or receiver.name
        found = rawlogs[path].fixes
        if label not in found:
            expected = f"no receiver of that label; the rawlog has {', '.join(sorted(found))}"
            raise InputError([Problem(path, expected, field="label", value=label)])
        return replace(found[label], receiver=receiver.name)
    if kind == "nmea":
        skip = settings.skip_damaged
        return read_nmea(path, receiver.name, day=receiver.date, skip_damaged=skip)
    if kind == "rtklib":
        return read_pos(path, receiver.name)
    if kind == "csv":
        return read_fix_csv(path, receiver.name)
    expected = (
        f"a kind of file that its name does not tell; set format, or use {', '.join(ENDINGS)}"
    )
    raise InputError([Problem(path, expected)])


def _kind_of(path: Path) -> str | None:
    """What a file is by its name, .gz apart; a table that begins with a sentence is a log."""
    inner = Path(path.stem) if path.suffix.lower() == ".gz" else path
    kind = ENDINGS.get(inner.suffix.lower())
    if kind == "csv" and path.is_file() and _begins_with_sentence(path):
        return "nmea"
    return kind


def _begins_with_sentence(path: Path) -> bool:
    """Whether the first line holds an NMEA sentence; also of a compressed file."""
    with path.open("rb") as plain:
        packed = plain.read(2) == b"\x1f\x8b"
    try:
        with gzip.open(path) if packed else path.open("rb") as file:
            return b"$G" in file.readline(1000)
    except (OSError, EOFError):
        return False


def stated_frame(settings: RtkSettings) -> LocalFrame | None:
    """The local frame of campaign.toml; None where no origin is stated."""
    if settings.origin is None:
        return None
    origin = settings.origin
    return LocalFrame.from_degrees(origin.latitude, origin.longitude, origin.height, settings.up)


def local_frame(settings: RtkSettings, records: list[Fixes]) -> LocalFrame:
    """The stated local frame, or one at the first RTK-fixed position of the first receiver."""
    stated = stated_frame(settings)
    if stated is not None:
        return stated
    fixed = records[0].geodetic[records[0].fixed]
    if len(fixed) == 0 and len(records) == 1 and len(records[0]):
        fixed = records[0].geodetic
    if len(fixed) == 0:
        raise GtvalError(f"receiver {records[0].receiver} is never RTK-fixed")
    latitude, longitude, height = (float(value) for value in fixed[0])
    return LocalFrame(latitude, longitude, height, settings.up)


def offset_prior(settings: RtkSettings, frame: LocalFrame) -> OffsetPrior:
    """What campaign.toml states of offsets and distances.

    Raises
    ------
    GtvalError
        If the known offsets belong to another frame, or a distance is of no pair.
    """
    names = tuple(receiver.name for receiver in settings.receivers)
    heights = antenna_places(settings).heights
    prior = OffsetPrior(heights=heights if np.isfinite(heights).all() else np.empty(0))
    if settings.known_offsets is not None:
        known = settings.known_offsets
        values = np.array([known.values.get(name, (np.nan,) * 3) for name in names])
        if names[0] in known.values:
            values = values - values[0]
        values = FrameVectors(replace(frame, up=known.up), values).within(frame)
        prior = replace(prior, offsets=values, offset_sigmas=np.full(values.shape, known.sigma))
    if settings.known_distances is not None:
        stated = settings.known_distances
        pairs = distance_names(names)
        distances = np.array([stated.of_pair(pair, np.nan) for pair in pairs])
        prior = replace(
            prior, distances=distances, distance_sigmas=np.full(len(pairs), stated.sigma)
        )
    return prior


def antenna_places(settings: RtkSettings) -> Places:
    """What campaign.toml states of where the antennas are on the vehicle."""
    receivers = settings.receivers
    stated = [receiver.position for receiver in receivers]
    heights = [one.height if one.position is None else one.position[2] for one in receivers]
    positions = None if any(place is None for place in stated) else np.array(stated, dtype=float)
    others = np.array(stated[3:], dtype=float) if stated[3:] else None
    return Places(np.array(heights, dtype=float), others, positions)
