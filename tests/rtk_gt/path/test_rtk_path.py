"""Path and sensor paths of simulated drives against their truth."""

from dataclasses import replace

import numpy as np
import pytest
from printed_formulas import published_squared_distance_covariance
from rtk_samples import DISTANCES, NOISE, steps_of
from scipy import stats

from data_samples.drives.drive import ANTENNAS, LEFT_CAMERA, OFFSETS, DriveSettings, simulate_drive
from rtk_gt.campaign.pose_tables import vehicle_table
from rtk_gt.offsets.estimate import estimate_offsets
from rtk_gt.offsets.noise import (
    GpsNoise,
    squared_distance_covariance,
)
from rtk_gt.path.antennas import Antennas, antenna_positions
from rtk_gt.path.composition import (
    compose,
    composition_jacobians,
    published_composition,
    published_jacobian,
)
from rtk_gt.path.consistency import consistency
from rtk_gt.path.interpolation import METHODS, PUBLISHED, hold_out, interpolate, segments
from rtk_gt.path.motion_check import motion_check
from rtk_gt.path.orientation import pose_of, transform_of
from rtk_gt.path.vehicle_path import heading_span, tilt_spread, vehicle_path
from rtk_gt.receivers.steps import common_steps
from validation.errors import GtvalError
from validation.poses.pose_table import SPATIAL, pose_difference

SENSOR_COVARIANCE = np.diag(np.square([0.002] * 3 + [np.radians(0.1)] * 3))


def driven(seed, **settings):
    """A simulated drive and the path found from its records."""
    drive = simulate_drive(seed, DriveSettings(**settings))
    steps = common_steps(drive.records, drive.frame)
    offsets = estimate_offsets(steps)
    antennas = antenna_positions(offsets.distances, ANTENNAS[:, 2])
    rows = np.flatnonzero(steps.complete)[offsets.weights > 0]
    return drive, steps, offsets, vehicle_path(steps.select(rows), offsets, antennas)


def nees_of(errors, covariance):
    return float(errors.ravel() @ np.linalg.solve(covariance, errors.ravel()))


def test_nees_of_whole_paths_on_hills():
    """Joint NEES, offsets' error included, of drives with slopes up to 10 degrees."""
    total, count = 0.0, 0
    for seed in range(12):
        drive, _, _, path = driven(seed)
        path = path.select(np.arange(0, len(path), 4))
        errors = pose_difference(path.poses, drive.poses(path.times), SPATIAL)
        total += nees_of(errors, vehicle_table(path).joint_covariance)
        count += errors.size
    # Sigma of the noise is estimated too, to 1/sqrt(2 * 120 * 3) in each drive: its effect on
    # the total is 2 count / (sqrt(12) * sqrt(720)).
    spread = 3.5 * np.hypot(np.sqrt(2 * count), 2 * count / np.sqrt(12 * 720))
    assert abs(total - count) < spread


def test_nees_of_sensor_paths():
    """One pose of each of 60 drives, so that the offsets' error is new each time."""
    values = []
    for seed in range(60):
        drive, _, _, path = driven(seed, loops=1, straight=60.0)
        generator = np.random.default_rng(seed)
        one = path.select(np.array([generator.integers(len(path))]))
        sensor = LEFT_CAMERA + generator.standard_normal(6) * np.sqrt(np.diag(SENSOR_COVARIANCE))
        truth = pose_of(drive.T_local_vehicle(one.times) * transform_of(sensor[None]))
        found = compose(one.poses, one.covariances, LEFT_CAMERA, SENSOR_COVARIANCE)
        errors = pose_difference(found.poses, truth, SPATIAL)
        values.append(nees_of(errors, found.covariances[0]))
    low, high = stats.chi2(6 * 60).ppf([0.0005, 0.9995])
    assert low < sum(values) < 1.15 * high  # sigma from few steps: t-like tails


def test_offsets_matter_where_the_published_covariance_leaves_them_out():
    ratio = []
    for seed in range(10):
        drive, _, _, path = driven(seed)
        errors = pose_difference(path.poses, drive.poses(path.times), SPATIAL)
        alone = np.einsum("ti,tij,tj->t", errors, np.linalg.inv(path.noise_covariances), errors)
        ratio.append(alone.mean() / 6)
    assert np.mean(ratio) > 1.1


def test_composition_jacobians_against_finite_differences():
    generator = np.random.default_rng(0)
    vehicle = generator.uniform(-1, 1, (20, 6)) * [50, 50, 5, 3, 0.3, 0.3]
    by_vehicle, by_sensor = composition_jacobians(vehicle, LEFT_CAMERA)
    sensor = np.tile(LEFT_CAMERA, (20, 1))

    def composed(vehicle, sensor):
        return pose_of(transform_of(vehicle) * transform_of(sensor))

    step = 1e-6
    for k in range(6):
        change = step * np.eye(6)[k]
        for J, plus, minus in (
            (by_vehicle, composed(vehicle + change, sensor), composed(vehicle - change, sensor)),
            (by_sensor, composed(vehicle, sensor + change), composed(vehicle, sensor - change)),
        ):
            difference = pose_difference(plus, minus, SPATIAL) / 2 / step
            np.testing.assert_allclose(difference, J[..., k], atol=2e-6)


