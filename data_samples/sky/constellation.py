"""The nominal constellations of GPS and Galileo: where satellites would be without disturbance.

Sources: GPS Standard Positioning Service Performance Standard, 4th edition (2008), Tables A.2-1 and
A.2-2 (slots as of 0000 UTC, 1 July 1993), and the European GNSS Service Centre, "Orbital and
technical parameters" (Galileo reference constellation, Walker 24/3/1, as of 21 November 2016).
"""

from datetime import UTC, date, datetime

import numpy as np

from rtk_gt.planning.almanacs.orbits import (
    EARTH_RATE,
    GPS_EPOCH,
    GRAVITY_GALILEO,
    GRAVITY_GPS,
    WEEK,
)
from rtk_gt.planning.almanacs.two_line import sidereal_time
from rtk_gt.receivers.gps_time import gps_minus_utc

Row = dict[str, float]
"""Elements of a satellite by the names of `rtk_gt.planning.almanacs.orbits.Elements`."""

SEMI_MAJOR_AXIS = 26559.7e3
"""Of GPS, m."""
INCLINATION = np.radians(55.0).item()
NODE_RATE = -8.0e-9
"""rad/s; what the flattened Earth makes of such orbits: -1.5 n J2 (R/a)^2 cos i = -7.8e-9."""
_PLANES = {"A": 272.847, "B": 332.847, "C": 32.847, "D": 92.847, "E": 152.847, "F": 212.847}
_SLOTS = {
    "A": (268.126, 161.786, 11.676, 41.806),
    "B": (80.956, 173.336, 309.976, 204.376),
    "C": (111.876, 11.796, 339.666, 241.556),
    "D": (135.226, 265.446, 35.156, 167.356),
    "E": (197.046, 302.596, 66.066, 333.686),
    "F": (238.886, 345.226, 105.206, 135.346),
}
_EXPANDED = {("B", 0): (94.916, 66.356), ("D", 1): (282.676, 257.976), ("F", 1): (0.456, 334.016)}
"""Pairs that take the place of a slot where there are 27 satellites."""
_GPS_DAY = datetime(1993, 7, 1, tzinfo=UTC).timestamp()
_GALILEO_DAY = datetime(2016, 11, 21, tzinfo=UTC).timestamp()
_GALILEO = {"axis": 29600.318e3, "inclination": 56.0, "node": 317.632, "anomaly": 225.153}
_GALILEO_NODE_RATE = -0.02764398 * np.pi / 180 / 86400


def gps_slots(satellites: int = 24) -> list[tuple[float, float]]:
    """Right ascension of the node, and argument of latitude, degrees, of 24 or 27 slots."""
    found: list[tuple[float, float]] = []
    for plane, slots in _SLOTS.items():
        for at, slot in enumerate(slots):
            pair = _EXPANDED.get((plane, at)) if satellites > 24 else None
            found += [(_PLANES[plane], one) for one in pair or (slot,)]
    return found


def gps_rows(day: date, satellites: int = 24) -> dict[str, Row]:
    """Elements of the nominal GPS satellites at the start of a day, by their names.

    Parameters
    ----------
    day : date
        UTC. The elements hold at its start.
    satellites : int
        24 or 27.
    """
    n = np.sqrt(GRAVITY_GPS / SEMI_MAJOR_AXIS**3).item()
    start = midnight(day)
    passed = start - _GPS_DAY
    return {
        f"G{prn:02d}": _row(
            SEMI_MAJOR_AXIS,
            INCLINATION,
            np.radians(node).item() + NODE_RATE * passed,
            np.radians(latitude).item() + n * passed,
            NODE_RATE,
            GRAVITY_GPS,
            start,
        )
        for prn, (node, latitude) in enumerate(gps_slots(satellites), 1)
    }


def galileo_rows(day: date) -> dict[str, Row]:
    """Elements of the 24 nominal Galileo satellites at the start of a day, by their names."""
    axis, start = _GALILEO["axis"], midnight(day)
    n = np.sqrt(GRAVITY_GALILEO / axis**3).item()
    passed = start - _GALILEO_DAY
    found = {}
    for k in range(24):
        plane, slot = divmod(k, 8)
        node = _GALILEO["node"] + 120.0 * plane
        latitude = _GALILEO["anomaly"] + 45.0 * slot + 15.0 * plane
        found[f"E{k + 1:02d}"] = _row(
            axis,
            np.radians(_GALILEO["inclination"]).item(),
            np.radians(node).item() + _GALILEO_NODE_RATE * passed,
            np.radians(latitude).item() + n * passed,
            _GALILEO_NODE_RATE,
            GRAVITY_GALILEO,
            start,
        )
    return found


def midnight(day: date) -> float:
    """The start of a day in UTC, seconds since 1970."""
    return datetime(day.year, day.month, day.day, tzinfo=UTC).timestamp()


def _row(
    axis: float, tilt: float, ascension: float, latitude: float, rate: float, mu: float, utc: float
) -> Row:
    """Elements of a circular orbit; the node against Greenwich at the start of the week."""
    gps = utc - GPS_EPOCH + gps_minus_utc(utc)
    longitude = ascension - float(sidereal_time(np.array(utc)))
    return {
        "reference": gps,
        "root_a": np.sqrt(axis).item(),
        "eccentricity": 0.0,
        "inclination": tilt,
        "node": within_a_turn(longitude + EARTH_RATE * (gps % WEEK)),
        "node_rate": rate,
        "perigee": 0.0,
        "anomaly": within_a_turn(latitude),
        "gravity": mu,
    }


def within_a_turn(angle: float) -> float:
    """The same angle from -pi to pi."""
    return float(np.mod(angle + np.pi, 2 * np.pi) - np.pi)
