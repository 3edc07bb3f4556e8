"""RTKLIB solution files (.pos, and Emlid's .LLH): geodetic, geocentric, or from a moving base.

Emlid's receivers write the same rows without the header.
"""

import re
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from rtk_gt.receivers.baselines import Baselines
from rtk_gt.receivers.fixes import AUTONOMOUS, DGPS, ESTIMATED, RTK_FIXED, RTK_FLOAT, SBAS, Fixes
from rtk_gt.receivers.formats.packed import contents
from rtk_gt.receivers.gps_time import of_week, utc_of_gps
from validation.errors import InputError, Problem
from validation.poses.angles import Array
from validation.poses.earth_frames import LocalFrame, geodetic_from_ecef
from validation.text_files.reading import is_utf16

KINDS = {1: RTK_FIXED, 2: RTK_FLOAT, 3: SBAS, 4: DGPS, 5: AUTONOMOUS, 6: ESTIMATED, 7: ESTIMATED}
"""RTKLIB's Q: fix, float, SBAS, DGPS, single, PPP, dead reckoning."""
BARE = re.compile(r"\s*\d{4}/\d\d/\d\d\s+\d\d:\d\d:\d\d(\.\d+)?(\s+\S+){11,}")
"""A row of a file without a header: a date, a time, and eleven numbers or more."""
NO_HEADER = (
    "No header: rows are taken as Emlid writes them, GPS time, degrees, ellipsoidal heights."
)
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")


def read_pos(path: Path, receiver: str) -> Fixes:
    """The solutions of an RTKLIB .pos file.

    Times in GPST are turned into UTC (leap seconds to 2017, none since).

    Raises
    ------
    InputError
        Naming line, field and value of every bad place; for heights above the geoid, degrees
        with minutes, or baselines, which this reader does not take.
    """
    return pos_fixes(path, contents(path), receiver)


def pos_fixes(path: Path, data: bytes, receiver: str) -> Fixes:
    """The solutions of a .pos file's contents; see `read_pos`."""
    kind, rows, notes = _solutions(path, data)
    if kind == "baseline":
        said = (
            "columns e-baseline n-baseline u-baseline: they are from a base to a rover. If the "
            "base is a receiver of this drive, state `base` at the rover; else set out-solformat "
            "to llh"
        )
        raise InputError([Problem(path, said, field="header")])
    return _fixes(path, receiver, rows, geodetic=kind == "geodetic", notes=notes)


def pos_baselines(path: Path, data: bytes, receiver: str) -> Baselines:
    """From a moving base to the rover, of a .pos file's contents with baselines.

    Raises
    ------
    InputError
        Naming line, field and value of every bad place, or for other columns.
    """
    kind, rows, _ = _solutions(path, data)
    if kind != "baseline":
        said = "positions, not baselines: set out-solformat to enu, or take `base` out"
        raise InputError([Problem(path, said, field="header")])
    squares = np.sign(rows[:, 6:12]) * rows[:, 6:12] ** 2
    e, n, u, en, nu, ue = squares.T
    covariances = np.stack([e, en, ue, en, n, nu, ue, nu, u], axis=-1).reshape(-1, 3, 3)
    kinds = np.array([KINDS[int(q)] for q in rows[:, 4]])
    lines = rows[:, 12].astype(np.int64)
    return Baselines(receiver, rows[:, 0], rows[:, 1:4], kinds, covariances, lines, path)


def _solutions(path: Path, data: bytes) -> tuple[str, Array, tuple[str, ...]]:
    """What the coordinates are, rows with times in UTC, and remarks."""
    if is_utf16(data):
        raise InputError([Problem(path, "saved as UTF-16; save the file as UTF-8", 1)])
    lines = data.decode("latin-1").splitlines()
    kind, utc, notes = _header(path, lines)
    problems: list[Problem] = []
    rows: list[Array] = []
    if lines and not data.endswith(b"\n") and len(lines[-1].split()) < 13 and len(lines) > 2:
        notes = (*notes, "The last line is cut and left out.")
        lines = lines[:-1]
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
    table = np.array(rows)
    if not utc:
        table[:, 0] = utc_of_gps(table[:, 0])
    return kind, table, notes


def _header(path: Path, lines: list[str]) -> tuple[str, bool, tuple[str, ...]]:
    """Whether coordinates are geodetic, geocentric or a baseline, times UTC, and remarks."""
    head = next((line for line in lines if re.match(r"%\s+(GPST|UTC|JST)", line)), None)
    first = next((line for line in lines if line.strip() and not line.startswith("%")), "")
    if head is None and BARE.match(first):
        return "geodetic", False, (NO_HEADER,)
    if head is None:
        expected = "no header line '% GPST latitude(deg) ...'; is this an RTKLIB solution?"
        raise InputError([Problem(path, expected, 1)])
    at = lines.index(head) + 1
    kinds = {"latitude(deg)": "geodetic", "x-ecef(m)": "geocentric", "e-baseline(m)": "baseline"}
    kind = next((kind for column, kind in kinds.items() if column in head), None)
    if "JST" in head or kind is None:
        expected = (
            "columns that are not read here; set out-timesys to gpst or utc, out-solformat to "
            "llh with out-degform deg, or to xyz"
        )
        raise InputError([Problem(path, expected, at, "header", head)])
    if any("geodetic" in line and "lat/lon/height" in line for line in lines[:at]):
        expected = "heights above the geoid; set out-height to ellipsoidal"
        raise InputError([Problem(path, expected, at, "header")])
    return kind, "UTC" in head, ()


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
        return of_week(int(first), float(second))
    except ValueError:
        return None


def _fixes(
    path: Path, receiver: str, rows: Array, *, geodetic: bool, notes: tuple[str, ...]
) -> Fixes:
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
        times=rows[:, 0],
        geodetic=places,
        kinds=np.array([KINDS[int(q)] for q in rows[:, 4]]),
        satellites=rows[:, 5].astype(np.int64),
        hdop=np.full(len(rows), np.nan),
        covariances=covariances,
        lines=rows[:, 12].astype(np.int64),
        source=path,
        notes=notes,
    )
