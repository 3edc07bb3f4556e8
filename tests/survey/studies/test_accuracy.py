import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, chi2
from surveys import case

from survey.chapters.motions import check_poses, motion_findings, motion_table
from survey.settings import Motion
from survey.studies.accuracy import check_motion, detectable_motion, noncentrality, pose_motion
from validation.cli import main
from validation.poses.angles import wrap
from validation.poses.pose_table import PoseTable

number = st.floats(-4, 4)
REAL = np.array([0.01, 0.01, np.radians(1.0)])
FOUND = np.array([0.013192, 0.010923, np.radians(1.013083)])


def random_covariance(rng, size=6, scale=1e-3):
    root = rng.normal(size=(size, size)) * scale
    return root @ root.T + np.eye(size) * scale**2


def test_the_printed_table():
    # AD2.3, "Table with results showing the accuracy experiment"
    check = check_motion(np.zeros(3), FOUND, None, REAL)
    assert check.error[:2] == pytest.approx([0.003192, 0.000923], abs=1e-12)
    assert np.degrees(check.error[2]) == pytest.approx(0.013083, abs=1e-10)
    assert np.isnan(check.p_value)


def test_the_printed_numbers_give_the_printed_errors_in_the_table_shown():
    poses = PoseTable("survey", ("18", "18'"), np.array([[0.0, 0.0, 0.0], FOUND]))
    motion = Motion(start="18", end="18'", dx=0.01, dy=0.01, dtheta=np.radians(1.0))
    table = motion_table(motion, check_poses(poses, motion))
    formats = table.formats[1:4]
    shown = [[format(v, f) for v, f in zip(row[1:4], formats, strict=True)] for row in table.rows]
    assert shown == [
        ["0.010000", "0.013192", "+0.003192"],
        ["0.010000", "0.010923", "+0.000923"],
        ["1.000000", "1.013083", "+0.013083"],
    ]
    assert all(row[4] is None for row in table.rows)


@pytest.mark.parametrize("frame", ["gtv", "robot"])
@given(values=st.lists(number, min_size=6, max_size=6))
def test_derivatives_are_those_of_finite_differences(frame, values):
    poses = np.array(values)
    _, jacobian = pose_motion(poses[:3], poses[3:], frame)
    step = 1e-6
    for column in range(6):
        ahead, back = poses.copy(), poses.copy()
        ahead[column] += step
        back[column] -= step
        change = pose_motion(ahead[:3], ahead[3:], frame)[0]
        change = change - pose_motion(back[:3], back[3:], frame)[0]
        change[2] = wrap(change[2])
        # Central differences err by step^2 / 6 times a third derivative below 20, and rounding.
        assert jacobian[:, column] == pytest.approx(change / (2 * step), abs=1e-8)


@given(values=st.lists(number, min_size=6, max_size=6))
def test_in_the_robot_s_axes_a_motion_does_not_depend_on_where_the_frame_is(values):
    start, motion = np.array(values[:3]), np.array(values[3:])
    turn = start[2]
    end = start + np.array(
        [
            np.cos(turn) * motion[0] - np.sin(turn) * motion[1],
            np.sin(turn) * motion[0] + np.cos(turn) * motion[1],
            motion[2],
        ]
    )
    found, _ = pose_motion(start, end, "robot")
    assert found[:2] == pytest.approx(motion[:2], abs=1e-12)
    assert wrap(found[2] - motion[2]) == pytest.approx(0, abs=1e-12)


def test_many_motions_are_computed_at_once():
    rng = np.random.default_rng(0)
    start, end = rng.normal(size=(2, 5, 3))
    motions, jacobians = pose_motion(start, end, "robot")
    for i in range(5):
        one, jacobian = pose_motion(start[i], end[i], "robot")
        assert motions[i] == pytest.approx(one)
        assert jacobians[i] == pytest.approx(jacobian)


def test_an_error_that_both_poses_share_is_no_error_of_the_motion():
    shared = np.tile(np.diag([1e-4, 1e-4, 0.0]), (2, 2))
    own = np.eye(6) * 1e-8
    check = check_motion(np.zeros(3), REAL, shared + own, REAL)
    assert check.covariance == pytest.approx(2e-8 * np.eye(3), abs=1e-15)


@pytest.mark.parametrize("frame", ["gtv", "robot"])
def test_stated_uncertainty_covers(frame):
    rng = np.random.default_rng(21)
    covariance = random_covariance(rng)
    start, end = np.array([1.0, 2.0, 3.1]), np.array([1.02, 2.01, -3.1])
    real, _ = pose_motion(start, end, frame)
    trials, rejected = 2000, 0
    for noise in rng.multivariate_normal(np.zeros(6), covariance, trials):
        rejected += (
            check_motion(start + noise[:3], end + noise[3:], covariance, real, frame).p_value < 0.05
        )
    low, high = binom.ppf([5e-5, 1 - 5e-5], trials, 0.05)
    assert low <= rejected <= high