def test_composition_agrees_with_simulation():
    generator = np.random.default_rng(1)
    vehicle = np.array([[10.0, 5.0, 1.0, 0.8, 0.1, -0.15]])
    W = np.diag(np.square([0.01, 0.01, 0.02, 0.003, 0.005, 0.01]))
    count = 100_000
    moved = vehicle + generator.multivariate_normal(np.zeros(6), W, count)
    sensor = LEFT_CAMERA + generator.multivariate_normal(np.zeros(6), SENSOR_COVARIANCE, count)
    poses = pose_of(transform_of(moved) * transform_of(sensor))
    found = compose(vehicle, W[None], LEFT_CAMERA, SENSOR_COVARIANCE)
    spread = np.cov(pose_difference(poses, found.poses, SPATIAL).T)
    expected = np.diagonal(found.covariances[0])
    np.testing.assert_allclose(np.diagonal(spread), expected, rtol=0.03)


def test_a_sensor_that_looks_straight_down_has_no_yaw_covariance():
    down = np.array([0, 0, 0, 0, np.pi / 2, 0])
    found = compose(np.zeros((1, 6)), np.eye(6)[None] * 1e-4, down, SENSOR_COVARIANCE)
    assert np.isnan(found.covariances[0, 3:, 3:]).any()
    assert np.isfinite(found.covariances[0, :3, :3]).all()


def test_added_angles_are_right_for_a_turn_about_the_vertical_only():
    W = np.eye(6)[None] * 1e-6
    flat = np.array([[3.0, 2.0, 0.0, 1.1, 0, 0]])
    exact = compose(flat, W, LEFT_CAMERA, SENSOR_COVARIANCE)
    added = published_composition(flat, W, LEFT_CAMERA, SENSOR_COVARIANCE)
    np.testing.assert_allclose(added.poses, exact.poses, atol=1e-12)
    slope = np.array([[3.0, 2.0, 0.0, 1.1, 0.17, 0]])
    exact = compose(slope, W, LEFT_CAMERA, SENSOR_COVARIANCE)
    added = published_composition(slope, W, LEFT_CAMERA, SENSOR_COVARIANCE)
    wrong = transform_of(exact.poses[0]).rotation.inv() * transform_of(added.poses[0]).rotation
    assert np.degrees(wrong.magnitude()) > 10


def test_f14_is_misprinted():
    """Eq. 33: sin(yaw) cos(yaw) for sin(yaw) cos(pitch)."""
    vehicle = np.array([1.0, 2.0, 3.0, 0.9, 0.2, -0.1])
    sensor = np.array([2.2, 0.4, 0.1, 0, 0, 0])
    step = 1e-6
    turned = vehicle + step * np.eye(6)[3]
    x = [transform_of(pose).apply(sensor[:3])[0] for pose in (turned, vehicle)]
    numeric = (x[0] - x[1]) / step
    assert published_jacobian(vehicle, sensor, as_printed=False)[0, 3] == pytest.approx(
        numeric, abs=1e-5
    )
    assert abs(published_jacobian(vehicle, sensor)[0, 3] - numeric) > 0.3


def test_all_other_terms_of_eq_33_are_right():
    vehicle = np.array([1.0, 2.0, 3.0, 0.9, 0.2, -0.1])
    sensor = np.array([2.2, 0.4, 0.1, 0, 0, 0])
    F = published_jacobian(vehicle, sensor, as_printed=False)
    xb, yb, zb = sensor[:3]
    sf, cf, sx, cx = np.sin(0.9), np.cos(0.9), np.sin(0.2), np.cos(0.2)
    sp, cp = np.sin(-0.1), np.cos(-0.1)
    printed = {
        (0, 4): -xb * cf * sx + yb * cf * cx * sp + zb * cf * cx * cp,
        (0, 5): yb * (cf * sx * cp + sf * sp) + zb * (-cf * sx * sp + sf * cp),
        (1, 3): xb * cf * cx + yb * (cf * sx * sp - sf * cp) + zb * (cf * sx * cp + sf * sp),
        (1, 4): -xb * sf * sx + yb * sf * cx * sp + zb * sf * cx * cp,
        (1, 5): yb * (sf * sx * cp - cf * sp) + zb * (-sf * sx * sp - cf * cp),
        (2, 4): -xb * cx - yb * sx * sp - zb * sx * cp,
        (2, 5): yb * cx * cp - zb * cx * sp,
    }
    for place, value in printed.items():
        assert F[place] == pytest.approx(value, abs=1e-12)


