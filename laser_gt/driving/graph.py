"""Pose graph of a drive: sparse, with weights that switch wrong links off.

Graduated non-convexity with truncated least squares: Yang et al., "Graduated Non-Convexity for
Robust Spatial Perception" (2020). The problem is first made so convex that every link counts, then
step by step less so; links that contradict the others lose their weight on the way.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laser_gt.driving.links import Link
from laser_gt.placing.equations import Equations, ends_of
from laser_gt.scans.planar import (
    CONTRADICTION,
    between,
    compose,
    compose_jacobians,
    inverse,
    inverse_jacobian,
    rotation,
    wrapped,
)
from laser_gt.scans.scan import Flags, Indices
from validation.poses.angles import Array
from validation.poses.nets import inverse_blocks

MAX_STEPS = 100
"""Bound on the steps. A judgement: the weights need thirty of them from a start that is off by a
hundred standard deviations, for each makes the cost less convex by `SHARPER`."""
SHARPER = 1.6
"""Factor on the convexity from step to step; the source takes 1.4 and many steps."""
SLIPPED = 4.0
"""How many times more than a match a motion by odometry must be off, in squared standard
deviations, to be left: eight of its own, for what it slips by has tails."""
BARELY = 1e-4
"""Weight of a motion that slipped: its standard deviations times a hundred. Enough for poses that
nothing else holds to be determined."""
SMALL = 1e-6
"""A step below this, in metres and radians, ends the iteration."""
LEAST_MISFIT = 0.02
"""Least factor on the covariances of the links, as in `laser_gt.placing.graph`."""
HELD = 1e12
"""Information with which a graph without surveyed poses is held at its first pose of the robot: a
micrometre and a microradian."""
_OPEN = "the scans and the odometry do not determine the poses"


@dataclass(frozen=True)
class Anchor:
    """A surveyed pose of the robot.

    Parameters
    ----------
    node : int
        Pose of the graph.
    pose : (3,) array
        Of the robot, in the GTV frame.
    covariance : (3, 3) array
        Of it.
    """

    node: int
    pose: Array
    covariance: Array


@dataclass(frozen=True)
class DriveGraph:
    """What is known of the poses of the laser frame.

    Parameters
    ----------
    initial : (n, 3) array
        First values.
    mount : (3,) array
        Laser frame in the robot frame, as measured.
    mount_covariance : (3, 3) array
        Of it.
    links : sequence of Link
        Matches; those that are not sure may be switched off. Start and end are poses of the graph.
    steps : sequence of Link
        Motions of the laser frame from a pose to the next, always believed: guesses, where there is
        no odometry.
    anchors : sequence of Anchor
        Surveyed poses; without any the first pose of the robot is held where it is.
    motions : sequence of Link
        Motions of the robot by odometry from a pose to the next, believed but where the matches
        clearly say otherwise: wheels slip. With the matches they tell the mount, as in the
        calibration of a hand against an eye.
    """

    initial: Array
    mount: Array
    mount_covariance: Array
    links: Sequence[Link]
    steps: Sequence[Link]
    anchors: Sequence[Anchor]
    motions: Sequence[Link] = ()

    @property
    def held(self) -> Sequence[Anchor]:
        """The surveyed poses, or the first pose, which the frame is that of."""
        first = compose(self.initial[0], inverse(self.mount))
        return self.anchors or [Anchor(0, first, np.eye(3) / HELD)]


@dataclass(frozen=True)
class DrivePoses:
    """What follows.

    Parameters
    ----------
    poses : (n, 3) array
        Of the laser frame.
    mount : (3,) array
        Laser frame in the robot frame.
    weights : (m,) array
        Of the links: 1 where believed, 0 where switched off.
    squares : (m,) array
        Squared residuals of the links in standard deviations.
    misfit : float
        Mean square of the residuals of the links that are believed, over its expectation.
    moving : (k,) array
        Weights of the motions by odometry: 1 where believed, `BARELY` where it slipped.
    """

    poses: Array
    mount: Array
    weights: Array
    squares: Array
    misfit: float
    moving: Array


@dataclass(frozen=True)
class _Terms:
    """The links and steps as arrays."""

    ends: Indices
    poses: Array
    information: Array

    @classmethod
    def of(cls, links: Sequence[Link]) -> "_Terms":
        poses = np.array([one.pose for one in links]).reshape(-1, 3)
        information = np.array([one.information for one in links]).reshape(-1, 3, 3)
        return cls(ends_of(links), poses, information)

    def residuals(self, poses: Array) -> tuple[Array, Array]:
        """(m, 3) residuals, and their (m,) squared lengths in standard deviations."""
        start, end = self.ends.T
        residual = wrapped(between(poses[start], poses[end]) - self.poses)
        return residual, np.einsum("mi,mij,mj->m", residual, self.information, residual)

    def jacobians(self, poses: Array) -> Array:
        """(m, 2, 3, 3) derivatives of the residuals by the poses at both ends."""
        start, end = poses[self.ends[:, 0]], poses[self.ends[:, 1]]
        by_start, by_end = compose_jacobians(inverse(start), end)
        return np.stack([by_start @ inverse_jacobian(start), by_end], axis=1)


def solve_drive(graph: DriveGraph) -> DrivePoses:
    """The poses that explain links, odometry and surveyed poses best.

    Raises
    ------
    GtvalError
        If they are not determined.
    """
    links, steps = _Terms.of(graph.links), _Terms.of(graph.steps)
    doubted = np.array([not one.sure for one in graph.links], dtype=bool)
    poses, mount = graph.initial.copy(), graph.mount.copy()
    weights, moving = np.ones(len(graph.links)), np.ones(len(graph.motions))
    _, squares = links.residuals(poses)
    slipping = np.array([not one.sure for one in graph.motions], dtype=bool)
    slips = _motion_squares(graph, poses, mount) / SLIPPED
    worst = float(max(squares[doubted].max(initial=0.0), slips[slipping].max(initial=0.0)))
    convexity = max(2 * worst / CONTRADICTION - 1, 1e-3) if worst > CONTRADICTION else 0.0
    for _ in range(MAX_STEPS):
        equations = _equations(graph, links, steps, (weights, moving), poses, mount)
        step = -equations.factor(_OPEN).solve(equations.gradient)
        poses = wrapped(poses + step[:-3].reshape(-1, 3))
        mount = mount + step[-3:]
        _, squares = links.residuals(poses)
        done = np.abs(step).max() < SMALL
        if convexity:
            weights = np.where(doubted, _weights(squares, convexity), 1.0)
            slips = _motion_squares(graph, poses, mount) / SLIPPED
            moving = np.where(slipping, np.maximum(_weights(slips, convexity), BARELY), 1.0)
            convexity /= SHARPER
            both = np.concatenate([weights, moving])
            done &= bool(((both < 0.01) | (both > 0.99)).all())
        if done:
            break
    believed = weights > 0.5
    freedom = 3 * int(believed.sum()) - 3 * (len(poses) - 1)
    misfit = float(squares[believed].sum()) / freedom if freedom > 0 else 1.0
    return DrivePoses(poses, mount, weights, squares, misfit, moving)


def _weights(squares: Array, convexity: float) -> Array:
    """(m,) weights of truncated least squares, smoothed by a convexity."""
    low = CONTRADICTION / (1 + convexity)
    high = CONTRADICTION * (1 + convexity)
    with np.errstate(divide="ignore", invalid="ignore"):
        between_both = (np.sqrt(low * high / squares) - np.sqrt(low)) / (
            np.sqrt(high) - np.sqrt(low)
        )
    inside = np.clip(np.nan_to_num(between_both, nan=1.0, posinf=1.0), 0.0, 1.0)
    return np.asarray(np.where(squares <= low, 1.0, np.where(squares >= high, 0.0, inside)))


def _equations(
    graph: DriveGraph,
    links: _Terms,
    steps: _Terms,
    weights: tuple[Array, Array],
    poses: Array,
    mount: Array,
) -> Equations:
    """All terms of the poses and, last, the mount."""
    n = len(poses)
    equations = Equations(n + 1)
    for terms, weight in ((links, weights[0]), (steps, np.ones(len(graph.steps)))):
        residual, _ = terms.residuals(poses)
        information = terms.information * weight[:, None, None]
        equations.add(terms.ends, terms.jacobians(poses), information, residual)
    _add_motions(equations, graph, weights[1], poses, mount)
    nodes = np.array([one.node for one in graph.held], dtype=np.intp)
    stated = np.array([one.pose for one in graph.held])
    stated_covariances = np.array([one.covariance for one in graph.held], dtype=float)
    robot = compose(poses[nodes], inverse(mount))
    by_pose, by_inverse = compose_jacobians(poses[nodes], inverse(mount))
    jacobians = np.stack([by_pose, by_inverse @ inverse_jacobian(mount)], axis=1)
    ends = np.column_stack([nodes, np.full(len(nodes), n)])
    information = np.linalg.inv(stated_covariances)
    equations.add(ends, jacobians, information, wrapped(robot - stated))
    measured: Array = np.asarray(np.linalg.inv(graph.mount_covariance))
    equations.add_known(n, measured, wrapped(mount - graph.mount))
    return equations


def _motion_squares(graph: DriveGraph, poses: Array, mount: Array) -> Array:
    """(k,) squared residuals of the motions by odometry, in standard deviations."""
    if not graph.motions:
        return np.zeros(0)
    motions = _Terms.of(graph.motions)
    start, end = poses[motions.ends[:, 0]], poses[motions.ends[:, 1]]
    robot = compose(compose(mount, between(start, end)), inverse(mount))
    off = wrapped(robot - motions.poses)
    return np.asarray(np.einsum("ki,kij,kj->k", off, motions.information, off))


def _add_motions(
    equations: Equations, graph: DriveGraph, weights: Array, poses: Array, mount: Array
) -> None:
    """Odometry: the robot moved by mount, motion of the laser frame, mount backwards."""
    if not graph.motions:
        return
    motions, back = _Terms.of(graph.motions), inverse(mount)
    start, end = poses[motions.ends[:, 0]], poses[motions.ends[:, 1]]
    by_start, by_end = compose_jacobians(inverse(start), end)
    moved = between(start, end)
    through = compose(mount, moved)
    to_mount, to_moved = compose_jacobians(np.broadcast_to(mount, moved.shape), moved)
    to_through, to_back = compose_jacobians(through, np.broadcast_to(back, moved.shape))
    by_moved = to_through @ to_moved
    by_mount = to_through @ to_mount + to_back @ inverse_jacobian(mount)
    jacobians = [by_moved @ by_start @ inverse_jacobian(start), by_moved @ by_end, by_mount]
    residual = wrapped(compose(through, back) - motions.poses)
    where = np.column_stack([motions.ends, np.full(len(moved), len(poses))])
    information = motions.information * weights[:, None, None]
    equations.add(where, np.stack(jacobians, axis=1), information, residual)


def own_noise(graph: DriveGraph, believed: Flags) -> Array:
    """(n, 3, 3) covariance of each pose from the noise of its own scan.

    Half of a link's covariance is the noise of either of its scans, seen from the other; the mean
    over a pose's links, each turned to the pose's own frame and then to that of the graph.
    """
    found: list[list[Array]] = [[] for _ in graph.initial]
    for link, good in zip(graph.links, believed, strict=True):
        if not good or np.linalg.eigvalsh(link.information)[0] < 1.0:
            continue  # a metre: nothing is known of one direction
        covariance = np.linalg.inv(link.information) / 2
        turn = np.eye(3)
        turn[:2, :2] = rotation(link.pose[2]).T
        found[link.end].append(turn @ covariance @ turn.T)
        back = inverse_jacobian(link.pose)
        found[link.start].append(_turned(back @ covariance @ back.T, -link.pose[2]))
    usual = [one for each in found for one in each]
    fallback = np.median(usual, axis=0) if usual else np.zeros((3, 3))
    own = np.array([np.mean(each, axis=0) if each else fallback for each in found])
    turns = np.tile(np.eye(3), (len(own), 1, 1))
    turns[:, :2, :2] = rotation(graph.initial[:, 2])
    return np.asarray(turns @ own @ np.swapaxes(turns, -1, -2))


def _turned(covariance: Array, angle: float) -> Array:
    """A covariance in axes that are turned back by an angle."""
    turn = np.eye(3)
    turn[:2, :2] = rotation(angle).T
    return np.asarray(turn @ covariance @ turn.T)


@dataclass(frozen=True)
class Marginals:
    """Covariances of the poses of a graph.

    Parameters
    ----------
    poses : (n, 3, 3) array
        Of each pose.
    with_mount : (n, 3, 3) array
        Of each pose with the mount.
    mount : (3, 3) array
        Of the mount.
    """

    poses: Array
    with_mount: Array
    mount: Array


def marginals(graph: DriveGraph, solved: DrivePoses, scale: float) -> Marginals:
    """Covariances of the poses, the links taken as good to ``scale`` times their covariances."""
    links, steps = _Terms.of(graph.links), _Terms.of(graph.steps)
    weights = np.where(solved.weights > 0.5, 1.0, 0.0) / scale, solved.moving
    equations = _equations(graph, links, steps, weights, solved.poses, solved.mount)
    factor, n = equations.factor(_OPEN), len(solved.poses)
    size = 3 * n + 3
    last = factor.solve(np.eye(size, 3, -3 * n))
    poses = inverse_blocks(factor, size, n, 3)
    cross = last[:-3].reshape(n, 3, 3)
    return Marginals(poses, cross, last[-3:])


def mount_covariance(graph: DriveGraph, solved: DrivePoses, scale: float) -> Array:
    """(3, 3) covariance of the mount, with links as `marginals` takes them."""
    return joint_covariance(graph, solved, scale, np.array([len(solved.poses)], dtype=np.intp))


def joint_covariance(graph: DriveGraph, solved: DrivePoses, scale: float, nodes: Indices) -> Array:
    """(3 p, 3 p) covariance of p poses together, with links as `marginals` takes them.

    The node after the last pose is the mount.
    """
    links, steps = _Terms.of(graph.links), _Terms.of(graph.steps)
    weights = np.where(solved.weights > 0.5, 1.0, 0.0) / scale, solved.moving
    equations = _equations(graph, links, steps, weights, solved.poses, solved.mount)
    factor, size = equations.factor(_OPEN), 3 * len(solved.poses) + 3
    columns = [factor.solve(np.eye(size, 3, -3 * int(node))) for node in nodes]
    flat = (3 * nodes[:, None] + np.arange(3)).ravel()
    joint = np.hstack(columns)[flat]
    return np.asarray((joint + joint.T) / 2)


def robot_covariances(
    laser: Array, covariances: Array, cross: Array, mount: Array, spread: Array
) -> Array:
    """(n, 3, 3) covariances of poses of the robot from those of the laser frame, (n, 3).

    ``cross``, (n, 3, 3), is of the poses with the mount, ``spread`` of the mount, (3,).
    """
    back = np.broadcast_to(inverse(mount), laser.shape)
    by_laser, by_back = compose_jacobians(laser, back)
    by_mount = by_back @ inverse_jacobian(mount)
    mixed = by_laser @ cross @ np.swapaxes(by_mount, -1, -2)
    found = by_laser @ covariances @ np.swapaxes(by_laser, -1, -2)
    found = found + by_mount @ spread @ np.swapaxes(by_mount, -1, -2)
    found = found + mixed + np.swapaxes(mixed, -1, -2)
    return np.asarray(found + np.swapaxes(found, 1, 2)) / 2
