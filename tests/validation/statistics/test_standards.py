"""Errors in the words of standards, against published tables and independent computations."""

import csv
import io

import numpy as np
import pytest
from scipy import special, stats
from scipy.signal import lfilter

from validation.campaign.folder import Comparison as ComparisonSettings
from validation.poses.pose_table import PLANAR, PoseTable
from validation.statistics.evaluation import evaluate
from validation.statistics.standards.budget import Contribution, budget
from validation.statistics.standards.from_errors import errors_of, tolerances, worth
from validation.statistics.standards.laboratories import agreement, en_numbers
from validation.statistics.standards.repeats import pose_repeats, same_places
from validation.statistics.standards.rows import standards_csv
from validation.statistics.standards.success import success
from validation.statistics.standards.summary import TOGETHER, standards_json, standards_of
from validation.statistics.standards.tables import standards_section
from validation.statistics.standards.tolerance import (
    fewest_values,
    free_bound,
    normality_p_value,
    one_sided_factor,
    two_sided_factor,
)


def tables(errors, covariance=None, positions=None):
    """A survey and a system that errs by so much."""
    n = len(errors)
    ids = tuple(str(i + 1) for i in range(n))
    rng = np.random.default_rng(4)
    poses = np.column_stack([rng.uniform(-5, 5, (n, 2)), rng.uniform(-3, 3, n)])
    if positions is not None:
        poses[:, :2], poses[:, 2] = positions, 0.5
    covariances = np.empty(0) if covariance is None else np.tile(covariance, (n, 1, 1))
    survey = PoseTable("survey", ids, poses, covariances)
    return survey, PoseTable("rig", ids, poses - errors, covariances)


def normal_errors(n, seed, sigma=(0.01, 0.01, 0.005)):
    return np.random.default_rng(seed).normal(size=(n, 3)) * sigma


# Hahn and Meeker, Statistical Intervals (1991), tables A.10b and A.12b; ISO 16269-6, annexes.
@pytest.mark.parametrize(
    ("n", "content", "confidence", "one_sided", "two_sided"),
    [
        (10, 0.95, 0.95, 2.911, 3.393),
        (20, 0.95, 0.95, 2.396, 2.760),
        (30, 0.95, 0.95, 2.220, 2.555),
        (5, 0.95, 0.95, 4.203, 5.077),
        (100, 0.95, 0.95, 1.927, 2.234),
        (10, 0.90, 0.95, 2.355, 2.856),
        (20, 0.99, 0.99, 3.832, 4.175),
    ],
)
def test_factors_are_those_of_the_printed_tables(n, content, confidence, one_sided, two_sided):
    assert one_sided_factor(n, content, confidence) == pytest.approx(one_sided, abs=6e-4)
    assert two_sided_factor(n, content, confidence) == pytest.approx(two_sided, abs=6e-4)


def test_normal_intervals_hold_their_share_as_often_as_stated():
    rng = np.random.default_rng(1)
    values = rng.normal(size=(20_000, 12))
    mean, std = values.mean(1), values.std(1, ddof=1)
    k = two_sided_factor(12, 0.9, 0.8)
    held = special.ndtr(mean + k * std) - special.ndtr(mean - k * std) >= 0.9
    # Standard deviation of a share of 0.8 in 20,000 trials: 0.0028.
    assert held.mean() == pytest.approx(0.8, abs=4 * 0.0028)
    above = special.ndtr(mean + one_sided_factor(12, 0.9, 0.8) * std) >= 0.9
    assert above.mean() == pytest.approx(0.8, abs=4 * 0.0028)


def test_bounds_by_order_take_the_published_numbers_of_values():
    # Wilks: 59 values for the largest, 93 for the second and 124 for the third largest.
    assert fewest_values() == 59
    for n, rank in ((59, 58), (92, 91), (93, 91), (123, 121), (124, 121)):
        assert free_bound(np.arange(n)).bound == rank
    short = free_bound(np.arange(20))
    assert np.isnan(short.bound)
    assert short.largest == 19
    assert short.reached == pytest.approx(1 - 0.95**20)


def test_bounds_by_order_hold_for_a_distribution_that_is_far_from_normal():
    rows = np.random.default_rng(2).standard_t(3, size=(4000, 70))
    bounds = np.array([free_bound(np.abs(row)).bound for row in rows])
    held = stats.t.cdf(bounds, 3) * 2 - 1 >= 0.95
    assert held.mean() == pytest.approx(1 - 0.95**70, abs=4 * 0.0027)


def test_the_test_for_normal_errors_keeps_its_level_and_agrees_with_shapiro_wilk():
    rng = np.random.default_rng(3)
    clean = [normality_p_value(row) for row in rng.normal(size=(2000, 20))]
    assert np.mean(np.array(clean) < 0.05) == pytest.approx(0.05, abs=4 * 0.0049)
    row = rng.standard_t(3, size=60)
    ours, theirs = normality_p_value(row), stats.shapiro(row).pvalue
    assert abs(np.log(ours / theirs)) < 1.5 or max(ours, theirs) < 1e-3
    assert np.isnan(normality_p_value([1, 2, 3]))


