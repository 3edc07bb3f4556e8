"""Sensors on a simulated vehicle: scanner, camera, consumer GPS, IMU, point clouds."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rtk_samples import MALAGA
from scipy import stats
from scipy.spatial.transform import Rotation
from trials.drives import solve_drive

from data_samples.drives.drive import (
    LEFT_CAMERA,
    LEFT_SCANNER,
    ROOF,
    START,
    DriveSettings,
    scan_along,
    simulate_drive,
)
from rtk_gt.path.interpolation import Interpolated
from rtk_gt.path.orientation import transform_of
from rtk_gt.path.vehicle_path import VehiclePath
from rtk_gt.receivers.fixes import Fixes
from rtk_gt.sensors.camera_pose import Lens, camera_pose, in_camera, vehicle_errors
from rtk_gt.sensors.characterisation import position_errors, rate_errors
from rtk_gt.sensors.clouds import NOT_SEEN, colour_points, ply
from rtk_gt.sensors.ground import KnownGround
from rtk_gt.sensors.pass_matching import (
    MatchingSettings,
    _equations,
    _matched,
    height_histogram,
    match_passes,
    perturbed,
)
from rtk_gt.sensors.scans import LineScans, cloud_of
from validation.errors import GtvalError

LENS = Lens(
    np.array([[923.5295, 0, 507.2222], [0, 922.2418, 383.5822], [0, 0, 1]]),
    np.array([-0.353754, 0.162014, 1.643379e-3, 3.655471e-4]),
)
"""Left camera of Blanco 2009, Table 4."""
HAND_SIGMAS = np.array([0.02] * 3 + [np.radians(2.0)] * 3)


def scanned(seed, **settings):
    drive = simulate_drive(seed, DriveSettings(loops=3, straight=50.0, shadow=0.0))
    scans = scan_along(drive, LEFT_SCANNER, np.random.default_rng(seed), **settings)
    return scans, drive.poses(scans.times), cloud_of(scans)


def hand_measured(seed):
    generator = np.random.default_rng(seed + 100)
    return LEFT_SCANNER + generator.standard_normal(6) * HAND_SIGMAS


def turn_of(pose):
    made = Rotation.from_euler("ZYX", pose[3:])
    return (made * Rotation.from_euler("ZYX", LEFT_SCANNER[3:]).inv()).as_rotvec()


@pytest.mark.full
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_passes_along_an_exact_path_place_the_scanner_within_1_cm_and_a_tenth_of_a_degree(seed):
    scans, vehicle, cloud = scanned(seed)
    found = match_passes(
        cloud, scans.times, vehicle, hand_measured(seed), HAND_SIGMAS, ground=KnownGround(-ROOF)
    )
    assert np.abs(found.pose[:3] - LEFT_SCANNER[:3]).max() < 0.01
    assert np.degrees(np.abs(turn_of(found.pose))).max() < 0.1


def test_the_scanner_gets_better_and_the_ground_sharper():
    scans, vehicle, cloud = scanned(1, every=0.25, beams=91)
    start = hand_measured(1)
    settings = MatchingSettings(sources=3000)
    found = match_passes(
        cloud, scans.times, vehicle, start, HAND_SIGMAS, settings=settings,
        ground=KnownGround(-ROOF),
    )  # fmt: skip
    assert found.rms_after < found.rms_before
    assert np.linalg.norm(turn_of(found.pose)) < 0.3 * np.linalg.norm(turn_of(start))
    bins = np.arange(-3.0, -1.0, 0.05)
    shares = [height_histogram(cloud, pose, bins, reach=4.0) for pose in (start, found.pose)]
    middles = (bins[1:] + bins[:-1]) / 2
    off = [share @ np.abs(middles + ROOF) / share.sum() for share in shares]
    assert off[1] < off[0]
    # The same pairs: derivative of their distances against finite differences.
    pairs = _matched(cloud, scans.times[cloud.scan], vehicle, found.pose, 0.3, settings)
    residual, J = _equations(cloud, vehicle, found.pose, pairs)
    for k in range(6):
        moved = _equations(cloud, vehicle, perturbed(found.pose, 1e-6 * np.eye(6)[k]), pairs)[0]
        np.testing.assert_allclose((moved - residual) / 1e-6, J[:, k], atol=1e-3)


def test_one_pass_calibrates_nothing():
    scans, vehicle, cloud = scanned(0, every=0.5, beams=31)
    with pytest.raises(GtvalError, match="seen from two passes"):
        match_passes(
            cloud, scans.times, vehicle, LEFT_SCANNER, HAND_SIGMAS,
            settings=MatchingSettings(apart=1000.0),
        )  # fmt: skip


def test_scans_of_the_wrong_shape():
    with pytest.raises(GtvalError, match="do not belong"):
        LineScans(np.zeros(2), np.zeros(3), np.zeros((3, 2)))


def seen_points(seed, count=60, noise=0.5):
    """Points in front of the camera along a drive, with the pixels where they are seen."""
    generator = np.random.default_rng(seed)
    drive = simulate_drive(seed)
    vehicle = drive.poses(START + generator.uniform(0, 100, count))
    own = np.column_stack(
        [generator.uniform(-3, 3, count), generator.uniform(-2, 2, count),
         generator.uniform(6, 20, count)]
    )  # fmt: skip
    points = np.empty((count, 3))
    for row in range(count):
        pose = vehicle[row]
        R = Rotation.from_euler("ZYX", pose[3:]) * Rotation.from_euler("ZYX", LEFT_CAMERA[3:])
        points[row] = R.apply(own[row]) + pose[:3]
        points[row] += Rotation.from_euler("ZYX", pose[3:]).apply(LEFT_CAMERA[:3])
    np.testing.assert_allclose(in_camera(points, vehicle, LEFT_CAMERA), own, atol=1e-9)
    pixels = LENS.project(own) + noise * generator.standard_normal((count, 2))
    return points, vehicle, pixels


def test_the_camera_is_recovered_as_surely_as_it_says():
    total = 0.0
    start = LEFT_CAMERA + np.array([0.05, -0.05, 0.04, 0.05, -0.04, 0.05])
    for seed in range(8):
        points, vehicle, pixels = seen_points(seed)
        found = camera_pose(LENS, points, vehicle, pixels, start)
        error = found.pose - LEFT_CAMERA
        total += error @ np.linalg.solve(found.covariance, error)
        assert found.sigma == pytest.approx(0.5, rel=0.3)
    # Chi-squared with 48 degrees of freedom: 0.05 % below 21, 0.05 % above 88.
    assert 21 < total < 88


def sighted(drive, path, seed, images=20, each=6):
    """Points in the camera's view at some poses of a measured path, and rows of these poses."""
    generator = np.random.default_rng(seed)
    rows = np.repeat(np.sort(generator.choice(len(path), images, replace=False)), each)
    own = generator.uniform([-3, -2, 6], [3, 2, 20], (len(rows), 3))
    T = drive.T_local_vehicle(path.times[rows]) * transform_of(LEFT_CAMERA[None])
    return T.apply(own), rows, LENS.project(own) + 0.5 * generator.standard_normal((len(rows), 2))


