"""Times of tables: a unit is told, or asked for; times of day need a day, GPS time its week."""

from datetime import date

import numpy as np
import pytest

from rtk_gt.receivers.formats.reading import Stated, read_receiver
from rtk_gt.sensors.sensor_files import read_times
from validation.errors import InputError
from validation.text_files.time_units import time_heading

START = 1_712_739_570.0  # 2024-04-10 08:59:30 UTC, GPS week 2309
SECONDS = np.arange(0, 90, 0.2)
SINCE_1970 = START + SECONDS
OF_WEEK = (START + 18 - 315_964_800) % 604_800 + SECONDS


def clocks(start=8 * 3600 + 59 * 60 + 30):
    """Times of day as NMEA writes them."""
    for one in (start + SECONDS) % 86_400:
        minutes, seconds = divmod(round(float(one), 2), 60)
        yield f"{int(minutes // 60):02d}{int(minutes % 60):02d}{seconds:05.2f}"


def read(tmp_path, heading, cells, day=None, speed=5.0):
    """A drive to the north whose times are written in some way."""
    rows = [
        f"{cell},{45.478 + speed * s / 6.4e6 * 180 / np.pi:.11f},9.232,160.0,4"
        for cell, s in zip(cells, SECONDS, strict=True)
    ]
    path = tmp_path / "rear.csv"
    path.write_text("\n".join([f"{heading},latitude,longitude,height,fix", *rows]) + "\n")
    return read_receiver(path, Stated("rear", day=day))


@pytest.mark.parametrize(
    ("heading", "cells", "start"),
    [
        ("time", [f"{one:.3f}" for one in SECONDS], 0.0),
        ("time_s", [f"{one:.3f}" for one in SECONDS], 0.0),
        ("time_ms", [f"{5000 + 1000 * one:.0f}" for one in SECONDS], 5.0),
        ("Time [ms]", [f"{5000 + 1000 * one:.1f}" for one in SECONDS], 5.0),
        ("t_us", [f"{1e6 * one:.0f}" for one in SECONDS], 0.0),
        ("stamp in ns", [f"{1e9 * one:.0f}" for one in SECONDS], 0.0),
        ("timestamp_ms", [f"{1000 * one:.0f}" for one in SINCE_1970], START),
        ("timestamp", [f"{1000 * one:.0f}" for one in SINCE_1970], START),
        ("gps_week,tow", [f"2309,{one:.3f}" for one in OF_WEEK], START),
        ("Week,TOW [ms]", [f"2309,{1000 * one:.0f}" for one in OF_WEEK], START),
        ("week,iTOW", [f"2309,{1000 * one:.0f}" for one in OF_WEEK], START),
        ("date,time", [f"2024-04-10,{one}" for one in clocks()], START),
    ],
)
def test_times_are_read_in_the_unit_that_is_told(tmp_path, heading, cells, start):
    np.testing.assert_allclose(read(tmp_path, heading, cells).times, start + SECONDS, atol=1e-6)


@pytest.mark.parametrize(
    ("heading", "cells", "words"),
    [
        ("time", [f"{5000 + 1000 * s:.0f}" for s in SECONDS], "line 2.*'5000'.*200 s.*time_ms"),
        ("time", [f"{1e6 * s:.0f}" for s in SECONDS], "microseconds.*time_us"),
        ("time", [f"{s / 86_400:.9f}" for s in SECONDS], "such as minutes"),
        ("time_us", [f"{1e3 * s:.0f}" for s in SECONDS], "another one; state seconds"),
        ("week,itow", [f"2309,{one:.3f}" for one in OF_WEEK], "field 'tow'.*another one"),
        ("time", list(clocks()), r"line 2.*'085930.00' — a time of day \(hhmmss\).*state `date"),
        ("time", list(clocks(36_000)), "behind 100059.80 stands 100100.00.*state `date"),
        ("time", [f"09:00:{s:05.2f}" for s in SECONDS / 2], "a time of day, and no day"),
        ("time [min]", [f"{s / 60:.6f}" for s in SECONDS], "times in min are not read"),
        ("time (GPST)", [f"{s:.2f}" for s in SINCE_1970], "not UTC"),
        ("gps_time", [f"{s:.2f}" for s in SINCE_1970], "18 s ahead of UTC"),
        ("tow", [f"{s:.2f}" for s in OF_WEEK], "needs the GPS week"),
        ("week,tow", [f"261,{one:.3f}" for one in OF_WEEK], "modulo 1024"),
    ],
)
def test_times_in_another_unit_are_refused_with_what_to_do(tmp_path, heading, cells, words):
    with pytest.raises(InputError, match=words) as raised:
        read(tmp_path, heading, cells)
    assert len(str(raised.value).splitlines()) == 1


def test_times_of_day_go_on_behind_midnight(tmp_path):
    found = read(tmp_path, "time", clocks(86_370), day=date(2024, 4, 10))
    midnight = 1_712_707_200.0 + 86_400
    np.testing.assert_allclose(found.times, midnight - 30 + SECONDS, atol=1e-6)


def test_seconds_that_look_like_times_of_day_stay_seconds(tmp_path):
    """From 100000 s on: within 100 s the last two digits pass 60."""
    found = read(tmp_path, "time", [f"{100_000 + s:.2f}" for s in SECONDS])
    np.testing.assert_allclose(found.times, 100_000 + SECONDS, atol=1e-6)


def test_a_receiver_that_stands_or_creeps_is_read(tmp_path):
    for speed in (0.0, 0.1):
        assert len(read(tmp_path, "time", [f"{s:.1f}" for s in SECONDS], speed=speed)) == 450
    minutes = read(tmp_path, "time", [f"{300 * s:.0f}" for s in SECONDS], speed=0.0)
    assert np.diff(minutes.times) == pytest.approx(60)


@pytest.mark.parametrize(
    ("heading", "found"),
    [
        ("time", ("time", "")),
        ("Time [ms]", ("time", "ms")),
        ("stamp_nsec", ("stamp", "ns")),
        ("ms", ("ms", "")),
        ("time (UTC)", ("time", "utc")),
    ],
)
def test_headings_tell_their_unit(heading, found):
    assert time_heading(heading) == found


@pytest.mark.parametrize(
    ("heading", "words"),
    [
        ("time [ms]", "the heading says 'ms'; write s"),
        ("time_ms", "'time' instead of 'time_ms', and its numbers in seconds, not in ms"),
    ],
)
def test_sensors_tell_seconds(tmp_path, heading, words):
    path = tmp_path / "times.csv"
    path.write_text(f"{heading}\n5000\n5200\n")
    with pytest.raises(InputError, match=words):
        read_times(path)


def test_no_column_is_renamed_into_another_that_is_needed(tmp_path):
    (tmp_path / "rear.csv").write_text("when,latitude,longitude,height\n1,45.478,9.232,160\n")
    with pytest.raises(InputError, match="the header has: 'when', 'latitude'"):
        read_receiver(tmp_path / "rear.csv", Stated("rear"))
