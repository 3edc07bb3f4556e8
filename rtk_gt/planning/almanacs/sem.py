"""SEM almanacs: bare numbers in a fixed order, angles in semicircles.

Source: IS-GPS-870 (and ICD-GPS-870), "SEM almanac description"; the inclination is an offset from
0.30 semicircles, as in IS-GPS-200, Table 20-VI.
"""

import re
from collections.abc import Sequence
from math import pi
from pathlib import Path

from rtk_gt.planning.almanacs.almanac import KeplerAlmanac
from rtk_gt.planning.almanacs.orbits import GRAVITY_GPS, WEEK, Elements
from rtk_gt.planning.almanacs.tokens import Reading, nearest_week
from rtk_gt.planning.almanacs.yuma import gps_name

FIRST = re.compile(r"\s*\d{1,2}(\s+\S.*)?\s*")
SECOND = re.compile(r"\s*\d{1,4}\s+\d{1,6}\s*")
_ROW = (
    ("PRN", ""), ("SVN", ""), ("URA", ""),
    ("eccentricity", "eccentricity"), ("inclination offset", "inclination"),
    ("rate of right ascension", "node_rate"), ("root of the semi-major axis", "root_a"),
    ("longitude of the orbital plane", "node"), ("argument of perigee", "perigee"),
    ("mean anomaly", "anomaly"), ("af0", ""), ("af1", ""), ("health", ""), ("configuration", ""),
)  # fmt: skip
_OFFSET = 0.30
"""Semicircles that the inclination is an offset from."""


def read_sem(path: Path, lines: Sequence[str], gps: float) -> KeplerAlmanac:
    """The satellites of a SEM almanac.

    Parameters
    ----------
    path : Path
        For messages.
    lines : sequence of str
        Of the file.
    gps : float
        GPS seconds for which it is wanted: the week is written modulo 1024.

    Raises
    ------
    InputError
        Naming line, field and value of every bad place.
    """
    reading = Reading(path)
    count = int(lines[0].split()[0])
    week, toe = lines[1].split()
    seconds = reading.number(2, "time of applicability", toe, "toe")
    reference = nearest_week(int(week), seconds, gps) * WEEK + seconds
    cells = [(n, cell) for n, line in enumerate(lines[2:], 3) for cell in line.split()]
    if len(cells) != count * len(_ROW):
        said = f"{len(cells)} numbers after line 2; {count} satellites have {count * len(_ROW)}"
        reading.bad(1, "number of records", str(count), f"{said}; was the file cut?")
    reading.stop()
    records, owners, unhealthy = [], [], []
    for start in range(0, len(cells), len(_ROW)):
        row = cells[start : start + len(_ROW)]
        name = gps_name(reading.whole(row[0][0], "PRN", row[0][1], 1, 210))
        values = {
            kind: _value(reading, *cell, label, kind)
            for (label, kind), cell in zip(_ROW, row, strict=True)
            if kind
        }
        health = reading.whole(row[12][0], "health", row[12][1], 0, 63)
        if name in owners or name in unhealthy:
            reading.bad(row[0][0], "PRN", row[0][1], "this satellite stands in the file twice")
        elif health:
            unhealthy.append(name)
        else:
            owners.append(name)
            records.append({**values, "reference": reference, "gravity": GRAVITY_GPS})
    reading.stop()
    return KeplerAlmanac(
        path, "SEM", tuple(owners), tuple(unhealthy), (), Elements.of_rows(records), tuple(owners)
    )


def _value(reading: Reading, line: int, cell: str, label: str, kind: str) -> float:
    """One element in radians and metres."""
    if kind in {"eccentricity", "root_a"}:
        return reading.number(line, label, cell, kind)
    if kind == "inclination":
        return reading.number(line, label, cell, "", pi) + _OFFSET * pi
    return reading.number(line, label, cell, kind, pi)
