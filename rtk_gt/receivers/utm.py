"""UTM coordinates turned into latitude and longitude.

Source: Karney, "Transverse Mercator with an accuracy of a few nanometers", Journal of Geodesy 85
(2011), section 4: Krueger's series to the sixth order in the third flattening.
"""

import re

import numpy as np

from validation.errors import GtvalError
from validation.poses.angles import Array

RADIUS, FLATTENING = 6_378_137.0, 1 / 298.257223563
"""Of the WGS84 ellipsoid: metres, and without unit."""
SCALE, FALSE_EAST, FALSE_NORTH = 0.9996, 500_000.0, 10_000_000.0
_N = FLATTENING / (2 - FLATTENING)
_BETA = (
    _N / 2 - 2 * _N**2 / 3 + 37 * _N**3 / 96 - _N**4 / 360 - 81 * _N**5 / 512
    + 96199 * _N**6 / 604800,
    _N**2 / 48 + _N**3 / 15 - 437 * _N**4 / 1440 + 46 * _N**5 / 105 - 1118711 * _N**6 / 3870720,
    17 * _N**3 / 480 - 37 * _N**4 / 840 - 209 * _N**5 / 4480 + 5569 * _N**6 / 90720,
    4397 * _N**4 / 161280 - 11 * _N**5 / 504 - 830251 * _N**6 / 7257600,
    4583 * _N**5 / 161280 - 108847 * _N**6 / 3991680,
    20648693 * _N**6 / 638668800,
)  # fmt: skip
_A = RADIUS / (1 + _N) * (1 + _N**2 / 4 + _N**4 / 64 + _N**6 / 256)
_E = np.sqrt(FLATTENING * (2 - FLATTENING))
_ZONE = re.compile(r"\s*([1-9]|[1-5]\d|60)\s*([NS]|north|south)\s*", re.IGNORECASE)


def central_meridian(zone: str) -> tuple[float, bool]:
    """Longitude in radians of the middle of a zone, and whether it is south of the equator.

    Raises
    ------
    GtvalError
        If it is no zone with a hemisphere.
    """
    found = _ZONE.fullmatch(zone)
    if found is None:
        raise GtvalError(
            f"'{zone}' is no UTM zone; expected a number from 1 to 60 and N or S, such as '32N'. "
            "Letters of latitude bands are not read: S of 32S may be either"
        )
    return float(np.radians(6 * int(found[1]) - 183)), found[2][0].upper() == "S"


def geodetic_of_utm(east_north: Array, zone: str) -> Array:
    """Latitude and longitude (n, 2) in radians of UTM coordinates (n, 2) in metres, WGS84.

    Raises
    ------
    GtvalError
        If the zone is none, or a place is outside of what UTM is for.
    """
    meridian, south = central_meridian(zone)
    x, y = east_north[:, 0], east_north[:, 1]
    bad = (x < 100_000) | (x > 900_000) | (y < -1e4) | (y > FALSE_NORTH)
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
        raise GtvalError(
            f"east {x[row]:.1f}, north {y[row]:.1f} m is not in a UTM zone (east 100000 to 900000, "
            "north 0 to 10000000); are the columns exchanged, or is it another grid?"
        )
    xi = (y - (FALSE_NORTH if south else 0.0)) / (SCALE * _A)
    eta = (x - FALSE_EAST) / (SCALE * _A)
    xi_, eta_ = xi.copy(), eta.copy()
    for j, beta in enumerate(_BETA, 1):
        xi_ -= beta * np.sin(2 * j * xi) * np.cosh(2 * j * eta)
        eta_ -= beta * np.cos(2 * j * xi) * np.sinh(2 * j * eta)
    conformal = np.sin(xi_) / np.hypot(np.sinh(eta_), np.cos(xi_))
    longitude = meridian + np.arctan2(np.sinh(eta_), np.cos(xi_))
    return np.column_stack([np.arctan(_tangent(conformal)), longitude])


def _tangent(conformal: Array) -> Array:
    """Tangent of the latitude from that of the conformal one, by Newton (Karney, Eq. 19 to 21)."""
    tau = conformal / (1 - _E**2)
    for _ in range(4):
        root = np.hypot(1.0, tau)
        sigma = np.sinh(_E * np.arctanh(_E * tau / root))
        found = tau * np.hypot(1.0, sigma) - sigma * root
        rise = (1 + (1 - _E**2) * tau**2) / ((1 - _E**2) * root)
        tau = tau + (conformal - found) / np.hypot(1.0, found) * rise
    return np.asarray(tau)
