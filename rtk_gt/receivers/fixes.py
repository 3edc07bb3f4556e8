"""What a receiver recorded: positions with their fix kind, satellites and stated errors."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.shown import Shown

Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

NO_FIX, AUTONOMOUS, DGPS, PPS, RTK_FIXED, RTK_FLOAT, ESTIMATED = range(7)
"""Fix kinds as the GGA sentence numbers them."""
SBAS = 9
FIX_NAMES: Mapping[int, str] = MappingProxyType(
    {
        NO_FIX: "no fix",
        AUTONOMOUS: "autonomous",
        DGPS: "DGPS",
        PPS: "PPS",
        RTK_FIXED: "RTK fixed",
        RTK_FLOAT: "RTK float",
        ESTIMATED: "estimated",
        7: "manual",
        8: "simulated",
        SBAS: "SBAS",
    }
)


class Frozen(NamedTuple):
    """A stretch in which a receiver hung.

    Its first and last time (s since 1970), how many positions are the same to the last digit, how
    far the next one leapt (m), and the line of the first.
    """

    begin: float
    end: float
    fixes: int
    leap: float
    line: int


@dataclass(frozen=True, repr=False)
class Fixes(Shown):
    """The record of one receiver, in order of time.

    Parameters
    ----------
    receiver : str
        Its name.
    times : (n,) array
        Seconds since 1970-01-01 UTC.
    geodetic : (n, 3) array
        Latitude and longitude in radians, height above the ellipsoid in metres.
    kinds : (n,) int array
        Fix kinds, see `FIX_NAMES`.
    satellites : (n,) int array
        Satellites used; -1 where not stated.
    hdop : (n,) array
        Horizontal dilution of precision; NaN where not stated.
    covariances : (n, 3, 3) array
        Of east, north and up in m^2, as the receiver states it; NaN where it does not.
    lines : (n,) int array
        Line of the file (number of the observation in a rawlog) that each fix came from.
    source : Path
        The file.
    tolerated : mapping of str to int
        Departures from the format that were accepted, and how often.
    notes : tuple of str
        What a person should know of this file.
    host : (n,) array, optional
        Seconds since 1970 at which a computer wrote each fix down; NaN where it did not.
    without_fix : int
        Epochs at which the receiver reported that it has no position.
    frozen : tuple of Frozen
        Stretches in which it hung, whose positions are not called fixed.
    level_digit : float
        Metres of the last digit to which the file writes level positions; 0 where it is too fine to
        tell.

    Raises
    ------
    GtvalError
        If the arrays differ in length.
    """

    receiver: str
    times: Array
    geodetic: Array
    kinds: Ints
    satellites: Ints
    hdop: Array
    covariances: Array
    lines: Ints
    source: Path
    tolerated: Mapping[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    host: Array = field(default_factory=lambda: np.empty(0))
    without_fix: int = 0
    frozen: tuple[Frozen, ...] = ()
    level_digit: float = 0.0

    def __post_init__(self) -> None:
        n = len(self.times)
        if len(self.host) == 0:
            object.__setattr__(self, "host", np.full(n, np.nan))
        expected = {
            "host": (n,),
            "geodetic": (n, 3),
            "kinds": (n,),
            "satellites": (n,),
            "hdop": (n,),
            "covariances": (n, 3, 3),
            "lines": (n,),
        }
        for name, shape in expected.items():
            if getattr(self, name).shape != shape:
                raise GtvalError(
                    f"receiver {self.receiver}: {name} has shape {getattr(self, name).shape}, "
                    f"not {shape}"
                )

    def __len__(self) -> int:
        return len(self.times)

    @property
    def epochs(self) -> int:
        """How many epochs the receiver reported, with and without a position."""
        return len(self) + self.without_fix

    @property
    def fixed(self) -> Bools:
        """(n,) True where the ambiguities are resolved (RTK fixed)."""
        return np.asarray(self.kinds == RTK_FIXED)

    def select(self, rows: npt.NDArray[np.bool_] | npt.NDArray[np.int64]) -> "Fixes":
        """The chosen rows."""
        return replace(
            self,
            times=self.times[rows],
            geodetic=self.geodetic[rows],
            kinds=self.kinds[rows],
            satellites=self.satellites[rows],
            hdop=self.hdop[rows],
            covariances=self.covariances[rows],
            lines=self.lines[rows],
            host=self.host[rows],
        )


def covariance_of_ellipse(major: Array, minor: Array, azimuth: Array) -> tuple[Array, Array, Array]:
    """East variance, north variance and their covariance of error ellipses.

    Parameters
    ----------
    major, minor : (n,) array
        Standard deviations along the axes, in metres.
    azimuth : (n,) array
        Direction of the major axis from north towards east, in radians.
    """
    sine, cosine = np.sin(azimuth), np.cos(azimuth)
    return (
        (major * sine) ** 2 + (minor * cosine) ** 2,
        (major * cosine) ** 2 + (minor * sine) ** 2,
        (major**2 - minor**2) * sine * cosine,
    )