def test_a_camera_on_a_measured_path_knows_what_the_path_leaves_open():
    """Half a degree of a pose is eight pixels, alike for all points of its image."""
    start = LEFT_CAMERA + np.array([0.05, -0.05, 0.04, 0.05, -0.04, 0.05])
    squares, exact = [], []
    for seed in range(4100, 4124):
        solved = solve_drive(simulate_drive(seed, DriveSettings(loops=3)))
        path = solved.path
        points, rows, pixels = sighted(solved.drive, path, seed)
        errors = vehicle_errors(
            path.times[rows], path.poses[rows], solved.antennas, solved.noise,
            path.systematic_covariance,
        )  # fmt: skip
        for known, into in ((errors, squares), (None, exact)):
            found = camera_pose(LENS, points, path.poses[rows], pixels, start, known)
            error = found.pose - LEFT_CAMERA
            into.append(error @ np.linalg.solve(found.covariance, error))
    low, high = stats.chi2(6 * len(squares)).ppf([0.001, 0.999])
    assert low < sum(squares) < high
    assert sum(exact) > 5 * high  # taken as exact, the path makes it far too sure


def test_projection_agrees_with_opencv():
    import cv2

    points = np.random.default_rng(0).uniform(-1, 1, (50, 3)) * [3, 2, 2] + [0, 0, 8]
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), LENS.matrix, LENS.distortion)
    np.testing.assert_allclose(LENS.project(points), expected[:, 0], atol=1e-9)


