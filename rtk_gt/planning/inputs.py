"""What a plan needs, from campaign.toml and from the options of the command."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import numpy as np

from rtk_gt.planning.horizon import Building, Horizon, read_horizon, typed_horizon
from rtk_gt.planning.plan import Place
from rtk_gt.receivers.fixes import Fixes
from rtk_gt.receivers.formats.reading import Stated, read_receiver
from rtk_gt.settings import RtkSettings, SkyPlace, SkySettings
from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError, Problem
from validation.poses.earth_frames import LocalFrame

Coordinates = tuple[float, float, float]
"""Latitude and longitude in degrees, height above the ellipsoid in metres."""


@dataclass(frozen=True)
class Asked:
    """What the command was asked for.

    Parameters
    ----------
    settings : SkySettings
        Of the campaign, or those of one without a table [rtk.plan].
    rovers : tuple of Place
        Where the vehicle will be.
    base : Place, optional
        Where the base station is.
    """

    settings: SkySettings
    rovers: tuple[Place, ...]
    base: Place | None


def from_campaign(campaign: Campaign) -> Asked:
    """The places of [rtk.plan], with what hides their sky.

    Raises
    ------
    InputError
        For bad horizons, or buildings without an origin for their corners.
    """
    settings = campaign.section("rtk", RtkSettings)
    plan = settings.plan
    if plan.buildings and settings.origin is None:
        said = "needed, as the corners of buildings are metres from it; write [rtk.origin]"
        raise InputError([Problem(campaign.toml, said, field="rtk.origin")])
    places = {one.name: _place(campaign, settings, one) for one in plan.places}
    bases = [places[one.name] for one in plan.places if one.base]
    rovers = tuple(places[one.name] for one in plan.places if not one.base)
    return Asked(plan, rovers, bases[0] if bases else None)


def _place(campaign: Campaign, settings: RtkSettings, stated: SkyPlace) -> Place:
    """One place with typed horizon and buildings around it."""
    frame = LocalFrame.from_degrees(stated.latitude, stated.longitude, stated.height)
    rows = (
        read_horizon(campaign.folder / stated.horizon_file)
        if stated.horizon_file
        else typed_horizon(stated.horizon)
    )
    buildings: tuple[Building, ...] = ()
    if settings.origin is not None:
        origin = settings.origin
        local = LocalFrame.from_degrees(origin.latitude, origin.longitude, origin.height)
        here = local.from_ecef(frame.origin)
        buildings = tuple(
            Building(one.name, np.array(one.corners) - here[:2], one.height - float(here[2]))
            for one in settings.plan.buildings
        )
    return Place(stated.name, frame, Horizon(rows, buildings))


def typed_place(name: str, coordinates: Coordinates, horizon: Path | None) -> Place:
    """A place given by options.

    Raises
    ------
    GtvalError
        For coordinates of no place on Earth.
    InputError
        For a bad file.
    """
    rows = np.empty((0, 2)) if horizon is None else read_horizon(horizon)
    return Place(name, LocalFrame.from_degrees(*coordinates), Horizon(rows))


def named_rovers(asked: Asked, names: Sequence[str]) -> tuple[Place, ...]:
    """The rovers' places of these names; all if none is named.

    Raises
    ------
    GtvalError
        Naming those there are.
    """
    known = {place.name: place for place in asked.rovers}
    for name in names:
        if name not in known:
            said = ", ".join(known) or "none"
            raise GtvalError(f"no place '{name}' for the rover in [rtk.plan]; there are: {said}")
    return tuple(known[name] for name in names) or asked.rovers


def read_log(path: Path, day: date | None) -> Fixes:
    """The fixes of a log of any kind that is read.

    Damaged sentences are left out: here only numbers of satellites are counted.

    Raises
    ------
    InputError
        Naming line, field and value of every bad place.
    GtvalError
        If nothing tells the day.
    """
    record = read_receiver(path, Stated(path.stem, day=day, skip_damaged=True))
    if record.times[0] < 0.5 * 86400 * 365:
        raise GtvalError(f"{path}: the log does not tell its date; give it with --day")
    return record


def place_of_log(record: Fixes) -> Place:
    """The middle of a log's positions, with an open sky."""
    latitude, longitude, height = np.median(record.geodetic, axis=0)
    return Place(record.receiver, LocalFrame(latitude.item(), longitude.item(), height.item()))
