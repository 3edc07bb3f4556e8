"""Campaigns with errors that last: what is said of them, and how their poses are marked."""

import csv
from typing import NamedTuple

import numpy as np
import pytest
from trials.lasting_errors import Errors, made_drive
from trials.straight_roads import write_road

from rtk_gt.campaign.solve import solve_campaign
from rtk_gt.receivers.steps import Steps
from rtk_gt.system import result_of
from validation.campaign.folder import load_campaign
from validation.errors import GtvalError

QUIET = Errors(0.003)


class Made(NamedTuple):
    """What `result_for` takes of a drive."""

    steps: Steps


def result_for(folder, made):
    write_road(folder, made.steps)
    return result_of(solve_campaign(load_campaign(folder)))


def finding(result, code):
    (found,) = [one for one in result.findings if one.code == code]
    return found


def test_a_jump_of_all_receivers_is_said_marked_and_written(tmp_path):
    made = made_drive(51, QUIET, seconds=200.0)
    rows = np.arange(500, len(made.steps))
    result = result_for(tmp_path / "c", made.jumped([0, 1, 2], rows, np.array([0.1, 0.05, 0.05])))
    found = finding(result, "jump")
    assert found.text.startswith("A jump: all receivers are off by 1")
    size = found.sizes[0]
    # 3.5 standard deviations: the interval is of 95 %.
    assert abs(size.value - np.sqrt(0.015)) < 3.5 / 1.96 * (size.high - size.value)
    marked = np.array(["jump taken out" in source for source in result.tables[0].sources])
    times = np.array([float(one) for one in result.tables[0].ids])
    np.testing.assert_array_equal(marked, times > made.steps.times[499] + 0.01)
    (row,) = csv.DictReader(result.files["rtk_jumps.csv"].splitlines())
    assert row["receivers"] == "all receivers"
    assert float(row["start"]) == made.steps.times[500]
    assert row["end"] == ""


def test_what_a_jump_of_all_may_hide_in_is_said(tmp_path):
    steps = made_drive(51, QUIET, seconds=200.0).steps
    whole = finding(result_for(tmp_path / "a", Made(steps)), "jumps_unseen")
    assert "Over a gap" not in whole.text
    assert "So may one of some of them, or a false fix, of less than some" in whole.text
    sizes = [one.value for one in whole.sizes]
    assert len(sizes) == 8  # of all and of some, level and upwards: of 95 and of 5 in a hundred
    assert all(often >= seldom for often, seldom in zip(sizes[::2], sizes[1::2], strict=True))
    of_all, level, up = sizes[0], sizes[4], sizes[6]
    assert 0 < of_all < 0.12
    # Errors are 1.75 times as large upwards, and the vehicle shakes that way.
    assert 0.02 < level < up < 0.25
    times = steps.times - steps.times[0]
    cut = steps.select((times < 80) | (times > 90))
    found = finding(result_for(tmp_path / "b", Made(cut)), "jumps_unseen")
    assert "Over a gap one of any size would not: 1 lasts more than 2 s" in found.text
    assert found.sizes[-1].value == 1


def test_a_leap_of_all_that_no_base_station_makes_is_never_taken_out(tmp_path):
    made = made_drive(51, QUIET, seconds=200.0)
    rows = np.arange(500, len(made.steps))
    with pytest.raises(GtvalError, match=r"receivers leap by 2[45] m.*No restart of"):
        result_for(tmp_path / "c", made.jumped([0, 1, 2], rows, np.array([20.0, 15.0, 0.0])))


def test_a_false_fix_that_lasts_is_one_line_and_no_pose(tmp_path):
    made = made_drive(52, QUIET, seconds=200.0)
    rows = np.arange(400, 520)
    result = result_for(tmp_path / "c", made.jumped([2], rows, np.array([0.0, 0.0, 0.15])))
    assert "front_right is off by 1" in finding(result, "lasting_false_fix").text
    times = np.array([float(one) for one in result.tables[0].ids])
    inside = (times > made.steps.times[400] - 0.01) & (times < made.steps.times[520] - 0.01)
    assert not inside.any()


def test_what_receivers_state_beyond_their_distances_is_common_to_all(tmp_path):
    made = made_drive(53, QUIET, seconds=120.0)
    write_road(tmp_path / "c", made.steps)
    for path in (tmp_path / "c" / "rtk").iterdir():
        head, *lines = path.read_text().splitlines()
        lines = [f"{line},0.015,0.015,0.030" for line in lines]
        path.write_text("\n".join([f"{head},sigma_east,sigma_north,sigma_up", *lines]) + "\n")
    outcome = solve_campaign(load_campaign(tmp_path / "c"))
    sigmas = np.sqrt(np.diagonal(outcome.path.covariances, axis1=1, axis2=2)).mean(0)
    # A mean of three has the common part whole, and a third of the variance of its own.
    np.testing.assert_allclose(sigmas[:3], [0.0148, 0.0148, 0.030], rtol=0.03)
    assert outcome.common.source == "stated"
    assert "all receivers share" in finding(result_of(outcome), "common_errors").text


