import numpy as np
import pytest
from laser_rooms import of_motions
from scipy import stats

from laser_gt.placing.graph import Edge, Graph, predicted, solve_graph
from laser_gt.placing.mounts import linear_hand_eye, mount_of
from laser_gt.placing.placement import place
from laser_gt.placing.switches import held
from laser_gt.scans.planar import between, compose, inverse
from validation.errors import GtvalError
from validation.poses.angles import wrap
from validation.poses.factored import Factored
from validation.poses.follows import Follows
from validation.poses.pose_table import PoseTable
from validation.statistics.comparison import compare

MOUNT = np.array([0.178, 0.1915, np.pi / 2])
NOISE = np.diag([1e-3, 1e-3, 3e-4]) ** 2


def _tour(rng, n=10):
    return np.column_stack([rng.uniform(-3, 3, (n, 2)), rng.uniform(-3, 3, n)])


def _edges(rng, poses, noise=NOISE):
    return [
        Edge(
            i,
            j,
            predicted(poses[i], poses[j], MOUNT) + rng.multivariate_normal(np.zeros(3), noise),
            noise,
        )
        for i in range(len(poses))
        for j in range(i + 1, min(i + 4, len(poses)))
    ]


def test_mount_and_its_covariance_are_right_over_many_surveys():
    nees = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        poses = _tour(rng)
        sigma = np.diag([0.002, 0.002, 0.003]) ** 2
        surveyed = poses + rng.multivariate_normal(np.zeros(3), sigma, len(poses))
        graph = Graph(
            surveyed,
            MOUNT + 0.02,
            _edges(rng, poses),
            range(len(poses)),
            surveyed,
            Factored.alone(np.tile(sigma, (len(poses), 1, 1))),
            None,
        )
        found = solve_graph(graph)
        error = found.mount - MOUNT
        nees.append(error @ np.linalg.solve(found.spread.mount, error))
    # 60 chi-squared values with 3 degrees of freedom
    assert 3 - 0.95 < np.mean(nees) < 3 + 0.95


def test_one_wrong_edge_does_not_move_the_poses():
    rng = np.random.default_rng(4)
    poses = _tour(rng)
    edges = _edges(rng, poses)
    wrong = edges[7]
    edges[7] = Edge(wrong.start, wrong.end, wrong.pose + 0.3, wrong.covariance)
    graph = Graph(poses, MOUNT, edges, [0], poses[:1], held(1), np.eye(3) * 1e-12)
    found = solve_graph(graph)
    assert found.weights.argmin() == 7
    assert np.abs(found.poses - poses)[:, :2].max() < 0.01


def test_motions_without_noise_give_the_mount_exactly_and_straight_ones_none():
    rng = np.random.default_rng(2)
    robot = _tour(rng, 12)
    laser = between(np.broadcast_to(MOUNT, robot.shape), compose(robot, MOUNT))
    assert np.allclose(laser, compose(compose(inverse(MOUNT), robot), MOUNT))
    # golden section stops at 1e-5 rad
    assert np.abs(linear_hand_eye(robot, laser) - MOUNT).max() < 1e-5
    covariances = np.tile(NOISE, (12, 1, 1))
    motions = of_motions(robot, covariances, laser, covariances)
    found = mount_of(*motions, np.zeros(3))
    assert np.abs(found.mount - MOUNT).max() < 1e-8
    straight = robot * [1, 1, 0]
    straight_laser = between(np.broadcast_to(MOUNT, robot.shape), compose(straight, MOUNT))
    with pytest.raises(GtvalError, match="without turns"):
        mount_of(*of_motions(straight, covariances, straight_laser, covariances), np.zeros(3))


MOUNT_SIGMAS = np.array([0.002, 0.002, 0.002])
SURVEY_SIGMAS = np.array([0.002, 0.002, 0.002])


def _placed(seed, mount_error):
    """Errors of placed poses, their joint covariance, and their distances from the survey."""
    poses, surveyed, found = _solved(seed, mount_error)[:3]
    error, apart = found.poses - poses, surveyed - found.poses
    error[:, 2], apart[:, 2] = wrap(error[:, 2]), wrap(apart[:, 2])
    return error, found.joint, apart


