"""A vertical scanner's place, from scans along paths that were measured, not known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation
from trials.drives import (
    HAND_SIGMAS,
    LEVEL,
    TAPE,
    calibration_drive,
    placement_error,
    scanner_trial,
    solve_drive,
)

from data_samples.drives.drive import (
    LEFT_SCANNER,
    RIGHT_SCANNER,
    ROOF,
    START,
    DriveSettings,
    scan_along,
    simulate_drive,
)
from rtk_gt.sensors.ground import (
    KnownGround,
    RoadPoints,
    ground_rows,
    motion_rows,
    road_beside,
    road_points,
)
from rtk_gt.sensors.pass_matching import perturbed
from rtk_gt.sensors.scanner_adjustment import gauss_newton_step, other_equations
from rtk_gt.sensors.scanner_calibration import MountedScans, calibrate_scanners
from rtk_gt.sensors.scanner_equations import ScannerSettings, scan_residuals, scan_rows
from rtk_gt.sensors.scans import LineScans, cloud_of
from rtk_gt.sensors.surfaces import shared_surfaces
from rtk_gt.sensors.trajectory import (
    Spline,
    antenna_equations,
    point_rows,
    pose_columns,
    roughness_information,
)
from validation.errors import GtvalError
from validation.poses.pose_table import SPATIAL, pose_difference


def calibrated(seed, scanners, loops, *, every=0.2, beams=121, settings=None):
    """Errors (k, 6) in the vehicle frame and the results."""
    drive = simulate_drive(seed, calibration_drive(loops))
    trial = scanner_trial(drive, *scanners, every=every, beams=beams)
    found = trial.calibrated(solve_drive(drive).trajectory(), settings)
    pairs = zip(found, scanners, strict=True)
    return np.array([placement_error(one.pose, truth) for one, truth in pairs]), found


def nees(errors, found):
    """Of the first scanner: the errors of two that share a path are not independent."""
    return float(errors[0] @ np.linalg.solve(found[0].covariance, errors[0]))


@pytest.mark.full
@pytest.mark.parametrize("seed", [101, 102, 103])
def test_within_1_cm_and_a_tenth_of_a_degree_on_a_measured_path(seed):
    """Ten minutes of figures of eight, both scanners together: each number of both."""
    errors, found = calibrated(seed, [LEFT_SCANNER, RIGHT_SCANNER], loops=12)
    assert np.abs(errors[:, :3]).max() < 0.01
    assert np.degrees(np.abs(errors[:, 3:]).max()) < 0.1
    # It knows that it is that good: 19 of 20 drives have all twelve numbers within.
    limits = np.array([0.01] * 3 + [np.radians(0.1)] * 3)
    sigmas = np.array([one.sigmas for one in found])
    assert 2 * stats.norm.sf(limits / sigmas).sum() < 0.05
    assert nees(errors, found) < stats.chi2(6).ppf(0.999)


@pytest.mark.full
def test_nees_over_many_drives():
    small = ScannerSettings(points=25_000)
    total = sum(
        nees(*calibrated(seed, [LEFT_SCANNER], 3, beams=91, settings=small))
        for seed in range(200, 220)
    )
    low, high = stats.chi2(6 * 20).ppf([0.005, 0.995])
    assert low < total < high


def test_a_short_drive_finds_what_it_says_it_finds():
    small = ScannerSettings(points=12_000)
    errors, (found,) = calibrated(31, [LEFT_SCANNER], 2, every=0.3, beams=61, settings=small)
    assert nees(errors, [found]) < stats.chi2(6).ppf(0.9999)
    assert found.rms_after < 0.3 * found.rms_before
    assert (found.sigmas < HAND_SIGMAS).all()
    assert (found.sigmas[3:] < 0.3 * HAND_SIGMAS[3:]).all()


def test_a_place_that_the_hand_excludes_is_refused():
    """20 cm too low by the hand, 2 cm claimed: the floor knows better, and one of them is wrong."""
    drive = simulate_drive(31, calibration_drive(2))
    trial = scanner_trial(drive, LEFT_SCANNER, every=0.3, beams=61)
    one = trial.mounted[0]
    low = replace(one, start=one.start - np.array([0, 0, 0.2, 0, 0, 0]))
    wrong = replace(trial, mounted=(low,))
    with pytest.raises(GtvalError, match=r"cm in z of where it was measured by hand"):
        wrong.calibrated(solve_drive(drive).trajectory(), ScannerSettings(points=12_000))


def test_too_little_seen_twice_is_said():
    drive = simulate_drive(0, calibration_drive(1))
    trajectory = solve_drive(drive).trajectory()
    scans = scan_along(drive, LEFT_SCANNER, np.random.default_rng(0), every=1.0, beams=31)
    mounted = MountedScans(scans.select(np.arange(10)), LEFT_SCANNER, HAND_SIGMAS)
    with pytest.raises(GtvalError, match="another direction"):
        calibrate_scanners(trajectory, [mounted], ground=KnownGround(-ROOF))


def test_scans_without_a_path_are_left_out():
    drive = simulate_drive(0, calibration_drive(1))
    trajectory = solve_drive(drive).trajectory()
    scans = scan_along(drive, LEFT_SCANNER, np.random.default_rng(0), every=1.0, beams=31)
    late = LineScans(scans.times + 1e5, scans.angles, scans.ranges)
    with pytest.raises(GtvalError, match="none of the scans"):
        calibrate_scanners(trajectory, [MountedScans(late, LEFT_SCANNER, HAND_SIGMAS)])


@pytest.mark.parametrize("receivers", [3, 5])
def test_smooth_paths_are_better_than_single_poses(receivers):
    settings = DriveSettings(
        loops=1, straight=60.0, false_fixes=0.01, missing=0.05, receivers=receivers
    )
    drive = simulate_drive(5, settings)
    solved = solve_drive(drive)
    path, trajectory = solved.path, solved.trajectory()
    assert set(trajectory.akaike) == {2.0, 1.5, 1.0, 0.75, 0.5}
    assert 0.8 < trajectory.sigma_ratio < 1.2
    inside = trajectory.spline.covers(path.times)
    truth = drive.poses(path.times[inside])
    single = pose_difference(path.poses[inside], truth, SPATIAL).std(0)
    smooth = pose_difference(trajectory.spline.poses(path.times[inside]), truth, SPATIAL).std(0)
    assert (smooth[[0, 1, 3, 5]] < single[[0, 1, 3, 5]]).all()
    # 1 % of the fixes are off by 30 cm: nearly all of them are found.
    wrong = 0.01 * sum(len(record) for record in drive.records)
    inside = sum(trajectory.spline.covers(r.times[r.kinds == 4]).sum() for r in drive.records)
    left_out = inside - len(trajectory.fixes.times)
    assert 0.3 * wrong < left_out < 2 * wrong + 5


def test_no_pose_outside_of_the_stretches():
    solved = solve_drive(simulate_drive(5, DriveSettings(loops=1, straight=60.0)))
    with pytest.raises(GtvalError, match="outside"):
        solved.trajectory().spline.poses(solved.path.times[-1:] + 10)


def curve(seed=3):
    """A short smooth path and random antennas on it, for derivatives."""
    settings = DriveSettings(loops=1, straight=40.0, shadow=0.0)
    return solve_drive(simulate_drive(seed, settings)).trajectory()


def test_derivatives_of_antennas_by_path_and_vehicle():
    trajectory = curve()
    spline, vehicle = trajectory.spline, trajectory.vehicle
    fixes = trajectory.fixes.select(np.arange(len(trajectory.fixes.times)) % 40 == 0)
    generator = np.random.default_rng(0)
    residual, by_pose, by_vehicle = antenna_equations(spline, vehicle, fixes)
    J = pose_columns(spline, fixes.times, by_pose)
    change = 1e-6 * generator.standard_normal(spline.coefficients.size)
    moved = antenna_equations(spline.moved(change.reshape(-1, 6)), vehicle, fixes)[0]
    np.testing.assert_allclose((moved - residual).ravel(), J @ change, atol=1e-10)
    change = 1e-6 * generator.standard_normal(vehicle.size)
    moved = antenna_equations(spline, vehicle.moved(change), fixes)[0]
    np.testing.assert_allclose(moved - residual, by_vehicle @ change, atol=1e-10)


def test_rates_are_the_derivative_of_poses():
    spline = curve().spline
    times = spline.starts[0] + np.linspace(1, 10, 13)
    # 0.1 ms: less would drown in the 0.2 microseconds that the clock is good for.
    difference = (spline.poses(times + 1e-4) - spline.poses(times - 1e-4)) / 2e-4
    np.testing.assert_allclose(difference, spline.rates(times), atol=0.02)


def test_roughness_is_that_of_the_third_derivative():
    spline = curve().spline
    H, gradient = roughness_information(spline)
    c = spline.coefficients.ravel()
    np.testing.assert_allclose(gradient, H @ c, atol=1e-6 * np.abs(gradient).max())
    times = spline.starts[0] + np.linspace(0, spline.spacings[0] * spline.counts[0], 50)
    straight = spline.moved(-spline.coefficients)
    assert np.abs(straight.poses(times)).max() < 1e-9


def standing(points, times, scanner=None):
    """Road points whose wheels are beside them when they are seen."""
    which = np.zeros(len(points), dtype=int) if scanner is None else scanner
    return RoadPoints(points, which, times, points)


def test_derivatives_of_motion_and_road():
    trajectory = curve()
    ground = KnownGround(-ROOF, slope_x=0.02, slope_y=-0.01)
    shape = ground.shape
    by_path, by_shape, residual = motion_rows(trajectory.spline, shape, ground)
    generator = np.random.default_rng(1)
    change = 1e-6 * generator.standard_normal(trajectory.spline.coefficients.size)
    moved = motion_rows(trajectory.spline.moved(change.reshape(-1, 6)), shape, ground)[2]
    np.testing.assert_allclose(moved - residual, by_path @ change, atol=1e-8)
    step = 1e-6 * np.array([1.0, 2.0, -1.0, 3.0, -2.0])
    moved = motion_rows(trajectory.spline, shape + step, ground)[2]
    np.testing.assert_allclose(moved - residual, by_shape @ step, atol=1e-9)
    own = generator.uniform(-3, 3, (400, 3)) * [0, 1, 0]
    shape = shape + np.array([0.0, 0.0, 0.0, 0.01, -0.003])
    x, y = own[:, 0], own[:, 1]
    own[:, 2] = np.column_stack([x**0, x, y, y**2 / 2, y**3 / 6]) @ shape
    # Where residuals are 0 the weights do not move.
    scanner = np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0])
    times = np.sort(generator.uniform(0, 10, 400))
    places = np.array([scanner, scanner + np.array([0.1, -0.2, 0.05, 0.0, 0.0, 0.0])])
    which = generator.integers(0, 2, 400)
    J, residual = ground_rows(standing(own, times, which), places, shape, ground)
    shift = 1e-6 * generator.standard_normal(17)
    turned = own.copy()
    for row, (place, part) in enumerate(zip(places, shift[:12].reshape(2, 6), strict=True)):
        mine = which == row
        arms = own[mine] - place[:3]
        turned[mine] = Rotation.from_rotvec(part[3:]).apply(arms) + place[:3] + part[:3]
    moved = ground_rows(standing(turned, times, which), places, shape + shift[12:], ground)[1]
    np.testing.assert_allclose(moved - residual, J @ shift, atol=1e-9)


def test_points_of_a_second_are_whitened_by_their_covariance():
    """The rows of one second against the dense covariance of heave, ride, bends and texture."""
    ground = KnownGround(-ROOF)
    y = np.linspace(-2.0, 2.5, 8)
    points = np.column_stack([np.zeros(8), y, np.full(8, -ROOF) + 0.01 * np.sin(5 * y)])
    J, residual = ground_rows(
        standing(points, np.full(8, 0.5)), np.zeros((1, 6)), ground.shape, ground
    )
    Q = np.column_stack([np.ones(8), y, y**2 / 2, y**3 / 6])
    S = np.diag(np.square([ground.heave, ground.ride, ground.curvature, ground.curvature_change]))
    covariance = ground.texture**2 * np.eye(8) + Q @ S @ Q.T
    plain = points[:, 2] + ROOF
    up, none = np.ones(8), np.zeros(8)
    by_shape = [-up, none, -y, -(y**2) / 2, -(y**3) / 6]
    rows = np.column_stack([none, none, up, y, none, none, *by_shape])
    np.testing.assert_allclose(residual @ residual, plain @ np.linalg.solve(covariance, plain))
    np.testing.assert_allclose(J.T @ J, rows.T @ np.linalg.solve(covariance, rows), atol=1e-6)


@pytest.mark.parametrize("bends", [(0.02, 0.0), (0.0, 0.002), (-0.02, 0.002)])
def test_a_road_that_is_bent_everywhere_does_not_turn_the_scanner(bends):
    """Ten minutes past the same camber: no second has a bend of its own, all have one together.

    Taken as new in each second, it would turn the scanner by up to six standard deviations.
    """
    generator = np.random.default_rng(4)
    ground = KnownGround(-ROOF, TAPE, tilt_sigma=LEVEL)
    times = np.repeat(np.arange(0.0, 600.0, 0.2), 8)
    y = generator.uniform(-3.7, -0.9, len(times))
    height = -ROOF + bends[0] * y**2 / 2 + bends[1] * y**3 / 6
    height += ground.texture * generator.standard_normal(len(y))
    scanner = np.array([-0.3, -0.8, 0.0, 0.0, 0.0, 0.0])
    points = np.column_stack([np.full(len(y), -0.3), y, height])
    # z and the rotation about x, with the road; the rest does not matter beside the vehicle.
    J, residual = ground_rows(standing(points, times), scanner[None], ground.shape, ground)
    J = J[:, [2, 3, 6, 7, 8, 9, 10]]
    known = np.concatenate([[0.02, np.radians(2.0)], ground.sigmas]) ** -2
    covariance = np.linalg.inv(J.T @ J + np.diag(known))
    found = -covariance @ J.T @ residual
    normalised = found[:2] @ np.linalg.solve(covariance[:2, :2], found[:2])
    assert normalised < stats.chi2(2).ppf(0.999)
    assert np.degrees(np.sqrt(covariance[1, 1])) < 0.2


@pytest.fixture(scope="module")
def adjusted():
    """A short drive with two scanners in the middle of its adjustment: data, state, surfaces."""
    drive = simulate_drive(31, calibration_drive(2))
    trial = scanner_trial(drive, LEFT_SCANNER, RIGHT_SCANNER, every=0.3, beams=61)
    caught = {}

    def stop(*given):
        caught["given"] = given
        raise StopIteration

    trajectory = solve_drive(drive).trajectory()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rtk_gt.sensors.scanner_calibration.gauss_newton_step", stop)
        with pytest.raises(StopIteration):
            trial.calibrated(trajectory, ScannerSettings(points=4000))
    data, state, surfaces = caught["given"]
    generator = np.random.default_rng(2)
    bent = generator.standard_normal(state.pieces.shape) * [0.02, 0.01, 0.01, 0.01, 0.01, 0.01]
    return data, replace(state, pieces=bent), surfaces


def test_derivatives_of_points_on_pieces(adjusted):
    data, state, surfaces = adjusted
    rows = scan_rows(data, state, surfaces)
    scale = rows.by_piece[:, 0]  # the height of a piece is multiplied by -1
    scan = data.points.scan[surfaces.points]
    generator = np.random.default_rng(3)
    path = 1e-6 * generator.standard_normal(state.spline.coefficients.shape)
    place = 1e-6 * generator.standard_normal((2, 6))
    piece = 1e-6 * generator.standard_normal(state.pieces.shape)

    def moved(part, sign):
        return replace(
            state,
            spline=state.spline.moved(sign * path if part == 0 else 0 * path),
            places=np.array([
                perturbed(one, sign * change if part == 1 else 0 * change)
                for one, change in zip(state.places, place, strict=True)
            ]),
            pieces=state.pieces + (sign * piece if part == 2 else 0.0),
        )  # fmt: skip

    at, weights = state.spline.basis(data.points.times)
    by_time = np.einsum("sk,skc->sc", weights, path[at])
    changes = [by_time[scan], place[data.points.scanner[scan]], piece[surfaces.of]]
    for part, J in enumerate((rows.by_pose, rows.by_place, rows.by_piece)):
        there, back = (scan_residuals(data, moved(part, sign), surfaces) for sign in (1, -1))
        np.testing.assert_allclose(
            -scale * (there - back) / 2, (J * changes[part]).sum(1), atol=2e-8 * np.abs(scale).max()
        )


def test_a_step_is_that_of_all_equations_at_once(adjusted):
    """Pieces eliminated one by one against one dense system with all unknowns."""
    data, state, surfaces = adjusted
    after, covariance = gauss_newton_step(data, state, surfaces)
    H, gradient = full_equations(data, state, surfaces)
    change = np.linalg.solve(H, -gradient)
    n, k = state.spline.coefficients.size, state.vehicle.size
    np.testing.assert_allclose(
        after.spline.coefficients, state.spline.coefficients + change[:n].reshape(-1, 6), atol=1e-7
    )
    np.testing.assert_allclose(
        after.pieces, state.pieces + change[n + k + 17 :].reshape(-1, 6), atol=1e-7
    )
    found = np.linalg.inv(H)[n + k : n + k + 12, n + k : n + k + 12]
    np.testing.assert_allclose(covariance, found, rtol=1e-5, atol=1e-12)


def full_equations(data, state, surfaces):
    """Information and gradient of all unknowns; what is no scan comes from one step without any."""
    n = state.spline.coefficients.size
    total = n + state.vehicle.size + 17
    rows = scan_rows(data, state, surfaces)
    scan = data.points.scan[surfaces.points]
    at, weights = state.spline.basis(data.points.times)
    m, c = len(scan), len(state.pieces)
    J = np.zeros((m, total + 6 * c))
    each = np.arange(m)[:, None]
    for k in range(4):
        J[each, 6 * at[scan, k][:, None] + np.arange(6)] = weights[scan, k, None] * rows.by_pose
    first = total - 17 + 6 * data.points.scanner[scan]
    J[each, first[:, None] + np.arange(6)] = rows.by_place
    J[each, total + 6 * surfaces.of[:, None] + np.arange(6)] = rows.by_piece
    own = np.tile([1e-2, 1.0, 1.0, *[data.settings.bend**-2] * 3], c)
    H, gradient = J.T @ J, J.T @ rows.residual
    H[total:, total:] += np.diag(own)
    gradient[total:] += own * state.pieces.ravel()
    rest = other_equations(data, state)
    H[:total, :total] += rest.H
    gradient[:total] += rest.gradient
    return H, gradient


def true_curve(drive, spacing=0.5):
    """The curve through the true poses of a drive."""
    times = START + np.arange(1.0, drive.duration - 1.0, 0.05)
    poses = drive.poses(times)
    poses[:, 3] = np.unwrap(poses[:, 3])
    count = int((times[-1] - times[0]) / spacing)
    spline = Spline(
        times[:1], np.array([spacing]), np.array([count]), np.zeros((count + 3, 6))
    )  # fmt: skip
    times, poses = times[spline.covers(times)], poses[spline.covers(times)]
    at, weights = spline.basis(times)
    A = np.zeros((len(times), count + 3))
    np.put_along_axis(A, at, weights, axis=1)
    return replace(spline, coefficients=np.linalg.lstsq(A, poses, rcond=None)[0])


def test_the_road_is_that_between_the_wheels():
    """On hills the road before or behind is twisted; beside the wheels it is not.

    Two scanners that look at the same moments, one of them two metres farther ahead.
    """
    drive = simulate_drive(8, calibration_drive(1))
    spline = true_curve(drive)
    ground = KnownGround(-ROOF)
    places = LEFT_SCANNER + np.array([[0.0] * 6, [2.0, *[0.0] * 5]])
    own, which, times = [], [], []
    for row, place in enumerate(places):
        scans = scan_along(drive, place, np.random.default_rng(0), beams=181, sigma=0.0)
        scans = scans.select((scans.times > START + 4) & (scans.times < scans.times[-1] - 4))
        cloud = cloud_of(scans)
        points = cloud.in_vehicle(place)
        rows = road_points(points, place, ground.shape, ground)
        own.append(points[rows])
        which.append(np.full(len(rows), row))
        times.append(scans.times[cloud.scan[rows]])
    road = road_beside(
        np.concatenate(own), np.concatenate(which), np.concatenate(times), spline, ground
    )

    def slopes(points, row):
        """Of the road across under the vehicle, scan by scan, from its cubic."""
        found = []
        mine = road.scanner == row
        for time in np.unique(road.times[mine]):
            y, z = points[mine & (road.times == time), 1:].T
            found.append(np.polynomial.polynomial.polyfit(y, z, 3)[1])
        return np.degrees(found)

    for row in (0, 1):
        seen, beside = slopes(road.points, row), slopes(road.beside, row)
        # What matters is what the level floor is known to; a scan may also show a lamp post.
        assert np.quantile(np.abs(seen), 0.9) > 4 * np.degrees(LEVEL)
        assert np.quantile(np.abs(beside), 0.9) < np.degrees(LEVEL)
        assert abs(np.median(beside)) < np.degrees(LEVEL) / 3


def test_point_rows_against_differences():
    generator = np.random.default_rng(0)
    poses = generator.uniform(-1, 1, (10, 6)) * [10, 10, 2, 3, 0.3, 0.3]
    own = generator.uniform(-5, 5, (10, 3))

    def place(at):
        return Rotation.from_euler("ZYX", at[:, 3:]).apply(own) + at[:, :3]

    J = point_rows(poses, own)
    for k in range(6):
        step = 1e-6 * np.eye(6)[k]
        difference = (place(poses + step) - place(poses - step)) / 2e-6
        np.testing.assert_allclose(difference, J[:, :, k], atol=1e-7)


def test_pieces_are_not_cut_by_the_grid():
    """Two noisy passes over a floor that lies on a wall of the grid: their planes agree."""
    generator = np.random.default_rng(0)
    n = 4000
    flat = generator.uniform(0, 6, (2 * n, 2))
    height = 2.0 + 0.05 * generator.standard_normal(2 * n)
    height[n:] += 0.06
    world = np.column_stack([flat, height])
    times = np.concatenate([np.linspace(0, 5, n), np.linspace(60, 65, n)])
    origins = world + np.array([0, 0, 2.0])
    found = shared_surfaces(world, origins, times, size=2.0, gate=0.4, apart=8.0)
    assert len(found.centres) >= 4
    local = found.local(world)[:, 2] * np.sign(found.axes[found.of, 2, 2])
    late = found.points >= n
    assert local[late].mean() - local[~late].mean() == pytest.approx(0.06, abs=0.006)
    below = shared_surfaces(world, 2 * world - origins, times, size=2.0, gate=0.4, apart=8.0)
    assert len(below.points) == len(found.points)
    once = shared_surfaces(world[:n], origins[:n], times[:n], size=2.0, gate=0.4, apart=8.0)
    assert len(once.centres) == 0


def test_scans_in_gaps_are_counted():
    """Of three scans in ten the time is an hour too late: the rest places the scanner."""
    drive = simulate_drive(0, calibration_drive(2))
    trajectory = solve_drive(drive).trajectory()
    scans = scan_along(drive, LEFT_SCANNER, np.random.default_rng(0), every=0.4, beams=61)
    cut = int(0.7 * len(scans.times))
    late = np.where(np.arange(len(scans.times)) < cut, scans.times, scans.times + 3600.0)
    given = MountedScans(LineScans(late, scans.angles, scans.ranges), LEFT_SCANNER, HAND_SIGMAS)
    settings = ScannerSettings(points=8000)
    (found,) = calibrate_scanners(trajectory, [given], settings=settings)
    without = int((~trajectory.spline.covers(scans.times[:cut])).sum())
    assert found.left_out == without + len(scans.times) - cut