def test_what_a_moving_base_states_is_in_all_poses(tmp_path):
    """The way from the base has none of its errors, so that no distance shows them."""
    steps = made_drive(53, QUIET, seconds=120.0).steps
    write_road(tmp_path / "c", steps)
    toml, text = tmp_path / "c" / "campaign.toml", ""
    for k, name in enumerate(steps.receivers[1:], 1):
        way = steps.positions[:, k] - steps.positions[:, 0]
        rows = np.column_stack([steps.times, way])[np.isfinite(way).all(1)].tolist()
        text = "\n".join(f"{t:.3f},{x!r},{y!r},{z!r},4" for t, x, y, z in rows)
        path = tmp_path / "c" / "rtk" / f"{name}.csv"
        path.write_text(f"time,east,north,height,fix\n{text}\n")
        line = f'name = "{name}"\n'
        toml.write_text(toml.read_text().replace(line, f'{line}base = "{steps.receivers[0]}"\n'))
    open_base = result_of(solve_campaign(load_campaign(tmp_path / "c")))
    assert "common_sigma" in finding(open_base, "base_noise_open").text
    path = tmp_path / "c" / "rtk" / f"{steps.receivers[0]}.csv"
    head, *lines = path.read_text().splitlines()
    lines = [f"{line},0.006,0.006,0.010" for line in lines]
    path.write_text("\n".join([f"{head},sigma_east,sigma_north,sigma_up", *lines]) + "\n")
    told = result_of(solve_campaign(load_campaign(tmp_path / "c")))
    assert "base states an error of 6.0 mm" in finding(told, "common_errors").text
    more = told.tables[0].covariances - open_base.tables[0].covariances
    np.testing.assert_allclose(
        np.diagonal(more, axis1=1, axis2=2).mean(0)[:3], [36e-6, 36e-6, 1e-4], rtol=0.02
    )


def test_a_setting_states_what_all_receivers_share(tmp_path):
    made = made_drive(54, QUIET, seconds=120.0)
    write_road(tmp_path / "c", made.steps)
    toml = tmp_path / "c" / "campaign.toml"
    text = toml.read_text()
    assert solve_campaign(load_campaign(tmp_path / "c")).common.source == "none"
    toml.write_text(text.replace("[rtk]\n", "[rtk]\ncommon_sigma = 0.02\ncommon_time = 600\n"))
    outcome = solve_campaign(load_campaign(tmp_path / "c"))
    sigmas = np.sqrt(np.diagonal(outcome.path.covariances, axis1=1, axis2=2)).mean(0)
    np.testing.assert_allclose(sigmas[:3], [0.0201, 0.0201, 0.0353], rtol=0.03)
    assert "for 600 s" in finding(result_of(outcome), "common_errors").text


def test_a_clock_that_is_off_is_said(tmp_path):
    made = made_drive(55, QUIET, seconds=200.0, delays=(0.0, 0.0, 0.5))
    found = finding(result_for(tmp_path / "c", made), "receiver_clock")
    assert "stamps of front_right are 0.500 s early" in found.text


def rounded(folder, decimals):
    """The logs of a campaign with so many decimals of degrees."""
    for path in (folder / "rtk").glob("*.csv"):
        header, *rows = path.read_text().splitlines()
        assert header.startswith("time,latitude,longitude,")
        cells = [row.split(",") for row in rows]
        short = [
            ",".join([cell[0], *(f"{float(one):.{decimals}f}" for one in cell[1:3]), *cell[3:]])
            for cell in cells
        ]
        path.write_text("\n".join([header, *short]) + "\n")


def test_rounding_of_level_positions_is_said_and_no_error_that_lasts(tmp_path):
    made = made_drive(52, QUIET, seconds=100.0)
    write_road(tmp_path, made.steps)
    results = {}
    for decimals in (9, 7, 6):
        rounded(tmp_path, decimals)
        results[decimals] = result_of(solve_campaign(load_campaign(tmp_path)))
    codes = {decimals: {one.code for one in one.findings} for decimals, one in results.items()}
    assert "coarse_positions" not in codes[9]
    # 11 mm: 3.2 mm of rounding beside 3 mm of noise count; 11 cm make errors that last.
    assert finding(results[7], "coarse_positions").severity == "warning"
    found = finding(results[6], "coarse_positions")
    assert found.severity == "error"
    assert found.sizes[0].value == pytest.approx(0.1117, rel=1e-2)
    assert not codes[6] & {"jump", "lasting_false_fix", "jumps_unseen"}