def test_dependent_errors_are_counted_or_the_interval_is_withheld():
    rng = np.random.default_rng(5)
    for correlation, n in ((0.0, 20), (0.5, 20), (0.8, 60), (0.95, 60)):
        missed = printed = 0
        for _ in range(50):
            noise = rng.normal(size=(n + 200, 3)) * 0.01
            series = lfilter([np.sqrt(1 - correlation**2)], [1, -correlation], noise, axis=0)[-n:]
            one = tolerances(errors_of(evaluate(*tables(series))), 0.95, 0.95)[0]
            if np.isfinite(one.low):
                printed += 1
                held = special.ndtr(one.high / 0.01) - special.ndtr(one.low / 0.01)
                missed += held < 0.95
        # 5 % are stated; of 50 tables more than 7 miss once in 200 times.
        assert missed <= 7, (correlation, n)
        assert printed >= (38 if correlation < 0.1 else 0)


def test_lasting_errors_are_told_with_the_interval():
    drift = np.linspace(-0.05, 0.05, 30)[:, None] * [1, 1, 0.2] + normal_errors(30, 6, 1e-3)
    found = standards_of(evaluate(*tables(drift)))
    assert "does not hold" in found.tolerances[0].reason
    assert not found.success_holds
    assert np.isnan(found.success.low)
    assert worth(normal_errors(6, 1)) == (6, "")  # too few to tell


def test_success_is_the_bound_of_clopper_and_pearson():
    # 30 trials without failure show 90.5 % with 95 % confidence; 0.05 = p^30.
    assert success(30, 30).low == pytest.approx(0.05 ** (1 / 30))
    known = stats.binomtest(19, 20, alternative="greater").proportion_ci(0.95, method="exact")
    assert success(20, 19).low == pytest.approx(known.low)
    assert success(20, 0).low == 0
    assert success(1, 1).needed == 59
    with pytest.raises(ValueError, match="3 successes of 2"):
        success(2, 3)


def test_stops_succeed_within_both_limits():
    errors = np.zeros((4, 3))
    errors[1, 0], errors[2, 2] = 0.06, -0.06
    found = standards_of(evaluate(*tables(errors + normal_errors(4, 1, 1e-4))))
    assert (found.success.n, found.success.successes) == (4, 2)


def test_accuracy_and_repeatability_are_those_of_a_computation_by_hand():
    # Four visits at the corners of a square of 2 mm round (10, 20) mm: all distances are
    # sqrt(2) mm, so that S_l is zero.
    corners = np.array([[11, 21], [9, 21], [9, 19], [11, 19]]) * 1e-3
    found = pose_repeats(corners, [0.01, 0.03, 0.01, 0.03], "A")
    assert found.accuracy == pytest.approx(np.hypot(10, 20) * 1e-3)
    assert found.repeatability == pytest.approx(np.sqrt(2) * 1e-3)
    assert found.accuracy_angle == pytest.approx(0.02)
    assert found.repeatability_angle == pytest.approx(3 * 0.01 * np.sqrt(4 / 3))
    assert not found.enough
    with pytest.raises(ValueError, match="two visits"):
        pose_repeats(corners[:1])


def test_repeatability_of_many_visits_is_that_of_a_rayleigh_distribution():
    visits = np.random.default_rng(7).normal(size=(40_000, 2))
    found = pose_repeats(visits)
    expected = np.sqrt(np.pi / 2) + 3 * np.sqrt(2 - np.pi / 2)
    assert found.repeatability == pytest.approx(expected, rel=0.01)
    assert found.enough
    assert np.isnan(found.accuracy_angle)


def test_only_places_that_are_visited_again_are_repeats():
    rng = np.random.default_rng(8)
    spots = np.repeat([[0.0, 0.0], [4.0, 1.0]], 5, axis=0) + rng.normal(size=(10, 2)) * 0.02
    assert same_places(spots) == [[0, 1, 2, 3, 4], [5, 6, 7, 8, 9]]
    turned = np.array([0.0, 0.1, 3.0, -0.1, 0.05, *[1.0] * 5])
    assert same_places(spots, turned)[0] == [0, 1, 3, 4]
    path = np.column_stack([np.arange(200) * 0.05, np.zeros(200)])
    assert same_places(path) == []


def test_repeats_of_a_system_are_told_at_its_places():
    spots = np.repeat([[0.0, 0.0], [4.0, 1.0]], 6, axis=0)
    errors = normal_errors(12, 9) + np.array([0.03, 0.04, 0])
    [first, second] = standards_of(evaluate(*tables(errors, positions=spots))).repeats
    assert (first.place, second.place) == ("1", "7")
    assert first.accuracy == pytest.approx(0.05, abs=4 * 0.01 / np.sqrt(6))


