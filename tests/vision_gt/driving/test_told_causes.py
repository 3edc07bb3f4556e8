"""What is said of frames that are copies, of exchanged cameras and of a clock that was set back."""

from dataclasses import replace

import numpy as np
from made_streams import bends, straight, stream

from validation.poses.trajectory import Trajectory
from vision_gt.drive_campaign.exchanged import Exchange
from vision_gt.drive_campaign.solve import CampaignDrive
from vision_gt.drive_campaign.told import drive_facts, drive_findings, drive_table
from vision_gt.driving.drive import solve_drive
from vision_gt.driving.set_back import SetBack


def solved(way, odometry=None):
    rng = np.random.default_rng(2)
    made = [stream(i, way, (0.0, 16.0), late, rng, rate=10.0)[0] for i, late in enumerate((0, 0.2))]
    return CampaignDrive(solve_drive(made, odometry), odometry, {}, ())


def told(drive):
    return {one.code: one.text for one in drive_findings(drive)}


def test_causes_are_told_with_their_sizes():
    drive = solved(bends)
    assert set(told(drive)) == {"drive_seen"}
    assert "Against camera" in drive_table(drive).note
    found = told(
        replace(
            drive,
            repeated={"1": 12, "2": 0},
            exchanged=(Exchange(("1", "2"), (40, 30), (39, 28)),),
            set_back={"2": SetBack(2.0, 12.25, 1_700_000_000, 45)},
        )
    )
    assert found["frames_repeated"].startswith("12 frames are copies")
    assert "39 of 40" in found["drive_exchanged"]
    assert "set back by 2.00 s, when its stamps were at 1700000012.25" in found["clock_set_back"]


def test_a_camera_with_most_poses_off_the_floor_is_told():
    drive = solved(bends)
    one, other = drive.outcome.streams
    off = other.judged(np.arange(int(other.posed.sum())) < 100, "off the floor")
    outcome = replace(drive.outcome, streams=(one, off))
    assert told(replace(drive, outcome=outcome))["many_off_the_floor"].startswith("100 of")


def test_odometry_that_is_not_used_is_told_with_whose_stamps_are():
    times = np.arange(-2.0, 18.0, 0.02)
    drive = solved(straight, Trajectory("odometry", times, straight(times)))
    said, facts = told(drive)["odometry_unused"], drive_facts(drive)
    assert "drives straight at constant speed" in said
    assert f"stamps of camera {facts['reference_camera']}" in said
    assert facts["without_odometry"]
