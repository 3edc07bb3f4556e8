"""One loader of stored tables: a run and what is computed from its files agree."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from small_campaigns import three_stops

from validation.campaign.folder import load_campaign
from validation.campaign.stored import read_tables, stored_tables
from validation.cli import main
from validation.errors import InputError
from validation.poses.pose_files import pose_files
from validation.run import run_campaign


def printed(*arguments: str) -> dict:
    done = CliRunner().invoke(main, [*arguments, "--json"])
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


pytestmark = pytest.mark.xdist_group("stored")  # two runs for all


@pytest.fixture(params=["ad23_run", "room_run"])
def finished(request) -> tuple[Path, dict]:
    folder, done = request.getfixturevalue(request.param)
    return folder, json.loads(done.stdout)


def test_comparing_stored_results_gives_the_numbers_of_the_run(finished):
    folder, run = finished
    again = printed("compare", str(folder))["comparisons"]
    for one in run["comparisons"]:
        (same,) = [other for other in again if other["system"] == one["system"]]
        # A run knows the explanation, which tells the budget's frame from its mount.
        assert one["standards"].pop("budget").keys() == same["standards"].pop("budget").keys()
        assert same == one
    assert len(again) == len(run["comparisons"])


def test_explaining_stored_results_gives_the_numbers_of_the_run(finished):
    folder, _ = finished
    file = folder / "results/explain/explanation.json"
    before = json.loads(file.read_text())
    again = printed("explain", str(folder))
    assert json.loads(file.read_text()) == before
    assert again["systems"] == before["systems"]


def test_a_room_has_a_joint_covariance_and_it_comes_back_to_the_last_bit(room_run):
    folder, run = room_run
    (stored,) = [t for t in stored_tables(load_campaign(folder)).tables if t.system == "survey"]
    solved = run_campaign(load_campaign(folder)).validation
    assert stored.joint is not None
    assert (stored.joint == solved.joint).all()
    assert (stored.poses == solved.poses).all()
    method = json.loads(run.stdout)["comparisons"][0]["nees_test"]["method"]
    assert method == "joint NEES, with the stated correlations between poses"


def test_bad_places_of_all_files_are_told_at_once(tmp_path):
    for name in ("a", "b"):
        (tmp_path / f"{name}.csv").write_text("pose,x,y,theta\n1,zero,0,0\n")
    with pytest.raises(InputError) as caught:
        read_tables([tmp_path / "a.csv", tmp_path / "b.csv"])
    assert [Path(one.file).name for one in caught.value.problems] == ["a.csv", "b.csv"]


def test_a_joint_covariance_of_other_poses_is_refused(tmp_path):
    one = three_stops(
        "rig", joint=np.eye(9) * 1e-4, covariances=np.tile(1e-4 * np.eye(3), (3, 1, 1))
    )
    for name, text in pose_files([one]).items():
        (tmp_path / name).write_text(text)
    assert read_tables([tmp_path / "poses_rig.csv"]).tables[0].joint is not None
    for name, text in pose_files([one.select(["1", "2"])]).items():
        if name.startswith("poses"):
            (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=r"joint_rig\.csv"):
        read_tables([tmp_path / "poses_rig.csv"])
