"""The rig in a synthetic room whose truth is known: `gtval_room` comes with gtval."""

import json
import subprocess
import sys

import numpy as np
import pytest

import gtval

SIGMAS = (0.004, 0.004, 0.003)
OFFSET = 0.1


@pytest.fixture
def room_with_rig(gtval_room):
    """The room, with what a rig would have recorded there: true poses, noise, and an offset."""
    rng = np.random.default_rng(7)
    poses = gtval_room.truth.poses + rng.normal(0, SIGMAS, gtval_room.truth.poses.shape)
    poses[:, 0] += OFFSET
    rows = [
        f"{name},{x:.5f},{y:.5f},{theta:.5f},{2 if name == '3' else 6}\n"
        for name, (x, y, theta) in zip(gtval_room.truth.ids, poses, strict=True)
    ]
    folder = gtval_room.folder
    (folder / "mocap").mkdir()
    (folder / "mocap" / "poses.csv").write_text("pose,x,y,theta,markers\n" + "".join(rows))
    with (folder / "campaign.toml").open("a") as file:
        file.write(f"\n[mocap]\nsigmas = {list(SIGMAS)}\n")
    return gtval_room


def test_a_run_compares_the_rig_with_the_survey(room_with_rig):
    done = gtval.run_campaign(room_with_rig.folder)
    errors = next(one for one in done.evaluations if one.system == "mocap")
    # Error is validation minus GT. 11 poses of 4 mm and a survey of under 2 mm: the mean is good
    # to 1.4 mm; five of that.
    assert errors.statistics[0].mean == pytest.approx(-OFFSET, abs=0.007)
    assert errors.comparison.missing_in_gt == ("3",)
    assert "mocap_markers" in [one.code for one in done.findings if one.subject == "mocap"]


def test_the_command_line_runs_it_and_the_report_has_its_section(room_with_rig):
    folder = room_with_rig.folder
    run = [sys.executable, "-m", "gtval", "run", str(folder), "--json"]
    told = json.loads(subprocess.run(run, check=False, capture_output=True, text=True).stdout)
    assert told["systems"]["mocap"] == {"poses": 11, "left_out": ["3"]}
    assert "<h2" in (page := (folder / "report" / "report.html").read_text(encoding="utf-8"))
    assert "Motion capture" in page
    assert (folder / "results" / "poses_mocap.csv").exists()


def test_its_own_command_prints_its_poses(room_with_rig):
    command = [sys.executable, "-m", "gtval", "mocap", str(room_with_rig.folder)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "Poses of the rig" in done.stdout
    assert "Left out, too few markers: 3." in done.stdout


def test_a_missing_sigma_is_told_with_file_and_key(room_with_rig):
    toml = room_with_rig.folder / "campaign.toml"
    toml.write_text(toml.read_text().replace("sigmas = [0.004", "sigma = [0.004"))
    with pytest.raises(gtval.InputError, match=r"campaign.toml.*mocap.sigmas"):
        gtval.run_campaign(room_with_rig.folder)


def test_a_bad_number_is_told_with_file_line_and_field(room_with_rig):
    path = room_with_rig.folder / "mocap" / "poses.csv"
    path.write_text(
        path.read_text().replace("pose,x,y,theta,markers\n1,", "pose,x,y,theta,markers\n1,9")
    )
    with pytest.raises(gtval.InputError, match=r"poses.csv, line 2, field 'x'"):
        gtval.run_campaign(room_with_rig.folder)
