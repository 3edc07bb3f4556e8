"""Places of satellites from orbital elements: the user algorithm of IS-GPS-200.

All is element-wise over arrays of any shape, so that many satellites and many times are one call.

Source: IS-GPS-200, section 20.3.3.4.3, Table 20-IV (called Table 20-IV below). An almanac leaves
out what it does not have: the correction of the mean motion, the rate of the inclination, and the
six harmonics are zero (section 20.3.3.5.2.1). Galileo uses the same equations with its own constant
of gravity (OS SIS ICD, section 5.1.1).
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from validation.poses.angles import Array

GRAVITY_GPS = 3.986005e14
"""mu of Table 20-IV, m^3/s^2."""
GRAVITY_GALILEO = 3.986004418e14
"""mu of the Galileo OS SIS ICD, m^3/s^2."""
EARTH_RATE = 7.2921151467e-5
"""Rate of the Earth's rotation, rad/s (Table 20-IV)."""
WEEK = 604800.0
"""Seconds of a GPS week."""
GPS_EPOCH = 315964800.0
"""1980-01-06, the start of GPS time, in seconds since 1970."""
LARGEST_ECCENTRICITY = 0.5
"""Of an orbit that is read; those of navigation satellites are below 0.25 (Galileo 5 and 6)."""
_ROUNDS = 12
"""Of Newton's method: from E = M and e up to 0.5 six leave less than 1e-12 rad."""


@dataclass(frozen=True)
class Elements:
    """Orbital elements, each an array of one shape.

    Parameters
    ----------
    reference : (...) array
        Time at which they hold (toe, toa), seconds of GPS time since its start in 1980.
    root_a : (...) array
        Square root of the semi-major axis, m^(1/2).
    eccentricity : (...) array
        Of the orbit.
    inclination, inclination_rate : (...) array
        At the reference time, rad, and its change, rad/s.
    node, node_rate : (...) array
        Longitude of the ascending node at the start of the week of the reference time, rad, and
        its change against the stars, rad/s.
    perigee : (...) array
        Argument of perigee, rad.
    anomaly : (...) array
        Mean anomaly at the reference time, rad.
    motion : (...) array
        Correction of the mean motion (Delta n), rad/s.
    cuc, cus, cic, cis : (...) array
        Harmonics of the argument of latitude and of the inclination, rad.
    crc, crs : (...) array
        Harmonics of the radius, m.
    gravity : (...) array
        Constant mu of the system, m^3/s^2.
    """

    reference: Array
    root_a: Array
    eccentricity: Array
    inclination: Array
    inclination_rate: Array
    node: Array
    node_rate: Array
    perigee: Array
    anomaly: Array
    motion: Array
    cuc: Array
    cus: Array
    crc: Array
    crs: Array
    cic: Array
    cis: Array
    gravity: Array

    @classmethod
    def of_rows(cls, rows: list[dict[str, float]]) -> "Elements":
        """Elements (n,) of records; what a record does not have is zero."""
        names = [field.name for field in fields(cls)]
        return cls(*(np.array([row.get(name, 0.0) for row in rows]) for name in names))

    def take(self, index: Any) -> "Elements":
        """Those at an index, as numpy understands it."""
        return Elements(*(getattr(self, field.name)[index] for field in fields(self)))


def eccentric_anomaly(mean: Array, eccentricity: Array) -> Array:
    """Eccentric anomalies (...), rad, of mean anomalies (...) by Newton's method.

    Kepler's equation M = E - e sin E of Table 20-IV, for eccentricities up to 0.5.
    """
    E = mean + eccentricity * np.sin(mean)
    for _ in range(_ROUNDS):
        E = E - (E - eccentricity * np.sin(E) - mean) / (1 - eccentricity * np.cos(E))
    return E


def positions(elements: Elements, times: Array) -> Array:
    """Places of satellites in the Earth-fixed frame, metres.

    Parameters
    ----------
    elements : Elements
        Of shape (...).
    times : (...) array
        Seconds of GPS time since its start in 1980.

    Returns
    -------
    (..., 3) array
        x, y, z in ECEF (WGS84), by the equations of Table 20-IV in their order. The way of the
        signal (0.07 s) is left out: it turns what is seen by 0.0003 degrees.
    """
    one = elements
    t = times - one.reference
    a = one.root_a**2
    motion = np.sqrt(one.gravity / a**3) + one.motion
    E = eccentric_anomaly(np.mod(one.anomaly + motion * t, 2 * np.pi), one.eccentricity)
    e = one.eccentricity
    true = np.arctan2(np.sqrt(1 - e**2) * np.sin(E), np.cos(E) - e)
    latitude = true + one.perigee
    c, s = np.cos(2 * latitude), np.sin(2 * latitude)
    u = latitude + one.cus * s + one.cuc * c
    radius = a * (1 - e * np.cos(E)) + one.crs * s + one.crc * c
    inclination = one.inclination + one.cis * s + one.cic * c + one.inclination_rate * t
    x, y = radius * np.cos(u), radius * np.sin(u)
    of_week = np.mod(one.reference, WEEK)
    node = one.node + (one.node_rate - EARTH_RATE) * t - EARTH_RATE * of_week
    return np.stack(
        [
            x * np.cos(node) - y * np.cos(inclination) * np.sin(node),
            x * np.sin(node) + y * np.cos(inclination) * np.cos(node),
            y * np.sin(inclination),
        ],
        axis=-1,
    )
