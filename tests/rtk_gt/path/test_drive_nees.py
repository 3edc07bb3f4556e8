"""Normalised errors of paths and sensor paths: other vehicles, other noise, missing fixes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from trials.drives import (
    CONDITIONS,
    normalised_squares,
    offset_errors,
    solve_drive,
)

from data_samples.drives.drive import DriveSettings, simulate_drive
from rtk_gt.path.consistency import consistency
from rtk_gt.path.leaps import leaping_poses
from validation.poses.pose_table import SPATIAL, pose_difference

QUICK = ("five receivers", "a tenth of the fixes missing")


def check(settings, seeds):
    found = [normalised_squares(solve_drive(simulate_drive(seed, settings))) for seed in seeds]
    joint, count, sensor = np.array([[one.path, one.count, one.sensor] for one in found]).T
    # Sigma is estimated in each drive from about 100 steps of three distances: all normalised
    # squares of a drive are off together by a factor of standard deviation sqrt(2 / 300).
    spread = np.hypot(np.sqrt(2 * count.sum()), np.sqrt(2 / 300) * np.sqrt(np.square(count).sum()))
    assert abs(joint.sum() - count.sum()) < 3.3 * spread
    low, high = stats.chi2(6 * len(seeds)).ppf([0.0005, 0.9995])
    assert low < sensor.sum() < 1.05 * high


@pytest.mark.parametrize(("receivers", "dof"), [(4, 5), (5, 7)])
def test_q_keeps_its_bound_with_more_receivers(receivers, dof):
    """1 % of the poses should pass it; 6 drives hold about 700 poses."""
    beyond, squares, poses = 0.0, 0.0, 0
    for seed in range(700, 706):
        solved = solve_drive(simulate_drive(seed, DriveSettings(receivers=receivers)))
        steps, offsets = solved.steps, solved.offsets
        good = steps.select(np.flatnonzero(steps.complete)[offsets.weights > 0])
        positions = good.corrected(offsets.offsets).positions
        found = consistency(positions, offsets.distances, solved.noise)
        assert found.dof == dof
        beyond += found.share_beyond * len(good)
        squares += found.mean_square * len(good)
        poses += len(good)
    assert beyond / poses == pytest.approx(0.01, abs=4 * np.sqrt(0.01 / poses))
    # Offsets and noise come from the same steps: the mean lies a little below 1.
    assert squares / poses == pytest.approx(0.98, abs=4 * np.sqrt(2 / dof / poses))


@pytest.mark.parametrize("name", QUICK)
def test_nees_of_a_few_drives(name):
    check(CONDITIONS[name], range(500, 510))


@pytest.mark.full
@pytest.mark.parametrize("name", CONDITIONS)
def test_nees_of_many_drives(name):
    check(CONDITIONS[name], range(600, 680))


@pytest.mark.parametrize("receivers", [3, 4, 5])
def test_offsets_and_distances_of_short_drives_fit_their_covariance(receivers):
    """About 115 steps: too few to take a covariance of 22 unknowns from their own scatter."""
    total, size = 0.0, 0
    for seed in range(2100, 2130):
        solved = solve_drive(simulate_drive(seed, DriveSettings(receivers=receivers)))
        error = offset_errors(solved)
        total += error @ np.linalg.solve(solved.offsets.covariance, error)
        size += len(error)
    # Sigma is that of each drive: all squares of a drive are off together, by sqrt(2 / 300).
    spread = np.hypot(np.sqrt(2 * size), np.sqrt(2 / 300 / 30) * size)
    assert abs(total - size) < 3.3 * spread


def test_nine_in_ten_false_fixes_are_taken_out_of_the_path():
    """One across both of its distances changes neither by much: no single step can show it."""
    settings = DriveSettings(false_fixes=0.01)
    far, poses = 0, 0
    for seed in range(600, 620):
        drive = simulate_drive(seed, settings)
        path = solve_drive(drive).path
        errors = pose_difference(path.poses, drive.poses(path.times), SPATIAL)
        squares = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(path.covariances), errors)
        far += int((squares > stats.chi2(6).isf(1e-8)).sum())
        poses += len(path)
    assert far < 0.1 * (1 - 0.99**3) * poses


def test_what_stays_in_is_flagged_as_a_leap_and_nothing_else_is():
    settings = DriveSettings(false_fixes=0.01)
    bad = unsaid = alarms = 0
    for seed in range(3200, 3240):
        drive = simulate_drive(seed, settings)
        path = solve_drive(drive).path
        leaps = leaping_poses(path, 2.0)
        errors = pose_difference(path.poses, drive.poses(path.times), SPATIAL)
        squares = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(path.covariances), errors)
        wrong = squares > stats.chi2(6).isf(1e-5)
        bad += int(wrong.sum())
        unsaid += int((wrong & ~leaps).sum())
        alarms += int((~wrong & leaps).sum())
    assert bad > 0
    assert unsaid <= 0.25 * bad
    assert alarms <= 1


def test_a_leap_is_told_from_a_hill():
    """One height is off by 30 cm at each of three moments; hills of 10 degrees are not leaps."""
    path = solve_drive(simulate_drive(3300, DriveSettings())).path
    assert not leaping_poses(path, 2.0).any()
    rows = np.array([20, 50, 80])
    poses = path.poses.copy()
    poses[rows, 2] += 0.3
    np.testing.assert_array_equal(
        np.flatnonzero(leaping_poses(replace(path, poses=poses), 2.0)), rows
    )
    few = replace(path, poses=poses).select(np.arange(18, 22))
    assert not leaping_poses(few, 2.0).any()