def test_squared_distance_covariance_against_simulation():
    generator = np.random.default_rng(0)
    world = ANTENNAS + generator.standard_normal((200_000, 3, 3)) * 0.0064 * [1, 1, 1.75]
    pairs = ((0, 1), (0, 2), (1, 2))
    squares = np.column_stack([np.square(world[:, i] - world[:, j]).sum(1) for i, j in pairs])
    simulated = np.cov(squares.T)
    exact = squared_distance_covariance(ANTENNAS, NOISE)
    # Standard errors of covariances from Gaussian samples.
    variances = np.diagonal(exact)
    error = np.sqrt((np.outer(variances, variances) + exact**2) / 200_000)
    assert (np.abs(simulated - exact) < 4.5 * error + 0.002 * np.abs(exact)).all()
    printed = published_squared_distance_covariance(DISTANCES, 0.0064)
    # All but one element are right to the approximation made (all antennas at one height).
    np.testing.assert_allclose(printed[[0, 0, 1, 1, 2], [0, 1, 1, 2, 2]],
                               exact[[0, 0, 1, 1, 2], [0, 1, 1, 2, 2]], rtol=0.01)  # fmt: skip
    assert printed[0, 2] == pytest.approx(-exact[0, 2], rel=0.01)


def test_q_is_chi_distributed_and_flags_what_is_wrong():
    steps = steps_of(0, count=3000, slope=8.0)
    good = consistency(steps.positions + OFFSETS, DISTANCES, NOISE)
    low, high = good.mean_square_interval
    assert low < good.mean_square < high
    assert good.share_beyond == pytest.approx(0.01, abs=4 * np.sqrt(0.01 / 3000))
    assert not good.biased.any()
    wrong = consistency(steps.positions + OFFSETS, DISTANCES + np.array([0.003, 0, 0]), NOISE)
    assert wrong.biased.tolist() == [True, False, False]
    small = consistency(steps.positions + OFFSETS, DISTANCES, GpsNoise(0.004, 1.75))
    assert small.mean_square > small.mean_square_interval[1]


def test_exchanged_front_receivers_are_told():
    steps = steps_of(0)
    offsets = estimate_offsets(steps)
    mirrored = antenna_positions(offsets.distances, ANTENNAS[:, 2]).positions * [1, -1, 1]
    with pytest.raises(GtvalError, match="upside down"):
        vehicle_path(steps, offsets, Antennas(mirrored, np.zeros((9, 3)), np.zeros(3)))


def test_spans_and_names():
    _, _, _, path = driven(0)
    assert np.degrees(heading_span(path)) > 180
    assert np.degrees(tilt_spread(path)) > 1
    table = vehicle_table(path)
    assert table.components == SPATIAL
    assert table.ids[0].startswith("1712739600")


def test_the_nose_points_where_the_vehicle_goes():
    _, _, _, path = driven(3)
    found = motion_check(path, 2.0)
    pitch = np.sqrt(path.systematic_covariances[:, 4, 4].mean())
    assert abs(found.up) < 4 * np.hypot(found.up_sigma, pitch)
    lifted = replace(path, poses=path.poses - [0, 0, 0, 0, np.radians(3.0), 0])
    assert np.degrees(motion_check(lifted, 2.0).up - found.up) == pytest.approx(-3.0, abs=0.05)


def test_gaps_stay_gaps_and_known_poses_are_met():
    drive, _, _, path = driven(0)
    stretches = segments(path.times, 2.0)
    assert len(stretches) > 1
    end, begin = path.times[stretches[0][-1]], path.times[stretches[1][0]]
    wanted = np.array([path.times[0] - 1, end - 0.5, (end + begin) / 2, path.times[-1] + 1])
    for methods in (PUBLISHED, hold_out(path, 2.0).chosen):
        found = interpolate(path, wanted, max_gap=2.0, methods=methods)
        assert found.available.tolist() == [False, True, False, False]
        truth = drive.poses(wanted[1:2])
        error = pose_difference(found.poses[1:2], truth, SPATIAL)
        assert np.abs(error[0, :3]).max() < 0.3
    splines = dict.fromkeys(PUBLISHED, "spline")
    exact = interpolate(path, path.times, max_gap=2.0, methods=splines)
    np.testing.assert_allclose(exact.poses, path.poses, atol=1e-9)


def test_the_chosen_methods_are_the_best_on_the_drive():
    drive, _, _, path = driven(1)
    found = hold_out(path, 2.0)
    for name, chosen in found.chosen.items():
        assert found.rms[name, chosen] == min(found.rms[name, method] for method in METHODS)
    # What was chosen beats straight lines against the truth as well.
    wanted = path.times[:-1] + 0.5
    errors = {}
    for label, methods in (("best", found.chosen), ("lines", dict.fromkeys(PUBLISHED, "linear"))):
        at = interpolate(path, wanted, max_gap=2.0, methods=methods)
        error = pose_difference(at.poses, drive.poses(wanted), SPATIAL)[at.available]
        errors[label] = np.sqrt(np.mean(error[:, :2] ** 2))
    assert errors["best"] < errors["lines"]
