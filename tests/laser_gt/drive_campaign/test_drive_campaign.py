"""A campaign with a drive: from its files to errors at stops, and what is told where it fails."""

import json

import numpy as np
import pytest
from drives import squared
from scipy.stats import chi2

from data_samples.motion.files import write_laser_drive
from data_samples.motion.laser import laser_drive
from laser_gt.drive_campaign.figures import drive_map, drive_sigmas, map_points
from laser_gt.drive_campaign.inputs import drive_inputs
from laser_gt.drive_campaign.solve import result_of, solve_drive_campaign
from laser_gt.driving.drive import solve_log
from laser_gt.scans.planar import wrapped
from validation.campaign.folder import load_campaign
from validation.errors import InputError
from validation.solving import solve_validation
from validation.systems import installed_systems
from validation.trajectories.formats import read_trajectory


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("drive")
    write_laser_drive(path, laser_drive(5, minutes=0.5, surveyed=3))
    return path


def _loaded(folder):
    return solve_validation(load_campaign(folder), installed_systems())


@pytest.fixture(scope="module")
def solved(folder):
    campaign = _loaded(folder)
    inputs, stops = drive_inputs(campaign)
    outcome = solve_log(inputs, 1, lambda _what, _share: None)
    return campaign, outcome, result_of(outcome, stops, campaign)


def test_a_drive_is_compared_at_its_stops_and_written_as_a_trajectory(folder, solved, tmp_path):
    _, outcome, result = solved
    truth = json.loads((folder / "truth" / "laser.json").read_text())
    assert abs(outcome.delay_s - truth["delay_s"]) < 0.002
    (table,) = result.tables
    true = read_trajectory(folder / "truth" / "trajectory.csv")
    path = tmp_path / "t.csv"
    path.write_text(result.files["trajectory_laser_drive.csv"])
    written = read_trajectory(path)
    times = written.times_since(true.epoch)
    place = np.column_stack([np.interp(times, true.times, column) for column in true.poses.T[:2]])
    assert np.sqrt(((written.positions - place) ** 2).sum(1).mean()) < 0.01
    assert written.has_covariance.all()
    headings = np.interp(times, true.times, np.unwrap(true.poses[:, 2]))
    errors = wrapped(written.poses - np.column_stack([place, headings]))
    # two anchors and the mount are shared: nine numbers that all poses have in common
    low, high = chi2.ppf([0.0005, 0.9995], 9) / 3
    assert low < squared(errors, outcome).mean() < high
    assert set(table.ids) >= set(outcome.anchors)
    assert {one.code for one in result.findings} >= {"drive_placed", "drive_clock", "drive_anchors"}


def test_the_map_and_the_uncertainty_are_drawn(solved):
    _, outcome, result = solved
    assert len(map_points(outcome)) > 1000
    assert drive_map(outcome).axes
    assert len(drive_sigmas(outcome).axes) == 2
    assert any("drive" in section.title for section in result.sections)


def test_what_is_not_stated_is_named_with_its_key(folder, tmp_path):
    toml = (folder / "campaign.toml").read_text()
    bare = tmp_path / "campaign.toml"
    bare.write_text(toml[: toml.index("[laser_drive.scanners")])
    scans = tmp_path / "laser" / "drive"
    scans.mkdir(parents=True)
    (scans / "scans.csv").write_text((folder / "laser/drive/scans.csv").read_text())
    with pytest.raises(InputError) as caught:
        solve_drive_campaign(load_campaign(tmp_path))
    fields = {problem.field for problem in caught.value.problems}
    assert fields == {"laser_drive.scanners.front.mount", "laser_drive.scanners.front.mount_sigmas"}


def test_a_reference_without_a_surveyed_pose_is_refused(folder, tmp_path):
    import shutil

    shutil.copytree(folder, tmp_path / "c")
    toml = tmp_path / "c" / "campaign.toml"
    text = toml.read_text()
    start = text.index("reference = ")
    toml.write_text(text[:start] + 'reference = ["nowhere"]' + text[text.index("]", start) + 1 :])
    with pytest.raises(InputError, match="nowhere"):
        drive_inputs(_loaded(tmp_path / "c"))