def test_en_numbers_are_one_at_twice_the_combined_uncertainty():
    assert en_numbers(0.10, 0.03, 0.04) == pytest.approx(1.0)
    assert np.isnan(en_numbers(0.1, np.nan, 0.04))
    numbers = en_numbers(np.array([0.05, -0.2]), 0.03, 0.04)
    found = agreement("x", numbers, ("a", "b"))
    assert (found.n, found.satisfactory, found.stop) == (2, 1, "b")
    assert found.largest == pytest.approx(-2)
    assert agreement("x", np.array([np.nan]), ("a",)) is None


def test_right_uncertainties_are_satisfactory_in_954_of_1000():
    covariance = np.diag([1e-4, 1e-4, 2.5e-5])
    errors = normal_errors(2000, 10) * np.sqrt(2)
    [x, _, _] = standards_of(evaluate(*tables(errors, covariance))).agreements
    assert x.satisfactory / x.n == pytest.approx(0.9545, abs=4 * 0.0047)


def test_the_budget_of_an_end_gauge_is_that_of_the_guide():
    # JCGM 100:2008, H.1: 32 nm, 16 degrees of freedom, k = 2.92, U99 = 93 nm.
    lines = [
        Contribution("standard", 25, 18),
        Contribution("difference", 9.7, 25.6, "A"),
        Contribution("expansion", 2.9, 50),
        Contribution("temperature", 16.6, 2),
    ]
    found = budget("length", "nm", lines, 0.99)
    assert round(found.combined) == 32
    assert found.freedom == 16
    assert round(found.coverage, 2) == 2.92
    assert found.expanded == pytest.approx(93, abs=1)
    # H.1.3.2: the comparator's 9.7 nm are of 5.8, 3.9 and 6.7 nm with 24, 5 and 8.
    parts = [Contribution(n, u, f) for n, u, f in (("d", 5.8, 24), ("r", 3.9, 5), ("s", 6.7, 8))]
    comparator = budget("difference", "nm", parts)
    assert comparator.combined == pytest.approx(9.7, abs=0.05)
    assert comparator.freedom == 25


def test_lines_from_the_same_data_count_as_one():
    # s^2 (1 + 1/n) is known by n - 1 degrees of freedom, however many lines it is written in.
    n, s = 20, 0.01
    lines = [
        Contribution("noise", s, n - 1, "A", "errors"),
        Contribution("mean", s / np.sqrt(n), n - 1, "A", "errors"),
    ]
    found = budget("x", "m", lines)
    assert found.freedom == n - 1
    assert found.coverage == pytest.approx(stats.t.ppf(0.975, n - 1))
    stated = budget("x", "m", [Contribution("stated", s)])
    assert stated.coverage == pytest.approx(stats.norm.ppf(0.975))


def test_a_budget_holds_the_next_error_as_often_as_it_says():
    # U is that of an error to come, minus the mean so far: a prediction interval.
    rng = np.random.default_rng(11)
    held = []
    for _ in range(150):
        errors = rng.normal(size=(16, 3)) * 0.01
        evaluation = evaluate(*tables(errors[:15]))
        for made in standards_of(evaluation).budgets:
            column = ["x", "y", "theta"].index(made.name)
            held.append(abs(errors[15, column] - errors[:15, column].mean()) <= made.expanded)
    assert len(held) > 380
    assert np.mean(held) == pytest.approx(0.95, abs=0.04)


def test_stated_uncertainty_of_the_survey_is_taken_from_the_scatter():
    covariance = np.diag([1e-4, 1e-4, 2.5e-5]) / 4
    found = standards_of(evaluate(*tables(normal_errors(500, 12), covariance)))
    lines = {line.name: line.uncertainty for line in found.budgets[0].contributions}
    assert lines["survey"] == pytest.approx(0.005)
    # The scatter of 500 errors is known to 3 %.
    assert lines["own noise"] == pytest.approx(0.01 * np.sqrt(0.75), rel=0.12)
    assert lines[TOGETHER] == pytest.approx(0.01 / np.sqrt(500), rel=0.12)
    assert found.budgets[0].missing == ()
    without = standards_of(evaluate(*tables(normal_errors(500, 12)))).budgets[0]
    assert without.missing == ("survey",)


def test_all_numbers_are_in_the_file_the_chapter_and_the_json():
    covariance = np.diag([1e-4, 1e-4, 2.5e-5]) / 2
    settings = ComparisonSettings(acceptable_bias_length=0.02)
    found = standards_of(evaluate(*tables(normal_errors(80, 13), covariance)), settings)
    rows = list(csv.DictReader(io.StringIO(standards_csv([found]))))
    assert {row["method"] for row in rows} == {"ISO 16269-6", "ASTM F3499", "ISO 13528", "JCGM 100"}
    section = standards_section([found])
    assert section.folded
    assert "20" not in [block.title for block in section.blocks[:-1]]
    told = standards_json(found)
    high = next(row for row in rows if row["quantity"].startswith("high") and row["subject"] == "x")
    assert float(high["value"]) == told["tolerance"]["x"]["high"]
    assert told["success"]["limit_position_m"] == 0.02
    assert {one.name for one in PLANAR} == set(told["budget"])
