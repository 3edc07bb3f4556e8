"""Control charts: false alarms as rare as asked for, drifts noticed in time."""

import numpy as np
import pytest
from scipy import stats

from validation.statistics.control.changes import candidates, evidence, likeliest
from validation.statistics.control.charts import control_chart
from validation.statistics.control.limits import FIRST, LIMITS, RATES, limit
from validation.statistics.control.trend import trend

SEASON = 20
DRIFT = 2.0 * np.maximum(np.arange(SEASON) - 8, 0)
"""Millimetres: 2 more each day from the tenth on."""
CHARTS = 6
"""Of one system: bias and spread in x, y and theta."""


def brute_force(values, weights):
    """Normal score of the best step or drift, by one regression for each."""
    n = len(values)
    root = np.sqrt(weights)
    best = 0.0
    for first in range(1, n):
        for power in (0, 1):
            change = np.maximum(np.arange(n) - first + 1, 0.0)
            change = np.minimum(change, 1.0) if power == 0 else change
            A = np.column_stack([np.ones(n), change]) * root[:, None]
            found, left, *_ = np.linalg.lstsq(A, values * root)
            sigma = np.sqrt(left[0] / (n - 2) * np.linalg.inv(A.T @ A)[1, 1])
            best = max(best, abs(found[1]) / sigma)
    return stats.norm.isf(stats.t.sf(best, n - 2))


@pytest.mark.parametrize("n", [5, 9, 13])
def test_the_evidence_is_that_of_the_best_regression(n):
    rng = np.random.default_rng(n)
    values, weights = rng.normal(size=n), rng.uniform(0.1, 1, n)
    assert evidence(values, weights) == pytest.approx(brute_force(values, weights), rel=1e-9)


def test_neither_place_nor_unit_changes_the_evidence():
    values = np.random.default_rng(1).normal(size=12)
    known = evidence(values, np.ones(12))
    assert evidence(1e3 * values - 7e4, np.full(12, 0.5)) == pytest.approx(known, rel=1e-6)


def test_long_series_look_at_few_changes_and_at_the_longest():
    found = candidates(np.arange(400.0), np.ones(400))
    assert len(found.first) < 40
    assert {1, 399} <= set(found.first.tolist())


@pytest.mark.parametrize("rate", [1 / 50, 1 / 250])
def test_limits_are_exceeded_as_often_as_said(rate):
    """On each day so many of the series in which nothing was noticed before.

    Binomial; 3.3 standard deviations are exceeded once in a thousand.
    """
    series, days = 20_000, 25
    drawn = np.random.default_rng(2).normal(3.0, 0.2, (series, days))
    rate = min(rate, RATES[0])
    at_risk = noticed = 0
    left = drawn
    for number in range(FIRST, days + 1):
        over = evidence(left[:, :number], np.ones(number)) > limit(rate, number)
        at_risk, noticed = at_risk + len(left), noticed + int(over.sum())
        left = left[~over]
    assert abs(noticed - rate * at_risk) < 3.3 * np.sqrt(rate * at_risk)


def test_limits_rise_with_the_rarity_also_beyond_the_table():
    rates = [1e-2, *RATES, 1e-5, 1e-6]
    limits = [limit(rate, 14) for rate in rates]
    assert limits[0] == limits[1] == LIMITS[0][4]
    assert np.all(np.diff(limits[1:]) > 0)
    # Ten times as rare is 0.45 more for a normal score about 4.5.
    assert limits[-1] - limits[-2] == pytest.approx(0.45, abs=0.05)
    assert limit(1e-4, 60) == limit(1e-4, 4000)


@pytest.mark.parametrize(("within", "least"), [(0.0, 0.9), (0.6, 0.9)])
def test_a_drift_of_two_millimetres_a_day_is_noticed_on_the_fifth_day(within, least):
    """Biases scatter by 1 mm from day to day, and by the uncertainty of the day."""
    rng = np.random.default_rng(3)
    sigma = np.hypot(1.0, within)
    noticed = 0
    for _ in range(200):
        chart = control_chart(
            DRIFT + rng.normal(0, sigma, SEASON), np.full(SEASON, within), charts=CHARTS
        )
        noticed += any(9 <= day <= 13 for day in chart.noticed)
    assert noticed >= least * 200


@pytest.mark.full
@pytest.mark.parametrize("seed", [4, 5])
def test_one_system_has_fewer_than_one_false_alarm_in_a_year(seed):
    """5,000 days of six charts; 13.7 would be one in a year, 6.8 are expected."""
    drawn = np.random.default_rng(seed).standard_normal((CHARTS, 5000))
    assert sum(len(control_chart(one, charts=CHARTS).changes) for one in drawn) <= 13


