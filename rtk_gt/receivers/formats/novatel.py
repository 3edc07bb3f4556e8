"""NovAtel's ASCII logs: BESTPOSA and its kind.

Source: OEM7 Commands and Logs Reference Manual, "ASCII", "BESTPOS" and "32-Bit CRC".
"""

import re
import zlib
from collections import Counter
from pathlib import Path

import numpy as np

from rtk_gt.receivers.fixes import AUTONOMOUS, DGPS, ESTIMATED, RTK_FIXED, RTK_FLOAT, SBAS, Fixes
from rtk_gt.receivers.gps_time import gps_minus_utc, of_week
from validation.errors import InputError, Problem
from validation.poses.angles import Array

LOGS = ("BESTPOSA", "BESTGNSSPOSA", "RTKPOSA", "MARKPOSA", "PSRPOSA")
KINDS = {
    "SINGLE": AUTONOMOUS, "SINGLE_SMOOTH": AUTONOMOUS, "PSRDIFF": DGPS, "PSRDIFF_SMOOTH": DGPS,
    "WAAS": SBAS, "SBAS": SBAS, "L1_FLOAT": RTK_FLOAT, "IONOFREE_FLOAT": RTK_FLOAT,
    "NARROW_FLOAT": RTK_FLOAT, "WIDE_FLOAT": RTK_FLOAT, "L1_INT": RTK_FIXED,
    "WIDE_INT": RTK_FIXED, "NARROW_INT": RTK_FIXED, "RTK_DIRECT_INS": RTK_FIXED,
    "INS_RTKFIXED": RTK_FIXED, "INS_RTKFLOAT": RTK_FLOAT, "INS_PSRSP": AUTONOMOUS,
    "INS_PSRDIFF": DGPS, "INS_SBAS": SBAS, "PPP": ESTIMATED, "PPP_CONVERGING": ESTIMATED,
    "PPP_BASIC": ESTIMATED, "INS": ESTIMATED, "PROPAGATED": ESTIMATED,
    "DOPPLER_VELOCITY": ESTIMATED, "FIXEDPOS": ESTIMATED, "FIXEDHEIGHT": AUTONOMOUS,
}  # fmt: skip
"""Position types as GGA numbers kinds of fixes; of those with two antennas the ambiguities are
resolved where the name ends with INT or RTKFIXED."""
UNSURE = ("UNKNOWN", "APPROXIMATE")
"""Qualities of the receiver's time with which positions have none."""
FEW_DAMAGED = 0.05
"""As for NMEA."""
_LINE = re.compile(r"#([A-Z]+),([^;]*);([^*]*)\*([0-9a-fA-F]{8})\s*$")


def crc(text: str) -> int:
    """NovAtel's CRC of the characters between '#' and '*': polynomial 0xEDB88320 from zero."""
    return zlib.crc32(text.encode("latin-1"), 0xFFFFFFFF) ^ 0xFFFFFFFF


def novatel_fixes(path: Path, data: bytes, receiver: str) -> Fixes:
    """The fixes of the contents of a NovAtel ASCII log; of the best kind of log there is.

    Returns
    -------
    Fixes
        Heights are above the ellipsoid: height above the sea plus undulation.

    Raises
    ------
    InputError
        Naming line, field and value of every bad place.
    """
    lines = data.decode("latin-1").splitlines()
    have = {line[1:].split(",", 1)[0] for line in lines if line.startswith("#")}
    name = next((one for one in LOGS if one in have), None)
    if name is None:
        said = f"no position log ({', '.join(LOGS)}); log one of them"
        raise InputError([Problem(path, said)])
    counts: Counter[str] = Counter()
    problems: list[Problem] = []
    damaged: list[Problem] = []
    rows: list[Array] = []
    total = 0
    for number, line in enumerate(lines, 1):
        if not line.startswith(f"#{name},"):
            continue
        total += 1
        match = _LINE.match(line)
        if match is None or crc(line[1 : line.rindex("*")]) != int(match[4], 16):
            said = "the sentence is cut or its CRC is wrong"
            damaged.append(Problem(path, said, number, "line", line))
            counts["damaged sentence skipped (cut, or wrong CRC)"] += 1
            continue
        row = _row(path, number, match, counts, problems)
        if row is not None:
            rows.append(row)
    if len(damaged) > FEW_DAMAGED * total:
        problems += damaged
    if problems:
        raise InputError(problems)
    if not rows:
        raise InputError([Problem(path, f"no {name} with a position")])
    return _fixes(path, receiver, np.array(rows), counts)


def _row(
    path: Path,
    number: int,
    match: re.Match[str],
    counts: Counter[str],
    problems: list[Problem],
) -> Array | None:
    """Time, latitude, longitude, height, kind, satellites, three sigmas and line of one log."""
    head, cells = match[2].split(","), match[3].split(",")
    if len(head) < 6 or len(cells) < 15:
        said = f"{len(head)} and {len(cells)} fields; expected 9 and 21"
        problems.append(Problem(path, said, number, match[1], match[0]))
        return None
    none = cells[0] != "SOL_COMPUTED" or cells[1] == "NONE"
    if none or head[3] in UNSURE:
        counts["without a fix" if none else "before the receiver knew the time"] += 1
        return None
    if cells[1] not in KINDS:
        said = f"not a position type; expected {', '.join(list(KINDS)[:6])}, ..."
        problems.append(Problem(path, said, number, "position type", cells[1]))
        return None
    try:
        gps = of_week(int(head[4]), float(head[5]))
        numbers = [float(cell) for cell in (*cells[2:6], *cells[7:10], cells[14])]
    except ValueError as error:
        problems.append(Problem(path, f"not a number: {error}", number, match[1], match[3]))
        return None
    latitude, longitude, height, undulation, north, east, up, satellites = numbers
    if not (abs(latitude) <= 90 and abs(longitude) <= 360):
        problems.append(Problem(path, "no place on the Earth", number, "latitude", cells[2]))
        return None
    time = gps - gps_minus_utc(gps)
    place = [np.radians(latitude), np.radians(longitude), height + undulation]
    return np.array([time, *place, KINDS[cells[1]], satellites, east, north, up, number])


def _fixes(path: Path, receiver: str, rows: Array, counts: Counter[str]) -> Fixes:
    without = counts.pop("without a fix", 0)
    return Fixes(
        receiver=receiver,
        times=rows[:, 0],
        geodetic=rows[:, 1:4],
        kinds=rows[:, 4].astype(np.int64),
        satellites=rows[:, 5].astype(np.int64),
        hdop=np.full(len(rows), np.nan),
        covariances=rows[:, 6:9, None] ** 2 * np.eye(3),
        lines=rows[:, 9].astype(np.int64),
        source=path,
        tolerated=dict(counts),
        without_fix=without,
    )
