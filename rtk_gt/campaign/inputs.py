"""A campaign's records of all receivers, and what it states beforehand."""

from dataclasses import dataclass, replace

import numpy as np

from rtk_gt.offsets.estimate import distance_names
from rtk_gt.offsets.prior import OffsetPrior
from rtk_gt.path.antennas import Places
from rtk_gt.receivers.assumptions import VEHICLE_SIZE
from rtk_gt.receivers.baselines import on_base
from rtk_gt.receivers.fix_checks import check_fixes
from rtk_gt.receivers.fixes import Fixes
from rtk_gt.receivers.formats.reading import Stated, read_baselines, read_receiver
from rtk_gt.receivers.frozen import without_frozen
from rtk_gt.receivers.steps import Steps, common_steps
from rtk_gt.settings import Receiver, RtkSettings
from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError, Problem
from validation.poses.earth_frames import FrameVectors, LocalFrame


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
    settings = campaign.section("rtk", RtkSettings)
    receivers = settings.receivers
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
    problems += _too_large(campaign, settings)
    if problems:
        raise InputError(problems)


def _too_large(campaign: Campaign, settings: RtkSettings) -> list[Problem]:
    """Stated places and distances that no vehicle has: most are in centimetres or millimetres."""
    receivers = settings.receivers
    heights = antenna_places(settings).heights
    key = {one.name: "height" if one.position is None else "position" for one in receivers}
    sizes = [
        (f"receivers.{one.name}.{key[one.name]}", float(value), VEHICLE_SIZE, "antenna's height")
        for one, value in zip(receivers, heights, strict=True)
    ]
    if settings.known_distances is not None:
        for pair, value in settings.known_distances.values.items():
            sizes.append((f"known_distances.{pair}", value, 2 * VEHICLE_SIZE, "distance"))
    return [
        Problem(
            campaign.toml,
            f"no {what} on a vehicle; write metres ({value / 100:g} if it is in centimetres, "
            f"{value / 1000:g} if in millimetres)",
            field=f"rtk.{name}",
            value=f"{value:g}",
        )
        for name, value, most, what in sizes
        if abs(value) > most
    ]


def read_records(campaign: Campaign, settings: RtkSettings) -> list[Fixes]:
    """The fixes of all receivers, in the order of campaign.toml; where one hung, not fixed.

    Raises
    ------
    InputError
        With the bad places of all files.
    """
    problems: list[Problem] = []
    records: dict[str, Fixes] = {}
    # Rovers of a moving base come after their base.
    for receiver in sorted(settings.receivers, key=lambda one: bool(one.base)):
        try:
            record = _read(campaign, receiver, settings, records.get(receiver.base))
            if record is not None:
                records[receiver.name] = record
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(dict.fromkeys(problems))
    found = [records[receiver.name] for receiver in settings.receivers]
    check_fixes(found, stated_frame(settings))
    return without_frozen(found)


def _read(
    campaign: Campaign, receiver: Receiver, settings: RtkSettings, base: Fixes | None
) -> Fixes | None:
    """The record of a receiver; None where that of its base could not be read."""
    path = campaign.folder / receiver.file
    stated = Stated(
        receiver.name, receiver.format, receiver.label, receiver.date, settings.skip_damaged,
        receiver.all_fixed, receiver.coordinates, receiver.zone, stated_frame(settings),
    )  # fmt: skip
    if not receiver.base:
        return read_receiver(path, stated)
    found = read_baselines(path, stated)
    return None if base is None else on_base(found, base, settings.simultaneous)


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
