"""Robot poses: accurate, with covariances that hold, and ambiguity declared."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation
from scipy.stats import chi2
from vision_scenes import LENS, camera_at, exact_network, random_robot, seen_robot

from data_samples.rooms.cameras import robot_layout
from validation.errors import GtvalError
from vision_gt.images.markers import MarkerView
from vision_gt.least_squares.adjustment import Knowledge, adjust
from vision_gt.least_squares.setups import Setup
from vision_gt.optics.camera import project
from vision_gt.optics.transforms import (
    angle_between,
    change_between,
    perturbed,
    planar_pose,
    stacked,
)
from vision_gt.robot.marker_poses import marker_corners, marker_views
from vision_gt.robot.robot_pose import (
    Floor,
    Sighting,
    best_of,
    joint_covariance,
    joint_factor,
    published_pose,
    robot_pose,
)

EVEN = Floor(0.003, 0.005)


def six_marker_errors(distance: float, noise: float, count: int):
    """Changes (n, 6) between estimate and truth, and normalised squares (n,)."""
    T_camera = camera_at(distance)
    network, layout = exact_network(T_camera), robot_layout()
    errors, nees = [], []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        true = random_robot(rng)
        pose = robot_pose([seen_robot(T_camera, true, noise, rng)], network, layout, EVEN)
        off = change_between(pose.T_gtv_robot, true)
        errors.append(off)
        nees.append(off @ np.linalg.solve(pose.covariance, off))
    return np.array(errors), np.array(nees)


@pytest.mark.parametrize(
    ("distance", "noise", "bound"),
    [(2.0, 0.3, 0.004), (5.0, 0.3, 0.013), (2.0, 0.1, 0.0014), (5.0, 0.1, 0.004)],
)
def test_six_markers_place_the_robot(distance, noise, bound):
    errors, nees = six_marker_errors(distance, noise, 15)
    assert np.median(np.linalg.norm(errors[:, :3], axis=1)) <= bound
    low, high = chi2.ppf([1e-4, 1 - 1e-4], 6 * len(nees))
    assert low < nees.sum() < high


@pytest.mark.full
def test_covariances_hold_over_many_seeds():
    _, nees = six_marker_errors(3.0, 0.2, 200)
    low, high = chi2.ppf([5e-4, 1 - 5e-4], 6 * len(nees))
    assert low < nees.sum() < high


def frontal_marker(noise: float, rng: np.random.Generator, back: float = 0.15):
    """Marker 89 alone, from straight above: the two solutions fit alike."""
    layout = robot_layout()
    from data_samples.rooms.cameras import looking

    T_camera = looking(np.array([0.0, -back, 5.0]), np.array([-0.4, 0.0, 0.5]))
    true = random_robot(rng)
    return T_camera, true, seen_robot(T_camera, true, noise, rng, only=(89,)), layout


def test_a_single_frontal_marker_is_declared_ambiguous_and_the_floor_decides():
    rng = np.random.default_rng(0)
    ambiguous = decided = 0
    for _ in range(8):
        T_camera, true, sighting, layout = frontal_marker(0.15, rng)
        network = exact_network(T_camera)
        pose = robot_pose([sighting], network, layout, EVEN)
        assert pose.ambiguous or angle_between(pose.T_gtv_robot, true) < np.deg2rad(10)
        ambiguous += pose.ambiguous
        on_floor = robot_pose([sighting], network, layout, EVEN, on_floor=True)
        assert not on_floor.ambiguous
        decided += bool(angle_between(on_floor.T_gtv_robot, true) < np.deg2rad(2))
    assert ambiguous >= 4
    assert decided == 8


def test_an_ambiguous_pose_keeps_both_solutions():
    rng = np.random.default_rng(1)
    T_camera, true, sighting, layout = frontal_marker(0.05, rng, back=2.5)
    pose = robot_pose([sighting], exact_network(T_camera), layout, EVEN)
    assert pose.second is not None
    other = stacked(pose.second.R, pose.second.t)
    assert angle_between(pose.T_gtv_robot, other) > np.deg2rad(20)
    assert angle_between(pose.T_gtv_robot, true) < np.deg2rad(10)
    assert pose.excess > 0


def test_a_robot_off_the_floor_is_found_out_and_one_on_it_is_not():
    T_camera, layout = camera_at(2.5), robot_layout()
    network = exact_network(T_camera)
    low = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        true = random_robot(rng)
        low.append(
            robot_pose([seen_robot(T_camera, true, 0.1, rng)], network, layout, EVEN).floor_p
        )
        lifted = perturbed(true, np.array([0, 0, 0.03, 0.03, 0, 0]))
        sighting = seen_robot(T_camera, lifted, 0.1, rng)
        assert robot_pose([sighting], network, layout, EVEN).floor_p < 1e-3
        assert robot_pose([sighting], network, layout, EVEN, on_floor=True).floor_p < 1e-3
    assert min(low) > 1e-3


def test_the_floor_makes_poses_better_and_the_covariance_says_so():
    T_camera, layout = camera_at(5.0), robot_layout()
    rng = np.random.default_rng(2)
    true = random_robot(rng)
    sighting = seen_robot(T_camera, true, 0.3, rng)
    free = robot_pose([sighting], exact_network(T_camera), layout, EVEN)
    bound = robot_pose(
        [sighting], exact_network(T_camera), layout, Floor(0.002, 0.003), on_floor=True
    )
    assert np.trace(bound.planar[1]) < np.trace(free.planar[1])


def test_what_the_cameras_and_the_layout_do_not_know_the_poses_do_not_know():
    T_camera = camera_at(2.5)
    rng = np.random.default_rng(3)
    true = random_robot(rng)
    sighting = seen_robot(T_camera, true, 0.05, rng)
    cameras = np.zeros((15, 15))
    cameras[0, 0] = 0.01**2  # the camera's x is known to 1 cm, and so is the robot's
    exact = robot_pose([sighting], exact_network(T_camera), robot_layout(), EVEN)
    unsure = robot_pose([sighting], exact_network(T_camera, cameras), robot_layout(), EVEN)
    gained = unsure.planar[1] - exact.planar[1]
    assert gained[0, 0] == pytest.approx(0.01**2, rel=0.02)
    assert abs(gained[1, 1]) < 1e-7
    layout = robot_layout()
    shared = np.kron(np.ones((6, 6)), np.diag([0.004, 0, 0, 0, 0, 0]) ** 2)
    moved = robot_pose(
        [sighting], exact_network(T_camera), replace(layout, covariance=shared), EVEN
    )
    # All markers 4 mm further along the robot's x: the robot is 4 mm further back.
    added = moved.planar[1] - exact.planar[1]
    heading = true.rotation.as_rotvec()[2]
    expected = 0.004**2 * np.outer(*(2 * [[np.cos(heading), np.sin(heading)]]))
    np.testing.assert_allclose(added[:2, :2], expected, atol=0.05 * 0.004**2)


def test_poses_from_one_camera_err_together():
    T_camera, layout = camera_at(2.5), robot_layout()
    cameras = np.zeros((15, 15))
    cameras[0, 0] = 0.01**2
    network = exact_network(T_camera, cameras)
    rng = np.random.default_rng(4)
    poses = [
        robot_pose([seen_robot(T_camera, random_robot(rng), 0.05, rng)], network, layout, EVEN)
        for _ in range(2)
    ]
    joint = joint_covariance(poses, network, layout)
    assert joint[0, 3] == pytest.approx(0.01**2, rel=0.02)
    assert np.linalg.eigvalsh(joint).min() > 0
    factor = joint_factor(poses, network, layout)
    between = (factor @ factor.T).reshape(len(poses), 3, len(poses), 3)
    for one, other in permutations(range(len(poses)), 2):
        expected = joint.reshape(between.shape)[one, :, other]
        assert between[one, :, other] == pytest.approx(expected, rel=1e-9, abs=1e-18)


def test_covariances_that_include_the_layout_hold():
    """Layouts drawn with what is stated: the errors are as large as stated, in both bounds."""
    T_camera, nominal = camera_at(2.5), robot_layout()
    covariance = np.diag(np.tile(np.square([0.003] * 3 + [0.01] * 3), 6))
    stated = replace(nominal, covariance=covariance)
    network = exact_network(T_camera)
    total = 0.0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        off = rng.standard_normal((6, 6)) * np.sqrt(np.diagonal(covariance)).reshape(6, 6)
        real = replace(nominal, T_robot_marker=perturbed(nominal.T_robot_marker, off))
        true = random_robot(rng)
        pose = robot_pose(
            [seen_robot(T_camera, true, 0.05, rng, layout=real)], network, stated, EVEN
        )
        error = change_between(pose.T_gtv_robot, true)
        total += float(error @ np.linalg.solve(pose.covariance, error))
    low, high = chi2.ppf([1e-4, 1 - 1e-4], 120)
    assert low < total < high


@pytest.mark.parametrize("spoiled", [0.0, 3.0])
@pytest.mark.parametrize("floor", [False, True])
def test_a_pose_is_what_an_adjustment_of_all_unknowns_gives(spoiled, floor):
    """Cameras and markers as unknowns of their own, with what is known of them as a prior."""
    T_camera, layout = camera_at(2.5), robot_layout()
    sigmas = [1e-3] * 3 + [5e-4] * 3 + [0.3, 0.3, 0.4, 0.4, 1e-3, 2e-3, 1e-4, 1e-4, 1e-3]
    camera_covariance = np.diag(np.square(sigmas))
    network = exact_network(T_camera, camera_covariance)
    layout = replace(layout, covariance=np.diag(np.square(np.tile([3e-4] * 3 + [1e-3] * 3, 6))))
    rng = np.random.default_rng(8)
    true = random_robot(rng)
    sighting = seen_robot(T_camera, true, 0.1, rng)
    sighting.views[0].corners[1] += spoiled
    pose = robot_pose([sighting], network, layout, EVEN, on_floor=floor)
    numbers = [view.number for view in sighting.views]
    sides = {number: float(layout.sides[layout.index(number)]) for number in numbers}
    views = marker_views([(0, 0, sighting.views)], numbers, sides)
    rows = [layout.index(number) for number in numbers]
    # The prior of the floor is about a robot that stands upright on it.
    x, y, theta = planar_pose(pose.T_gtv_robot)
    upright = RigidTransform.from_components([x, y, 0], Rotation.from_rotvec([0, 0, theta]))
    start = Setup.of(
        RigidTransform.concatenate([T_camera]),
        network.cameras[0].parameters[None],
        RigidTransform.concatenate([upright]),
        layout.T_robot_marker[rows],
    )
    variances = np.concatenate(
        [np.diagonal(camera_covariance), np.tile(np.square([3e-4] * 3 + [1e-3] * 3), len(rows))]
    )
    on_floor = np.diag([0, 0, 0.003**-2, 0.005**-2, 0.005**-2, 0])[None]
    knowledge = Knowledge(
        np.diag(1 / variances),
        on_floor if floor else np.zeros((1, 6, 6)),
        np.ones(len(variances), dtype=bool),
    )
    done = adjust(views, start, knowledge, huber=4.0)
    full = done.body_covariances[0]
    apart = change_between(done.setup.T_world_body[0], pose.T_gtv_robot)
    assert apart @ np.linalg.solve(full, apart) < 0.02**2
    assert pose.best.freedom == done.freedom
    if not spoiled:
        root = np.linalg.cholesky(full)
        ratio = np.linalg.eigvalsh(np.linalg.solve(root, np.linalg.solve(root, pose.covariance).T))
        np.testing.assert_allclose(ratio, 1.0, atol=0.02)
        assert pose.best.chi_square == pytest.approx(2 * done.cost, rel=0.02, abs=2 if floor else 0)


def test_a_misplaced_corner_is_held_back():
    T_camera, layout = camera_at(2.5), robot_layout()
    rng = np.random.default_rng(5)
    true = random_robot(rng)
    sighting = seen_robot(T_camera, true, 0.05, rng)
    first = sighting.views[0]
    corners = first.corners.copy()
    corners[0] += [3.0, -2.0]
    spoiled = Sighting(
        "1", (MarkerView(first.number, corners, first.covariances), *sighting.views[1:])
    )
    pose = robot_pose([spoiled], exact_network(T_camera), layout, EVEN)
    assert np.linalg.norm(pose.T_gtv_robot.translation - true.translation) < 0.005
    assert pose.p_value < 1e-4


def test_the_documents_way_is_worse():
    T_camera, layout = camera_at(4.0), robot_layout()
    network = exact_network(T_camera)
    ours, theirs = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        true = random_robot(rng)
        sighting = seen_robot(T_camera, true, 0.5, rng)
        published = published_pose(sighting, network.cameras[0], T_camera, layout)
        pose = robot_pose([sighting], network, layout, EVEN)
        ours.append(np.linalg.norm(pose.T_gtv_robot.translation - true.translation))
        theirs.append(np.linalg.norm(published.translation - true.translation))
    assert np.median(theirs) > 3 * np.median(ours)


def test_a_marker_that_the_layout_does_not_have_is_refused_and_named():
    T_camera, layout = camera_at(2.0), robot_layout()
    network = exact_network(T_camera)
    stranger = MarkerView(777, np.zeros((4, 2)), np.zeros((4, 2, 2)))
    with pytest.raises(GtvalError, match="the layout has no marker 777"):
        robot_pose([Sighting("1", (stranger,))], network, layout, EVEN)


def test_no_marker_is_no_pose():
    network, layout = exact_network(camera_at(2.0)), robot_layout()
    assert robot_pose([Sighting("1", ())], network, layout, EVEN) is None
    assert best_of({}) is None


def test_marker_corners_are_seen_in_the_order_of_detection():
    """From the front, x right and y up in the marker's frame: clockwise from the top left."""
    facing = RigidTransform.from_components([0, 0, 2], Rotation.from_rotvec([np.pi, 0, 0]))
    pixels = project(facing.apply(marker_corners(0.1)), LENS)
    assert (pixels[0] < pixels[2]).all()
    assert pixels[1, 0] > pixels[0, 0]
    assert pixels[3, 1] > pixels[0, 1]
