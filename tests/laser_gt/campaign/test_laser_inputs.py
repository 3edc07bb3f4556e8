"""What a campaign must state for laser GT, and what is said of all that is not used."""

from dataclasses import replace

import numpy as np
import pytest
from laser_rooms import write_campaign

from laser_gt.campaign.findings import laser_findings
from laser_gt.campaign.inputs import ASSUMED_SIGMAS, TAPE_MEASURE, as_surveyed, load_inputs
from laser_gt.campaign.solve import solve_campaign
from laser_gt.settings import LaserSettings
from validation.campaign.folder import load_campaign
from validation.errors import InputError
from validation.poses.pose_table import PoseTable, from_csv
from validation.results import SystemResult


@pytest.fixture
def campaign(tmp_path):
    write_campaign(tmp_path, seed=4, stops=3)
    return tmp_path


def _inputs(folder):
    loaded = load_campaign(folder)
    return load_inputs(loaded, loaded.section("laser", LaserSettings))


def _edit(folder, *changes):
    toml = folder / "campaign.toml"
    text = toml.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    toml.write_text(text)


def _keep(path, wanted):
    """Keep the header and the lines that are wanted."""
    head, *rows = path.read_text().splitlines(keepends=True)
    path.write_text(head + "".join(row for row in rows if wanted(row)))


def _log(folder, times=(100, 110, 120), sensors=("FLASER", "RLASER")):
    """A CARMEN log of three stops; the robot turns while it is logged."""
    text = ""
    for time in times:
        pose = f"0 0 {0.1 * time}"
        for kind in sensors:
            text += f"{kind} 181 {'3.0 ' * 181}{pose} {pose} {time} host 0.0\n"
    (folder / "laser" / "robot.log").write_text(text)
    rows = "".join(f"{stop},{time}\n" for stop, time in enumerate(times, 1))
    (folder / "laser" / "stops.csv").write_text(f"pose,time\n{rows}")
    (folder / "laser" / "odometry.csv").unlink()
    _edit(folder, ("[laser]\n", '[laser]\nformat = "carmen"\nscans = "laser/robot.log"\n'))


def test_all_facts_of_the_scanners_that_are_missing_are_named_at_once(campaign):
    toml = campaign / "campaign.toml"
    toml.write_text(toml.read_text().split("\n[laser.scanners.")[0])
    with pytest.raises(InputError) as caught:
        _inputs(campaign)
    # what one scanner sees is laid over what the other sees through both mounts
    assert [problem.field for problem in caught.value.problems] == [
        "laser.scanners.front.mount",
        "laser.scanners.rear.mount",
    ]
    assert "[laser.scanners.rear]" in str(caught.value)
    assert "mount = [0.178, 0.192, 1.571]" in str(caught.value)


def test_a_single_scanner_without_a_mount_is_itself_what_is_placed(campaign):
    _keep(campaign / "laser" / "scans.csv", lambda row: ",rear," not in row)
    toml = campaign / "campaign.toml"
    toml.write_text(toml.read_text().split("\n[laser.scanners.")[0])
    inputs = _inputs(campaign)
    assert inputs.mount.tolist() == [0, 0, 0]
    assert inputs.mount_sigmas.max() < 1e-5
    (said,) = inputs.assumed
    assert "the poses are those of the scanner" in said
    assert "[laser.scanners.front]" in said
    assert "mount_sigmas = [0.002, 0.002, 0.002]" in said


def test_a_mount_without_sigmas_is_taken_as_read_off_a_tape_measure_and_that_is_said(campaign):
    toml = campaign / "campaign.toml"
    lines = toml.read_text().splitlines()
    toml.write_text("\n".join(one for one in lines if not one.startswith("mount_sigmas")) + "\n")
    inputs = _inputs(campaign)
    assert inputs.mount_sigmas.tolist() == list(TAPE_MEASURE)
    (said,) = inputs.assumed
    assert "5 mm and 10 mrad" in said


