"""Readers of the text formats of the RAWSEEDS datasets.

A scan a line, separated by commas. SICK: time, number of ranges, offset of the first beam in
quarters of a degree, ranges over 180 degrees in steps of one. Hokuyo: time, number of ranges,
ranges over 240 degrees. Odometry: time, counter, right and left ticks, x, y, theta.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from laser_gt.logs.records import (
    SICK_RANGE_MAX,
    Line,
    ScanRecord,
    checked,
    read_each,
    read_lines,
    without_far,
)
from laser_gt.scans.scan import Scan
from validation.errors import InputError, Problem
from validation.poses.angles import Array

HOKUYO_RANGE_MAX = 5.6
"""Largest range of a Hokuyo URG-04LX, in metres, by its data sheet."""
HOKUYO_FIELD = np.deg2rad(240.0)
"""Its field of view, by the same."""
RANGE_MIN = 0.01
"""Metres below which a range is none: the formats hold whole centimetres or less, and 0 for
nothing came back."""
ODOMETRY_NUMBERS = 7
"""Numbers of a line of odometry, by the format."""


def read_rawseeds_sick(path: Path, sensor: str = "front") -> list[ScanRecord]:
    """Scans of a SICK_*.csv; missing readings at the end (zero) are no returns."""
    return checked(path, *read_each(path, _lines(path), partial(_record, sensor, sick=True)))


def read_rawseeds_hokuyo(path: Path, sensor: str = "front") -> list[ScanRecord]:
    """Scans of a HOKUYO_*.csv."""
    return checked(path, *read_each(path, _lines(path), partial(_record, sensor, sick=False)))


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of each line that is no comment."""
    for number, text in enumerate(read_lines(path), 1):
        words = [word.strip() for word in text.split(",")]
        while words and not words[-1]:
            words.pop()
        if words and not words[0].startswith(("#", "%")):
            yield number, words


def _record(sensor: str, line: Line, words: Sequence[str], *, sick: bool) -> ScanRecord:
    """A scan of one line."""
    skip = 3 if sick else 2
    found = len(words) - skip
    if found < 1:
        raise line.bad(f"the line is cut short: {len(words)} numbers", "ranges")
    head = line.numbers(words[:skip], "head", finite=True)
    if head[1] < 1 or head[1] != np.round(head[1]):
        raise line.bad("not a count of readings", "head", words[1])
    count = int(head[1])
    if found < count:
        raise line.bad(f"the line is cut short: {found} ranges, {count} expected", "ranges")
    ranges = line.numbers(words[skip : skip + count], "ranges")
    if sick:
        angles = np.deg2rad(-90.0 + 0.25 * head[2] + np.arange(count))
        limit = SICK_RANGE_MAX
    else:
        angles = np.linspace(-HOKUYO_FIELD / 2, HOKUYO_FIELD / 2, count)
        limit = HOKUYO_RANGE_MAX
    scan = Scan(
        without_far(np.where(ranges == 0, np.inf, ranges), limit),
        angles,
        range_min=RANGE_MIN,
        range_max=limit,
        time=float(head[0]),
        sensor=sensor,
    )
    return ScanRecord(scan, line=line.number)


def read_rawseeds_odometry(path: Path) -> tuple[Array, Array]:
    """Times (n,) and poses (n, 3) of an ODOMETRY_XYT.csv.

    Raises
    ------
    InputError
        Naming every bad line.
    """
    rows, problems = read_each(path, _lines(path), _odometry)
    if not rows and not problems:
        problems = [Problem(path, "the file holds no odometry")]
    if problems:
        raise InputError(problems)
    table = np.array(rows)
    return table[:, 0], table[:, 1:]


def _odometry(line: Line, words: Sequence[str]) -> Array:
    """(4,) time and pose of one line."""
    values = line.numbers(words, "odometry", finite=True)
    if len(values) < ODOMETRY_NUMBERS:
        short = f"the line is cut short: {len(values)} of {ODOMETRY_NUMBERS} numbers"
        raise line.bad(short, "odometry")
    return values[[0, 4, 5, 6]]
