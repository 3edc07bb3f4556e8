"""A mount that is stated wrongly, and odometry that slips, in drives whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from drives import drive_inputs_of, errors_of, squared
from scipy.stats import chi2

from data_samples.motion.laser import laser_drive
from laser_gt.drive_campaign.told import drive_findings
from laser_gt.driving.drive import solve_log
from laser_gt.driving.mount_check import contradicts
from laser_gt.placing.mounts import mount_hint
from laser_gt.scans.planar import between, compose, inverse, wrapped
from validation.poses.trajectory import Trajectory


@pytest.fixture(scope="module")
def drive():
    return laser_drive(6, minutes=0.5, surveyed=3)


def _solved(drive):
    return solve_log(drive_inputs_of(drive), 1, lambda _what, _share: None)


@pytest.mark.parametrize(
    "off",
    [pytest.param([0.05, 0.0, 0.0], marks=pytest.mark.full), [0.0, 0.0, np.pi]],
    ids=["5 cm", "half a turn"],
)
def test_a_wrong_mount_is_named_and_the_drive_goes_on_with_the_one_found(drive, off):
    true = drive.stated_mount
    outcome = _solved(replace(drive, stated_mount=wrapped(true + np.array(off))))
    check = outcome.mount_check
    assert contradicts(check)
    # the true mount differs from the stated one by one sigma of a tape measure, too
    assert (np.abs(wrapped(check.found.mount - true)) < 4 * check.sigmas).all()
    assert (check.sigmas < [0.02, 0.02, 0.02]).all()
    (error,) = [one for one in drive_findings(outcome) if one.severity == "error"]
    assert error.code == "drive_mount"
    assert ("half a turn" in error.text) == (off[2] == np.pi)
    errors = errors_of(drive, outcome)
    assert np.sqrt((errors[:, :2] ** 2).sum(1).mean()) < 0.01
    low, high = chi2.ppf([0.0005, 0.9995], 9) / 3
    assert low < squared(errors, outcome).mean() < high


def test_odometry_of_another_point_is_told_from_a_wrong_mount_by_the_survey(drive):
    point = np.array([-0.3, 0.05, 0.0])
    given = drive.odometry
    off = Trajectory("odometry", given.times, compose(given.poses, point), epoch=given.epoch)
    outcome = _solved(replace(drive, odometry=off))
    assert outcome.mount_check.of_point
    (said,) = [one for one in drive_findings(outcome) if one.severity in {"error", "warning"}]
    assert said.code == "drive_odometry_point"
    found = compose(outcome.mount_check.stated, inverse(outcome.mount_check.found.mount))
    assert (np.abs(wrapped(found - point)) < 4 * outcome.mount_check.sigmas).all()
    errors = errors_of(drive, outcome)
    low, high = chi2.ppf([0.0005, 0.9995], 9) / 3
    assert low < squared(errors, outcome).mean() < high


def _slipping(drive, rng):
    """The odometry of a drive, with 30 mrad more for each root of a radian that it turns."""
    given = drive.odometry
    steps = between(given.poses[:-1], given.poses[1:])
    steps[:, 2] += 0.03 * np.sqrt(np.abs(steps[:, 2])) * rng.normal(size=len(steps))
    poses = [given.poses[0]]
    for step in steps:
        poses.append(compose(poses[-1], step))
    return Trajectory("odometry", given.times, np.array(poses), epoch=given.epoch)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.full)])
def test_odometry_that_slips_in_turns_costs_no_scan_and_no_honesty(seed):
    drive = laser_drive(20 + seed, minutes=0.5, surveyed=3)
    outcome = _solved(replace(drive, odometry=_slipping(drive, np.random.default_rng(seed))))
    assert not contradicts(outcome.mount_check)
    assert outcome.matched.mean() > 0.97
    errors = errors_of(drive, outcome)
    # three surveyed stops and the mount are shared; the delay as well
    low, high = chi2.ppf([0.0005, 0.9995], 9) / 3
    assert low < squared(errors, outcome).mean() < high
    # no pose is off by what its covariance makes one in a million, with room for a few people
    assert (squared(errors, outcome) > chi2.isf(1e-6, 3)).mean() < 0.01


def _pushed(drive, times, by):
    """The odometry of a drive in which the robot turns at some times without its wheels."""
    given = drive.odometry
    steps = between(given.poses[:-1], given.poses[1:])
    steps[np.searchsorted(given.times, times), 2] -= by
    poses = [given.poses[0]]
    for step in steps:
        poses.append(compose(poses[-1], step))
    return Trajectory("odometry", given.times, np.array(poses), epoch=given.epoch)


def test_a_robot_that_is_pushed_is_followed_by_its_scans():
    drive = laser_drive(7, minutes=0.5, surveyed=3)
    times = drive.odometry.times[0] + np.array([9.0, 17.0, 24.0])
    outcome = _solved(replace(drive, odometry=_pushed(drive, times, 0.2)))
    assert 3 <= len(outcome.slips) <= 5
    assert outcome.doubt is None
    assert not contradicts(outcome.mount_check)
    errors = errors_of(drive, outcome)
    low, high = chi2.ppf([0.0005, 0.9995], 9) / 3
    assert low < np.median(squared(errors, outcome)) < high
    # all but the scan at the push itself, whose beams are put right with a wrong speed
    assert (np.abs(errors[:, 2]) > 0.02).sum() <= 3


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ([180.0, 50.0, 0.02], "millimetres"),
        ([0.18, 0.05, np.rad2deg(0.2)], "degrees"),
        ([0.18, -0.05, 0.2], "y has the wrong sign"),
        ([0.05, 0.18, 0.2], "exchanged"),
        ([0.23, 0.05, 0.2], ""),
        ([0.181, 0.05, 0.2], ""),
    ],
)
def test_a_slip_of_the_pen_is_said(stated, said):
    found = np.array([0.18, 0.05, 0.02 if stated[0] > 100 else 0.2])
    hint = mount_hint(np.array(stated), found)
    assert said in hint if said else not hint
