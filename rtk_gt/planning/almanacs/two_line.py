"""Two-line elements (TLE), propagated by SGP4.

The propagation is that of the library sgp4 (Vallado, Crawford, Hujsak and Kelso, "Revisiting
Spacetrack Report #3", AIAA 2006-6753), with the constants of WGS72, for which such elements are
made. Its frame (TEME) is turned to the Earth by the sidereal time of 1982 (there, Eq. C-2 ff. and
Vallado, "Fundamentals of astrodynamics", Eq. 3-47); UT1 is taken as UTC, at most 0.9 s or 0.004
degrees, and the motion of the pole, below 0.0002 degrees, is left out.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rtk_gt.planning.almanacs.almanac import DAY, Almanac
from rtk_gt.planning.almanacs.tokens import Reading
from validation.errors import GtvalError
from validation.poses.angles import Array

UNIX_EPOCH_JD = 2440587.5
"""1970-01-01 as a Julian date."""
FIRST = re.compile(r"1 [ 0-9A-Z][ 0-9]{4}[A-Z ] .*")
_PRN = re.compile(r"PRN\s*([EGRCJ]?)\s*(\d{1,3})", re.IGNORECASE)
_SYSTEMS = (
    ("GALILEO", "E"), ("GSAT", "E"), ("GPS", "G"), ("NAVSTAR", "G"), ("COSMOS", "R"),
    ("GLONASS", "R"), ("BEIDOU", "C"), ("QZS", "J"), ("MICHIBIKI", "J"),
)  # fmt: skip
_CELLS = {
    "1": (("epoch", 18, 32),),
    "2": (
        ("inclination", 8, 16), ("node", 17, 25), ("eccentricity", 26, 33), ("perigee", 34, 42),
        ("mean anomaly", 43, 51), ("mean motion", 52, 63),
    ),
}  # fmt: skip
"""Numbers of each line and their columns. Letters do not count in the sum of a line."""
_BOTTOM = 1e7
"""Metres from the Earth's centre: nearer than this no satellite serves navigation."""


@dataclass(frozen=True)
class TwoLineAlmanac(Almanac):
    """Satellites by two-line elements; see `Almanac`.

    Parameters
    ----------
    epochs : (s,) array
        Of the elements, seconds since 1970 UTC.
    satellites : Any
        The library's record of each.
    """

    epochs: Array
    satellites: Any

    def ecef(self, times: Array) -> Array:
        """Places (s, t, 3) at times (t,), seconds since 1970 UTC; metres.

        Raises
        ------
        GtvalError
            If the propagation of a satellite breaks down: the elements are far too old, or not
            those of a satellite of navigation.
        """
        days = np.asarray(times, dtype=float) / DAY
        whole = np.floor(days)
        failed, places, _ = self.satellites.sgp4(whole + UNIX_EPOCH_JD, days - whole)
        wrong = ((failed != 0) | ~(np.linalg.norm(places, axis=-1) * 1e3 >= _BOTTOM)).any(1)
        if wrong.any():
            name = self.names[int(np.argmax(wrong))]
            raise GtvalError(
                f"{self.source}: the orbit of {name} cannot be propagated to this day, or is not "
                "that of a satellite for navigation. Take it out of the file, or get newer elements"
            )
        turned = -sidereal_time(times)
        c, s = np.cos(turned), np.sin(turned)
        x, y, z = np.moveaxis(1e3 * places, -1, 0)
        return np.stack([c * x - s * y, s * x + c * y, z], axis=-1)

    def ages(self, times: Array) -> Array:
        """Seconds (s, t) from the epoch of each satellite's elements."""
        return np.asarray(np.asarray(times)[None] - self.epochs[:, None])


def sidereal_time(times: Array) -> Array:
    """Greenwich mean sidereal time of 1982, rad, at times (...) in seconds since 1970.

    Vallado, "Fundamentals of astrodynamics", Eq. 3-47, in seconds of time, from UT1 (UTC here).
    """
    T = (np.asarray(times, dtype=float) / DAY + UNIX_EPOCH_JD - 2451545.0) / 36525.0
    seconds = 67310.54841 + (876600 * 3600 + 8640184.812866) * T + 0.093104 * T**2 - 6.2e-6 * T**3
    return np.asarray(np.mod(seconds, DAY) * 2 * np.pi / DAY)


def read_two_line(path: Path, lines: Sequence[str]) -> TwoLineAlmanac:
    """The satellites of a file of two-line elements, with or without lines of names.

    Raises
    ------
    InputError
        Naming line, field and value of every bad place.
    GtvalError
        If the library sgp4 is missing.
    """
    try:
        from sgp4.api import Satrec, SatrecArray  # noqa: PLC0415  (an extra)
    except ImportError:
        raise GtvalError("two-line elements need an extra: pip install 'gtval[gnss]'") from None
    reading = Reading(path)
    names: list[str] = []
    found = []
    title, number = "", 0
    while number < len(lines):
        line = lines[number].rstrip()
        number += 1
        if not line.startswith(("1 ", "2 ")):
            title = line.removeprefix("0 ").strip() or title
            continue
        if not line.startswith("1 ") or number == len(lines):
            reading.bad(number, "line 1", line, "two-line elements are a line 1 and a line 2")
            continue
        second = lines[number].rstrip()
        number += 1
        if not (_holds(reading, number - 1, line, "1") and _holds(reading, number, second, "2")):
            continue
        if line[2:7] != second[2:7]:
            reading.bad(number, "satellite number", second[2:7], f"line 1 is of {line[2:7]}")
            continue
        name = satellite_name(title, line[2:7].strip())
        if name in names:
            reading.bad(number - 1, "satellite", name, "stands in the file twice; keep the newer")
        names.append(name)
        found.append(Satrec.twoline2rv(line, second))
        title = ""
    reading.stop()
    epochs = np.array([(one.jdsatepoch - UNIX_EPOCH_JD + one.jdsatepochF) * DAY for one in found])
    notes = ("Two-line elements do not say which satellites are healthy.",)
    return TwoLineAlmanac(path, "TLE", tuple(names), (), notes, epochs, SatrecArray(found))


def _holds(reading: Reading, number: int, line: str, which: str) -> bool:
    """Whether a line has its number, its length and its checksum."""
    if not line.startswith(f"{which} "):
        reading.bad(number, f"line {which}", line, f"expected line {which} of two-line elements")
        return False
    if len(line) < 69 or not line[68].isdigit():
        reading.bad(number, f"line {which}", line, f"{len(line)} characters, expected 69")
        return False
    total = sum(int(one) if one.isdigit() else one == "-" for one in line[:68]) % 10
    if total != int(line[68]):
        reading.bad(number, "checksum", line[68], f"the line sums up to {total}; was it changed?")
        return False
    before = len(reading.problems)
    for name, start, end in _CELLS[which]:
        reading.number(number, name, line[start:end])
    return len(reading.problems) == before


def satellite_name(title: str, number: str) -> str:
    """Name of a satellite by the title above its elements, or else by its catalogue number."""
    upper = title.upper()
    letter = next((letter for word, letter in _SYSTEMS if word in upper), "X")
    prn = _PRN.search(title)
    if prn is None:
        return f"{letter}-{number}"
    letter = prn[1].upper() or (letter if letter != "X" else "G")
    return f"{letter}{int(prn[2]):02d}"
