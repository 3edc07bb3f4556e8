"""Readers of the text formats of the RAWSEEDS datasets.

A scan a line, separated by commas. SICK: time, number of ranges, offset of the first beam in
quarters of a degree, ranges over 180 degrees in steps of one. Hokuyo: time, number of ranges,
ranges over 240 degrees. Odometry: time, counter, right and left ticks, x, y, theta.
"""

from pathlib import Path

import numpy as np

from laser_gt.records import ScanRecord, checked, make_scan, numbers, read_lines, without_far
from validation.angles import Array
from validation.errors import InputError, Problem

SICK_RANGE_MAX = 81.0
HOKUYO_RANGE_MAX = 5.6
HOKUYO_FIELD = np.deg2rad(240.0)
SICK_READINGS = 181


def read_rawseeds_sick(path: Path, sensor: str = "front") -> list[ScanRecord]:
    """Scans of a SICK_*.csv; missing readings at the end (zero) are no returns."""
    return _read(path, sensor, sick=True)


def read_rawseeds_hokuyo(path: Path, sensor: str = "front") -> list[ScanRecord]:
    """Scans of a HOKUYO_*.csv."""
    return _read(path, sensor, sick=False)


def _read(path: Path, sensor: str, *, sick: bool) -> list[ScanRecord]:
    records: list[ScanRecord | Problem] = []
    for line, text in enumerate(read_lines(path), 1):
        words = [word.strip() for word in text.split(",") if word.strip()]
        if not words or words[0].startswith(("#", "%")):
            continue
        values = numbers(path, line, words, "ranges")
        if isinstance(values, Problem):
            records.append(values)
            continue
        records.append(_record(path, line, values, sensor, sick=sick))
    return checked(path, records)


def _record(
    path: Path, line: int, values: Array, sensor: str, *, sick: bool
) -> ScanRecord | Problem:
    """A scan of one line."""
    skip = 3 if sick else 2
    if len(values) < skip + 1 or len(values) - skip < values[1]:
        text = f"the line is cut short: {max(len(values) - skip, 0)} ranges"
        return Problem(path, f"{text}, {values[1]:.0f} expected" if len(values) > 1 else text, line)
    count = int(values[1])
    ranges = values[skip : skip + count]
    if sick:
        angles = np.deg2rad(-90.0 + 0.25 * values[2] + np.arange(count))
        limit = SICK_RANGE_MAX
    else:
        angles = np.linspace(-HOKUYO_FIELD / 2, HOKUYO_FIELD / 2, count)
        limit = HOKUYO_RANGE_MAX
    ranges = without_far(np.where(ranges == 0, np.inf, ranges), limit)
    scan = make_scan(
        path,
        line,
        ranges,
        angles,
        range_min=0.01,
        range_max=limit,
        time=float(values[0]),
        sensor=sensor,
    )
    return scan if isinstance(scan, Problem) else ScanRecord(scan, line=line)


def read_rawseeds_odometry(path: Path) -> tuple[Array, Array]:
    """Times (n,) and poses (n, 3) of an ODOMETRY_XYT.csv.

    Raises
    ------
    InputError
        Naming every bad line.
    """
    rows, problems = [], []
    for line, text in enumerate(read_lines(path), 1):
        words = [word.strip() for word in text.split(",") if word.strip()]
        if not words or words[0].startswith(("#", "%")):
            continue
        values = numbers(path, line, words, "odometry")
        if isinstance(values, Problem):
            problems.append(values)
        elif len(values) < 7:
            short = f"the line is cut short: {len(values)} of 7 numbers"
            problems.append(Problem(path, short, line))
        else:
            rows.append(values)
    if not rows and not problems:
        problems.append(Problem(path, "the file holds no odometry"))
    if problems:
        raise InputError(problems)
    table = np.array([row[[0, 4, 5, 6]] for row in rows])
    return table[:, 0], table[:, 1:]