def test_a_camera_that_looks_the_wrong_way():
    points, vehicle, pixels = seen_points(0)
    with pytest.raises(GtvalError, match="behind the camera"):
        camera_pose(LENS, points, vehicle, pixels, np.array([0, 0, 0, np.pi, 0, 0]))
    with pytest.raises(GtvalError, match="too few"):
        camera_pose(LENS, points[:3], vehicle[:3], pixels[:3], LEFT_CAMERA)


def path_of(times, poses):
    n = len(times)
    return VehiclePath(
        times, poses, np.tile(np.eye(6) * 1e-6, (n, 1, 1)), np.zeros((n, 6, 6)),
        np.zeros((n, 6, 1)), np.zeros((1, 1)), MALAGA,
    )  # fmt: skip


def test_a_consumer_gps_is_characterised():
    generator = np.random.default_rng(0)
    drive = simulate_drive(0)
    times = START + np.arange(0, 120.0)
    poses = drive.poses(times)
    antenna = np.array([-0.25, 0.0, 0.1])
    true = drive.T_local_vehicle(times).apply(np.tile(antenna, (120, 1)))
    bias = np.array([2.0, -1.0, 4.0])
    recorded = true + bias + generator.standard_normal((120, 3)) * [1, 1, 2]
    record = Fixes(
        "dgps", times, MALAGA.to_geodetic(recorded), np.full(120, 2), np.full(120, 7),
        np.full(120, 1.5), np.full((120, 3, 3), np.nan), np.arange(120), Path("d.csv"),
    )  # fmt: skip
    available = times < START + 100
    covariances = np.tile(np.eye(6), (120, 1, 1))
    found = position_errors(
        record, Interpolated(times, poses, covariances, available), antenna, path_of(times, poses)
    )
    assert len(found.errors) == 100
    assert np.abs((found.bias - bias) / found.bias_sigma).max() < 4
    assert found.rmse_horizontal == pytest.approx(np.sqrt(5 + 2), rel=0.2)
    assert found.rmse_vertical == pytest.approx(np.sqrt(16 + 4), rel=0.2)


def test_imu_rates_and_their_drift():
    generator = np.random.default_rng(0)
    drive = simulate_drive(0)
    path = path_of(START + np.arange(0, 140.0), drive.poses(START + np.arange(0, 140.0)))
    times = START + np.arange(0, 140.0, 0.05)
    angles = drive.poses(times)[:, 3:]
    drift = np.radians(0.5)
    angles[:, 0] += drift * (times - START)
    angles += np.radians(0.02) * generator.standard_normal(angles.shape)
    yaw, pitch, _ = rate_errors(times, angles, path, 2.0)
    assert yaw.drift == pytest.approx(drift, abs=4 * yaw.drift_sigma)
    assert yaw.rmse == pytest.approx(drift, rel=0.05)
    assert np.degrees(yaw.greatest_rate) > 10
    assert abs(pitch.drift) < 4 * pitch.drift_sigma
    with pytest.raises(GtvalError, match="same drive and clock"):
        rate_errors(times + 1e6, angles, path, 2.0)


def test_points_take_the_colour_of_what_is_in_front():
    lens = Lens(np.array([[100.0, 0, 50], [0, 100.0, 40], [0, 0, 1]]), np.zeros(4))
    image = np.zeros((1, 80, 100, 3), dtype=np.uint8)
    image[0, :, :50] = [200, 10, 10]
    image[0, :, 50:] = [10, 10, 200]
    camera = np.array([0, 0, 0, *Rotation.from_matrix(
        [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]).as_euler("ZYX")])  # fmt: skip
    points = np.array([[5.0, 1, 0], [5.0, -1, 0], [10.0, 2.0, 0], [-5.0, 0, 0], [90.0, 0, 0]])
    colours, seen = colour_points(points, image, np.zeros((1, 6)), camera, lens)
    assert colours[0].tolist() == [200, 10, 10]
    assert colours[1].tolist() == [10, 10, 200]
    # The third is right behind the first; the others are behind the camera and too far away.
    assert seen.tolist() == [True, True, False, False, False]
    assert colours[2].tolist() == list(NOT_SEEN)


