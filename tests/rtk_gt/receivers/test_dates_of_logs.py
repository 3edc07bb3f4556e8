"""Days of fixes: dates stand in sentences of their own, times of day in all."""

from datetime import UTC, date, datetime

import numpy as np
import pytest

from rtk_gt.receivers.fix_checks import check_fixes
from rtk_gt.receivers.formats.nmea import read_nmea
from validation.errors import InputError

NOON = datetime(2024, 4, 10, 12, tzinfo=UTC).timestamp()
EVENING = datetime(2024, 4, 10, 23, 59, 55, tzinfo=UTC).timestamp()


def sentence(body):
    value = 0
    for character in body:
        value ^= ord(character)
    return f"${body}*{value:02X}"


def gga(time):
    return sentence(
        f"GPGGA,{stamp(time):%H%M%S}.00,4528.68,N,00913.92,E,4,12,0.9,112.0,M,48.0,M,1.0,0000"
    )


def gst(time):
    return sentence(f"GPGST,{stamp(time):%H%M%S}.00,0.02,0.01,0.01,0,0.01,0.01,0.02")


def rmc(time, status="A", of=None):
    of = time if of is None else of
    return sentence(
        f"GPRMC,{stamp(time):%H%M%S}.00,{status},4528.68,N,00913.92,E,0.1,0.0,"
        f"{stamp(of):%d%m%y},,,R"
    )


def zda(time):
    return sentence(f"GPZDA,{stamp(time):%H%M%S}.00,{stamp(time):%d,%m,%Y},00,00")


def stamp(time):
    return datetime.fromtimestamp(time, tz=UTC)


def times_of(tmp_path, lines, **more):
    path = tmp_path / "rear.nmea"
    path.write_text("\n".join(lines) + "\n")
    return read_nmea(path, "rear", **more)


def epochs(times, orders):
    return [write(time) for time in times for write in orders]


ORDERS = pytest.mark.parametrize(
    "orders",
    [(rmc, gga, gst), (gga, gst, rmc), (gga, rmc, gst), (zda, gga, gst), (gga, gst, zda)],
    ids=["rmc first", "rmc last", "rmc between", "zda first", "zda last"],
)


@ORDERS
@pytest.mark.parametrize("start", [NOON, EVENING])
@pytest.mark.parametrize("pause", [3600, 82800, 86400, 90000, 366 * 86400 - 3600, 3 * 86400])
def test_a_log_that_goes_on_on_another_day_has_the_times_of_its_dates(
    tmp_path, orders, start, pause
):
    times = start + np.r_[np.arange(20.0), pause + np.arange(20.0, 40.0)]
    found = times_of(tmp_path, epochs(times, orders))
    assert found.times.tolist() == times.tolist()
    assert np.isfinite(found.covariances).all()


def test_a_pause_of_more_than_a_day_is_refused_for_what_it_is(tmp_path):
    times = NOON + np.r_[np.arange(20.0), 90000 + np.arange(20.0, 40.0)]
    found = times_of(tmp_path, epochs(times, (gga, rmc)))
    with pytest.raises(InputError, match=r"line 41, .*1\.04 days later than the fix.*cut"):
        check_fixes([found])


@ORDERS
def test_a_stated_day_is_that_of_the_first_fix_and_the_dates_tell_the_rest(tmp_path, orders):
    times = NOON + np.r_[np.arange(20.0), 82800 + np.arange(20.0, 40.0)]
    found = times_of(tmp_path, epochs(times, orders), day=date(2020, 2, 28))
    assert found.times[0] == datetime(2020, 2, 28, 12, tzinfo=UTC).timestamp()
    assert (found.times - found.times[0]).tolist() == (times - NOON).tolist()


@pytest.mark.parametrize("late", [1, 8])
@pytest.mark.parametrize("first", [True, False])
def test_a_date_that_is_late_at_midnight_is_no_leap(tmp_path, late, first):
    times = EVENING + np.arange(40.0)
    lines = []
    for time in times:
        behind = 0 <= time - EVENING - 5 < late
        dated = rmc(time, of=time - 86400 * behind)
        lines += [dated, gga(time)] if first else [gga(time), dated]
    assert times_of(tmp_path, lines).times.tolist() == times.tolist()


def test_a_damaged_date_and_one_without_a_fix_are_no_leaps(tmp_path):
    times = NOON + np.arange(40.0)
    lines = epochs(times, (rmc, gga))
    lines[20] = rmc(times[10], of=times[10] + 20 * 86400)  # the checksum is right: a damaged clock
    lines[40] = rmc(times[20]).replace(",100424,", ",110424,")
    lines[-2] = rmc(times[-1]).replace(",100424,", ",120424,")  # nothing comes after it
    lines[60] = rmc(times[30], "V", of=0.0)
    assert times_of(tmp_path, lines).times.tolist() == times.tolist()


def test_dates_go_on_while_there_is_no_fix(tmp_path):
    """Over a night in a hall only the clock is written; midnight passes in it."""
    night = NOON + np.arange(0.0, 90000.0, 60.0)
    times = NOON + np.r_[np.arange(5.0), 90000.0 + np.arange(5.0)]
    lines = [*epochs(times[:5], (gga,)), *map(zda, night), *epochs(times[5:], (gga, zda))]
    assert times_of(tmp_path, lines).times.tolist() == times.tolist()


def test_a_single_date_serves_a_log_of_two_days(tmp_path):
    times = NOON + np.arange(0.0, 170000.0, 600.0)
    assert times_of(tmp_path, [rmc(NOON), *map(gga, times)]).times.tolist() == times.tolist()


def test_a_log_without_a_date_is_counted_from_1970_and_says_where_that_matters(tmp_path):
    found = times_of(tmp_path, epochs(NOON + np.arange(20.0), (gga, gst)))
    assert found.times.tolist() == (43_200 + np.arange(20.0)).tolist()
    (note,) = [one for one in found.notes if "no date" in one]
    assert "The drive needs none" in note
    assert 'state `date = "YYYY-MM-DD"`' in note
    stated = times_of(tmp_path, epochs(NOON + np.arange(20.0), (gga,)), day=date(2024, 4, 10))
    assert stated.times[0] == NOON
    assert not any("no date" in one for one in stated.notes)
