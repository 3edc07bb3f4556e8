"""The satellites that base and rover have together over time, and the best times of the day."""

from dataclasses import dataclass

import numpy as np

from rtk_gt.planning.almanacs.almanac import Almanac
from rtk_gt.planning.horizon import OPEN, Horizon
from rtk_gt.planning.visibility import Bools, Dilution, dilution, directions
from rtk_gt.receivers.fixes import Ints
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.earth_frames import LocalFrame


@dataclass(frozen=True)
class Place:
    """Where an antenna stands, and what hides its sky.

    Parameters
    ----------
    name : str
        What results call it.
    frame : LocalFrame
        At the antenna, with the normal of the ellipsoid as 'up'.
    horizon : Horizon
        Around it.
    """

    name: str
    frame: LocalFrame
    horizon: Horizon = OPEN


@dataclass(frozen=True)
class Wanted:
    """What makes a time good.

    Parameters
    ----------
    mask : float
        Least elevation, rad.
    satellites : int
        Least number of satellites.
    pdop : float
        Greatest PDOP.
    """

    mask: float
    satellites: int
    pdop: float


@dataclass(frozen=True)
class View:
    """The satellites from one place.

    Parameters
    ----------
    place : Place
        From where.
    azimuth, elevation : (s, t) array
        Directions, rad.
    visible : (s, t) array of bool
        Whether a satellite stands above the mask and what hides the sky.
    """

    place: Place
    azimuth: Array
    elevation: Array
    visible: Bools

    @property
    def count(self) -> Ints:
        """(t,) how many satellites are visible."""
        return np.asarray(self.visible.sum(0))


@dataclass(frozen=True)
class Window:
    """A good time.

    Parameters
    ----------
    start, end : float
        Seconds since 1970 UTC.
    least : int
        Fewest satellites in it.
    pdop : float
        Worst PDOP in it.
    """

    start: float
    end: float
    least: int
    pdop: float

    @property
    def length(self) -> float:
        """Seconds."""
        return self.end - self.start


@dataclass(frozen=True)
class SkyPlan:
    """A rover's satellites over time.

    Parameters
    ----------
    almanac : Almanac
        Where the satellites are.
    times : (t,) array
        Seconds since 1970 UTC.
    wanted : Wanted
        What makes a time good.
    rover : View
        From the rover.
    base : View, optional
        From the base station.
    used : (s, t) array of bool
        Satellites that both have: those of the rover where there is no base.
    dop : Dilution
        Of the satellites used, at the rover.
    """

    almanac: Almanac
    times: Array
    wanted: Wanted
    rover: View
    base: View | None
    used: Bools
    dop: Dilution

    @property
    def count(self) -> Ints:
        """(t,) how many satellites are used."""
        return np.asarray(self.used.sum(0))

    @property
    def good(self) -> Bools:
        """(t,) whether there are enough satellites, and well spread."""
        return (self.count >= self.wanted.satellites) & (self.dop.position <= self.wanted.pdop)

    @property
    def baseline(self) -> float:
        """Metres from base to rover; 0 without a base."""
        if self.base is None:
            return 0.0
        ends = self.base.place.frame.origin, self.rover.place.frame.origin
        return float(np.linalg.norm(ends[0] - ends[1]))

    def windows(self) -> list[Window]:
        """All good times, the longest first.

        Each time of the plan stands for the interval up to the next one.
        """
        good = np.concatenate([[False], self.good[:-1], [False]])
        edges = np.flatnonzero(np.diff(good.astype(int)))
        found = [
            Window(
                float(self.times[start]),
                float(self.times[end]),
                int(self.count[start:end].min()),
                float(self.dop.position[start:end].max()),
            )
            for start, end in edges.reshape(-1, 2)
        ]
        return sorted(found, key=lambda one: (-one.length, one.pdop))


def chosen(almanac: Almanac, systems: tuple[str, ...]) -> Bools:
    """(s,) which satellites are of the systems wanted; all if none is named.

    Raises
    ------
    GtvalError
        If there are none of these.
    """
    found = np.array([not systems or letter in systems for letter in almanac.systems])
    if not found.any():
        there = ", ".join(sorted(set(almanac.systems)))
        wanted = ", ".join(systems)
        raise GtvalError(
            f"{almanac.source}: no satellite of the systems {wanted}; there are: {there}"
        )
    return found


def sky_plan(
    almanac: Almanac,
    times: Array,
    wanted: Wanted,
    rover: Place,
    base: Place | None = None,
    systems: tuple[str, ...] = (),
) -> SkyPlan:
    """The satellites of a rover, and of its base station, at given times.

    Parameters
    ----------
    almanac : Almanac
        Where the satellites are.
    times : (t,) array
        Seconds since 1970 UTC, ascending.
    wanted : Wanted
        Mask, and what makes a time good.
    rover : Place
        Where the vehicle is.
    base : Place, optional
        Where the base station is; RTK uses satellites that both have (AD2.3, "RTK GPS").
    systems : tuple of str
        Letters of the systems that count; all if none.
    """
    places = almanac.ecef(times)
    taken = chosen(almanac, systems)

    def view(place: Place) -> View:
        azimuth, elevation = directions(place.frame, places)
        lowest = np.maximum(wanted.mask, place.horizon.elevation(azimuth))
        return View(place, azimuth, elevation, (elevation >= lowest) & taken[:, None])

    seen = view(rover)
    other = None if base is None else view(base)
    used = seen.visible if other is None else seen.visible & other.visible
    found = dilution(seen.azimuth, seen.elevation, used, almanac.systems)
    return SkyPlan(almanac, np.asarray(times), wanted, seen, other, used, found)


SECTORS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")


def hours_by_sector(plan: SkyPlan) -> Array:
    """(8,) satellite hours in each eighth of the compass that the rover has over the plan."""
    sector = np.round(plan.rover.azimuth / (np.pi / 4)).astype(int) % 8
    hours = np.append(np.diff(plan.times), 0.0) / 3600.0
    weight = plan.rover.visible * hours
    return np.array([weight[sector == one].sum() for one in range(len(SECTORS))])
