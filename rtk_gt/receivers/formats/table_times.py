"""Times of a receiver's table: their unit, GPS weeks, times of day."""

import math
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, date, datetime
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rtk_gt.receivers.fix_checks import FASTEST
from rtk_gt.receivers.fixes import Bools
from rtk_gt.receivers.formats.dates import DAY, HALF_DAY
from rtk_gt.receivers.gps_time import WEEK as SECONDS_OF_WEEK
from rtk_gt.receivers.gps_time import of_week, utc_of_gps
from validation.errors import InputError, Problem
from validation.poses.angles import Array
from validation.text_files.csv_tables import Column, CsvTable
from validation.text_files.time_units import SCALES, time_heading

TIME = ("time", "timestamp", "stamp", "utc", "datetime", "date_time", "t", "unix_time", "epoch",
        "time_utc", "utc_time", "gnss_timestamp")  # fmt: skip
WEEK = ("gps_week", "week", "gpsweek", "gps_wn", "wn", "week_number", "gps_week_number")
TOW = ("tow", "gps_tow", "time_of_week", "gps_time_of_week", "seconds_of_week", "gps_seconds",
       "gps_second", "gps_sec", "week_seconds", "sow", "gps_sow", "itow")  # fmt: skip
"""Names of the columns, in small letters and without units."""
IN_MILLISECONDS = "itow"
"""u-blox counts it so."""
LEAST_WEEK, MOST_WEEK = 1024, 4000
"""Weeks below are counted modulo 1024 (to 1999), and nobody can tell which are meant; those above
are of 2056."""
OTHERS = {"min", "mins", "minute", "minutes", "m", "h", "hr", "hrs", "hour", "hours", "d", "day",
          "days"}  # fmt: skip
