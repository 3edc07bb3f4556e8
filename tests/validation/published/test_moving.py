import json

import numpy as np
import pytest
from click.testing import CliRunner
from moving_robots import robot_between_stops

from validation.campaign.folder import load_campaign
from validation.cli import main
from validation.errors import InputError
from validation.poses.angles import wrap
from validation.poses.pose_table import PoseTable, from_csv, to_csv
from validation.poses.trajectory import Trajectory
from validation.run import run_campaign
from validation.run_files import write_results
from validation.trajectories.formats import write_trajectory

SURVEY = np.array([0.0015, 0.0015, 0.002])


def moving_campaign(folder, more='stops = "stops.csv"', *, turn=0.0, seed=5):
    """A campaign of surveyed stops and a motion capture that saw the robot drive."""
    seen, stops, truth = robot_between_stops(seed, rate=25, memory=0.5)
    c, s = np.cos(turn), np.sin(turn)
    poses = seen.poses @ [[c, s, 0], [-s, c, 0], [0, 0, 1]]
    poses[:, 2] = wrap(poses[:, 2] + turn)
    (folder / "gt").mkdir(parents=True)
    write_trajectory(Trajectory("mocap", seen.times, poses), folder / "gt" / "mocap.csv", "csv")
    lines = [f"{stop.name},{stop.start + 0.2:.3f},{stop.end - 0.2:.3f}\n" for stop in stops]
    (folder / "stops.csv").write_text("pose,from,to\n" + "".join(lines))
    noise = np.random.default_rng(seed).normal(size=truth.shape) * SURVEY
    covariances = np.tile(np.diag(SURVEY**2), (len(stops), 1, 1))
    surveyed = PoseTable("survey", tuple(s.name for s in stops), truth + noise, covariances)
    (folder / "gt" / "survey.csv").write_text(to_csv(surveyed))
    (folder / "campaign.toml").write_text(
        'name = "hall"\n[[published]]\nsystem = "survey"\nfile = "gt/survey.csv"\n'
        f'[[published]]\nsystem = "mocap"\nfile = "gt/mocap.csv"\n{more}\n'
    )
    return folder


def test_a_moving_ground_truth_has_the_statistics_of_stops(tmp_path):
    run = run_campaign(load_campaign(moving_campaign(tmp_path / "c")))
    (evaluation,) = run.evaluations
    assert len(evaluation.comparison) == 26
    # The survey's 1.5 mm rule; the mean of some 150 poses adds a third of a millimetre.
    for statistics in evaluation.statistics[:2]:
        assert 0.8e-3 < statistics.std < 2.4e-3
        assert abs(statistics.mean) < 4 * 1.6e-3 / np.sqrt(26)
    # 78 numbers: their NEES is 1 +- sqrt(2 / 78) a number.
    assert 0.5 < np.mean(evaluation.comparison.nees) / 3 < 1.6


@pytest.mark.parametrize(("more", "turn"), [("", 0.0), ('frame = "own"', 1.2)])
def test_standstills_are_named_by_the_survey(tmp_path, more, turn):
    campaign = load_campaign(moving_campaign(tmp_path / "c", more, turn=turn))
    run = run_campaign(campaign)
    (evaluation,) = run.evaluations
    assert len(evaluation.comparison) >= 18
    assert evaluation.comparison.distances.max() < 0.01
    codes = {finding.code for finding in run.findings}
    assert "standstills" in codes
    assert ("frame_fitted" in codes) == bool(turn)
    write_results(run)
    assert (campaign.results / "stops_mocap.csv").exists()


def test_what_a_run_read_is_in_its_record(tmp_path):
    campaign = load_campaign(moving_campaign(tmp_path / "c"))
    write_results(run_campaign(campaign))
    step = json.loads((campaign.results / "run.json").read_text())["steps"]["mocap"]
    assert set(step["inputs"]) == {"campaign.toml", "gt/mocap.csv", "stops.csv"}


