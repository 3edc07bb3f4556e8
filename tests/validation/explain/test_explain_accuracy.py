"""Repeatability, pairs of systems, 'good enough', and how many poses that takes."""

import numpy as np
import pytest
from explain_campaigns import simulate, table
from scipy import stats

from validation.errors import GtvalError
from validation.explain.fitting.planning import poses_for_bias, poses_for_deviation
from validation.explain.sources.equivalence import deviation_ratio, good_enough, paired_comparison
from validation.explain.sources.repeatability import repeated_runs, revisits
from validation.explain.telling.tables import good_enough_table


def test_the_planned_number_of_poses_reaches_its_power():
    # Simulated oracle: the two one-sided tests done as `scipy.stats` does them.
    sigma, limit, bias = 0.03, 0.02, 0.004
    n = poses_for_bias(sigma, limit, bias=bias, power=0.9)
    for number, enough in ((n, True), (n - 3, False)):
        samples = np.random.default_rng(1).normal(bias, sigma, (20_000, number))
        upper = stats.ttest_1samp(samples, limit, axis=1, alternative="less").pvalue
        lower = stats.ttest_1samp(samples, -limit, axis=1, alternative="greater").pvalue
        shown = float(np.mean(np.maximum(upper, lower) < 0.05))
        # Three standard deviations of 20 000 trials are 0.0064.
        assert (shown > 0.9 - 0.0064) is enough


def test_the_planned_number_for_the_deviation_is_exact():
    n = poses_for_deviation(0.03, 0.05, power=0.9)

    def power(number):
        critical = stats.chi2.ppf(0.05, number - 1)
        return stats.chi2.cdf(critical * (0.05 / 0.03) ** 2, number - 1)

    assert power(n) >= 0.9 > power(n - 1)


def test_what_cannot_be_shown_is_an_error():
    with pytest.raises(GtvalError, match="cannot be shown"):
        poses_for_bias(0.01, 0.02, bias=0.03)
    with pytest.raises(GtvalError, match="cannot be shown"):
        poses_for_deviation(0.06, 0.05)
    with pytest.raises(GtvalError, match="more than"):
        poses_for_bias(1.0, 0.001)


def test_paired_differences_are_those_of_scipy():
    survey, a = simulate("frame", 1)
    _, b = simulate("none", 2)
    b = table("other", a.poses + np.random.default_rng(3).normal(size=(26, 3)) * 0.02 + 0.01)
    found = paired_comparison(survey, a, b, (0.05, 0.05, 0.05))
    for column, one in enumerate(found[:2]):
        ea, eb = (survey.poses[:, column] - t.poses[:, column] for t in (a, b))
        interval = stats.ttest_rel(ea, eb).confidence_interval(0.95)
        assert (one.bias_low, one.bias_high) == pytest.approx(tuple(interval))


def test_the_ratio_of_paired_deviations_covers():
    rng, inside = np.random.default_rng(0), 0
    covariance = np.array([[1.0, 1.2], [1.2, 4.0]])
    for _ in range(1000):
        a, b = rng.multivariate_normal([0, 0], covariance, 15).T
        _, low, high = deviation_ratio(a, b)
        inside += low <= 0.5 <= high
    assert stats.binom.ppf(0.001, 1000, 0.95) <= inside <= stats.binom.ppf(0.999, 1000, 0.95)


def test_too_few_pairs_have_no_ratio():
    assert np.isnan(deviation_ratio(np.array([1.0, 2.0]), np.array([1.0, 3.0]))).all()


def test_good_enough_needs_a_small_bias_and_a_small_spread():
    rng = np.random.default_rng(0)
    assert good_enough(rng.normal(0, 0.01, 30), 0.05).holds
    assert not good_enough(rng.normal(0.06, 0.01, 30), 0.05).holds
    assert not good_enough(rng.normal(0, 0.06, 30), 0.05).holds
    assert good_enough(np.array([0.01]), 0.05).holds is None


def test_repeated_runs_cover_the_noise():
    rng, inside = np.random.default_rng(0), np.zeros(3)
    for _ in range(500):
        stops = rng.uniform(-3, 3, (10, 3))
        runs = [table(f"run{i}", stops + rng.normal(size=(10, 3)) * 0.02) for i in range(3)]
        found = repeated_runs(runs)
        inside += [one.low <= 0.02 <= one.high for one in found]
        assert {one.dof for one in found} == {20}
    low, high = stats.binom.ppf([0.0005, 0.9995], 500, 0.95)
    assert (low <= inside).all()
    assert (inside <= high).all()


def test_one_run_shows_no_repeatability():
    with pytest.raises(GtvalError, match="at least two runs"):
        repeated_runs([table("run", np.zeros((3, 3)))])


def test_revisits_use_each_stop_once():
    stops = np.array([[0, 0, 0], [0.1, 0, 1], [0.15, 0, 2], [5, 5, 0], [5.05, 5, 3]], dtype=float)
    survey, rig = table("survey", stops), table("rig", stops + np.array([0.01, 0, 0]))
    found = revisits(survey, rig, 0.25)
    assert [one.dof for one in found] == [2, 2, 2]
    assert found[0].deviation == pytest.approx(0, abs=1e-12)


def test_a_path_that_does_not_come_back_has_no_revisits():
    stops = np.column_stack([np.arange(5.0), np.zeros(5), np.zeros(5)])
    assert revisits(table("survey", stops), table("rig", stops), 0.25) == ()


def test_what_is_shown_and_what_it_takes_is_in_the_table(ad23):
    table = good_enough_table(ad23.systems, (0.05, 0.05, 0.05), 0.95)
    rows = {(row[0], row[1]): row for row in table.rows}
    # 7 cm of spread are no 5 cm, whatever the number of poses; the corrected ones are, with few.
    genetic = rows["laser_genetic", "x"]
    assert genetic[6] == "not shown"
    assert genetic[7] is None
    assert genetic[8] < 10
    assert rows["vision", "theta"][6] == "not shown"
