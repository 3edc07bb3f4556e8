"""Almanac files of each kind, from elements: YUMA, SEM, two-line elements, RINEX navigation."""

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from math import degrees, pi, sqrt

import numpy as np

from data_samples.sky.constellation import Row
from rtk_gt.planning.almanacs.orbits import EARTH_RATE, GPS_EPOCH, WEEK
from rtk_gt.planning.almanacs.two_line import sidereal_time
from rtk_gt.receivers.gps_time import gps_minus_utc

FORMATS = ("yuma", "sem", "tle", "rinex2", "rinex3")


def almanac_text(rows: Mapping[str, Row], form: str) -> str:
    """The text of an almanac file.

    Parameters
    ----------
    rows : mapping of str to Row
        Elements by the names of the satellites: 'G05'.
    form : str
        One of `FORMATS`.
    """
    writers = {"yuma": yuma_text, "sem": sem_text, "tle": two_line_text}
    if form in writers:
        return writers[form](rows)
    return navigation_text(rows, int(form[-1]))


def yuma_text(rows: Mapping[str, Row], health: Mapping[str, int] | None = None) -> str:
    """A YUMA almanac, with weeks modulo 1024; health by name, 0 where not stated."""
    blocks = []
    for name, row in rows.items():
        week, toa = divmod(row["reference"], WEEK)
        week = int(week) % 1024
        values = [
            ("ID", name[1:]),
            ("Health", f"{(health or {}).get(name, 0):03d}"),
            ("Eccentricity", _fortran(row["eccentricity"])),
            ("Time of Applicability(s)", f"{toa:.4f}"),
            ("Orbital Inclination(rad)", f"{row['inclination']:.10f}"),
            ("Rate of Right Ascen(r/s)", _fortran(row["node_rate"])),
            ("SQRT(A)  (m 1/2)", f"{row['root_a']:.6f}"),
            ("Right Ascen at Week(rad)", _fortran(row["node"])),
            ("Argument of Perigee(rad)", f"{row['perigee']:.9f}"),
            ("Mean Anom(rad)", _fortran(row["anomaly"])),
            ("Af0(s)", _fortran(0.0)),
            ("Af1(s/s)", _fortran(0.0)),
            ("week", f"{week}"),
        ]
        lines = [f"******** Week {week} almanac for PRN-{name[1:]} ********"]
        blocks.append("\n".join([*lines, *(f"{key + ':':27s} {value}" for key, value in values)]))
    return "\n\n".join(blocks) + "\n"


def _fortran(value: float) -> str:
    """A number as 0.1234567890E-002."""
    if value == 0:
        return "0.0000000000E+000"
    exponent = int(np.floor(np.log10(abs(value)))) + 1
    return f"{value / 10.0**exponent:.10f}E{exponent:+04d}"


def sem_text(rows: Mapping[str, Row], health: Mapping[str, int] | None = None) -> str:
    """A SEM almanac of satellites with one reference time; angles in semicircles."""
    week, toa = divmod(next(iter(rows.values()))["reference"], WEEK)
    lines = [f"{len(rows)} CURRENT.ALM", f" {int(week) % 1024:03d} {toa:.0f}", ""]
    for name, row in rows.items():
        offset = row["inclination"] / pi - 0.30
        node, perigee = row["node"] / pi, row["perigee"] / pi
        lines += [
            f"{int(name[1:])}",
            f"{int(name[1:]) + 30}",
            "0",
            f" {row['eccentricity']:.14E} {offset:.14E} {row['node_rate'] / pi:.14E}",
            f" {row['root_a']:.14E} {node:.14E} {perigee:.14E}",
            f" {row['anomaly'] / pi:.14E} {0.0:.14E} {0.0:.14E}",
            f"{(health or {}).get(name, 0)}",
            "11",
            "",
        ]
    return "\n".join(lines)


