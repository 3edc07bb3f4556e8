"""Normalised errors and chi-squared intervals, against scipy.stats and by simulation."""

import numpy as np
import pytest
from scipy import stats

from validation.statistics.consistency import (
    chi_squared_interval,
    nees,
    normalised_errors,
    sum_test,
    verdict,
)

COVARIANCE = np.array([[4e-4, 1e-4, 1e-5], [1e-4, 2e-4, -2e-5], [1e-5, -2e-5, 1e-5]])


@pytest.mark.parametrize(("dof", "n"), [(1, 1), (3, 1), (3, 26), (6, 100)])
@pytest.mark.parametrize("confidence", [0.9, 0.95, 0.999])
def test_the_interval_is_the_quantiles_of_chi_squared(dof, n, confidence):
    expected = np.array(stats.chi2.interval(confidence, n * dof)) / n
    assert chi_squared_interval(dof, confidence, n) == pytest.approx(expected, rel=1e-9)


def test_the_documents_single_pose_interval():
    # Tables of chi-squared with 3 degrees of freedom: 0.216 and 9.348.
    assert chi_squared_interval(3) == pytest.approx((0.216, 9.348), abs=5e-4)


@pytest.mark.parametrize(("dof", "n"), [(0, 1), (3, 0), (-1, 5)])
def test_no_degrees_of_freedom_have_no_interval(dof, n):
    with pytest.raises(ValueError, match="must be positive"):
        chi_squared_interval(dof, 0.95, n)


def test_nees_is_the_textbook_formula():
    errors = np.random.default_rng(0).normal(0, 0.02, (7, 3))
    textbook = [error @ np.linalg.inv(COVARIANCE) @ error for error in errors]
    assert nees(errors, np.tile(COVARIANCE, (7, 1, 1))) == pytest.approx(textbook, rel=1e-9)


def test_nees_does_not_depend_on_the_units():
    error, scale = np.array([0.01, -0.02, 0.003]), np.diag([1e6, 1e-3, 57.3])
    expected = nees(error, COVARIANCE)
    assert nees(scale @ error, scale @ COVARIANCE @ scale) == pytest.approx(expected, rel=1e-9)


def test_without_covariance_there_is_no_nees_and_not_a_zero():
    covariances = np.stack([COVARIANCE, np.full((3, 3), np.nan)])
    scores = nees(np.zeros((2, 3)), covariances)
    assert scores[0] == 0
    assert np.isnan(scores[1])
    assert np.isnan(normalised_errors(np.ones((2, 3)), covariances)[1]).all()


@pytest.mark.parametrize(
    ("covariance", "message"),
    [
        (np.zeros((3, 3)), "not positive"),
        (np.diag([1.0, -1.0, 1.0]), "not positive"),
        (np.array([[1.0, 2.0], [2.0, 1.0]]), "not positive definite"),
    ],
)
def test_what_is_no_covariance_is_refused(covariance, message):
    with pytest.raises(ValueError, match=message):
        nees(np.ones(len(covariance)), covariance)


def test_95_percent_of_single_and_summed_scores_fall_inside():
    campaigns, n = 3000, 8
    rng = np.random.default_rng(4)
    errors = rng.multivariate_normal(np.zeros(3), COVARIANCE, (campaigns, n))
    scores = nees(errors, np.broadcast_to(COVARIANCE, (campaigns, n, 3, 3)))
    low, high = chi_squared_interval(3)
    single = int(((scores >= low) & (scores <= high)).sum())
    assert _is_plausible(single, campaigns * n, 0.95)
    verdicts = [sum_test(float(s.sum()), n, 3, 0.95, "sum").verdict for s in scores]
    assert _is_plausible(verdicts.count("inside"), campaigns, 0.95)
    assert _is_plausible(verdicts.count("below"), campaigns, 0.025)
    assert _is_plausible(verdicts.count("above"), campaigns, 0.025)


def _is_plausible(count: int, trials: int, probability: float) -> bool:
    """Whether a right procedure gives such a count, but for one case in a million."""
    return bool(
        stats.binom.ppf(5e-7, trials, probability)
        <= count
        <= stats.binom.isf(5e-7, trials, probability)
    )


def test_covariances_ten_times_too_small_are_found_out():
    errors = np.random.default_rng(5).multivariate_normal(np.zeros(3), COVARIANCE, 20)
    total = float(nees(errors, np.tile(COVARIANCE / 10, (20, 1, 1))).sum())
    test = sum_test(total, 20, 3, 0.95, "sum")
    assert test.verdict == "above"
    assert test.p_value < 1e-6


def test_the_p_value_is_two_sided():
    test = sum_test(stats.chi2.ppf(0.01, 60), 20, 3, 0.95, "sum")
    assert test.p_value == pytest.approx(0.02, rel=1e-6)
    assert test.verdict == "below"


def test_verdicts_name_the_side():
    interval = chi_squared_interval(3)
    assert [verdict(value, interval) for value in (0.1, 3.0, 20.0)] == ["below", "inside", "above"]
