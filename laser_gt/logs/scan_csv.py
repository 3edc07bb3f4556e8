"""The campaign's own scan format: a CSV that a spreadsheet can show, a scan a row.

Columns: pose (the stop), sensor, time (seconds, may be blank), angle_min and angle_step
(radians), range_min, range_max (metres, optional), ranges (metres, separated by blanks; `inf`
for no return).
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from laser_gt.logs.records import ScanRecord, checked, make_scan, numbers
from laser_gt.scans.scan import Scan
from validation.errors import InputError, Problem
from validation.text_files.csv_tables import Column, read_csv

COLUMNS = (
    Column("pose"),
    Column("sensor", required=False, blank=True),
    Column("time", "number", required=False, blank=True, unit="s"),
    Column("angle_min", "number", low=-4 * np.pi, high=4 * np.pi, unit="rad"),
    Column("angle_step", "number", low=-np.pi, high=np.pi, unit="rad"),
    Column("range_min", "number", required=False, blank=True, low=0, high=1e3, unit="m"),
    Column("range_max", "number", required=False, blank=True, low=0, high=1e4, unit="m"),
    Column("ranges", blank=True),
)
RANGE_MIN, RANGE_MAX = 0.02, 80.0
MAX_BYTES = 200_000_000


def read_scan_csv(path: Path) -> list[ScanRecord]:
    """All scans of the file.

    Raises
    ------
    InputError
        Naming every bad place: no numbers, NaN, no ranges, fewer ranges than the other scans of
        the sensor, a stop and sensor that come twice.
    """
    table = read_csv(path, COLUMNS, max_bytes=MAX_BYTES)
    table.flag_duplicates(["pose", "sensor"])
    table.raise_problems()
    records: list[ScanRecord | Problem] = []
    for row, line in enumerate(table.lines):
        values = numbers(path, line, table.text["ranges"][row].split(), "ranges")
        if isinstance(values, Problem):
            records.append(values)
            continue
        step = table.numbers["angle_step"][row]
        angles = np.asarray(table.numbers["angle_min"][row] + step * np.arange(len(values)))
        if step < 0:
            values, angles = values[::-1], angles[::-1]
        scan = make_scan(
            path,
            line,
            values,
            angles,
            range_min=_or(table.numbers["range_min"][row], RANGE_MIN),
            range_max=_or(table.numbers["range_max"][row], RANGE_MAX),
            time=table.numbers["time"][row],
            sensor=table.text["sensor"][row] or "laser",
        )
        if isinstance(scan, Problem):
            records.append(scan)
        else:
            records.append(ScanRecord(scan, line=line, stop=table.text["pose"][row]))
    if not records:
        raise InputError([Problem(path, "the file has a header but no scan", 1)])
    return checked(path, _of_one_length(path, records))


def _of_one_length(
    path: Path, records: Sequence[ScanRecord | Problem]
) -> list[ScanRecord | Problem]:
    """The records, with a problem in place of each scan that has not all of its beams.

    A sensor with the same first angle and step has the same number of beams in every scan; where
    it has not, a line was cut.
    """
    kinds: dict[tuple[str, float, float], list[ScanRecord]] = {}
    for record in records:
        if isinstance(record, ScanRecord):
            first, step = record.scan.angles[0], record.scan.step
            kind = (record.scan.sensor, round(float(first), 9), round(float(step), 9))
            kinds.setdefault(kind, []).append(record)
    odd: dict[int, Problem] = {}
    for (sensor, *_), members in kinds.items():
        counts = Counter(len(one.scan) for one in members)
        usual = max(counts, key=lambda count: (counts[count], count))
        for one in members:
            if len(one.scan) != usual:
                what = (
                    f"{len(one.scan)} ranges, where other scans of '{sensor}' with these angles "
                    f"have {usual}; was the line cut?"
                )
                odd[one.line] = Problem(path, what, one.line, "ranges")
    return [
        odd.get(record.line, record) if isinstance(record, ScanRecord) else record
        for record in records
    ]


def _or(value: float, default: float) -> float:
    """The value, or the default where it is blank."""
    return value if np.isfinite(value) else default


def scan_csv(scans: Iterable[tuple[str, Scan]]) -> str:
    """The text of the file for stops and their scans; ranges to 0.1 mm."""
    lines = ["pose,sensor,time,angle_min,angle_step,range_min,range_max,ranges"]
    for stop, scan in scans:
        ranges = " ".join(f"{r:.4f}".rstrip("0").rstrip(".") for r in scan.ranges)
        time = repr(scan.time) if np.isfinite(scan.time) else ""
        step = (scan.angles[-1] - scan.angles[0]) / max(len(scan) - 1, 1)
        lines.append(
            f"{stop},{scan.sensor},{time},{float(scan.angles[0])!r},{float(step)!r},"
            f"{scan.range_min:g},{scan.range_max:g},{ranges}"
        )
    return "\n".join(lines) + "\n"
