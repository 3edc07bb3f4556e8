"""Reader of the logs of the Canonical Scan Matcher: one JSON object a scan, one after the other.

Fields: nrays, min_theta, max_theta, theta, readings, valid, odometry, timestamp ([seconds,
microseconds]). What is not known is null.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from laser_gt.logs.records import Line, ScanRecord, checked, read_each, read_lines
from laser_gt.scans.scan import Scan
from validation.errors import InputError, Problem
from validation.poses.angles import Array

MICROSECOND = 1e-6


def read_csm(path: Path) -> list[ScanRecord]:
    """All scans of a log of the Canonical Scan Matcher.

    Readings that are null, or of rays that are not valid, are no returns.

    Raises
    ------
    InputError
        Naming every scan that cannot be read by the line on which it begins.
    """
    text = "\n".join(read_lines(path))
    return checked(path, *read_each(path, _objects(path, text), _record))


def _objects(path: Path, text: str) -> Iterator[tuple[int, Any]]:
    """Line and value of each object."""
    decoder = json.JSONDecoder()
    place, line = 0, 1
    while True:
        start = len(text) - len(text[place:].lstrip()) if place < len(text) else len(text)
        line += text.count("\n", place, start)
        if start >= len(text):
            return
        try:
            found, end = decoder.raw_decode(text, start)
        except (ValueError, RecursionError) as error:
            raise InputError([Problem(path, f"not JSON: {error}", line)]) from None
        yield line, found
        line += text.count("\n", start, end)
        place = end


def _record(line: Line, found: Any) -> ScanRecord:
    """The scan of an object."""
    if not isinstance(found, Mapping):
        raise line.bad("expected an object, { ... }, for each scan", "scan", str(found)[:40])
    readings = _numbers(line, found, "readings")
    if readings is None:
        raise line.bad("a scan has no readings", "readings")
    count = len(readings)
    angles = _angles(line, found, count)
    valid = _numbers(line, found, "valid")
    back = np.isfinite(readings) & (readings > 0)
    if valid is not None:
        if len(valid) != count:
            raise line.bad(f"{len(valid)} values for {count} readings", "valid")
        back &= valid > 0
    ranges = np.where(back, readings, np.inf)
    if count > 1 and angles[1] < angles[0]:
        ranges, angles = ranges[::-1], angles[::-1]
    stamp, pose = _numbers(line, found, "timestamp"), _numbers(line, found, "odometry")
    time = np.nan
    if stamp is not None:
        if len(stamp) != 2 or not np.isfinite(stamp).all():
            raise line.bad("expected [seconds, microseconds]", "timestamp", str(stamp))
        time = float(stamp[0] + MICROSECOND * stamp[1])
    if pose is not None and not (len(pose) == 3 and np.isfinite(pose).all()):
        pose = None
    return ScanRecord(Scan(ranges, angles, time=time), odometry=pose, line=line.number)


def _angles(line: Line, found: Mapping[str, Any], count: int) -> Array:
    """(n,) directions of the rays: stated one by one, or evenly from the first to the last."""
    stated = _numbers(line, found, "theta")
    if stated is not None and len(stated) == count and np.isfinite(stated).all():
        return stated
    ends = []
    for name in ("min_theta", "max_theta"):
        value = found.get(name)
        if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) > 10:
            raise line.bad("the directions of the rays are not stated", name, str(value))
        ends.append(float(value))
    return np.linspace(ends[0], ends[1], count)


def _numbers(line: Line, found: Mapping[str, Any], name: str) -> Array | None:
    """(n,) numbers of a field, NaN for null; None where it is not there."""
    values = found.get(name)
    if values is None:
        return None
    if not isinstance(values, list):
        raise line.bad("expected a list of numbers", name, str(values)[:40])
    for value in values:
        if isinstance(value, bool) or not isinstance(value, int | float | None):
            raise line.bad("not a number", name, str(value)[:40])
    try:
        return np.array([np.nan if value is None else float(value) for value in values])
    except OverflowError:
        raise line.bad("a number is too large", name) from None