def two_line_text(rows: Mapping[str, Row]) -> str:
    """Two-line elements of the same orbits, with lines of names.

    Two-line elements are means of another theory: the two move apart by some hundredths of a degree
    a day.
    """
    lines = []
    for number, (name, row) in enumerate(rows.items(), 1):
        utc = row["reference"] + GPS_EPOCH
        utc -= gps_minus_utc(utc)
        of_week = row["reference"] % WEEK
        node = row["node"] - EARTH_RATE * of_week + float(sidereal_time(np.array(utc)))
        motion = sqrt(row["gravity"] / row["root_a"] ** 6) * 86400 / (2 * pi)
        stamp = datetime.fromtimestamp(utc, tz=UTC)
        day = (stamp - datetime(stamp.year, 1, 1, tzinfo=UTC)) / timedelta(days=1) + 1
        system = {"G": "GPS NOMINAL", "E": "GALILEO NOMINAL"}[name[0]]
        prn = name[1:] if name[0] == "G" else name
        first = (
            f"1 {90000 + number:05d}U 93001A   {stamp:%y}{day:012.8f}  .00000000"
            "  00000-0  00000-0 0  999"
        )
        second = (
            f"2 {90000 + number:05d} {degrees(row['inclination']):8.4f} {_turned(node)} "
            f"{row['eccentricity'] * 1e7:07.0f} {_turned(row['perigee'])} "
            f"{_turned(row['anomaly'])} {motion:11.8f}    1"
        )
        lines += [f"{system} (PRN {prn})", _summed(first), _summed(second)]
    return "\n".join(lines) + "\n"


def _turned(angle: float) -> str:
    """Degrees from 0 to 360 in eight columns."""
    return f"{round(degrees(angle) % 360, 4) % 360:8.4f}"


def _summed(line: str) -> str:
    """A line of two-line elements with its checksum."""
    return f"{line}{sum(int(c) if c.isdigit() else c == '-' for c in line) % 10}"


def navigation_text(
    rows: Mapping[str, Row] | list[tuple[str, Row]],
    version: int,
    health: Mapping[str, int] | None = None,
) -> str:
    """A RINEX navigation file of version 2 (GPS only) or 3."""
    pairs = list(rows.items()) if isinstance(rows, Mapping) else rows
    header = [
        (f"{'2.11' if version == 2 else '3.04':>9s}", "N: GNSS NAV DATA", "M: MIXED"),
        (f"{'':60s}", "", ""),
    ]
    kind = f"{header[0][0]}{'':11s}{header[0][1]:20s}{header[0][2] if version == 3 else '':20s}"
    lines = [f"{kind}RINEX VERSION / TYPE", f"{'':60s}END OF HEADER"]
    for name, row in pairs:
        stamp = datetime.fromtimestamp(row["reference"] + GPS_EPOCH, tz=UTC)
        if version == 2:
            first = (
                f"{int(name[1:]):2d} {stamp:%y} {stamp.month:2d} {stamp.day:2d} {stamp.hour:2d} "
                f"{stamp.minute:2d}{stamp.second:5.1f}"
            )
        else:
            first = f"{name} {stamp:%Y %m %d %H %M %S}"
        week, toe = divmod(row["reference"], WEEK)
        ill = float((health or {}).get(name, 0))
        numbers: list[tuple[str | float, ...]] = [
            (0.0, "crs", "motion", "anomaly"),
            ("cuc", "eccentricity", "cus", "root_a"),
            (toe, "cic", "node", "cis"),
            ("inclination", "crc", "perigee", "node_rate"),
            ("inclination_rate", 1.0, week, 0.0),
            (2.0, ill, 0.0, 0.0),
            (toe, 4.0),
        ]
        lines.append(first + _cells((0.0, 0.0, 0.0)))
        for cells in numbers:
            values = [row.get(one, 0.0) if isinstance(one, str) else float(one) for one in cells]
            lines.append(" " * (3 if version == 2 else 4) + _cells(values))
    return "\n".join(lines) + "\n"


def _cells(values: "list[float] | tuple[float, ...]") -> str:
    """Numbers as RINEX writes them: 19 columns, D for the exponent."""
    return "".join(f"{value:19.12E}".replace("E", "D") for value in values)
