"""Sentences that say what the numbers say."""

from dataclasses import replace

import numpy as np
import pytest
from small_campaigns import three_stops

from validation.campaign.folder import Comparison
from validation.poses.pose_table import PoseTable
from validation.statistics.conclusions import conclusions
from validation.statistics.evaluation import evaluate


def many(shift, sigma, spread=0.01, n=20):
    rng = np.random.default_rng(6)
    covariances = np.tile(np.diag([sigma**2] * 3), (n, 1, 1))
    truth = rng.uniform(-2, 2, (n, 3))
    ids = tuple(str(i) for i in range(n))
    noise = rng.normal(0, spread, (n, 3))
    return (
        PoseTable("survey", ids, truth, covariances / 100),
        PoseTable("rig", ids, truth - shift + noise, covariances),
    )


def codes(findings):
    return [finding.code for finding in findings]


def test_a_bias_is_told_with_its_interval_and_the_bound_that_holds(ad23_poses):
    findings = conclusions(evaluate(ad23_poses["survey"], ad23_poses["vision"]))
    first = findings[0]
    assert first.severity == "warning"
    assert first.subject == "vision"
    assert first.text == (
        "There is a bias in x: +0.0804 m (95 % interval, wider than Student's t, as neighbours "
        "depend on each other, n = 20: +0.0056 to +0.1551 m). It cannot be claimed with 95 % "
        "confidence that it is below 0.05 m, only that it is below 0.1332 m."
    )
    # Student's own is from +0.0633 to +0.0975 m, and holds for independent errors only.
    assert "dependent_errors" in codes(findings)


def test_the_normal_interval_is_named_as_such(ad23_poses):
    evaluation = evaluate(ad23_poses["survey"], ad23_poses["vision"], method="normal")
    assert "95 % interval, normal, n = 20: +0.0643 to +0.0964 m" in conclusions(evaluation)[0].text


def test_a_small_bias_is_good_news():
    findings = conclusions(evaluate(*many(0.0, 0.01)))
    assert findings[0].severity == "good"
    assert findings[0].text.startswith("No bias in x is shown")
    assert "It is below 0.05 m with 95 % confidence" in findings[0].text


def test_a_significant_bias_below_the_limit_is_noted():
    settings = Comparison(acceptable_bias_length=0.08, acceptable_bias_angle=0.08)
    findings = conclusions(evaluate(*many(0.05, 0.01), settings))
    assert findings[0].severity == "note"
    assert findings[0].code == "bias"


@pytest.mark.parametrize(
    ("sigma", "code", "words"),
    [
        (0.01, "nees_inside", "fit the stated covariances"),
        (0.002, "nees_above", "larger than the stated covariances allow"),
        (0.1, "nees_below", "smaller than the stated covariances say"),
    ],
)
def test_the_direction_in_which_covariances_are_wrong_is_told(sigma, code, words):
    findings = conclusions(evaluate(*many(0.0, sigma)))
    found = next(finding for finding in findings if finding.code.startswith("nees"))
    assert found.code == code
    assert words in found.text


def test_one_stop_gives_no_bias_and_no_exception():
    one = three_stops("survey").select(["1"])
    findings = conclusions(evaluate(one, three_stops("rig", shift=0.1)))
    assert codes(findings)[:3] == ["bias_unknown"] * 3
    assert "a single error has no spread (n = 1)" in findings[0].text
    coverage = next(finding for finding in findings if finding.code == "coverage")
    assert "without a validation pose, which are not judged: 2, 3" in coverage.text


def test_the_reference_pose_of_a_frame_is_noticed(ad23_poses):
    findings = conclusions(evaluate(ad23_poses["survey"], ad23_poses["laser_genetic"]))
    zero = next(finding for finding in findings if finding.code == "zero_error")
    assert "pose 6 are zero" in zero.text
    for system in ("vision", "laser_scanmatch"):
        others = conclusions(evaluate(ad23_poses["survey"], ad23_poses[system]))
        assert "zero_error" not in codes(others)


def test_a_pose_is_hardly_ever_taken_for_a_reference_by_chance():
    seen = 0
    for seed in range(300):
        errors = np.random.default_rng(seed).normal(0, 0.05, (26, 3))
        ids = tuple(str(i) for i in range(26))
        evaluation = evaluate(PoseTable("survey", ids, errors), PoseTable("rig", ids, 0 * errors))
        seen += "zero_error" in codes(conclusions(evaluation))
    # 26 poses, each with a chance of (0.0054)^3: 300 campaigns give 0.0012 cases.
    assert seen == 0


def test_the_largest_errors_are_named(ad23_poses):
    findings = conclusions(evaluate(ad23_poses["survey"], ad23_poses["laser_genetic"]))
    largest = next(finding for finding in findings if finding.code == "largest_errors")
    assert "theta +0.5909 rad at pose 11" in largest.text


def test_a_bias_that_the_survey_alone_may_cause_is_not_put_on_the_system():
    # 20 stops with a common error of the Vframe of 5 mm, and 1 mm of their own.
    n = 20
    joint = np.kron(np.full((n, n), 0.005**2), np.eye(3)) + 0.001**2 * np.eye(3 * n)
    validation, gt = many(0.006, 0.001, spread=0.001)
    covariances = np.tile((0.005**2 + 0.001**2) * np.eye(3), (n, 1, 1))
    surveyed = replace(validation, covariances=covariances, joint=joint)
    found = conclusions(evaluate(surveyed, gt))[0]
    assert found.code == "bias_within_stated"
    assert found.severity == "note"
    assert "(its standard deviation is 0.0050 m)" in found.text
    # The same errors against a survey without such a common part are the system's own.
    assert conclusions(evaluate(validation, gt))[0].code == "bias"
