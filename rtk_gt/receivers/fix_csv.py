"""Fixes in a CSV file: one row a fix, degrees and metres."""

import math
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from rtk_gt.receivers.fixes import FIX_NAMES, RTK_FIXED, Fixes
from validation.text_files.csv_tables import Column, CsvTable, read_csv

COLUMNS = (
    Column("time"),
    Column("latitude", "number", low=-90, high=90, unit="degrees"),
    Column("longitude", "number", low=-180, high=360, unit="degrees"),
    Column("height", "number", low=-1000, high=20000, unit="m"),
    Column("fix", required=False, blank=True),
    Column("satellites", "number", required=False, blank=True, low=0, high=200),
    Column("hdop", "number", required=False, blank=True, low=0, high=1000),
    *(
        Column(f"sigma_{axis}", "number", required=False, blank=True, low=1e-6, high=1e5, unit="m")
        for axis in ("east", "north", "up")
    ),
)
MAX_BYTES = 500_000_000
LATEST = 4_102_444_800.0
"""Seconds from 1970 to 2100."""
NO_TIME = "not a time; expected seconds (not milliseconds) since 1970, or ISO 8601"
_KINDS = {
    **{name: kind for kind, name in FIX_NAMES.items()},
    **{str(kind): kind for kind in FIX_NAMES},
    "fixed": 4,
    "float": 5,
}


def read_fix_csv(path: Path, receiver: str) -> Fixes:
    """The fixes of a CSV file.

    Columns ``time`` (seconds since 1970 UTC, or ISO 8601 taken as UTC), ``latitude``,
    ``longitude`` in degrees, ``height`` above the ellipsoid; optional ``fix`` (fixed, float,
    DGPS, ... or the number of GGA; fixed where blank), ``satellites``, ``hdop``,
    ``sigma_east``, ``sigma_north``, ``sigma_up``.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.
    """
    table = read_csv(path, COLUMNS, max_bytes=MAX_BYTES)
    times = [_time(table, row) for row in range(len(table))]
    kinds = [_kind(table, row) for row in range(len(table))]
    table.raise_problems()
    n = len(table)
    covariances = np.full((n, 3, 3), np.nan)
    sigmas = np.column_stack(
        [np.array(table.numbers[f"sigma_{axis}"]) for axis in ("east", "north", "up")]
    )
    stated = np.isfinite(sigmas).all(1)
    covariances[stated] = sigmas[stated][:, :, None] ** 2 * np.eye(3)
    return Fixes(
        receiver=receiver,
        times=np.array(times),
        geodetic=np.column_stack(
            [
                np.radians(table.numbers["latitude"]),
                np.radians(table.numbers["longitude"]),
                table.numbers["height"],
            ]
        ),
        kinds=np.array(kinds, dtype=np.int64),
        satellites=np.nan_to_num(table.numbers["satellites"], nan=-1).astype(np.int64),
        hdop=np.array(table.numbers["hdop"]),
        covariances=covariances,
        lines=np.array(table.lines, dtype=np.int64),
        source=path,
    )


def seconds_of(text: str) -> float:
    """Seconds since 1970 of a number or an ISO 8601 time (UTC without a zone); NaN if bad.

    Numbers beyond the year 2100 are no seconds: milliseconds, most likely.
    """
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        try:
            stamp = datetime.fromisoformat(text)
        except ValueError:
            return math.nan
        value = (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()
    return value if abs(value) < LATEST else math.nan


def _time(table: CsvTable, row: int) -> float:
    value = seconds_of(table.text["time"][row])
    if math.isnan(value):
        table.flag(row, "time", NO_TIME)
    return value


def _kind(table: CsvTable, row: int) -> int:
    text = table.text["fix"][row]
    if not text:
        return RTK_FIXED
    if text not in _KINDS:
        table.flag(row, "fix", "not a fix kind; expected fixed, float, DGPS, autonomous or 0 to 9")
        return RTK_FIXED
    return _KINDS[text]
