"""The graph of a drive against its equations solved otherwise, and against wrong links."""

from dataclasses import replace

import numpy as np
import pytest

from laser_gt.driving.graph import Anchor, DriveGraph, marginals, robot_covariances, solve_drive
from laser_gt.driving.links import Link
from laser_gt.scans.planar import between, compose, inverse, rotation, wrapped
from validation.errors import GtvalError

SIGMAS = np.array([0.002, 0.002, 0.001])
MOUNT = np.array([0.2, 0.1, 0.3])
MOUNT_SIGMAS = np.array([1e-3, 1e-3, 5e-4])


def _loop(rng, count=24, wrong=0):
    """Poses on a circle, links of one and two steps and over the loop; some of these wrong."""
    angle = 2 * np.pi * np.arange(count) / count
    robot = np.column_stack([3 * np.cos(angle), 3 * np.sin(angle), angle + np.pi / 2])
    laser = compose(robot, MOUNT)
    information = np.diag(1 / SIGMAS**2)
    pairs = [(i, i + k) for k in (1, 2) for i in range(count - k)]
    pairs += [(i, count - 1 - i) for i in range(count // 3)]
    links = []
    for start, end in pairs:
        pose = between(laser[start], laser[end]) + rng.normal(size=3) * SIGMAS
        links.append(Link(start, end, pose, information))
    for number in range(wrong):
        start, end = number, count // 2 + number
        pose = between(laser[start], laser[end]) + rng.uniform(0.3, 1.0, 3)
        links.append(Link(start, end, pose, information))
    rough = np.diag(1 / np.array([0.05, 0.05, 0.05]) ** 2)
    steps = [
        Link(
            i, i + 1, between(laser[i], laser[i + 1]) + rng.normal(size=3) * 0.05, rough, sure=True
        )
        for i in range(count - 1)
    ]
    start = laser.copy()
    for i in range(count - 1):
        start[i + 1] = compose(start[i], steps[i].pose)
    anchors = [
        Anchor(i, robot[i] + rng.normal(size=3) * 0.002, np.eye(3) * 0.002**2) for i in (0, 8, 16)
    ]
    stated = MOUNT + rng.normal(size=3) * MOUNT_SIGMAS
    return laser, DriveGraph(start, stated, np.diag(MOUNT_SIGMAS**2), links, steps, anchors)


def test_the_marginals_are_those_of_the_whole_inverse_and_cover_the_truth():
    total = []
    for seed in range(12):
        laser, graph = _loop(np.random.default_rng(seed))
        solved = solve_drive(graph)
        assert (solved.weights < 0.5).sum() <= 1  # by chance one in a thousand
        known = marginals(graph, solved, 1.0)
        errors = wrapped(solved.poses - laser)
        each = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(known.poses), errors)
        total.append(each.mean())
        off = solved.mount - MOUNT
        total.append(off @ np.linalg.solve(known.mount, off))
    # means of 3 with some nine independent numbers a drive: 12 drives know them to 0.4
    assert 3 - 3 * 0.4 < np.mean(total) < 3 + 3 * 0.4


@pytest.mark.parametrize("seed", range(3))
def test_wrong_links_are_switched_off_and_no_right_one(seed):
    laser, graph = _loop(np.random.default_rng(seed), wrong=8)
    solved = solve_drive(graph)
    assert (solved.weights[-8:] < 0.5).all()
    # one right link in a thousand is beyond the limit by chance: of 53, none or one
    assert (solved.weights[:-8] < 0.5).sum() <= 1
    assert np.abs(wrapped(solved.poses - laser)[:, :2]).max() < 0.01


def test_a_direction_without_information_is_left_to_the_odometry():
    laser, graph = _loop(np.random.default_rng(0))
    along = [
        Link(one.start, one.end, one.pose + np.array([0.5, 0, 0]), np.diag([0.0, 1e6, 1e6]))
        for one in graph.links
    ]
    blind = DriveGraph(graph.initial, MOUNT, graph.mount_covariance, along, graph.steps, ())
    solved = solve_drive(blind)
    # 23 steps of 50 mm: the end is where odometry has it, and not half a metre a step away
    end = between(solved.poses[0], solved.poses[-1])
    assert np.hypot(*(end - between(laser[0], laser[-1]))[:2]) < 4 * 0.05 * np.sqrt(23)


def test_without_anchors_the_first_pose_stays_where_it_was():
    laser, graph = _loop(np.random.default_rng(3))
    free = DriveGraph(laser, MOUNT, graph.mount_covariance, graph.links, graph.steps, ())
    solved = solve_drive(free)
    assert np.abs(wrapped(solved.poses[0] - laser[0])).max() < 1e-6
    assert np.allclose(compose(solved.poses[0], inverse(solved.poses[0])), 0, atol=1e-12)


def test_without_anchors_covariances_are_of_motions_from_the_first_pose():
    total = []
    for seed in range(12):
        laser, graph = _loop(np.random.default_rng(seed))
        solved = solve_drive(replace(graph, anchors=()))
        known = marginals(replace(graph, anchors=()), solved, 1.0)
        spread = robot_covariances(
            solved.poses, known.poses, known.with_mount, solved.mount, known.mount
        )
        assert np.sqrt(np.diagonal(spread[0])).max() < 2e-6  # the frame is that of this pose
        robot, true = (
            compose(poses, inverse(mount))
            for poses, mount in ((solved.poses, solved.mount), (laser, MOUNT))
        )
        errors = wrapped(between(robot[0], robot) - between(true[0], true))[1:]
        turned = inverse_turn(robot[0], spread[1:])
        total.append((errors * np.linalg.solve(turned, errors[..., None])[..., 0]).sum(1).mean())
    # All are motions from one pose and share its error: of 60 drives the means spread by 1.7, and
    # 12 drives know theirs to 0.5.
    assert 3 - 3 * 0.5 < np.mean(total) < 3 + 3 * 0.5


def inverse_turn(pose, covariances):
    """Covariances in the axes of a pose."""
    turn = np.eye(3)
    turn[:2, :2] = rotation(pose[2]).T
    return turn @ covariances @ turn.T


def test_a_pose_that_nothing_holds_is_said():
    _, graph = _loop(np.random.default_rng(0))
    one = np.zeros((3, 3))
    alone = [Link(link.start, link.end, link.pose, one) for link in graph.links]
    steps = [Link(link.start, link.end, link.pose, one, sure=True) for link in graph.steps]
    with pytest.raises(GtvalError, match="do not determine"):
        solve_drive(DriveGraph(graph.initial, MOUNT, graph.mount_covariance, alone, steps, ()))
