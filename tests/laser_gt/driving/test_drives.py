"""A robot that drives becomes a trajectory that fits its stated uncertainty."""

from dataclasses import replace

import numpy as np
import pytest
from drives import drive_inputs_of, errors_of, squared
from scipy.stats import chi2

from data_samples.motion.laser import laser_drive
from laser_gt.driving.drive import solve_log

pytestmark = pytest.mark.full


def _solved(drive, **changes):
    return solve_log(replace(drive_inputs_of(drive), **changes), 1, lambda _what, _share: None)


@pytest.fixture(scope="module")
def short():
    """A minute among people and glass, and what is made of it."""
    drive = laser_drive(21, minutes=1.0, surveyed=4)
    return drive, _solved(drive)


def test_a_drive_among_people_and_glass_is_placed_to_millimetres(short):
    drive, outcome = short
    errors = errors_of(drive, outcome)
    assert np.sqrt((errors[:, :2] ** 2).sum(1).mean()) < 0.010
    assert np.sqrt((errors[:, 2] ** 2).mean()) < 0.003
    assert outcome.matched.mean() > 0.98
    # four surveyed stops and the mount are shared: 15 numbers that all poses have in common
    low, high = chi2.ppf([0.0005, 0.9995], 15) / 5
    assert low < squared(errors, outcome).mean() < high


def test_the_delay_of_the_scanner_is_found_to_two_milliseconds(short):
    drive, outcome = short
    assert abs(drive.delay_s) > 0.005  # there is one to be found
    assert abs(outcome.delay_s - drive.delay_s) < 0.002


def test_stamps_that_shift_by_a_second_shift_the_delay_by_a_second(short):
    drive, outcome = short
    later = [replace(scan, time=scan.time + 1.0) for scan in drive.scans]
    moved = _solved(drive, scans={"front": later})
    assert np.isclose(moved.delay_s, outcome.delay_s - 1.0, atol=0.002)


def test_without_odometry_the_scans_find_the_way_alone(short):
    drive, _ = short
    outcome = _solved(drive, odometer=None, own_clock=False)
    truth = replace(outcome, trajectory=outcome.trajectory.shifted(drive.delay_s))
    errors = errors_of(drive, truth)
    # the anchors' times are 0.1 s off, in which a robot that stands does not move
    assert np.sqrt((errors[:, :2] ** 2).sum(1).mean()) < 0.010


def test_without_surveyed_stops_the_frame_is_that_of_the_first_pose(short):
    drive, _ = short
    outcome = _solved(drive, stops=())
    assert outcome.trajectory.frame == "own"
    assert np.abs(outcome.trajectory.poses[0]).max() < 1e-6
    assert outcome.anchors == ()
    sigmas = np.sqrt(np.diagonal(outcome.trajectory.covariances, axis1=1, axis2=2))
    assert sigmas[0].max() < 2e-6  # by definition
    assert sigmas[1:].min() > 1e-5


def test_two_processes_make_what_one_makes(short):
    drive, outcome = short
    both = solve_log(drive_inputs_of(drive), 2, lambda _what, _share: None)
    assert np.abs(both.trajectory.poses - outcome.trajectory.poses).max() < 1e-9


def test_twenty_drives_fit_their_covariances():
    """Line by line: 10 mm and 3 mrad, delays within 2 ms, mean squared errors 2.4 to 3.9."""
    means = []
    for seed in range(20):
        drive = laser_drive(seed, minutes=20.0)
        outcome = _solved(drive)
        errors = errors_of(drive, outcome)
        assert np.sqrt((errors[:, :2] ** 2).sum(1).mean()) < 0.010
        assert np.sqrt((errors[:, 2] ** 2).mean()) < 0.003
        assert abs(outcome.delay_s - drive.delay_s) < 0.002
        means.append(squared(errors, outcome).mean())
    assert 2.4 < np.mean(means) < 3.9
