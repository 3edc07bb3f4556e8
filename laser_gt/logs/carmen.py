"""Reader of CARMEN logs: FLASER, RLASER, ROBOTLASER1 and ROBOTLASER2.

Old messages (FLASER, RLASER) state neither field of view nor limits: 180 degrees, symmetric, as
the SICK scanners of that time had them, and 81.9 m for no return. The others state them all.
"""

from collections.abc import Sequence
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
from validation.poses.angles import Array

RANGE_SIGMA = 0.01
"""Of the SICK scanners that CARMEN logs come from, in metres: ranges in whole centimetres."""
SENSORS = {"FLASER": "front", "RLASER": "rear", "ROBOTLASER1": "front", "ROBOTLASER2": "rear"}
HEAD = 9
"""Words of a ROBOTLASER line before the ranges, the message's name included."""


def read_carmen(path: Path) -> list[ScanRecord]:
    """All scans of a CARMEN log.

    Messages that are no scans are skipped, and so are RAWLASER ones: the log holds the same
    ranges again, with the robot's pose.

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
    lines = ((number, text.split()) for number, text in enumerate(read_lines(path), 1))
    scans = ((number, words) for number, words in lines if words and words[0] in SENSORS)
    return checked(path, *read_each(path, scans, _record))


def _record(line: Line, words: Sequence[str]) -> ScanRecord:
    """The scan of a line."""
    return (_robot_laser if words[0].startswith("ROBOT") else _old)(line, words)


def _refuse_short(line: Line, words: Sequence[str], wanted: int) -> None:
    """Raise for a line that ends too early."""
    if len(words) < wanted:
        text = f"the line is cut short: {len(words)} words, at least {wanted} expected"
        raise line.bad(text, words[0])


def _count(line: Line, words: Sequence[str], place: int) -> int:
    """A count among the words of a line."""
    _refuse_short(line, words, place + 1)
    if not words[place].isdigit():
        raise line.bad("not a count of readings", words[0], words[place])
    return int(words[place])


def _old(line: Line, words: Sequence[str]) -> ScanRecord:
    """FLASER or RLASER: n, n ranges, pose x y theta, odometry x y theta, time, host, time."""
    count = _count(line, words, 1)
    _refuse_short(line, words, 2 + count + 9)
    ranges = line.numbers(words[2 : 2 + count], "ranges")
    tail = line.numbers(words[2 + count : 9 + count], "poses and time", finite=True)
    # of 180 readings of one degree, the last beam of the half turn is missing
    angles = np.linspace(-np.pi / 2, np.pi / 2, count, endpoint=count != 180)
    return _scan(line, words[0], ranges, angles, SICK_RANGE_MAX, tail)


def _robot_laser(line: Line, words: Sequence[str]) -> ScanRecord:
    """ROBOTLASER: type, start, field of view, step, maximum range, accuracy, remission mode.

    Then n and n ranges, m and m remissions, laser pose, robot pose, five of the vehicle, time,
    host, logger time.
    """
    count = _count(line, words, HEAD - 1)
    poses = HEAD + count + 1 + _count(line, words, HEAD + count)
    _refuse_short(line, words, poses + 14)
    head = line.numbers(words[1 : HEAD - 1], "head", finite=True)
    ranges = line.numbers(words[HEAD : HEAD + count], "ranges")
    tail = line.numbers(words[poses : poses + 12], "poses and time", finite=True)
    angles = head[1] + head[3] * np.arange(count)
    return _scan(line, words[0], ranges, angles, float(head[4]), tail)


def _scan(
    line: Line, message: str, ranges: Array, angles: Array, range_max: float, tail: Array
) -> ScanRecord:
    """The record of a scan; the tail is the laser's pose, the robot's pose, ..., the time."""
    scan = Scan(
        without_far(ranges, range_max),
        angles,
        range_min=0.0,
        range_max=range_max,
        time=float(tail[-1]),
        sensor=SENSORS[message],
        sigma=RANGE_SIGMA,
    )
    return ScanRecord(scan, tail[3:6], tail[:3], line.number)
