"""Reader of CARMEN logs: FLASER, RLASER and ROBOTLASER1.

Old messages (FLASER, RLASER) state neither field of view nor limits: 180 degrees, symmetric, as
the SICK scanners of that time had them, and 81.9 m for no return. ROBOTLASER1 states them all.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from laser_gt.logs.records import (
    ScanRecord,
    checked,
    make_scan,
    numbers,
    read_lines,
    without_far,
)
from validation.errors import Problem

OLD_RANGE_MAX = 81.0
RANGE_SIGMA = 0.01
"""Of the SICK scanners that CARMEN logs come from, in metres: ranges in whole centimetres."""
OLD_MESSAGES = {"FLASER": "front", "RLASER": "rear"}
HEAD = 9
"""Words of a ROBOTLASER1 line before the ranges, the message's name included."""


def read_carmen(path: Path) -> list[ScanRecord]:
    """All scans of a CARMEN log; other messages are skipped.

    Parameters
    ----------
    path : Path
        The log, gzip-compressed or not.

    Raises
    ------
    InputError
        Naming every line that is cut short or holds what is no number, and every sensor with
        the same time stamp twice.
    """
    records: list[ScanRecord | Problem] = []
    for line, text in enumerate(read_lines(path), 1):
        words = text.split()
        if not words:
            continue
        if words[0] in OLD_MESSAGES:
            records.append(_old(path, line, words))
        elif words[0] == "ROBOTLASER1":
            records.append(_robot_laser(path, line, words))
    return checked(path, records)


def _cut(path: Path, line: int, words: Sequence[str], wanted: int) -> Problem:
    """The problem of a line that ends too early."""
    text = f"the line is cut short: {len(words)} words, at least {wanted} expected"
    return Problem(path, text, line, words[0])


def _count(path: Path, line: int, words: Sequence[str], place: int) -> int | Problem:
    """A count among the words of a line."""
    if len(words) <= place:
        return _cut(path, line, words, place + 1)
    if not words[place].isdigit():
        return Problem(path, "not a count of readings", line, words[0], words[place])
    return int(words[place])


def _old(path: Path, line: int, words: Sequence[str]) -> ScanRecord | Problem:
    """FLASER or RLASER: n, n ranges, pose x y theta, odometry x y theta, time, host, time."""
    count = _count(path, line, words, 1)
    if isinstance(count, Problem):
        return count
    wanted = 2 + count + 9
    if len(words) < wanted:
        return _cut(path, line, words, wanted)
    ranges = numbers(path, line, words[2 : 2 + count], "ranges")
    if isinstance(ranges, Problem):
        return ranges
    tail = numbers(path, line, words[2 + count : 9 + count], "poses and time", finite=True)
    if isinstance(tail, Problem):
        return tail
    angles = np.linspace(-np.pi / 2, np.pi / 2, count) if count != 180 else _half_open(count)
    scan = make_scan(
        path,
        line,
        without_far(ranges, OLD_RANGE_MAX),
        angles,
        range_min=0.0,
        range_max=OLD_RANGE_MAX,
        time=float(tail[6]),
        sensor=OLD_MESSAGES[words[0]],
        sigma=RANGE_SIGMA,
    )
    if isinstance(scan, Problem):
        return scan
    return ScanRecord(scan, tail[3:6], tail[:3], line)


def _half_open(count: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Angles of 180 readings of one degree: the last beam of the half turn is missing."""
    return np.linspace(-np.pi / 2, np.pi / 2, count, endpoint=False)


def _robot_laser(path: Path, line: int, words: Sequence[str]) -> ScanRecord | Problem:
    """ROBOTLASER1: type, start, field of view, step, maximum range, accuracy, remission mode.

    Then n and n ranges, m and m remissions, laser pose, robot pose, five of the vehicle, time,
    host, logger time.
    """
    count = _count(path, line, words, HEAD - 1)
    if isinstance(count, Problem):
        return count
    remissions = _count(path, line, words, HEAD + count)
    if isinstance(remissions, Problem):
        return remissions
    poses = HEAD + count + 1 + remissions
    if len(words) < poses + 14:
        return _cut(path, line, words, poses + 14)
    head = numbers(path, line, words[1 : HEAD - 1], "head", finite=True)
    ranges = numbers(path, line, words[HEAD : HEAD + count], "ranges")
    tail = numbers(path, line, words[poses : poses + 12], "poses and time", finite=True)
    for part in (head, ranges, tail):
        if isinstance(part, Problem):
            return part
    assert not isinstance(head, Problem)
    assert not isinstance(ranges, Problem)
    assert not isinstance(tail, Problem)
    angles = head[1] + head[3] * np.arange(count)
    scan = make_scan(
        path,
        line,
        without_far(ranges, head[4]),
        angles,
        range_min=0.0,
        range_max=float(head[4]),
        time=float(tail[11]),
        sensor="front",
        sigma=RANGE_SIGMA,
    )
    if isinstance(scan, Problem):
        return scan
    return ScanRecord(scan, tail[3:6], tail[0:3], line)
