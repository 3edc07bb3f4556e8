"""Intervals where neighbours share errors: what part of them holds the truth."""

import numpy as np
import pytest
from dependent_intervals import errors, measured, newey_west, settings

from validation.statistics.dependence import (
    FEWEST_VALUES,
    bias_of_series,
    mean_of_series,
    nees_of_series,
    rms_of_series,
)

SEEDS = 100


def shares(kind, n, time, seeds=SEEDS, seed=3):
    """What benchmarks/dependent_intervals.py prints of one setting."""
    return measured(errors(kind, n, time, seeds, np.random.default_rng(seed)))


@pytest.mark.parametrize("kind", ["ar1", "ar1+white", "oscillating", "skewed"])
@pytest.mark.parametrize(("n", "time"), [(200, 0.1), (200, 2.0), (1000, 5.0), (4000, 30.0)])
def test_most_intervals_hold_the_truth_on_ten_correlation_times_and_more(kind, n, time):
    found = shares(kind, n, time)
    # With 100 seeds the share of a method that holds 90 % is below 0.82 once in 200 times.
    assert found["holds"] >= 0.82
    assert found["width"] < 3


@pytest.mark.full
@pytest.mark.parametrize(("kind", "n", "time"), list(settings()))
def test_nine_in_ten_hold_the_truth_in_every_setting(kind, n, time):
    found = shares(kind, n, time, seeds=400)
    if n * 0.1 / time >= 10:
        assert found["holds"] >= 0.90
        assert found["withheld"] <= 0.5
    else:
        assert found["short"] >= 0.7  # withheld, or said


def test_independent_errors_are_not_punished():
    found = shares("ar1", 200, 1e-3, seeds=200)
    assert found["withheld"] == 0
    assert 0.94 <= found["holds"] <= 1
    assert found["width"] < 1.6
    assert found["short"] < 0.2


@pytest.mark.parametrize(("n", "time"), [(1000, 10.0), (1000, 3.0), (4000, 30.0)])
def test_intervals_of_very_skewed_errors_hold_the_truth(n, time):
    # The exponential of normal errors has a skewness of 6.
    rows = np.exp(errors("ar1", n, time, 200, np.random.default_rng(8)))
    found = [mean_of_series(row) for row in rows]
    held = [one.low <= np.exp(0.5) <= one.high for one in found if one.reason == ""]
    # With 130 intervals the share of a method that holds 90 % is below 0.83 once in 200 times.
    assert len(held) > 130
    assert np.mean(held) >= 0.83
    # One in three normal series is more skewed by chance than its standard error.
    assert np.mean([mean_of_series(row).widened == 1 for row in np.log(rows)]) > 0.6


def test_student_and_newey_west_hold_far_less():
    found = shares("ar1", 1000, 5.0)
    assert found["student"] < 0.3
    assert found["newey_west"] < 0.6
    assert found["holds"] > 0.9


def test_newey_west_of_the_benchmark_is_the_sum_of_weighted_autocovariances():
    values = np.random.default_rng(1).standard_normal(100)
    away = values - values.mean()
    covariances = [np.sum(away[lag:] * away[: 100 - lag]) / 100 for lag in range(5)]
    expected = covariances[0] + 2 * sum((1 - k / 5) * covariances[k] for k in range(1, 5))
    assert newey_west(values) == pytest.approx(1.96 * np.sqrt(expected / 100))


def test_a_short_record_is_withheld_or_said():
    for kind in ("ar1", "ar1+white", "skewed"):
        assert shares(kind, 1000, 50.0)["short"] >= 0.8


def test_effective_number_is_that_of_the_process():
    # First-order with correlation time T on n steps: n (1 - a) / (1 + a).
    a = np.exp(-0.1)
    rows = errors("ar1", 20_000, 1.0, 60, np.random.default_rng(5))
    found = np.median([mean_of_series(row).n_effective for row in rows])
    assert found == pytest.approx(20_000 * (1 - a) / (1 + a), rel=0.35)
    white = [
        mean_of_series(row).n_effective for row in np.random.default_rng(1).normal(size=(60, 500))
    ]
    assert np.median(white) > 300
    assert max(white) <= 500


def test_cells_of_a_long_series_stand_for_its_values(monkeypatch):
    # The cosines change by 0.3 % of their standard deviations, the interval by less.
    rows = errors("ar1+white", 40_000, 1.0, 5, np.random.default_rng(6))
    by_cells = [mean_of_series(row).half_width for row in rows]
    monkeypatch.setattr("validation.statistics.dependence.CELLS", 10**9)
    assert by_cells == pytest.approx([mean_of_series(row).half_width for row in rows], rel=3e-3)


def test_nothing_changes_with_sign_unit_or_offset():
    row = errors("ar1", 500, 1.0, 1, np.random.default_rng(2))[0]
    one, other = mean_of_series(row), mean_of_series(7 - 1000 * row)
    assert other.mean == pytest.approx(7 - 1000 * one.mean)
    assert other.high == pytest.approx(7 - 1000 * one.low)
    assert other.n_effective == pytest.approx(one.n_effective)


def test_few_or_equal_values_have_no_interval_and_it_is_said():
    few = mean_of_series(np.arange(FEWEST_VALUES - 1.0))
    assert np.isnan(few.low)
    assert str(FEWEST_VALUES) in few.reason
    assert mean_of_series(np.arange(FEWEST_VALUES) % 3.0).reason == ""
    same = mean_of_series(np.full(100, 0.1))
    assert (same.mean, same.std, same.method) == (pytest.approx(0.1), 0.0, "withheld")
    assert mean_of_series([]).n == 0
    assert bias_of_series(same, 1.0).holds is None
    assert nees_of_series([], 3) is None
    assert np.isnan(rms_of_series(np.zeros(50)).low)


def test_rms_holds_the_truth():
    for time in (0.1, 2.0):
        found = shares("ar1", 1000, time)
        assert found["rms"] >= 0.85
    zero = rms_of_series(np.zeros(100))
    assert zero.rms == 0


def test_a_bias_at_the_limit_is_called_small_no_more_often_than_the_level():
    rows = 1 + errors("ar1", 1000, 1.0, 300, np.random.default_rng(6))
    wrong = np.mean([bool(bias_of_series(mean_of_series(row), 1.0).holds) for row in rows])
    assert wrong <= 0.09  # 5 %, and three standard deviations of 300 seeds
    small = np.mean([bool(bias_of_series(mean_of_series(row - 1), 1.0).holds) for row in rows])
    assert small > 0.9


def test_the_smallest_limit_is_where_the_test_turns():
    found = mean_of_series(errors("ar1", 500, 1.0, 1, np.random.default_rng(7))[0])
    limit = bias_of_series(found, 1.0).smallest_limit
    assert bias_of_series(found, limit * 1.0001).holds
    assert not bias_of_series(found, limit * 0.9999).holds


@pytest.mark.parametrize("time", [0.1, 1.0, 5.0])
def test_nees_in_a_row_is_tested_with_its_effective_number(time):
    rng = np.random.default_rng(9)
    rows = np.square([errors("ar1", 2000, time, 200, rng) for _ in range(3)]).sum(0)
    tests = [nees_of_series(row, 3) for row in rows]
    assert np.mean([one.verdict != "inside" for one in tests if one]) <= 0.09
    assert (
        np.mean([one.verdict == "above" for one in (nees_of_series(4 * r, 3) for r in rows) if one])
        > 0.8
    )