def test_the_uncertainty_of_the_real_motion_counts_too():
    covariance = np.eye(6) * 1e-8
    check = check_motion(np.zeros(3), REAL, covariance, REAL, "gtv", np.array([1e-3, 2e-3, 3e-3]))
    assert np.diagonal(check.covariance) == pytest.approx([1.02e-6, 4.02e-6, 9.02e-6])


def test_the_quantile_of_a_known_direction_is_the_textbook_one():
    # (1.95996 + 0.84162)^2
    assert noncentrality(1, 0.95, 0.8) == pytest.approx(7.849, abs=5e-4)
    # Cohen, Statistical Power Analysis (1988), two degrees of freedom
    assert noncentrality(2, 0.95, 0.8) == pytest.approx(9.63, abs=5e-3)


def test_a_detectable_motion_is_detected_as_often_as_stated():
    rng = np.random.default_rng(8)
    covariance = random_covariance(rng, 3)
    least = detectable_motion(covariance)
    trials = 4000
    noise = rng.multivariate_normal(np.zeros(3), covariance, trials)
    sigma = np.sqrt(np.diagonal(covariance))
    low, high = binom.ppf([5e-5, 1 - 5e-5], trials, 0.8)
    for i in range(3):
        seen = np.abs(noise[:, i] + least.components[i]) > 1.959964 * sigma[i]
        assert low <= seen.sum() <= high
    inverse = np.linalg.inv(covariance[:2, :2])
    worst = np.linalg.eigh(covariance[:2, :2])[1][:, 1]
    moved = noise[:, :2] + least.any_direction * worst
    seen = np.einsum("ni,ij,nj->n", moved, inverse, moved) > chi2.ppf(0.95, 2)
    assert low <= seen.sum() <= high


def test_motions_between_surveyed_stops_err_as_their_joint_covariance_says():
    squares = []
    for seed in range(6):
        solved = case(seed)
        table = solved.solution.pose_table()
        first, second = table.ids[:2]
        truth = solved.simulated.truth.poses.select([first, second]).poses
        real, _ = pose_motion(truth[0], truth[1], "robot")
        motion = Motion(
            start=first, end=second, dx=real[0], dy=real[1], dtheta=real[2], frame="robot"
        )
        check = check_poses(table, motion)
        assert check.correlated
        squares.append(check.squared)
    low, high = chi2.ppf([1e-3, 1 - 1e-3], 3 * len(squares))
    assert low < sum(squares) < high


def test_taking_poses_as_uncorrelated_is_said():
    covariances = np.tile(np.eye(3) * 1e-6, (2, 1, 1))
    poses = PoseTable("survey", ("a", "b"), np.array([[0.0, 0.0, 0.0], REAL]), covariances)
    motion = Motion(start="a", end="b", dx=0.01, dy=0.01, dtheta=np.radians(1))
    check = check_poses(poses, motion)
    assert check.covariance == pytest.approx(2e-6 * np.eye(3))
    assert "no_correlation" in [f.code for f in motion_findings(motion, check)]


def campaign(folder: Path, motion: str = "") -> Path:
    (folder / "survey").mkdir()
    (folder / "campaign.toml").write_text(f'name = "two poses"\n{motion}')
    (folder / "survey/published_poses.csv").write_text(
        f"pose,x,y,theta\n18,0,0,0\n18',{FOUND[0]},{FOUND[1]},{FOUND[2]}\n"
    )
    return folder


def test_the_command_takes_motions_from_the_campaign(tmp_path):
    text = f"""[[survey.motions]]
start = "18"
end = "18'"
dx = 0.01
dy = 0.01
dtheta = {np.radians(1.0)}
"""
    done = CliRunner().invoke(main, ["accuracy", str(campaign(tmp_path, text)), "--json"])
    assert done.exit_code == 0, done.output
    (motion,) = json.loads(done.output)["motions"]
    assert motion["check"]["error"][0] == pytest.approx(0.003192)
    assert motion["check"]["p_value"] is None


def test_the_command_takes_a_motion_from_its_options(tmp_path):
    options = ["--start", "18", "--end", "18'", "--dx", "0.01", "--dy", "0.01"]
    options += ["--dtheta", "1", "--degrees"]
    done = CliRunner().invoke(main, ["accuracy", str(campaign(tmp_path)), *options])
    assert done.exit_code == 0, done.output
    assert "+0.003192" in done.output
    assert "+0.013083" in done.output


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("", "no [[survey.motions]]"),
        ("--start 18", "belong together"),
        ("--start 18 --end 99 --dx 0 --dy 0 --dtheta 0", "no pose 99"),
        ("--start 18 --end 18' --dx nan --dy 0 --dtheta 0", "finite"),
    ],
)
def test_what_is_missing_is_said(tmp_path, options, said):
    done = CliRunner().invoke(main, ["accuracy", str(campaign(tmp_path)), *options.split()])
    assert done.exit_code == 2
    assert said in done.output