"""Units in which times are not read."""
LATEST = 4_102_444_800.0
"""Seconds from 1970 to 2100."""
EARLIEST = 315_964_800.0
"""Seconds from 1970 to the start of GPS: a count in another unit is far outside."""
NO_TIME = "not a time; expected seconds (not milliseconds) since 1970, or ISO 8601"
NAMES: Mapping[str, str] = {"ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}
_CLOCK = re.compile(r"(\d{1,2}):?(\d{2}):?(\d{2}(?:[.,]\d*)?)Z?")
_SIX = re.compile(r"\d{6}(?:\.\d*)?")
_FEWEST = 10
"""Rows that show a spacing."""
MOVED, SLOWEST = 10.0, 0.05
"""Metres after which a receiver has moved, and m/s that it then exceeds somewhere: milliseconds
read as seconds make 0.05 of 50 m/s, and no vehicle that is driven stays below."""
SHORTEST, LONGEST = 0.002, 30.0
"""Seconds from row to row outside of which they are none: receivers write at most 100 times a
second, and whoever writes less often than this records places, no drive."""
OF_DAY = (
    'a time of day{}, and no day with it: state `date = "YYYY-MM-DD"` at this receiver, add a '
    "column date, or write seconds since 1970"
)


class TimeColumns(NamedTuple):
    """The columns that hold a table's times, their headings, and the unit that these state."""

    columns: list[Column]
    renamed: dict[str, str]
    unit: str


def time_columns(path: Path, line: int, header: Sequence[str]) -> TimeColumns:
    """Which columns of a table hold its times: ``time``, or GPS week and time of week.

    Raises
    ------
    InputError
        Where a heading states a unit or a scale of time that is not read, or only one of week and
        time of week is there.
    """
    alike = {cell: time_heading(cell.lstrip("# ")) for cell in header}

    def found(names: Sequence[str]) -> str | None:
        exact = (cell for one in names for cell in header if cell == one)
        near = (cell for one in names for cell in header if alike[cell][0] == one)
        return next(chain(exact, near), None)

    time, week, tow = found(TIME), found(WEEK), found(TOW)
    if time is not None:
        _check_unit(path, line, time, alike[time][1])
        return TimeColumns([Column("time")], {time: "time"}, alike[time][1])
    if week is not None and tow is not None:
        name, unit = alike[tow]
        _check_unit(path, line, tow, unit)
        unit = unit or ("ms" if name == IN_MILLISECONDS else "s")
        columns = [
            Column("gps_week", "number", low=0, high=MOST_WEEK),
            Column("tow", "number", low=0, high=SECONDS_OF_WEEK * SCALES.get(unit, 1), unit=unit),
        ]
        return TimeColumns(columns, {week: "gps_week", tow: "tow"}, unit)
    alone = week or tow or next((cell for cell in header if alike[cell][0].startswith("gps")), None)
    if alone is not None and _is_of_time(alike[alone][0]):
        said = (
            "a time needs the GPS week and the time of week (gps_week,tow), or one column time in "
            "seconds since 1970 UTC; GPS time is 18 s ahead of UTC since 2017"
        )
        raise InputError([Problem(path, said, line, "time", alone)])
    return TimeColumns([Column("time")], {}, "")


def _is_of_time(name: str) -> bool:
    return name in {*WEEK, *TOW} or name.startswith(("gps_t", "gpst"))


def _check_unit(path: Path, line: int, heading: str, unit: str) -> None:
    """Raise for a heading whose unit or scale of time is not read."""
    if unit in OTHERS:
        said = f"times in {unit} are not read; state seconds since 1970, or ISO 8601"
    elif unit in {"gps", "gpst", "tai"}:
        said = "not UTC; write UTC (GPS time is 18 s ahead since 2017), or gps_week and tow"
    else:
        return
    raise InputError([Problem(path, said, line, "time", heading)])


def seconds_of(text: str) -> float:
    """Seconds since 1970 of a number or an ISO 8601 time (UTC without a zone); NaN if bad.

    Numbers beyond the year 2100 are no seconds: milliseconds, most likely.
    """
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        try:
            stamp = datetime.fromisoformat(text.replace("/", "-"))
        except ValueError:
            return math.nan
        value = (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()
    return value if abs(value) < LATEST else math.nan


def table_times(
    table: CsvTable, unit: str, day: date | None = None
) -> tuple[Array, list[str], bool]:
    """Times of a table's rows; what is wrong with them is recorded in it.

    Parameters
    ----------
    table : CsvTable
        With the columns of `time_columns`, and ``date``.
    unit : str
        That the heading states, '' where none.
    day : date, optional
        Of the first row, where the table has times of day only.

    Returns
    -------
    times : (n,) array
        Seconds since 1970 UTC.
    notes : list of str
        How they were read.
    sure : bool
        Whether their unit is told: by the heading, as a date, or by the size of all.
    """
    if "tow" in table.numbers:
        return _of_weeks(table, unit), ["Times are of GPS weeks; leap seconds are taken off."], True
    cells, dates = table.text["time"], table.text["date"]
    if any(dates) and any(":" in cell for cell in cells):
        both = zip(dates, cells, strict=True)
        cells = [f"{date}T{cell}" if date else cell for date, cell in both]
    elif (said := _clock_said(cells)) is not None:
        return _of_day(table, said, day), ["Times are read as times of day (hhmmss)."], True
    for scale in (one for one in NAMES if unit in {"", one}):
        if all(_counts(cell, SCALES[scale]) for cell in cells):
            return _whole(cells, scale), [f"Times are read as {NAMES[scale]} since 1970."], True
    times = np.array([seconds_of(cell) for cell in cells])
    if unit in NAMES and all(map(_is_number, cells)):
        return _whole(cells, unit), [f"Times are read as {NAMES[unit]}, as the heading says."], True
    for row in np.flatnonzero(np.isnan(times)):
        table.flag(int(row), "time", NO_TIME)
    return times, [], bool(unit) or not all(map(_is_number, cells))


def _whole(cells: Sequence[str], unit: str) -> Array:
    """Seconds of counts: whole numbers, as doubles of nanoseconds would lose their last digits."""
    scale = SCALES[unit]
    numbers = [int(cell) if cell.isdecimal() else float(cell.replace(",", ".")) for cell in cells]
    return np.array([one / scale for one in numbers])


def _counts(cell: str, scale: int) -> bool:
    """Whether a cell is a count of a fraction of a second since 1970."""
    try:
        return EARLIEST * scale < float(cell) < LATEST * scale
    except ValueError:
        return False


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell.replace(",", ".")))
    except ValueError:
        return False


def _of_weeks(table: CsvTable, unit: str) -> Array:
    """Seconds since 1970 UTC of GPS weeks and times of week."""
    weeks = np.array(table.numbers["gps_week"])
    for row in np.flatnonzero(weeks < LEAST_WEEK)[:1]:
        said = "counted modulo 1024; write the whole number of weeks since 1980 (2048 more in 2024)"
        table.flag(int(row), "gps_week", said)
    return utc_of_gps(of_week(weeks, np.array(table.numbers["tow"]) / SCALES[unit]))


