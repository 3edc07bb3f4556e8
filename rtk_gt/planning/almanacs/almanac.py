"""Almanacs: the satellites of a file, and where they are at given times."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rtk_gt.planning.almanacs.orbits import GPS_EPOCH, Elements, positions
from rtk_gt.receivers.gps_time import gps_minus_utc
from validation.poses.angles import Array

SYSTEMS = {
    "G": "GPS",
    "E": "Galileo",
    "R": "GLONASS",
    "C": "BeiDou",
    "J": "QZSS",
    "S": "SBAS",
    "I": "NavIC",
    "X": "other",
}
"""Satellite systems by the letter that begins the names of their satellites, as in RINEX."""
DAY = 86400.0
AGEING = 50.0
"""Metres per day squared: almanacs fitted to a week of orbits that were integrated with the Earth's
field, Sun and Moon are off by 19, 48 and 161 km (root mean square) 18, 32 and 64 days later. The
300 km of IS-GPS-200 after 180 days are errors of ranges, of which the error along the orbit has a
sixth."""
BROADCAST_AGEING = 1400.0
"""Metres per day: elements fitted to four hours of the same orbits, as those that satellites
broadcast, are off by 0.7, 10 and 29 km after 1.2, 7 and 21 days."""
_LEAST_DISTANCE = 2.02e7
"""Metres from the ground to the nearest satellites of GPS: an error of theirs looks largest so."""


@dataclass(frozen=True)
class Almanac(ABC):
    """The satellites of a file.

    Parameters
    ----------
    source : Path
        The file.
    kind : str
        'YUMA', 'SEM', 'TLE' or 'RINEX'.
    names : tuple of str
        Satellites that are used, as in RINEX: 'G05'.
    unhealthy : tuple of str
        Those that their record calls unhealthy; they are left out.
    notes : tuple of str
        What a person should know of this file.
    """

    source: Path
    kind: str
    names: tuple[str, ...]
    unhealthy: tuple[str, ...]
    notes: tuple[str, ...]

    @abstractmethod
    def ecef(self, times: Array) -> Array:
        """Places (s, t, 3) of the satellites at times (t,), seconds since 1970 UTC; metres."""

    @abstractmethod
    def ages(self, times: Array) -> Array:
        """Seconds (s, t) from the record of each satellite to the times (t,); below 0 before it."""

    @property
    def systems(self) -> tuple[str, ...]:
        """The letter of the system of each satellite."""
        return tuple(name[0] for name in self.names)

    def direction_error(self, age: float) -> float:
        """Error of directions, rad, one standard deviation, of records so many seconds old.

        IS-GPS-200, section 20.3.3.5.2.1: an almanac is wrong by 900 m at first, and then about by
        the square of its age. How fast, integrated orbits tell (`AGEING`). Two-line elements are
        no worse (Kelso, "Validation of SGP4 and IS-GPS-200D against GPS precision ephemerides",
        2007). Elements for some hours are worse after days (`BROADCAST_AGEING`). Satellites that
        were moved or replaced meanwhile are not in any of these.
        """
        days = abs(age) / DAY
        off = 900.0 + AGEING * days**2
        if self.kind == "RINEX":
            off = max(off, BROADCAST_AGEING * days)
        return float(np.arctan2(off, _LEAST_DISTANCE))


@dataclass(frozen=True)
class KeplerAlmanac(Almanac):
    """Satellites by orbital elements, of one or more records each.

    Parameters
    ----------
    elements : Elements
        (r,) of all records that are used.
    owners : (r,) tuple of str
        Name of the satellite of each record.
    """

    elements: Elements
    owners: tuple[str, ...]

    def ecef(self, times: Array) -> Array:
        """Places (s, t, 3), each from the satellite's record nearest in time."""
        gps = gps_seconds(times)
        nearest = self._nearest(gps)
        return positions(self.elements.take(nearest), np.broadcast_to(gps, nearest.shape))

    def ages(self, times: Array) -> Array:
        """Seconds (s, t) from the nearest record."""
        gps = gps_seconds(times)
        return np.asarray(gps - self.elements.reference[self._nearest(gps)])

    def _nearest(self, gps: Array) -> "np.ndarray[tuple[int, ...], np.dtype[np.int64]]":
        """(s, t) the record of each satellite that is nearest to each time."""
        rows = np.empty((len(self.names), len(gps)), dtype=np.int64)
        owners = np.array(self.owners)
        for row, name in enumerate(self.names):
            own = np.flatnonzero(owners == name)
            own = own[np.argsort(self.elements.reference[own], kind="stable")]
            middles = self.elements.reference[own]
            rows[row] = own[np.searchsorted((middles[1:] + middles[:-1]) / 2, gps)]
        return rows


def gps_seconds(times: Array) -> Array:
    """Seconds of GPS time since its start of times in seconds since 1970 UTC.

    With the leap seconds of the first: within a day one second at most is missed, which is 0.004
    degrees.
    """
    return np.asarray(times) - GPS_EPOCH + gps_minus_utc(float(times[0]))