def test_a_cloud_of_the_campus_keeps_its_colours():
    """Points of the scanner, coloured by rendered images, have the colours of the surfaces."""
    drive = simulate_drive(2, DriveSettings(loops=1, straight=40.0, shadow=0.0))
    scans = scan_along(drive, LEFT_SCANNER, np.random.default_rng(0), every=0.3, beams=61)
    points = cloud_of(scans).in_world(drive.poses(scans.times), LEFT_SCANNER)
    lens = Lens(np.array([[80.0, 0, 63.5], [0, 80.0, 47.5], [0, 0, 1]]), np.zeros(4))
    times = START + np.arange(0.0, 20.0, 2.0)
    vehicle = drive.poses(times)
    v, u = np.mgrid[0:96, 0:128]
    rays = np.column_stack([(u.ravel() - 63.5) / 80, (v.ravel() - 47.5) / 80, np.ones(u.size)])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    images = []
    for pose in vehicle:
        R = Rotation.from_euler("ZYX", pose[3:])
        turned = (R * Rotation.from_euler("ZYX", LEFT_CAMERA[3:])).apply(rays)
        eye = np.tile(pose[:3] + R.apply(LEFT_CAMERA[:3]), (len(rays), 1))
        hit = drive.campus.cast(eye, turned, reach=60.0)
        sky = np.isinf(hit)
        seen = eye + np.where(sky, 60.0, hit)[:, None] * turned
        colour = np.where(sky[:, None], [0.6, 0.75, 0.95], drive.campus.colours(seen))
        images.append((255 * colour).astype(np.uint8).reshape(96, 128, 3))
    colours, seen = colour_points(points, np.array(images), vehicle, LEFT_CAMERA, lens)
    assert seen.sum() > 200
    right = (255 * drive.campus.colours(points[seen])).astype(int)
    off = np.abs(colours[seen].astype(int) - right).max(1)
    # Pixels are 5 to 30 cm wide out there: edges may differ, surfaces may not.
    assert np.mean(off < 30) > 0.8


def test_ply_files_can_be_read_back():
    points = np.random.default_rng(0).uniform(-100, 100, (10, 3))
    colours = np.arange(30, dtype=np.uint8).reshape(10, 3)
    data = ply(points, colours)
    head, body = data.split(b"end_header\n", 1)
    assert b"element vertex 10" in head
    assert len(body) == 10 * 15
    rows = np.frombuffer(body, dtype=[("p", "<f4", 3), ("c", "u1", 3)])
    np.testing.assert_allclose(rows["p"], points, atol=1e-5)
    np.testing.assert_array_equal(rows["c"], colours)
    assert len(ply(points)) < len(data)
    with pytest.raises(GtvalError, match="not finite"):
        ply(np.full((1, 3), np.nan))
    with pytest.raises(GtvalError, match="colours for"):
        ply(points, colours[:3])


def test_replaced_scans_are_selected():
    scans = LineScans(np.arange(3.0), np.zeros(1), np.arange(3.0)[:, None])
    assert scans.select(np.array([2])).ranges.tolist() == [[2.0]]
    assert replace(scans, times=scans.times + 1).times[0] == 1.0


def test_points_where_the_distortion_turns_back_take_no_colour():
    """With k1 = -0.3 alone all beyond 47 degrees from the axis would be projected inwards."""
    lens = Lens(np.array([[500.0, 0, 500], [0, 500, 500], [0, 0, 1]]), np.array([-0.3, 0, 0, 0]))
    points = np.array([[1.0, 0, 2], [1.7, 0, 1]])  # 27 and 60 degrees from the axis
    pixels = lens.project(points)
    assert ((pixels > 0) & (pixels < 1000)).all()
    assert lens.shows(points).tolist() == [True, False]
    image = np.full((1, 1000, 1000, 3), 7, np.uint8)
    _, seen = colour_points(points, image, np.zeros((1, 6)), np.zeros(6), lens)
    assert seen.tolist() == [True, False]