def _clock_said(cells: Sequence[str]) -> str | None:
    """What shows that a column holds times of day; None where it holds none.

    As numbers, hhmmss never has 60 to 99 as its last two digits before the point, and leaps by 40
    where a minute begins; seconds reach these digits in all of 100 s.
    """
    if not cells or _CLOCK.fullmatch(cells[0]) is None:
        return None
    parts = [one for one in map(_CLOCK.fullmatch, cells) if one is not None]
    hours, minutes, seconds = (
        np.array([float(one[k].replace(",", ".")) for one in parts]) for k in (1, 2, 3)
    )
    none = (hours > 23) | (minutes > 59) | (seconds >= 61)
    if len(parts) < len(cells) or none.any():
        return None
    if all(":" in cell for cell in cells):
        return ""
    if all(map(_SIX.fullmatch, cells)) and any(cell.startswith("0") for cell in cells):
        return " (hhmmss)"
    return _minute_said(cells, minutes, 3600 * hours + 60 * minutes + seconds)


def _minute_said(cells: Sequence[str], minutes: Array, clock: Array) -> str | None:
    """Where a minute begins in rows that are evenly spaced as times of day; None where nowhere."""
    steps = np.diff(clock)
    usual = float(np.median(steps)) if len(steps) >= _FEWEST else 0.0
    begins = np.flatnonzero((np.diff(minutes) != 0) & (steps > 0) & (steps < 1.5 * usual))
    if not 0 < usual < 10 or not len(begins):
        return None
    row = int(begins[0])
    return f" (hhmmss: behind {cells[row]} stands {cells[row + 1]})"


def _of_day(table: CsvTable, said: str, day: date | None) -> Array:
    """Seconds since 1970 of times of day, with the days of their rows or that of the first."""
    cells, dates = table.text["time"], table.text["date"]
    found = [_CLOCK.fullmatch(cell) for cell in cells]
    clock = np.array(
        [3600 * int(one[1]) + 60 * int(one[2]) + float(one[3].replace(",", "."))
         for one in found if one is not None]
    )  # fmt: skip
    if all(dates):
        days = np.array([seconds_of(one) if "-" in one or "/" in one else math.nan
                         for one in dates])  # fmt: skip
        for row in np.flatnonzero(np.isnan(days)):
            table.flag(int(row), "date", "not a date; expected YYYY-MM-DD")
        return np.asarray(days + clock)
    if day is None:
        table.flag(0, "time", OF_DAY.format(said))
        return clock
    start = datetime(day.year, day.month, day.day, tzinfo=UTC).timestamp()
    midnights = np.cumsum(np.diff(clock, prepend=clock[0]) < -HALF_DAY)
    return np.asarray(start + DAY * midnights + clock)


def check_pace(
    table: CsvTable, times: Array, metres: Array, fixed: Bools, *, stated: bool = False
) -> None:
    """Record a problem where times are in a unit in which nothing is driven.

    Parameters
    ----------
    table : CsvTable
        For the line and the cell of the first row.
    times : (n,) array
        Read as seconds; NaN where bad.
    metres : (n, 3) array
        Places in any frame.
    fixed : (n,) bool array
        Rows to judge by: places of other kinds leap by metres.
    stated : bool
        Whether the heading says the unit.
    """
    rows = np.flatnonzero(fixed & np.isfinite(times) & np.isfinite(metres).all(1))
    seconds = np.diff(times[rows])
    lengths = np.linalg.norm(np.diff(metres[rows], axis=0), axis=1)[seconds > 0]
    seconds = seconds[seconds > 0]
    if len(seconds) < _FEWEST:
        return
    usual, speeds = float(np.median(seconds)), lengths / seconds
    way = float(np.linalg.norm(np.ptp(metres[rows], axis=0)))
    said = f"read {'so' if stated else 'as seconds'} there is a row every {usual:.4g} s, and "
    if way > MOVED and speeds.max() < SLOWEST:
        fitting = [
            f"{NAMES[one]} ({SCALES[one] / usual:.3g} rows a second: call the column time_{one})"
            for one in NAMES
            if SHORTEST <= usual / SCALES[one] < LONGEST and not stated
        ]
        said += (
            f"the receiver moves {way:.0f} m without ever being faster than "
            f"{speeds.max():.2g} m/s: the unit is another one"
        )
        said += f", {' or '.join(fitting)}" if fitting else ""
    elif usual < SHORTEST or np.median(speeds) > FASTEST:
        said += (
            f"the receiver moves at {np.median(speeds):.3g} m/s: the unit is another one"
            f"{'' if stated else ', such as minutes'}"
        )
    else:
        return
    name = "tow" if "tow" in table.raw else "time"
    table.flag(int(rows[0]), name, f"{said}; state seconds since 1970, or ISO 8601")
