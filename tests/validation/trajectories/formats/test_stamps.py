"""Time stamps: exact to the nanosecond, their unit told or asked for, their order."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation.errors import GtvalError, InputError
from validation.text_files.time_units import SCALES
from validation.trajectories.formats import read_trajectory
from validation.trajectories.formats.stamps import (
    UncertainUnitError,
    exact_times,
    lines_shown,
    texts_of,
    unit_of,
)


@pytest.mark.parametrize("unit", SCALES)
def test_dates_tell_their_unit_at_any_rate(unit):
    for rate in (1000, 100, 10, 1, 0.1):
        seconds = 1_235_561_680 + np.arange(20) / rate
        assert unit_of(seconds * SCALES[unit]) == unit


@pytest.mark.parametrize(
    ("interval", "unit"),
    [(0.01, "s"), (0.1, "s"), (0.5, "s"), (100, "ms"), (33_333, "us"), (50, "ms"), (1e8, "ns")],
)
def test_a_rate_tells_the_unit_where_one_is_possible(interval, unit):
    assert unit_of(np.arange(50) * interval) == unit


@pytest.mark.parametrize("interval", [1.0, 2, 10, 20, 30, 1000, 1e6, 1e7])
def test_a_rate_that_two_units_could_have_is_asked_for(interval):
    with pytest.raises(UncertainUnitError, match=r"Hz in .* or .*--unit"):
        unit_of(np.arange(50) * interval)


def test_one_stamp_has_no_rate():
    with pytest.raises(UncertainUnitError, match="--unit"):
        unit_of(np.array([5.0]))
    assert unit_of(np.array([1.4e18])) == "ns"


@given(
    st.lists(st.integers(0, 4 * 10**18), min_size=1, max_size=5), st.sampled_from(sorted(SCALES))
)
def test_times_are_the_nearest_doubles(nanoseconds, unit):
    scale = SCALES[unit]
    texts = [f"{n // 10**9}.{n % 10**9:09d}" for n in nanoseconds]
    if unit != "s":
        values = [Fraction(n) * scale / 10**9 for n in nanoseconds]
        texts = [f"{v.numerator // v.denominator}.{int(v % 1 * 10**9):09d}" for v in values]
    epoch, times = exact_times(texts, unit)
    exact = [Fraction(text) / scale - epoch for text in texts]
    assert all(one >= 0 or epoch == 0 for one in exact)
    for time, wanted in zip(times, exact, strict=True):
        # A quotient of 28 digits, then the nearest double.
        assert abs(Fraction(float(time)) - wanted) <= Fraction(np.spacing(float(wanted))) * 51 / 100


@given(st.lists(st.integers(0, 10**13), min_size=1, max_size=5), st.integers(0, 4 * 10**9))
def test_nanoseconds_go_there_and_back(nanoseconds, epoch):
    texts = [str(n + epoch * 10**9) for n in nanoseconds]
    found, times = exact_times(texts, "ns")
    assert texts_of(times, found, "ns") == texts
    assert exact_times(texts_of(times, found), "s", found)[1].tolist() == times.tolist()


def test_a_year_that_is_not_ours_is_refused():
    with pytest.raises(GtvalError, match="no year of ours"):
        exact_times(["1e18", "2e18"], "s")


def rows(times):
    return "time,x,y,theta\n" + "".join(f"{t},{k},0,0\n" for k, t in enumerate(times))


def test_a_few_rows_out_of_order_are_sorted_or_dropped_and_told(written):
    times = [k / 10 for k in range(200)]
    times[50], times[51] = times[51], times[50]
    times[120] = times[119]
    found = read_trajectory(written("a.csv", rows(times)))
    assert len(found) == 199
    assert (np.diff(found.times) > 0).all()
    assert found.poses[50, 0] == 51
    assert found.poses[51, 0] == 50
    assert found.provenance["rows_sorted"] == found.provenance["rows_left_out"] == 1
    notes = " ".join(found.provenance["notes"])
    assert "line 53" in notes
    assert "line 122" in notes


def test_two_recordings_in_one_file_are_refused(written):
    times = [k / 10 for k in range(100)] + [k / 10 for k in range(100)]
    with pytest.raises(InputError, match=r"99 of 200 rows went back in time \(line 102 to 200\)"):
        read_trajectory(written("a.csv", rows(times)))


def test_the_unit_that_is_given_holds(written):
    path = written("a.csv", rows(range(20)))
    with pytest.raises(InputError, match="not certain"):
        read_trajectory(path)
    assert read_trajectory(path, unit="ms").times[-1] == 0.019
    assert read_trajectory(path, unit="s").times[-1] == 19
    with pytest.raises(GtvalError, match="'h' is no unit of time"):
        read_trajectory(path, unit="h")


def test_lines_are_shown_in_runs():
    assert lines_shown([9, 3, 4, 5, 12]) == "3 to 5, 9, 12"
    assert lines_shown(range(0, 100, 2)).endswith("8, …")