def test_stops_of_another_clock_are_refused_by_name(tmp_path):
    folder = moving_campaign(tmp_path / "c")
    (folder / "stops.csv").write_text("pose,from,to\n0,1700000000,1700000010\n")
    with pytest.raises(InputError, match="of one clock") as error:
        run_campaign(load_campaign(folder))
    assert "stops.csv" in str(error.value)


def test_positions_alone_cannot_hide_the_missing_heading(tmp_path):
    folder = moving_campaign(tmp_path / "c")
    seen, _, _ = robot_between_stops(5, rate=25, memory=0.5)
    points = Trajectory("mocap", seen.times, seen.positions, "points_plane")
    write_trajectory(points, folder / "gt" / "mocap.csv", "csv")
    (evaluation,) = run_campaign(load_campaign(folder)).evaluations
    assert [statistics.component.name for statistics in evaluation.statistics] == ["x", "y"]


def test_trajectories_are_compared_in_time_with_the_one_that_is_named(tmp_path):
    folder = moving_campaign(tmp_path / "c")
    seen, _, _ = robot_between_stops(5, rate=25, memory=0.5)
    # A second source: 5 mm of noise of its own, every other frame.
    noise = np.random.default_rng(0).normal(size=(len(seen), 3)) * 0.005
    other = Trajectory("b", seen.times[::2], (seen.poses + noise)[::2])
    write_trajectory(other, folder / "gt" / "b.csv", "csv")
    with (folder / "campaign.toml").open("a") as toml:
        toml.write('[[published]]\nsystem = "b"\nfile = "gt/b.csv"\njudged = false\n')
    assert "no_time_reference" in {f.code for f in run_campaign(load_campaign(folder)).findings}
    with (folder / "campaign.toml").open("a") as toml:
        toml.write('[time]\nreference = "mocap"\n')
    campaign = load_campaign(folder)
    run = run_campaign(campaign)
    (compared,) = run.in_time.comparisons
    # Same poses at the same times: only the 5 mm in x and y are left.
    assert compared.rms_position.rms == pytest.approx(0.005 * np.sqrt(2), rel=0.1)
    write_results(run)
    lines = (campaign.results / "errors_in_time_b.csv").read_text().splitlines()
    assert len(lines) == len(compared) + 1
    (folder / "campaign.toml").write_text(
        (folder / "campaign.toml").read_text().replace('reference = "mocap"', 'reference = "mokap"')
    )
    with pytest.raises(InputError, match="there are: mocap, b"):
        run_campaign(load_campaign(folder))


def test_compare_takes_a_table_and_a_trajectory(tmp_path):
    folder = moving_campaign(tmp_path / "c", turn=0.7)
    command = ["compare", str(folder / "gt" / "survey.csv"), str(folder / "gt" / "mocap.csv")]
    stops = ["--stops", str(folder / "stops.csv"), "--align", "frame", "--json"]
    told = json.loads(CliRunner().invoke(main, [*command, *stops]).stdout)
    assert told["systems"]["mocap"]["rms_position_m"] < 0.005
    assert "frame_fitted" in {finding["code"] for finding in told["findings"]}
    wrong = CliRunner().invoke(main, ["compare", *command[:0:-1]])
    assert wrong.exit_code == 2
    assert "give the table of stops first" in wrong.output


def test_a_published_table_in_millimetres_is_bad_input(tmp_path):
    folder = moving_campaign(tmp_path / "c")
    table = from_csv(folder / "gt" / "survey.csv")
    wrong = PoseTable("mm", table.ids, table.poses * [1000, 1000, 1])
    (folder / "gt" / "mm.csv").write_text(to_csv(wrong))
    with (folder / "campaign.toml").open("a") as toml:
        toml.write('[[published]]\nsystem = "mm"\nfile = "gt/mm.csv"\n')
    with pytest.raises(InputError, match="in metres: they are in millimetres") as error:
        run_campaign(load_campaign(folder))
    assert "mm.csv" in str(error.value)
