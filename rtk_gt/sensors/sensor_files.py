"""CSV files of what hangs on the vehicle: line scans, IMU angles, points seen in images."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rtk_gt.receivers.formats.table_times import NO_TIME, seconds_of
from rtk_gt.sensors.scans import LineScans
from validation.errors import InputError, Problem
from validation.poses.angles import Array
from validation.text_files.csv_tables import Column, CsvTable, read_csv
from validation.text_files.reading import file_bytes

MAX_BYTES = 1_000_000_000
TIME = Column("time", unit="s")
"""Seconds since 1970, or ISO 8601; a heading that states another unit is refused."""


def _rows(path: Path, columns: Sequence[Column], what: str = "rows") -> CsvTable:
    """The table of a file that has to have rows; cells that are wrong are recorded in it."""
    table = read_csv(path, columns, max_bytes=MAX_BYTES)
    if len(table) == 0:
        table.raise_problems()
        raise InputError([Problem(path, f"no {what} below the header")])
    return table


def _times(table: CsvTable) -> Array:
    """(n,) seconds since 1970 of the column ``time``; bad ones are recorded as problems."""
    times = np.array([seconds_of(text) for text in table.text["time"]])
    for row in np.flatnonzero(np.isnan(times)):
        table.flag(int(row), "time", NO_TIME)
    return times


def _increasing(table: CsvTable, times: Array) -> None:
    for row in np.flatnonzero(np.diff(times) <= 0):
        table.flag(int(row) + 1, "time", "not later than the row before")


def read_times(path: Path) -> Array:
    """(m,) seconds since 1970 of the column ``time`` of a CSV file; see `seconds_of`.

    Raises
    ------
    InputError
        Naming every cell that is no time, and times given twice.
    """
    table = _rows(path, [TIME], "times")
    times = _times(table)
    table.flag_duplicates(["time"])
    table.raise_problems()
    return times


def read_line_scans(path: Path) -> LineScans:
    """Scans of a CSV file: ``time,first_angle,angle_step,ranges``.

    Angles in radians from the scanner's x towards its y axis, the same in all rows; ranges in
    metres, separated by blanks, ``nan`` or 0 where nothing was hit.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.
    """
    columns = [
        TIME,
        Column("first_angle", "number", low=-7, high=7, unit="rad"),
        Column("angle_step", "number", low=-1, high=1, unit="rad"),
        Column("ranges"),
    ]
    table = _rows(path, columns)
    times = _times(table)
    _increasing(table, times)
    rows: list[list[float]] = []
    for row, text in enumerate(table.text["ranges"]):
        try:
            rows.append([float(cell) for cell in text.split()])
        except ValueError:
            table.flag(row, "ranges", "not numbers separated by blanks")
            continue
        if any(r < 0 for r in rows[-1]):
            table.flag(row, "ranges", "a negative range; expected metres, 0 or nan for no hit")
        if len(rows[-1]) != len(rows[0]):
            table.flag(row, "ranges", f"{len(rows[-1])} ranges; the first scan has {len(rows[0])}")
    for name in ("first_angle", "angle_step") if table.numbers["first_angle"] else ():
        for other in np.flatnonzero(np.array(table.numbers[name]) != table.numbers[name][0]):
            table.flag(int(other), name, "differs from the first scan; one file, one scan plane")
    table.raise_problems()
    ranges = np.array(rows, dtype=float)
    first, step = table.numbers["first_angle"][0], table.numbers["angle_step"][0]
    angles: Array = np.asarray(first + step * np.arange(ranges.shape[1]), dtype=float)
    ranges[~(ranges > 0)] = np.nan
    return LineScans(times, angles, ranges)


def read_imu(path: Path) -> tuple[Array, Array]:
    """Times (m,) and yaw, pitch, roll (m, 3) in radians of ``time,yaw,pitch,roll``.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.
    """
    names = ("yaw", "pitch", "roll")
    # Ten turns and more are degrees, or a yaw that nobody would call one.
    limits = (60.0, 2.0, 4.0)
    angles = [
        Column(name, "number", low=-limit, high=limit, unit="radians (not degrees)")
        for name, limit in zip(names, limits, strict=True)
    ]
    table = _rows(path, [TIME, *angles])
    times = _times(table)
    _increasing(table, times)
    table.raise_problems()
    return times, np.column_stack([table.numbers[name] for name in names])


RATES = ("wz", "rate_z", "gyro_z", "angular_velocity_z", "angular_velocity.z", "yaw_rate")
"""Names of the column of rates about the upward axis, radians a second."""


def read_turns(path: Path) -> tuple[Array, Array, bool] | None:
    """Times (m,), yaws or rates about the upward axis (m,), and whether they are rates.

    None where the file is no table with a time and one of these, or has positions, too.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.
    """
    head = file_bytes(path, MAX_BYTES, text=True)[:2000].decode("utf-8-sig", errors="replace")
    first = next((line for line in head.splitlines() if line.strip("# ")), "")
    names = [name.strip().lower() for name in re.split("[,;\t]", first.lstrip("# "))]
    rate = next((name for name in RATES if name in names), None)
    if "time" not in names or "x" in names or (rate is None and "yaw" not in names):
        return None
    if rate is None:
        column = Column("yaw", "number", low=-1e5, high=1e5, unit="radians")
    else:
        column = Column(rate, "number", low=-40, high=40, unit="radians a second (not degrees)")
    table = _rows(path, [TIME, column])
    times = _times(table)
    _increasing(table, times)
    table.raise_problems()
    return times, np.array(table.numbers[column.name]), rate is not None


def read_images(path: Path) -> tuple[Array, list[Path]]:
    """Times (m,) and paths of the images listed in ``time,file``; files relative to the list.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place, and images that are missing.
    """
    table = _rows(path, [TIME, Column("file")])
    times = _times(table)
    files = [path.parent / name for name in table.text["file"]]
    for row, file in enumerate(files):
        if not file.is_file():
            table.flag(row, "file", "there is no such file")
    table.raise_problems()
    return times, files


@dataclass(frozen=True)
class SeenPoints:
    """Points known in the local frame and seen in images.

    ``times`` (n,) of the images, ``points`` (n, 3) in metres, ``pixels`` (n, 2).
    """

    times: Array
    points: Array
    pixels: Array


def read_seen_points(path: Path) -> SeenPoints:
    """Points of a CSV file: ``time,x,y,z,u,v``, metres in the local frame and pixels.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.
    """
    columns = [Column(name, "number", low=-1e6, high=1e6, unit="m") for name in "xyz"]
    columns += [Column(name, "number", low=-1e5, high=1e5, unit="pixels") for name in "uv"]
    table = _rows(path, [TIME, *columns])
    times = _times(table)
    table.raise_problems()
    numbers = {name: np.array(table.numbers[name]) for name in "xyzuv"}
    return SeenPoints(
        times,
        np.column_stack([numbers[name] for name in "xyz"]),
        np.column_stack([numbers[name] for name in "uv"]),
    )
