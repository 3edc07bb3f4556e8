"""Jumps and false fixes that last, of one receiver and of two, as far as their motion tells."""

from dataclasses import replace

import numpy as np
import pytest
from trials.lasting_errors import Errors, made_drive

from rtk_gt.lasting.errors import errors_of_one
from rtk_gt.positions.result import positions_result
from rtk_gt.positions.solve import solve_positions
from validation.campaign.folder import load_campaign

HEADER = "time,latitude,longitude,height,fix,sigma_east,sigma_north,sigma_up\n"


def campaign_of(folder, steps, columns):
    """A campaign of some receivers of steps, as tables with stated sigmas."""
    text = 'name = "Drive"\n[rtk]\n'
    frame = steps.frame
    degrees = np.degrees([frame.latitude, frame.longitude]).tolist()
    text += f"origin = {{ latitude = {degrees[0]!r}, longitude = {degrees[1]!r}, height = "
    text += f"{float(frame.height)!r} }}\n"
    for k in columns:
        places = frame.to_geodetic(steps.positions[:, k]) * [180 / np.pi, 180 / np.pi, 1.0]
        rows = [
            f"{time:.3f},{place[0]!r},{place[1]!r},{place[2]!r},fixed,0.004,0.004,0.007"
            for time, place in zip(steps.times, places.tolist(), strict=True)
            if np.isfinite(place).all()
        ]
        name = steps.receivers[k]
        (folder / f"{name}.csv").write_text(HEADER + "\n".join(rows) + "\n")
        text += f'[[rtk.receivers]]\nname = "{name}"\nfile = "{name}.csv"\nheight = 0.1\n'
    (folder / "campaign.toml").write_text(text)
    return load_campaign(folder)


def test_a_false_fix_upwards_of_one_receiver_is_left_out(tmp_path):
    made = made_drive(4001, Errors(0.004))
    rows = np.arange(1200, 1320)
    bad = made.jumped([1], rows, np.array([0.0, 0.0, 0.15]))
    outcome = solve_positions(campaign_of(tmp_path, bad.steps, [1]))
    (error,) = outcome.lasting
    assert abs(error.start - bad.steps.times[1200]) < 0.41
    assert abs(error.end - bad.steps.times[1320]) < 0.41
    # The size agrees with its own sigma: 3 sigmas of three numbers.
    assert abs(error.size[2] - 0.15) < 4 * np.sqrt(error.covariance[2, 2])
    assert not outcome.fixed[1200:1320].any()
    assert outcome.record.fixed.all()
    assert outcome.fixed_share == 1.0
    result = positions_result(outcome)
    assert {"lasting_false_fix", "positions_fixed"} <= {one.code for one in result.findings}
    assert "left out as false" in next(
        one.text for one in result.findings if one.code == "positions_fixed"
    )
    assert "rtk_jumps.csv" in result.files
    assert "false fix that lasts" in result.files["rtk_positions.csv"]


def test_an_error_of_one_whose_end_shows_first_still_begins_before_it():
    """Its end is clearer than its beginning, which is looked for from there."""
    steps = made_drive(4002, Errors(0.003)).steps
    positions = steps.positions[:, 1:2].copy()
    positions[1505:1717] += [0.029, -0.074, 0.0]
    one = replace(
        steps, receivers=steps.receivers[1:2], positions=positions, kinds=steps.kinds[:, 1:2]
    )
    (error,) = errors_of_one(one)[0]
    assert abs(error.start - steps.times[1505]) < 0.41
    assert abs(error.end - steps.times[1717]) < 0.41


def test_a_jump_that_stays_is_taken_out_and_in_the_covariance(tmp_path):
    made = made_drive(4003, Errors(0.003))
    bad = made.jumped([1], np.arange(1500, 3000), np.array([0.12, -0.05, 0.1]))
    outcome = solve_positions(campaign_of(tmp_path, bad.steps, [1]))
    (error,) = outcome.lasting
    assert error.stays
    true = made.steps.positions[:, 1]
    off = (outcome.positions - true)[1520:].mean(0)
    assert (np.abs(off) < 4 * np.sqrt(np.diagonal(error.covariance))).all()
    before, after = outcome.covariances[100, 0, 0], outcome.covariances[2000, 0, 0]
    assert after == pytest.approx(before + error.covariance[0, 0])
    assert outcome.remarks[2000] == "jump taken out"


def test_clean_drives_of_one_receiver_raise_no_alarm(tmp_path):
    """And what could not be seen is said: at 1 Hz jumps of decimetres."""
    fast = solve_positions(campaign_of(tmp_path, made_drive(4004, Errors(0.005)).steps, [1]))
    assert not fast.lasting
    slow = made_drive(4005, Errors(0.004), every=(1.0, 1.0, 1.0))
    outcome = solve_positions(campaign_of(tmp_path, slow.steps, [0]))
    assert not outcome.lasting
    said = [one.text for one in positions_result(outcome).findings if one.code == "jumps_unseen"]
    assert said
    assert said[0].startswith("A jump of less than some")


def test_a_false_fix_of_the_second_of_two_receivers_turns_no_heading(tmp_path):
    made = made_drive(4002, Errors(0.003))
    bad = made.jumped([1], np.arange(900, 1000), np.array([0.0, 0.3, 0.0]))
    outcome = solve_positions(campaign_of(tmp_path, bad.steps, [0, 1]))
    assert outcome.headings is not None, outcome.without_heading
    (error,) = outcome.lasting
    assert error.receivers == (1,)
    during = (outcome.headings.times >= error.start) & (outcome.headings.times < error.end)
    assert not during.any()
    assert not outcome.left_out.any()