@pytest.mark.full
@pytest.mark.parametrize("scatter", [0.5, 1.0])
def test_days_of_unlike_uncertainty_make_no_more_alarms_than_one_in_a_year(scatter):
    """Days ten times as uncertain as others; 6,400 days at risk, at most 17.5 in a year's measure.

    The scatter from day to day is to be told from few days: that costs up to twice the false alarms
    that are asked for, one in 730 days.
    """
    rng = np.random.default_rng(6)
    alarms = 0
    for _ in range(400):
        sigmas = rng.choice([0.3, 1.0, 3.0], SEASON)
        values = rng.normal(0, np.hypot(scatter, sigmas))
        alarms += len(control_chart(values, sigmas).changes)
    assert alarms <= 6400 / 365 + 2 * np.sqrt(6400 / 365)


def test_a_bad_day_that_says_so_is_no_change():
    values = np.array([0.1, -0.2, 0.3, 0.0, -0.1, 0.2, 0.1, -0.3, 0.2, 6.0])
    sigmas = np.full(10, 0.1)
    assert control_chart(values, sigmas).noticed == (9,)
    sigmas[9] = 5.0
    assert control_chart(values, sigmas).noticed == ()


def test_what_was_noticed_is_told_with_size_kind_and_day():
    rng = np.random.default_rng(7)
    step = np.where(np.arange(SEASON) < 12, 0.0, 8.0) + rng.normal(0, 1, SEASON)
    (first,) = control_chart(step).changes[:1]
    assert (first.kind, first.began) == ("step", 12)
    assert first.low < 8 < first.high
    drift = 3 * np.maximum(np.arange(SEASON) - 11, 0) + rng.normal(0, 0.3, SEASON)
    (first,) = control_chart(drift).changes[:1]
    assert first.began_low <= 12 <= first.began_high
    told = likeliest(drift, np.ones(SEASON))
    assert told.kind == "drift"
    assert told.per_day == pytest.approx(3, abs=0.2)  # 0.3 / sqrt(204) is 0.02 a day


def test_intervals_of_sizes_hold_the_truth():
    """A step that was noticed, of unknown day: 95 % less what selection costs, by 300 seeds."""
    rng = np.random.default_rng(8)
    held = []
    for _ in range(300):
        values = np.where(np.arange(24) < 14, 0.0, 6.0) + rng.normal(0, 1, 24)
        told = likeliest(values, np.ones(24))
        held.append(told.low <= 6 <= told.high)
    assert 0.9 <= np.mean(held) <= 0.99


def test_a_chart_begins_anew_after_what_it_noticed():
    values = np.repeat([0.0, 10.0, -10.0], 10) + np.random.default_rng(9).normal(0, 0.5, 30)
    assert control_chart(values).noticed == (10, 20)


def test_equal_days_and_few_days_say_nothing():
    assert control_chart(np.full(12, 0.1 + 0.2)).changes == ()
    few = control_chart([1.0, 2.0, 30.0, 4.0])
    assert few.changes == ()
    assert np.isnan(few.evidence).all()
    assert control_chart([]).changes == ()


def test_a_step_of_days_without_any_scatter_is_noticed():
    assert control_chart([1.0] * 8 + [2.0]).noticed == (8,)


def test_numbers_that_are_none_are_refused():
    with pytest.raises(ValueError, match="finite"):
        control_chart([0.0, np.nan])
    with pytest.raises(ValueError, match="one number a day each"):
        control_chart([0.0, 1.0], [0.1])
    with pytest.raises(ValueError, match="not negative"):
        control_chart([0.0, 1.0], [0.1, -0.1])


def test_the_trend_is_that_of_a_regression():
    rng = np.random.default_rng(10)
    days = np.array([0.0, 1, 2, 5, 6, 7, 20])
    values = 0.3 * days + rng.normal(0, 1, 7)
    known = stats.linregress(days, values)
    told = trend(days, values, np.zeros(7))
    assert told.per_day == pytest.approx(known.slope)
    half = stats.t.ppf(0.975, 5) * known.stderr
    assert (told.low, told.high) == pytest.approx((known.slope - half, known.slope + half))
    assert np.isnan(trend([1, 1, 1], [1, 2, 3], np.zeros(3)).per_day)
    assert np.isnan(trend([1, 2], [1, 2], np.zeros(2)).per_day)


def separate(values):
    return sum(not change.goes_on for change in control_chart(values, charts=6).changes)


def test_a_drift_that_goes_on_is_one_change_and_a_step_in_it_another():
    days = np.arange(40)
    drift = 0.002 * np.maximum(days - 8, 0)
    seeds = [np.random.default_rng(seed).normal(0, 0.001, 40) for seed in range(100)]
    on = [separate(scatter + drift) for scatter in seeds]
    # One in a hundred is told as two by the level of the test, one more as it is asked some five
    # times in 40 days: of 100 with a chance of 5 % at most, 12 and more in one of a thousand.
    assert on.count(1) >= 88
    for day, least in ((24, 98), (28, 75)):  # on the 28th many charts have just begun anew
        jumped = [separate(scatter + drift + 0.02 * (days >= day)) for scatter in seeds]
        assert sum(number >= 2 for number in jumped) >= least
