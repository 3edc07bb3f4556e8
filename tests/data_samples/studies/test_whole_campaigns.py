"""Whole campaigns over many rooms, by the plans beside this file: intervals hold the truth.

Bounds are those of the study's own intervals, of 99.9 %: each is crossed by one run in a thousand
of a program that is right.
"""

from pathlib import Path

import pytest
from scipy import stats

from data_samples.studies.plan import read_plan
from data_samples.studies.study import run_study

PLANS = Path(__file__).parent / "plans"


def studied(name, folder):
    return run_study(read_plan(PLANS / f"{name}.toml"), folder)


def honest(one):
    """Whether the errors of a system are as large as it says."""
    return (
        one.inside.low <= 0.999 and one.inside.value > 0.98 and one.nees.low <= 1 <= one.nees.high
    )


@pytest.mark.full
def test_surveys_are_as_good_as_they_say_and_a_wrong_reading_is_found(tmp_path):
    study = studied("surveys", tmp_path)
    right, *wrong = study.plan.settings
    (own,) = [one for one in study.honesty if one.setting == right]
    assert own.poses == own.stops == 4 * len(study.plan.seeds)
    assert honest(own), own
    found = dict.fromkeys(study.plan.settings, 0)
    for label, trials in study.trials.items():
        found[label] = sum(any(code == "blunder" for _, code, _ in one.findings) for one in trials)
    # One in twenty right surveys may be accused, by the level of the test.
    count = len(study.plan.seeds)
    assert found[right] <= stats.binom.ppf(0.999, count, 0.05)
    assert min(found[label] for label in wrong) >= stats.binom.ppf(0.001, count, 0.95)


@pytest.mark.full
def test_poses_by_scanners_are_as_good_as_they_say(tmp_path):
    study = studied("scanners", tmp_path)
    laser = [one for one in study.honesty if one.system.startswith("laser")]
    assert laser
    for one in laser:
        assert one.poses == one.stops
        assert honest(one), one
