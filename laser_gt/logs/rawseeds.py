"""Readers of the text formats of the RAWSEEDS datasets.

A scan a line, separated by commas. SICK: time, number of ranges, offset of the first beam in
quarters of a degree, ranges over 180 degrees in steps of one. Hokuyo: time, number of ranges,
ranges over 240 degrees. Odometry: time, counter, right and left ticks, x, y, theta.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from laser_gt.logs.records import ScanRecord, checked, make_scan, numbers, read_lines, without_far
from validation.errors import InputError, Problem
from validation.poses.angles import Array

SICK_RANGE_MAX = 81.0
HOKUYO_RANGE_MAX = 5.6
HOKUYO_FIELD = np.deg2rad(240.0)
ODOMETRY_NUMBERS = 7


def read_rawseeds_sick(path: Path, sensor: str = "front") -> list[ScanRecord]:
    """Scans of a SICK_*.csv; missing readings at the end (zero) are no returns."""
    return _read(path, sensor, sick=True)


def read_rawseeds_hokuyo(path: Path, sensor: str = "front") -> list[ScanRecord]:
    """Scans of a HOKUYO_*.csv."""
    return _read(path, sensor, sick=False)


def _read(path: Path, sensor: str, *, sick: bool) -> list[ScanRecord]:
    records = [
        _record(path, line, words, sensor, sick=sick) for line, words in _lines(read_lines(path))
    ]
    return checked(path, records)


def _lines(lines: Sequence[str]) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of each line that is no comment."""
    for line, text in enumerate(lines, 1):
        words = [word.strip() for word in text.split(",")]
        while words and not words[-1]:
            words.pop()
        if words and not words[0].startswith(("#", "%")):
            yield line, words


def _record(
    path: Path, line: int, words: Sequence[str], sensor: str, *, sick: bool
) -> ScanRecord | Problem:
    """A scan of one line."""
    skip = 3 if sick else 2
    if len(words) <= skip:
        return Problem(path, f"the line is cut short: {len(words)} numbers", line, "ranges")
    head = numbers(path, line, words[:skip], "head", finite=True)
    if isinstance(head, Problem):
        return head
    if head[1] < 1 or head[1] != np.round(head[1]):
        return Problem(path, "not a count of readings", line, "head", words[1])
    count = int(head[1])
    found = len(words) - skip
    if found < count:
        text = f"the line is cut short: {found} ranges, {count} expected"
        return Problem(path, text, line, "ranges")
    ranges = numbers(path, line, words[skip : skip + count], "ranges")
    if isinstance(ranges, Problem):
        return ranges
    if sick:
        angles = np.deg2rad(-90.0 + 0.25 * head[2] + np.arange(count))
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
        time=float(head[0]),
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
    for line, words in _lines(read_lines(path)):
        values = numbers(path, line, words, "odometry", finite=True)
        if isinstance(values, Problem):
            problems.append(values)
        elif len(values) < ODOMETRY_NUMBERS:
            short = f"the line is cut short: {len(values)} of {ODOMETRY_NUMBERS} numbers"
            problems.append(Problem(path, short, line, "odometry"))
        else:
            rows.append(values)
    if not rows and not problems:
        problems.append(Problem(path, "the file holds no odometry"))
    if problems:
        raise InputError(problems)
    table = np.array([row[[0, 4, 5, 6]] for row in rows])
    return table[:, 0], table[:, 1:]
