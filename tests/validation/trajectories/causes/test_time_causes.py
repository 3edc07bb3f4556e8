"""Causes of errors in time: formulas against independent ones, and simulated drives with truth."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from trials.drives_in_time import Drive, simulate

from validation.errors import GtvalError
from validation.explain.telling.in_time import time_findings, time_json, time_parameter_table
from validation.poses.angles import wrap
from validation.poses.trajectory import Trajectory
from validation.trajectories.causes.chain import CAUSES, PARAMETERS, Moving, corrected, slopes
from validation.trajectories.causes.explanation import time_causes
from validation.trajectories.causes.noise import (
    Noise,
    Whitener,
    effective_number,
    estimate_noise,
)
from validation.trajectories.causes.weighing import all_sets

SHORT = Drive(seconds=100.0, outliers=0.02, flips=0.02, lost=0.05)
TRUTH = {"mount_x": 0.03, "mount_y": -0.02, "mount_theta": 0.02, "delay": -0.1}


def test_whitening_is_the_inverse_of_the_covariance_at_any_stamps():
    rng = np.random.default_rng(1)
    times = np.cumsum(rng.uniform(0.05, 0.4, 60))
    used = rng.random(60) > 0.2
    noise = Noise(0.7, 1.3, 0.8)
    whole = 1.3**2 * np.exp(-np.abs(times[:, None] - times) / 0.8) + 0.7**2 * np.eye(60)
    whole = whole[np.ix_(used, used)]
    values = rng.normal(size=(60, 2))
    whiten = Whitener(times, used, noise)
    # Condition numbers are below 100: a dozen digits are left of sixteen.
    assert whiten(values)[used] == pytest.approx(np.linalg.solve(whole, values[used]), abs=1e-11)
    assert (whiten(values)[~used] == 0).all()
    assert whiten.log_determinant == pytest.approx(np.linalg.slogdet(whole)[1], abs=1e-9)
    mean = noise.sigma**2 * np.linalg.inv(whole).sum()
    assert effective_number(times, used, noise) == pytest.approx(mean)


def test_noise_is_found_from_what_a_fit_leaves():
    """The slow part comes from 200 correlation times and two components: known to 5 to 7 %."""
    rng = np.random.default_rng(2)
    times = np.arange(4000) * 0.1
    slow = np.zeros((4000, 2))
    keep = np.exp(-0.1 / 2.0)
    for row, (_, fresh) in enumerate(pairwise(rng.normal(size=(4001, 2)))):
        slow[row] = keep * slow[row - 1] + np.sqrt(1 - keep**2) * fresh
    values = 0.004 * slow + 0.003 * rng.normal(size=slow.shape)
    by = np.ones((4000, 2, 1))
    found = estimate_noise(times, np.ones(4000, dtype=bool), values - values.mean(0), by)
    assert found.white == pytest.approx(0.003, rel=0.05)
    assert found.slow == pytest.approx(0.004, rel=0.2)
    assert found.correlation_time == pytest.approx(2.0, rel=0.45)


def test_slopes_are_those_of_the_chain():
    rng = np.random.default_rng(3)
    poses, since = rng.normal(size=(5, 3)), rng.normal(size=5)
    at = rng.normal(size=12) * 0.3
    velocity, turn = rng.normal(size=5) + 1j * rng.normal(size=5), rng.normal(size=5)
    source = corrected(at, poses, since)
    moving = Moving(source[:, 0] + 1j * source[:, 1], source[:, 2], velocity, turn)
    found = slopes(at, moving, since)
    for column, name in enumerate(PARAMETERS):
        step = np.zeros(12)
        step[column] = 1e-6
        moved = corrected(at + step, poses, since) - corrected(at - step, poses, since)
        expected = -moved / 2e-6
        if name in {"delay", "clock_drift"}:
            rate = np.column_stack([velocity.real, velocity.imag, turn])
            expected = rate * (since[:, None] if name == "clock_drift" else 1.0)
        assert found[:, :, column] == pytest.approx(expected, abs=1e-8), name


def test_every_set_of_causes_is_weighed_once():
    sets = all_sets()
    assert len(sets) == len(set(sets)) == 3 * 2 ** (len(CAUSES) - 2)
    assert not any({"mount", "turn"} <= set(one) for one in sets)


def test_a_mount_and_a_delay_are_told_apart_among_outliers_and_flips():
    found = time_causes(*simulate(SHORT, 4, TRUTH))
    assert found.name == "mount_delay"
    assert found.rivals == ()
    for one in found.parameters:
        # Four standard deviations: one in 15,000 beyond.
        assert abs(one.value - TRUTH[one.name]) < 4 * one.sigma
        assert one.low < one.value < one.high
    delay = found.parameters[-1]
    assert delay.sigma < 0.001
    # The effect of a delay is the speed times it.
    assert found.causes[1].spoils == pytest.approx(0.1 * found.typical_speed, rel=0.1)
    told = time_findings(found)
    assert [one.code for one in told[:2]] == ["systematic_error"] * 2
    assert "delay -0.09" in told[1].text
    assert len(time_parameter_table(found).rows) == 4
    systems = time_json([found])["systems"]
    assert isinstance(systems, dict)
    assert systems["source"]["explanation"] == "mount_delay"


def test_a_large_frame_is_found_with_a_mount_turned_by_half():
    truth = {"frame_x": 3.0, "frame_y": -2.0, "frame_theta": 2.5, "mount_theta": 3.1}
    found = time_causes(*simulate(SHORT, 5, truth))
    assert {one.name for one in found.causes} == {"frame", "turn"}
    for one in found.parameters:
        off = one.value - truth[one.name]
        off = float(wrap(off)) if one.unit == "rad" else off
        assert abs(off) < 4 * one.sigma


def test_no_cause_is_claimed_in_a_clean_drive():
    """Seeds are fixed; one drive in twenty may claim one, so of two clean ones at most one does."""
    found = [time_causes(*simulate(SHORT, seed)) for seed in (6, 7)]
    clean = [one for one in found if one.name == "none"]
    assert clean
    told = time_findings(clean[0])
    assert told[0].code == "no_systematic_error"


def test_a_straight_drive_at_one_speed_does_not_tell_a_delay_from_a_frame_or_a_mount():
    drive = Drive(way="straight", seconds=100.0)
    found = time_causes(*simulate(drive, 8, {"delay": -0.1}))
    named = {name for causes in (*found.rivals, [c.name for c in found.causes]) for name in causes}
    assert {"delay", "frame", "mount"} <= named
    text = next(one.text for one in time_findings(found) if one.code == "rivals")
    assert "cannot be told" in text
    assert "Drive at changing speeds" in text
    assert ("frame", "delay") in found.alike


def test_a_robot_at_rest_shows_no_delay():
    found = time_causes(*simulate(Drive(way="still", seconds=100.0), 9, {"delay": -0.1}))
    assert {"delay", "clock_drift"} <= set(found.unseen)
    assert "delay" not in {one.name for one in found.causes}
    assert "cannot be seen" in " ".join(one.text for one in time_findings(found))


def test_what_cannot_be_explained_is_refused():
    reference, source = simulate(replace(SHORT, seconds=20.0), 10)
    with pytest.raises(GtvalError, match="poses at times"):
        time_causes(reference, source.shifted(1000.0))
    places = Trajectory("gps", source.times, source.positions, kind="points_plane")
    with pytest.raises(GtvalError, match="without headings"):
        time_causes(reference, places)


@pytest.mark.full
@pytest.mark.parametrize("correlation_time", [0.1, 1.0, 10.0])
def test_false_alarms_are_rare_and_intervals_hold_the_truth(correlation_time):
    """300 s; 60 drives: of 5 % at most 8 with a chance of 99 %; 10 s are few correlation times."""
    drive = replace(SHORT, seconds=300.0, correlation_time=correlation_time)
    alarms = [time_causes(*simulate(drive, seed)).name != "none" for seed in range(60)]
    assert sum(alarms) <= 8
    inside = []
    for seed in range(40):
        found = time_causes(*simulate(drive, seed, TRUTH))
        inside += [one.low <= TRUTH.get(one.name, 0.0) <= one.high for one in found.parameters]
    assert 0.88 <= np.mean(inside) <= 1.0
