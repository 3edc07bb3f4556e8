"""Statistics of errors: printed numbers, independent oracles, coverage."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from validation.poses.angles import wrap
from validation.poses.pose_table import PLANAR, SPATIAL, Component
from validation.statistics.error_statistics import (
    bias_test,
    by_magnitude,
    component_statistics,
    error_statistics,
    mean_interval,
)
from validation.statistics.evaluation import evaluate

X, _, THETA = PLANAR

# AD2.3, "Overall conclusions for indoor validation" and "Vision Stats": as many digits as printed.
PRINTED_MEANS = {
    "vision": ("0.0804", "0.0362", "0.0137"),
    "laser_scanmatch": ("0.04228", "0.05151", "0.00444"),
    "laser_genetic": ("-0.06543", "0.02695", "0.03287"),
}
PRINTED_STDS = {
    "vision": ("0.03657", "0.06777", "0.04618"),
    "laser_scanmatch": ("0.09042", "0.07420", "0.04415"),
    "laser_genetic": ("0.07787", "0.06620", "0.12173"),
}


def as_printed(value: float, printed: str) -> str:
    return f"{value:.{len(printed.split('.')[1])}f}"


@pytest.mark.parametrize("system", PRINTED_MEANS)
def test_the_printed_means_and_deviations_come_out_to_the_last_digit(ad23_poses, system):
    statistics = evaluate(ad23_poses["survey"], ad23_poses[system]).statistics
    means = [as_printed(s.mean, p) for s, p in zip(statistics, PRINTED_MEANS[system], strict=True)]
    stds = [as_printed(s.std, p) for s, p in zip(statistics, PRINTED_STDS[system], strict=True)]
    assert tuple(means) == PRINTED_MEANS[system]
    assert tuple(stds) == PRINTED_STDS[system]
    assert {s.n for s in statistics} == {len(ad23_poses[system])}


def test_the_printed_largest_vision_errors_come_out(ad23_poses):
    statistics = evaluate(ad23_poses["survey"], ad23_poses["vision"]).statistics
    assert [f"{s.max_abs:.4f}" for s in statistics] == ["0.1481", "0.1965", "0.1636"]


def test_pose_11_of_the_genetic_system_enters_with_its_whole_34_degrees(ad23_poses):
    comparison = evaluate(ad23_poses["survey"], ad23_poses["laser_genetic"]).comparison
    error = comparison.errors[comparison.ids.index("11"), 2]
    assert f"{error:.4f}" == "0.5909"
    without = np.delete(comparison.errors[:, 2], comparison.ids.index("11"))
    # Left out, the printed standard deviation of 0.12173 would be a third of that.
    assert component_statistics(without, THETA, 0.05).std < 0.12173 / 2


def test_the_circular_mean_alone_would_not_give_the_printed_angle(ad23_poses):
    errors = evaluate(ad23_poses["survey"], ad23_poses["laser_genetic"]).comparison.errors[:, 2]
    circular = np.angle(np.exp(1j * errors).mean())
    assert f"{circular:.5f}" != "0.03287"


def test_the_printed_interval_used_22_poses_where_there_are_20(ad23_poses):
    vision = evaluate(ad23_poses["survey"], ad23_poses["vision"]).statistics[0]
    assert vision.n == 20
    low, high = mean_interval(vision.mean, vision.std, 22, method="normal")
    assert (f"{low:.4f}", f"{high:.4f}") == ("0.0651", "0.0957")
    normal = mean_interval(vision.mean, vision.std, 20, method="normal")
    assert [f"{end:.4f}" for end in normal] == ["0.0643", "0.0964"]
    student = mean_interval(vision.mean, vision.std, 20)
    assert [f"{end:.4f}" for end in student] == ["0.0633", "0.0975"]
    # Its errors depend on their neighbours: what is told is wider than any of these.
    assert vision.ci_low < student[0]
    assert vision.ci_high > student[1]


@pytest.mark.parametrize(
    ("row", "interval"), [(1, ("0.0079", "0.0645")), (2, ("-0.0056", "0.0330"))]
)
def test_so_do_the_other_printed_intervals(ad23_poses, row, interval):
    vision = evaluate(ad23_poses["survey"], ad23_poses["vision"]).statistics[row]
    ends = mean_interval(vision.mean, vision.std, 22, method="normal")
    assert tuple(f"{end:.4f}" for end in ends) == interval


@pytest.mark.parametrize("confidence", [0.8, 0.95, 0.99])
def test_the_interval_is_that_of_the_t_test(confidence):
    errors = np.random.default_rng(1).normal(0.02, 0.03, 9)
    ours = component_statistics(errors, X, 0.05, confidence)
    theirs = stats.ttest_1samp(errors, 0).confidence_interval(confidence)
    assert (ours.ci_low, ours.ci_high) == pytest.approx(tuple(theirs), rel=1e-12)


@pytest.mark.parametrize("mean", [-0.06, -0.02, 0.0, 0.04, 0.08])
def test_two_one_sided_tests_are_two_one_sided_t_tests(mean):
    errors = np.random.default_rng(2).normal(mean, 0.03, 12)
    limit = 0.05
    below = stats.ttest_1samp(errors, limit, alternative="less").pvalue
    above = stats.ttest_1samp(errors, -limit, alternative="greater").pvalue
    bias = component_statistics(errors, X, limit).bias
    assert bias.p_value == pytest.approx(max(below, above), rel=1e-9)
    assert bias.holds == (max(below, above) < 0.05)


def test_the_smallest_limit_is_where_the_statement_starts_to_hold():
    mean, std, n = 0.02, 0.03, 12
    smallest = bias_test(mean, std, n, 0.05).smallest_limit
    assert bias_test(mean, std, n, smallest * 1.000001).holds is True
    assert bias_test(mean, std, n, smallest * 0.999999).holds is False


def binomial_bounds(trials: int, probability: float) -> tuple[int, int]:
    """Counts outside of which a right procedure falls once in a million."""
    return (
        int(stats.binom.ppf(5e-7, trials, probability)),
        int(stats.binom.isf(5e-7, trials, probability)),
    )


@pytest.mark.parametrize("n", [2, 3, 5, 20])
def test_the_t_interval_holds_the_truth_in_95_percent_of_campaigns(n):
    trials, truth = 4000, 0.03
    errors = np.random.default_rng(n).normal(truth, 0.05, (trials, n))
    low, high = mean_interval(errors.mean(1), errors.std(1, ddof=1), n)
    held = int(((low <= truth) & (truth <= high)).sum())
    fewest, most = binomial_bounds(trials, 0.95)
    assert fewest <= held <= most


def test_the_documents_interval_holds_it_too_rarely_for_five_poses():
    trials = 4000
    errors = np.random.default_rng(5).normal(0, 1, (trials, 5))
    low, high = mean_interval(errors.mean(1), errors.std(1, ddof=1), 5, method="normal")
    assert int(((low <= 0) & (high >= 0)).sum()) < binomial_bounds(trials, 0.95)[0]


def test_a_bias_at_the_limit_is_called_below_it_in_5_percent_of_campaigns():
    trials, n, limit = 2000, 15, 0.05
    errors = np.random.default_rng(7).normal(limit, 0.02, (trials, n))
    claimed = sum(
        bool(bias_test(float(row.mean()), float(row.std(ddof=1)), n, limit).holds) for row in errors
    )
    fewest, most = binomial_bounds(trials, 0.05)
    assert fewest <= claimed <= most


angles = st.lists(st.floats(-0.7, 0.7), min_size=3, max_size=12)


@given(angles, st.floats(-10, 10))
def test_turning_all_angles_turns_their_mean_and_leaves_their_spread(errors, turn):
    before = component_statistics(errors, THETA, 0.05)
    after = component_statistics(wrap(np.array(errors) + turn), THETA, 0.05)
    # 1e-12: rounding of sums of a few numbers below 20.
    assert abs(wrap(after.mean - before.mean - turn)) < 1e-12
    assert abs(wrap(after.median - before.median - turn)) < 1e-12
    assert after.std == pytest.approx(before.std, abs=1e-12)
    assert after.mad == pytest.approx(before.mad, abs=1e-12)


@given(angles)
def test_small_angles_have_the_statistics_of_numbers(errors):
    circle, line = (component_statistics(errors, component, 0.05) for component in (THETA, X))
    assert circle.mean == pytest.approx(line.mean, abs=1e-12)
    assert circle.std == pytest.approx(line.std, abs=1e-12)
    assert circle.median == pytest.approx(line.median, abs=1e-12)


def test_angles_about_pi_are_near_each_other():
    statistics = component_statistics([math.pi - 0.01, -math.pi + 0.03], THETA, 0.05)
    assert wrap(statistics.mean - (math.pi + 0.01)) == pytest.approx(0, abs=1e-12)
    assert statistics.std == pytest.approx(0.04 / math.sqrt(2), abs=1e-12)


def test_no_error_at_all_gives_no_number_and_says_so():
    statistics = component_statistics([], X, 0.05)
    numbers = (statistics.mean, statistics.std, statistics.rms, statistics.max_abs, statistics.mad)
    assert all(math.isnan(number) for number in numbers)
    assert statistics.reason == "no error to take statistics of"
    assert statistics.bias.holds is None
    assert statistics.bias_is_significant is None


def test_one_error_has_a_mean_but_no_spread():
    statistics = component_statistics([0.03], X, 0.05)
    assert statistics.mean == statistics.max_abs == 0.03
    assert math.isnan(statistics.std)
    assert math.isnan(statistics.ci_low)
    assert math.isnan(statistics.bias.smallest_limit)
    assert "single" in statistics.reason


def test_two_errors_have_a_very_wide_interval():
    statistics = component_statistics([0.02, 0.04], X, 0.05)
    # t with one degree of freedom is 12.7.
    assert statistics.ci_high - statistics.mean == pytest.approx(12.7062 * 0.01, abs=1e-6)


@pytest.mark.parametrize("last_bits", [0.0, 1e-16])
def test_equal_errors_do_not_make_the_mean_certain(last_bits):
    statistics = component_statistics([0.02, 0.02, 0.02 + last_bits], X, 0.05)
    assert statistics.std == 0
    assert math.isnan(statistics.ci_low)
    assert statistics.bias.holds is None
    assert "same number" in statistics.reason


def test_opposite_angles_have_no_mean():
    statistics = component_statistics([0.0, math.pi], THETA, 0.05)
    assert math.isnan(statistics.mean)
    assert "cancel" in statistics.reason


def test_poses_in_space_go_the_same_way():
    errors = np.random.default_rng(3).normal(0, 0.01, (30, 6))
    statistics = error_statistics(errors, SPATIAL, [0.05] * 6)
    assert [one.component.name for one in statistics] == ["x", "y", "z", "yaw", "pitch", "roll"]
    assert [one.mean for one in statistics] == pytest.approx(list(errors.mean(0)), abs=1e-15)


def test_a_component_of_any_name_has_statistics():
    speed = Component("depth", "length", "d")
    assert component_statistics([1.0, 2.0, 3.0], speed, 0.05).median == 2.0


def test_the_largest_errors_come_first_column_by_column():
    errors = np.array([[0.1, -0.5], [-0.3, 0.2], [0.2, 0.4]])
    assert by_magnitude(errors).tolist() == [[1, 0], [2, 2], [0, 1]]