def test_a_stated_scanner_without_a_scan_is_an_error(campaign):
    _keep(campaign / "laser" / "scans.csv", lambda row: ",rear," not in row)
    with pytest.raises(InputError, match="'rear' — there is no scan of this sensor"):
        _inputs(campaign)


def test_stops_that_one_scanner_did_not_scan_are_named(campaign):
    assert _inputs(campaign).left_out == ()
    _keep(campaign / "laser" / "scans.csv", lambda row: not row.startswith("2,rear,"))
    assert _inputs(campaign).left_out == ("there is no scan by 'rear' of the stops 2",)


def test_scans_of_a_log_by_a_scanner_that_is_not_stated_are_named(campaign):
    _log(campaign)
    toml = campaign / "campaign.toml"
    toml.write_text(toml.read_text().split("\n[laser.scanners.rear]")[0])
    inputs = _inputs(campaign)
    assert all(len(one.sweep.views) == 1 for one in inputs.sweeps)
    (said,) = inputs.left_out
    assert said.startswith("the scans of 'rear' are not used")


def test_scans_that_cannot_be_corrected_for_motion_are_named(campaign):
    # 10 s from stop to stop: what is between says nothing about the speed at a scan
    _log(campaign)
    _edit(campaign, ("[laser.scanners.front]\n", "[laser.scanners.front]\nturn_time = 0.0133\n"))
    (said,) = _inputs(campaign).left_out
    assert said.startswith("the scans by 'front' of the stops 1, 2, 3 are not corrected")


def test_either_all_scanners_have_a_file_of_their_own_or_none(campaign):
    own = ("[laser.scanners.front]\n", '[laser.scanners.front]\nscans = "laser/scans.csv"\n')
    _edit(campaign, own)
    with pytest.raises(InputError, match="state scans of rear too"):
        _inputs(campaign)


def test_a_scanners_own_file_with_scans_of_several_sensors_is_an_error(campaign):
    for name in ("front", "rear"):
        table = f"[laser.scanners.{name}]\n"
        _edit(campaign, (table, f'{table}scans = "laser/scans.csv"\n'))
    with pytest.raises(InputError, match=r"several sensors \(front, rear\)"):
        _inputs(campaign)


def test_stated_odometry_that_is_not_there_is_an_error(campaign):
    (campaign / "laser" / "odometry.csv").unlink()
    assert _inputs(campaign).odometry is None
    _edit(campaign, ("[laser]\n", '[laser]\nodometry = "laser/wheels.csv"\n'))
    with pytest.raises(InputError, match=r"wheels\.csv: there is no such file"):
        _inputs(campaign)


def test_odometry_of_other_stops_and_decisions_that_are_not_there_are_named(campaign):
    with (campaign / "laser" / "odometry.csv").open("a") as stream:
        stream.write("77,1,2,0.5\n")
    _edit(campaign, ("[laser]\n", '[laser]\ndecisions = "laser/mine.csv"\n'))
    decisions, odometry = _inputs(campaign).left_out
    assert "no file laser/mine.csv" in decisions
    assert "odometry of the stops 77 is not used" in odometry


def test_surveyed_poses_without_covariance_are_named_with_what_is_assumed(campaign):
    truth = from_csv(campaign / "truth" / "poses.csv")
    covariances = np.full((3, 3, 3), np.nan)
    covariances[0] = np.eye(3) * 1e-6
    table = PoseTable("survey", truth.ids, truth.poses, covariances)
    surveyed = as_surveyed(table)
    assert surveyed.assumed == ("2", "3")
    expected = np.concatenate([np.full(3, 1e-3), ASSUMED_SIGMAS, ASSUMED_SIGMAS])
    assert np.allclose(surveyed.covariance.matrix(), np.diag(expected**2))
    solved = replace(load_campaign(campaign), solved={"survey": SystemResult(tables=[table])})
    outcome = solve_campaign(solved, engines=("scanmatch",))
    (finding,) = [one for one in laser_findings(outcome) if one.code == "assumed_sigmas"]
    assert finding.severity == "note"
    assert "the stops 2, 3 have no covariance" in finding.text
    assert "2 mm and 3 mrad" in finding.text
