"""A rendered drive of a whole campaign: solved, told, compared with the truth, resumed."""

import json

import numpy as np
import pytest
from scipy.stats import chi2

from data_samples.rendering.campaign import render_all
from data_samples.rendering.drive import DriveSettings, film
from data_samples.rendering.files import make_room_with_cameras
from data_samples.rooms.cameras import VisionSettings
from data_samples.rooms.rooms import RoomSettings
from validation.campaign.folder import load_campaign
from validation.poses.angles import wrap
from validation.text_files.writing import write_files
from validation.trajectories.formats import read_trajectory
from vision_gt.drive_campaign.solve import solve_campaign_drive
from vision_gt.drive_campaign.told import (
    drive_facts,
    drive_files,
    drive_findings,
    drive_sections,
)

SMALL = VisionSettings(
    cameras=2, calibration=5, snapshots=5, both=2, movie=10, blades=0.1, occlusions=0.1
)


@pytest.fixture(scope="module")
def driven(rendered, tmp_path_factory):
    """The campaign of two cameras with a drive of sixteen seconds, four frames a second."""
    import shutil

    folder = tmp_path_factory.mktemp("drive") / "campaign"
    shutil.copytree(rendered, folder)
    rng = np.random.default_rng(11)
    room_settings = RoomSettings(stops=6, runs=1, clearance=2.3, world_points=8)
    _, cameras = make_room_with_cameras(room_settings, SMALL, rng)
    made = film(cameras, DriveSettings(seconds=16.0, rate=4.0), np.random.default_rng(1))
    texts = dict(made.files)
    toml = folder / "campaign.toml"
    toml.write_text(toml.read_text() + texts.pop("campaign.toml"))
    write_files(folder, texts)
    write_files(folder, dict(render_all(made.photographs, 1)))
    return folder


def test_a_drive_is_solved_told_and_kept(driven, outcome):
    campaign = load_campaign(driven)
    # The cameras as they were solved, with the drive's own settings.
    import dataclasses

    from vision_gt.settings import VisionSettings as Stated

    vision = dataclasses.replace(outcome, settings=campaign.section("vision", Stated))
    drive = solve_campaign_drive(campaign, vision, workers=1)
    kept = {one.camera: int(one.kept.sum()) for one in drive.outcome.streams}
    assert sum(kept.values()) > 30
    files = drive_files(drive)
    write_files(driven / "results", files)
    trajectory = read_trajectory(driven / "results" / "trajectory_vision_drive.csv")
    truth = read_trajectory(driven / "truth" / "drive.csv")
    times = trajectory.times + (trajectory.epoch - truth.epoch)
    inside = (times > 0.3) & (times < truth.times[-1] - 0.3) & drive.outcome.supported
    headings = np.unwrap(truth.poses[:, 2])
    true = np.column_stack(
        [np.interp(times, truth.times, c) for c in (*truth.poses[:, :2].T, headings)]
    )
    off = trajectory.poses - true
    off[:, 2] = wrap(off[:, 2])
    # All poses share the errors of the cameras: their mean is that of one draw at worst.
    inverse = np.linalg.inv(trajectory.covariances[inside])
    scores = np.einsum("ni,nij,nj->n", off[inside], inverse, off[inside])
    assert scores.mean() < chi2.ppf(0.9999, 3)
    assert np.sqrt(np.square(off[inside, :2]).sum(1).mean()) < 0.005
    assert np.sqrt(np.square(off[inside, 2]).mean()) < 0.004
    clocks = json.loads((driven / "truth" / "drive_clocks.json").read_text())
    for name, clock in drive.outcome.clocks.items():
        if clock.verdict == "determined":
            assert abs(clock.delay_s - clocks[name]["delay_s"]) < clock.high_s - clock.low_s
    codes = {one.code for one in drive_findings(drive)}
    assert "drive_seen" in codes
    assert json.dumps(drive_facts(drive))
    sections = drive_sections(drive)
    assert sections[0].title == "Vision GT: drive"
    for block in sections[0].blocks:
        if hasattr(block, "draw"):
            block.draw()
    lines = files["vision_drive_frames.csv"].splitlines()
    assert len(lines) == 1 + sum(len(one) for one in drive.outcome.streams)
    again = solve_campaign_drive(campaign, vision, workers=1)
    np.testing.assert_array_equal(again.outcome.trajectory.poses, drive.outcome.trajectory.poses)
