"""Normalised errors of paths and sensor paths: other vehicles, other noise, missing fixes."""

import numpy as np
import pytest
from scipy import stats

from data_samples.drives import LEFT_CAMERA, DriveSettings, simulate_drive
from rtk_gt.antennas import antenna_positions
from rtk_gt.composition import compose
from rtk_gt.consistency import consistency
from rtk_gt.noise import GpsNoise
from rtk_gt.offsets import estimate_offsets
from rtk_gt.orientation import pose_of, transform_of
from rtk_gt.path import vehicle_path
from rtk_gt.steps import common_steps
from validation.poses import SPATIAL, pose_difference

SENSOR_COVARIANCE = np.diag(np.square([0.002] * 3 + [np.radians(0.1)] * 3))
CONDITIONS = {
    "three receivers": DriveSettings(),
    "four receivers": DriveSettings(receivers=4),
    "five receivers": DriveSettings(receivers=5),
    "a tenth of the fixes missing": DriveSettings(missing=0.1),
    "twice the noise, eta 2.5": DriveSettings(noise=GpsNoise(0.0128, 2.5), loops=3),
    "slopes of 5 degrees": DriveSettings(steepest=float(np.radians(5.0)), loops=3),
}
QUICK = ("five receivers", "a tenth of the fixes missing")


def squares_of(seed, settings):
    """Sums of normalised squares of path and sensor path over some poses, and their number."""
    drive = simulate_drive(seed, settings)
    steps = common_steps(drive.records, drive.frame)
    offsets = estimate_offsets(steps, eta=settings.noise.eta)
    others = drive.antennas[3:] if len(drive.antennas) > 3 else None
    antennas = antenna_positions(offsets.distances, drive.antennas[:3, 2], others)
    rows = np.flatnonzero(steps.complete)[offsets.weights > 0]
    path = vehicle_path(steps.select(rows), offsets, antennas)
    path = path.select(np.arange(seed % 4, len(path), 4))
    errors = pose_difference(path.poses, drive.poses(path.times), SPATIAL)
    joint = errors.ravel() @ np.linalg.solve(path.joint_covariance, errors.ravel())
    # One pose of the sensor path: the offsets' error, which all share, is new in each drive.
    generator = np.random.default_rng([seed, 3])
    one = path.select(np.array([generator.integers(len(path))]))
    sensor = LEFT_CAMERA + generator.standard_normal(6) * np.sqrt(np.diag(SENSOR_COVARIANCE))
    truth = pose_of(drive.T_local_vehicle(one.times) * transform_of(sensor[None]))
    found = compose(one.poses, one.covariances, LEFT_CAMERA, SENSOR_COVARIANCE)
    error = pose_difference(found.poses, truth, SPATIAL)[0]
    return float(joint), errors.size, float(error @ np.linalg.solve(found.covariances[0], error))


def check(settings, seeds):
    joint, count, sensor = np.array([squares_of(seed, settings) for seed in seeds]).T
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
        drive = simulate_drive(seed, DriveSettings(receivers=receivers))
        steps = common_steps(drive.records, drive.frame)
        offsets = estimate_offsets(steps)
        good = steps.select(np.flatnonzero(steps.complete)[offsets.weights > 0])
        noise = GpsNoise(offsets.sigma, 1.75)
        found = consistency(good.corrected(offsets.offsets).positions, offsets.distances, noise)
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


def test_nine_in_ten_false_fixes_are_taken_out_of_the_path():
    """One across both of its distances changes neither by much: no single step can show it."""
    settings = DriveSettings(false_fixes=0.01)
    far, poses = 0, 0
    for seed in range(600, 620):
        drive = simulate_drive(seed, settings)
        steps = common_steps(drive.records, drive.frame)
        offsets = estimate_offsets(steps)
        antennas = antenna_positions(offsets.distances, drive.antennas[:3, 2])
        rows = np.flatnonzero(steps.complete)[offsets.weights > 0]
        path = vehicle_path(steps.select(rows), offsets, antennas)
        errors = pose_difference(path.poses, drive.poses(path.times), SPATIAL)
        squares = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(path.covariances), errors)
        far += int((squares > stats.chi2(6).isf(1e-8)).sum())
        poses += len(path)
    assert far < 0.1 * (1 - 0.99**3) * poses
