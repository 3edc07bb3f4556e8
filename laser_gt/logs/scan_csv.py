"""The campaign's own scan format: a CSV that a spreadsheet can show, a scan a row.

Columns: pose (the stop), sensor, time (seconds, may be blank), angle_min and angle_step
(radians), range_min, range_max (metres, optional), ranges (metres, separated by blanks; `inf`
for no return).
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from laser_gt.logs.records import Line, ScanRecord, checked, read_each
from laser_gt.scans.scan import Scan
from validation.errors import InputError, Problem
from validation.text_files.csv_tables import Column, CsvTable, read_csv

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
DRIVE = {
    "pose": Column("pose", required=False, blank=True),
    "time": Column("time", "number", unit="s"),
}
"""Columns that the scans of a drive have instead: no stop, but a time."""
MAX_BYTES = 200_000_000
"""Bytes of the largest file that is read. A judgement: some 50,000 scans of 500 ranges, far more
than a robot makes stops."""


def read_scan_csv(path: Path, *, stops: bool = True) -> list[ScanRecord]:
    """All scans of the file.

    Parameters
    ----------
    path : Path
        The file.
    stops : bool
        Whether each scan is that of a stop; else of a drive, and told by its time.

    Raises
    ------
    InputError
        Naming every bad place: no numbers, NaN, no ranges, fewer ranges than the other scans of
        the sensor, a stop and sensor that come twice.
    """
    columns = COLUMNS if stops else [DRIVE.get(one.name, one) for one in COLUMNS]
    table = read_csv(path, columns, max_bytes=MAX_BYTES)
    if stops:
        table.flag_duplicates(["pose", "sensor"])
    table.raise_problems()
    records, problems = read_each(path, zip(table.lines, _rows(table), strict=True), _record)
    if not records and not problems:
        raise InputError([Problem(path, "the file has a header but no scan", 1)])
    return checked(path, records, [*problems, *_cut(path, records)])


def _rows(table: CsvTable) -> Iterator[dict[str, Any]]:
    """The cells of each row by the names of their columns."""
    columns: dict[str, Sequence[Any]] = {**table.text, **table.numbers}
    for row in range(len(table)):
        yield {name: cells[row] for name, cells in columns.items()}


def _record(line: Line, row: Mapping[str, Any]) -> ScanRecord:
    """The scan of a row."""
    values = line.numbers(row["ranges"].split(), "ranges")
    step = row["angle_step"]
    angles = np.asarray(row["angle_min"] + step * np.arange(len(values)))
    if step < 0:
        values, angles = values[::-1], angles[::-1]
    scan = Scan(
        values,
        angles,
        range_min=_or(row["range_min"], Scan.range_min),
        range_max=_or(row["range_max"], Scan.range_max),
        time=row["time"],
        sensor=row["sensor"] or "laser",
    )
    return ScanRecord(scan, line=line.number, stop=row["pose"])


def _cut(path: Path, records: Sequence[ScanRecord]) -> Iterator[Problem]:
    """A problem for each scan that has not all of its beams.

    A sensor with the same first angle and step has the same number of beams in every scan; where
    it has not, a line was cut.
    """
    kinds: dict[tuple[str, float, float], list[ScanRecord]] = {}
    for record in records:
        first, step = record.scan.angles[0], record.scan.step
        kind = (record.scan.sensor, round(float(first), 9), round(float(step), 9))
        kinds.setdefault(kind, []).append(record)
    for (sensor, *_), members in kinds.items():
        counts = Counter(len(one.scan) for one in members)
        usual = max(counts, key=lambda count: (counts[count], count))
        for one in members:
            if len(one.scan) != usual:
                what = (
                    f"{len(one.scan)} ranges, where other scans of '{sensor}' with these angles "
                    f"have {usual}; was the line cut?"
                )
                yield Problem(path, what, one.line, "ranges")


def _or(value: float, default: float) -> float:
    """The value, or the default where it is blank."""
    return value if np.isfinite(value) else default


def scan_csv(scans: Iterable[tuple[str, Scan]]) -> str:
    """The text of the file for stops and their scans; ranges to 0.1 mm."""
    lines = ["pose,sensor,time,angle_min,angle_step,range_min,range_max,ranges"]
    for stop, scan in scans:
        ranges = " ".join(f"{r:.4f}".rstrip("0").rstrip(".") for r in scan.ranges)
        time = repr(float(scan.time)) if np.isfinite(scan.time) else ""
        step = (scan.angles[-1] - scan.angles[0]) / max(len(scan) - 1, 1)
        lines.append(
            f"{stop},{scan.sensor},{time},{float(scan.angles[0])!r},{float(step)!r},"
            f"{scan.range_min:g},{scan.range_max:g},{ranges}"
        )
    return "\n".join(lines) + "\n"