def _solved(seed, mount_error, anchors=26, common=0.0):
    """True poses, surveyed ones with their joint covariance, and where the laser was placed."""
    rng = np.random.default_rng(seed)
    poses = _tour(rng, 26)
    robot = between(poses[0], poses)
    graph = Graph(
        robot,
        MOUNT + mount_error,
        _edges(rng, poses),
        [0],
        np.zeros((1, 3)),
        held(1),
        np.diag(MOUNT_SIGMAS**2),
    )
    surveyed = poses + rng.normal(0, SURVEY_SIGMAS, poses.shape)
    covariance = np.kron(np.eye(len(poses)), np.diag(SURVEY_SIGMAS**2))
    shared = np.tile([common, common, 0.0], len(poses))
    surveyed += rng.normal() * shared.reshape(-1, 3)
    covariance += np.outer(shared, shared)
    known = covariance[: 3 * anchors, : 3 * anchors]
    found = place(
        solve_graph(graph), list(range(anchors)), surveyed[:anchors], Factored.of_matrix(known, 3)
    )
    return poses, surveyed, found, covariance


def test_all_surveyed_headings_together_show_an_error_of_the_mount_within_its_sigmas():
    nees, headings = [], []
    for seed in range(40):
        mount_error = np.random.default_rng(1000 + seed).normal(0, MOUNT_SIGMAS)
        error, joint, apart = _placed(seed, mount_error)
        mean = error.mean(0)
        averaged = joint.reshape(26, 3, 26, 3).mean((0, 2))
        nees.append(mean @ np.linalg.solve(averaged, mean) / 3)
        headings.append(apart[:, 2].mean())
    # 40 times 3 degrees of freedom: 99.9 % of right ones
    assert 0.629 < np.mean(nees) < 1.480
    # 26 headings of 2 mrad tell the mount's to 0.4 mrad, five times better than it was stated
    assert np.sqrt(np.mean(np.square(headings))) < 0.0004


def test_a_mount_that_contradicts_its_sigmas_stays_as_stated_and_shows():
    _, _, apart = _placed(5, np.array([0.09, 0.05, 0.0]))
    # 10 cm in directions that turn with the robot: 7 cm along each axis
    assert (apart[:, :2].std(0) > 0.05).all()


def test_a_mount_that_the_stops_leave_open_is_not_determined():
    rng = np.random.default_rng(6)
    poses = _tour(rng, 2) * [1, 1, 0.1]
    edges = [edge for edge in _edges(rng, poses) for _ in range(2)]
    loose = Factored.alone(np.tile(0.05**2 * np.eye(3), (2, 1, 1)))
    with pytest.raises(GtvalError, match="not determined by these stops"):
        mount_of(poses, loose, edges, MOUNT)


@pytest.mark.parametrize(
    ("anchors", "seeds"),
    [(26, 8), (1, 5), *(pytest.param(some, 60, marks=pytest.mark.full) for some in (26, 8, 1))],
)
def test_differences_from_the_survey_that_placed_the_laser_are_as_large_as_stated(anchors, seeds):
    total, freedom, levels = 0.0, 0, []
    for seed in range(seeds):
        mount_error = np.random.default_rng(2000 + seed).normal(0, MOUNT_SIGMAS)
        _, surveyed, found, covariance = _solved(seed, mount_error, anchors, common=0.003)
        ids = tuple(map(str, range(26)))
        tables = [
            PoseTable(
                name, ids, poses, joint.reshape(26, 3, 26, 3)[range(26), :, range(26)],
                joint=joint, follows=follows,
            )
            for name, poses, joint, follows in (
                ("survey", surveyed, covariance, None),
                ("laser", found.poses, found.joint,
                 Follows("survey", ids[:anchors], found.by, found.of)),
            )
        ]  # fmt: skip
        test = compare(*tables).test
        total += test.mean * test.poses
        freedom += round(test.per_pose * test.poses)
        levels.append(test.p_value)
    low, high = stats.chi2.ppf([0.0005, 0.9995], freedom)
    assert low < total < high
    # 99.9 % of right ones have no more outside of their 95 % interval.
    assert sum(level < 0.05 for level in levels) <= stats.binom.ppf(0.999, seeds, 0.05)
