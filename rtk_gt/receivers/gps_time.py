"""GPS time and UTC."""

from datetime import UTC, datetime
from typing import TypeVar

import numpy as np

from validation.poses.angles import Array

GPS_EPOCH = datetime(1980, 1, 6, tzinfo=UTC)
WEEK = 604_800.0
"""Seconds."""
Scalars = TypeVar("Scalars", float, Array)
_START = GPS_EPOCH.timestamp()
_LEAP_SECONDS = (
    ("1981-07-01", 1), ("1982-07-01", 2), ("1983-07-01", 3), ("1985-07-01", 4),
    ("1988-01-01", 5), ("1990-01-01", 6), ("1991-01-01", 7), ("1992-07-01", 8),
    ("1993-07-01", 9), ("1994-07-01", 10), ("1996-01-01", 11), ("1997-07-01", 12),
    ("1999-01-01", 13), ("2006-01-01", 14), ("2009-01-01", 15), ("2012-07-01", 16),
    ("2015-07-01", 17), ("2017-01-01", 18),
)  # fmt: skip


_STEPS = [datetime.fromisoformat(f"{day}T00:00:00+00:00").timestamp() for day, _ in _LEAP_SECONDS]


def gps_minus_utc(time: float) -> int:
    """Leap seconds between GPS time and UTC at a time in seconds since 1970."""
    return int(np.searchsorted(_STEPS, time, side="right"))


def utc_of_gps(times: Array) -> Array:
    """(n,) seconds since 1970 UTC of the same in GPS time."""
    return np.asarray(times - np.searchsorted(_STEPS, times, side="right"))


def of_week(week: Scalars, seconds: Scalars) -> Scalars:
    """Seconds since 1970, in GPS time, of weeks (not counted modulo 1024) and their seconds."""
    return _START + WEEK * week + seconds
