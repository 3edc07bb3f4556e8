"""YUMA almanacs: a heading for each satellite, and a value a line.

Source: U.S. Coast Guard Navigation Center, "YUMA almanac description"; angles in radians.
"""

import re
from collections.abc import Sequence
from pathlib import Path

from rtk_gt.planning.almanacs.almanac import KeplerAlmanac
from rtk_gt.planning.almanacs.orbits import GRAVITY_GPS, WEEK, Elements
from rtk_gt.planning.almanacs.tokens import Reading, nearest_week

HEADING = re.compile(r"\*+\s*Week\s+\d+\s+almanac for", re.IGNORECASE)
_KEYS = (
    ("id", "id"),
    ("health", "health"),
    ("eccentricity", "eccentricity"),
    ("time of applicability", "toe"),
    ("orbital inclination", "inclination"),
    ("rate of right ascen", "node_rate"),
    ("sqrt(a)", "root_a"),
    ("right ascen at", "node"),
    ("argument of perigee", "perigee"),
    ("mean anom", "anomaly"),
    ("af0", ""),
    ("af1", ""),
    ("week", "week"),
)
_NEEDED = [kind for _, kind in _KEYS if kind]


def read_yuma(path: Path, lines: Sequence[str], gps: float) -> KeplerAlmanac:
    """The satellites of a YUMA almanac.

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
    blocks: list[tuple[int, dict[str, tuple[int, str]]]] = []
    for number, line in enumerate(lines, 1):
        if HEADING.match(line.strip()):
            blocks.append((number, {}))
        elif line.strip() and blocks:
            _add(reading, number, line, blocks[-1][1])
        elif line.strip():
            reading.bad(number, "heading", line, "expected '******** Week ... almanac for PRN-..'")
    records, owners, unhealthy = [], [], []
    for number, cells in blocks:
        record = _record(reading, number, cells, gps)
        if record is None:
            continue
        name, health, values = record
        if name in owners or name in unhealthy:
            reading.bad(number, "ID", name, "this satellite stands in the file twice")
        elif health:
            unhealthy.append(name)
        else:
            owners.append(name)
            records.append(values)
    reading.stop()
    return KeplerAlmanac(
        path, "YUMA", tuple(owners), tuple(unhealthy), (), Elements.of_rows(records), tuple(owners)
    )


def _add(reading: Reading, number: int, line: str, cells: dict[str, tuple[int, str]]) -> None:
    """Put the value of a line where it belongs."""
    key, colon, value = line.partition(":")
    kind = next((kind for start, kind in _KEYS if key.strip().lower().startswith(start)), None)
    if not colon or kind is None:
        reading.bad(number, "line", line, "not a line of a YUMA almanac, such as 'ID: 01'")
    elif kind in cells:
        reading.bad(number, key.strip(), value.strip(), f"stands in line {cells[kind][0]}, too")
    elif kind:
        cells[kind] = (number, value)


def _record(
    reading: Reading, start: int, cells: dict[str, tuple[int, str]], gps: float
) -> tuple[str, int, dict[str, float]] | None:
    """Name, health and elements of one satellite; None if something is missing."""
    missing = [
        next(key for key, kind in _KEYS if kind == one) for one in _NEEDED if one not in cells
    ]
    if missing:
        reading.bad(start, missing[0], None, "missing below this heading; was the file cut?")
        return None
    got = {
        kind: reading.number(cells[kind][0], key, cells[kind][1], kind)
        for key, kind in _KEYS
        if kind not in {"", "id", "week", "health"}
    }
    prn = reading.whole(cells["id"][0], "ID", cells["id"][1], 1, 210)
    health = reading.whole(cells["health"][0], "health", cells["health"][1], 0, 1023)
    week = reading.whole(cells["week"][0], "week", cells["week"][1], 0, 9999)
    toe = got.pop("toe")
    got["reference"] = nearest_week(week, toe, gps) * WEEK + toe
    return gps_name(prn), health, {**got, "gravity": GRAVITY_GPS}


def gps_name(prn: int) -> str:
    """Name of a satellite by its PRN as GPS almanacs count them: from 193 QZSS."""
    return f"J{prn - 192:02d}" if 193 <= prn <= 210 else f"G{prn:02d}"
