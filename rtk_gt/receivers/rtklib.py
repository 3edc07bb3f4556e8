"""RTKLIB solution files (.pos) with geodetic or geocentric coordinates."""

import re
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from rtk_gt.receivers.fixes import AUTONOMOUS, DGPS, ESTIMATED, RTK_FIXED, RTK_FLOAT, SBAS, Fixes
from validation.errors import InputError, Problem
from validation.poses.angles import Array
from validation.poses.earth_frames import LocalFrame, geodetic_from_ecef
from validation.text_files.reading import file_bytes

MAX_BYTES = 2_000_000_000
"""A judgement: thirteen million solutions, two weeks at 10 Hz."""
KINDS = {1: RTK_FIXED, 2: RTK_FLOAT, 3: SBAS, 4: DGPS, 5: AUTONOMOUS, 6: ESTIMATED, 7: ESTIMATED}
"""RTKLIB's Q: fix, float, SBAS, DGPS, single, PPP, dead reckoning."""
GPS_EPOCH = datetime(1980, 1, 6, tzinfo=UTC)
_LEAP_SECONDS = (
    ("1981-07-01", 1), ("1982-07-01", 2), ("1983-07-01", 3), ("1985-07-01", 4),
    ("1988-01-01", 5), ("1990-01-01", 6), ("1991-01-01", 7), ("1992-07-01", 8),
    ("1993-07-01", 9), ("1994-07-01", 10), ("1996-01-01", 11), ("1997-07-01", 12),
    ("1999-01-01", 13), ("2006-01-01", 14), ("2009-01-01", 15), ("2012-07-01", 16),
    ("2015-07-01", 17), ("2017-01-01", 18),
)  # fmt: skip
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")


def gps_minus_utc(time: float) -> int:
    """Leap seconds between GPS time and UTC at a time in seconds since 1970."""
    steps = [
        datetime.fromisoformat(day + "T00:00:00+00:00").timestamp() for day, _ in _LEAP_SECONDS
    ]
    return int(np.searchsorted(steps, time, side="right"))


def read_pos(path: Path, receiver: str) -> Fixes:
    """The solutions of an RTKLIB .pos file.

    Times in GPST are turned into UTC (leap seconds to 2017, none since).

    Raises
    ------
    InputError
        Naming line, field and value of every bad place; for heights above the geoid, degrees
        with minutes, or baselines, which this reader does not take.
    """
    lines = file_bytes(path, MAX_BYTES, text=True).decode("latin-1").splitlines()
    geodetic, utc = _header(path, lines)
    problems: list[Problem] = []
    rows: list[Array] = []
    for number, line in enumerate(lines, 1):
        if line.startswith("%") or not line.strip():
            continue
        row = _row(path, number, line, problems)
        if row is not None:
            rows.append(row)
    if not rows and not problems:
        problems.append(Problem(path, "no solution in the file"))
    if problems:
        raise InputError(problems)
    return _fixes(path, receiver, np.array(rows), geodetic=geodetic, utc=utc)


def _header(path: Path, lines: list[str]) -> tuple[bool, bool]:
    """Whether the columns are latitude and longitude, and whether times are UTC."""
    head = next((line for line in lines if re.match(r"%\s+(GPST|UTC|JST)", line)), None)
    if head is None:
        expected = "no header line '% GPST latitude(deg) ...'; is this an RTKLIB solution?"
        raise InputError([Problem(path, expected, 1)])
    at = lines.index(head) + 1
    if "JST" in head or not ("latitude(deg)" in head or "x-ecef(m)" in head):
        expected = (
            "columns that are not read here; set out-timesys to gpst or utc, out-solformat to "
            "llh with out-degform deg, or to xyz"
        )
        raise InputError([Problem(path, expected, at, "header", head)])
    if any("geodetic" in line and "lat/lon/height" in line for line in lines[:at]):
        expected = "heights above the geoid; set out-height to ellipsoidal"
        raise InputError([Problem(path, expected, at, "header")])
    return "latitude(deg)" in head, "UTC" in head


def _row(path: Path, number: int, line: str, problems: list[Problem]) -> Array | None:
    """Time, three coordinates, Q, satellites, six deviations and the line number."""
    cells = line.replace(",", " ").split()
    comma = re.search(r"\d,\d", line)
    if len(cells) < 13 or comma:
        expected = "a decimal comma" if comma else f"{len(cells)} columns, expected at least 13"
        problems.append(Problem(path, f"{expected}; was the line cut?", number, "line", line))
        return None
    names = ("x", "y", "z", "Q", "ns", "sd", "sd", "sd", "sd", "sd", "sd")
    for name, cell in zip(names, cells[2:13], strict=True):
        if _NUMBER.fullmatch(cell) is None:
            problems.append(Problem(path, "not a number", number, name, cell))
            return None
    if float(cells[5]) not in KINDS:
        problems.append(Problem(path, "not a solution status (1 to 7)", number, "Q", cells[5]))
        return None
    time = _time(cells[0], cells[1])
    if time is None:
        problems.append(
            Problem(path, "not a time; expected yyyy/mm/dd hh:mm:ss or week and seconds", number,
                    "time", f"{cells[0]} {cells[1]}")
        )  # fmt: skip
        return None
    return np.array([time, *(float(cell) for cell in cells[2:13]), number])


def _time(first: str, second: str) -> float | None:
    """Seconds since 1970 in the file's time system."""
    try:
        if "/" in first:
            day = datetime.strptime(first, "%Y/%m/%d").replace(tzinfo=UTC)
            hours, minutes, seconds = second.split(":")
            return day.timestamp() + 3600 * int(hours) + 60 * int(minutes) + float(seconds)
        return (GPS_EPOCH + timedelta(weeks=int(first))).timestamp() + float(second)
    except ValueError:
        return None


def _fixes(path: Path, receiver: str, rows: Array, *, geodetic: bool, utc: bool) -> Fixes:
    times = rows[:, 0] if utc else rows[:, 0] - [gps_minus_utc(time) for time in rows[:, 0]]
    # Signed roots: RTKLIB writes a negative covariance as minus the root of its size.
    squares = np.sign(rows[:, 6:12]) * rows[:, 6:12] ** 2
    if geodetic:
        places = np.column_stack([np.radians(rows[:, 1:3]), rows[:, 3]])
        n, e, u, ne, eu, un = squares.T
        covariances = np.stack([e, ne, eu, ne, n, un, eu, un, u], axis=-1).reshape(-1, 3, 3)
    else:
        places = geodetic_from_ecef(rows[:, 1:4])
        x, y, z, xy, yz, zx = squares.T
        ecef = np.stack([x, xy, zx, xy, y, yz, zx, yz, z], axis=-1).reshape(-1, 3, 3)
        axes = LocalFrame(*places[0]).axes
        covariances = axes @ ecef @ axes.T
    return Fixes(
        receiver=receiver,
        times=times,
        geodetic=places,
        kinds=np.array([KINDS[int(q)] for q in rows[:, 4]]),
        satellites=rows[:, 5].astype(np.int64),
        hdop=np.full(len(rows), np.nan),
        covariances=covariances,
        lines=rows[:, 12].astype(np.int64),
        source=path,
    )
