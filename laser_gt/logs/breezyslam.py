"""Reader of the logs that BreezySLAM comes with: a Hokuyo URG-04LX on a robot with two wheels.

A scan a line, separated by blanks: time in microseconds, a number, ticks of the left and the right
wheel, twenty more numbers, and 682 ranges in millimetres over 240 degrees.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from laser_gt.logs.motion import moved
from laser_gt.logs.rawseeds import HOKUYO_FIELD, HOKUYO_RANGE_MAX
from laser_gt.logs.records import Line, ScanRecord, checked, read_each, read_lines
from laser_gt.scans.planar import compose
from laser_gt.scans.scan import Scan
from validation.poses.angles import Array

HEAD = 24
"""Numbers before the ranges."""
BEAMS = 682
"""Ranges of a scan."""
HIDDEN = 70
"""Beams at either end that meet the robot itself, by the log's own reader."""
RANGE_MIN = 0.02
"""Metres; smaller numbers are codes of errors, by the scanner's data sheet."""
WHEEL, AXLE, TICKS = 0.077, 0.165, 2000.0
"""Radius of a wheel and half of the axle in metres, ticks of half a turn's encoder cycle: by the
log's own reader, where a tick turns a wheel by pi / 2000 of the mean of both."""


def read_breezyslam(path: Path) -> list[ScanRecord]:
    """All scans of a log, with odometry from the ticks of the wheels.

    Raises
    ------
    InputError
        Naming every line that is cut short or holds what is no number.
    """
    lines = ((number, text.split()) for number, text in enumerate(read_lines(path), 1))
    parts = ((number, words) for number, words in lines if words)
    found, problems = read_each(path, parts, _record)
    poses = _odometry(np.array([ticks for _, ticks in found]).reshape(-1, 2))
    records = [
        ScanRecord(scan.scan, odometry=pose, line=scan.line)
        for (scan, _), pose in zip(found, poses, strict=True)
    ]
    return checked(path, records, problems)


def _record(line: Line, words: Sequence[str]) -> tuple[ScanRecord, Array]:
    """The scan of a line, and the ticks of both wheels."""
    if len(words) < HEAD + BEAMS:
        text = f"the line is cut short: {len(words)} numbers, {HEAD + BEAMS} expected"
        raise line.bad(text, "ranges")
    head = line.numbers(words[:4], "time and ticks", finite=True)
    ranges = line.numbers(words[HEAD : HEAD + BEAMS], "ranges", finite=True) / 1000
    ranges = np.where((ranges < RANGE_MIN) | (ranges >= HOKUYO_RANGE_MAX), np.inf, ranges)
    ranges[:HIDDEN] = ranges[-HIDDEN:] = np.inf
    angles = np.linspace(-HOKUYO_FIELD / 2, HOKUYO_FIELD / 2, BEAMS)
    scan = Scan(ranges, angles, RANGE_MIN, HOKUYO_RANGE_MAX, time=float(head[0]) * 1e-6)
    return ScanRecord(scan, line=line.number), head[2:4]


def _odometry(ticks: Array) -> Array:
    """(n, 3) poses from the ticks of the left and the right wheel, (n, 2)."""
    turned = np.diff(ticks, axis=0) * (np.pi / TICKS)
    ahead = WHEEL * turned.sum(1)
    turn = WHEEL / AXLE * (turned[:, 1] - turned[:, 0])
    poses = [np.zeros(3)] if len(ticks) else []
    for way, angle in zip(ahead, turn, strict=True):
        poses.append(compose(poses[-1], moved(np.array([way, 0.0, angle]), np.ones(1))[0]))
    return np.array(poses).reshape(-1, 3)
