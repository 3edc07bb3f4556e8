"""Pose graph: robot poses at all stops, and the mount, from matches, surveyed poses and priors.

One least-squares problem serves both uses. Laser GT: one surveyed reference stop, a measured
mount, and all accepted matches give the poses of the other stops. Mount calibration: surveyed
poses of many stops and the same matches give the mount (AX = XB in the plane, with the errors of
the poses in it).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laser_gt.placing.equations import Equations, ends_of
from laser_gt.scans.planar import (
    between,
    compose,
    compose_jacobians,
    inverse,
    inverse_covariance_of,
    inverse_jacobian,
    rotation,
    wrapped,
)
from validation.errors import GtvalError
from validation.poses.angles import Array

MAX_STEPS = 50
"""Bound on the steps of Gauss-Newton. A judgement: it converges in a few from the initial guess of
any chain of matches; the bound ends what weights that change to and fro would keep going."""
LEAST_MISFIT = 0.02
"""Least factor on the edges' covariances: no loop closes perfectly but by chance. A judgement: a
seventh of the stated standard deviations; the rest is then noise of the stops."""
_OPEN = "the matches do not determine the poses and the mount: turn the robot between stops"


@dataclass(frozen=True)
class Edge:
    """A match between two stops, in the laser frame.

    Parameters
    ----------
    start, end : int
        Stops.
    pose : (3,) array
        Laser frame at the end stop in the laser frame at the start stop.
    covariance : (3, 3) array
        Of the pose.
    noise : (3, 3) array, optional
        What of it is noise of the two scans, where a direction that they do not determine makes
        the covariance large; all of it if not given.
    """

    start: int
    end: int
    pose: Array
    covariance: Array
    noise: Array | None = None


@dataclass(frozen=True)
class Graph:
    """What is known.

    Parameters
    ----------
    initial : (n, 3) array
        First values of the robot poses, in the GTV frame. Edges join all of them.
    mount : (3,) array
        First value of the mount: laser frame in the robot frame.
    edges : sequence of Edge
        Matches.
    prior_stops : (p,) sequence of int
        Stops with surveyed poses.
    prior_poses : (p, 3) array
        Those poses.
    prior_covariance : (3p, 3p) array
        Joint covariance of those poses.
    mount_covariance : (3, 3) array or None
        Of the measured mount; None where it is to be found without a measured one.
    guesses : sequence of Edge
        Motions between stops by odometry. They decide what the matches leave open, and do not
        count in the misfit.
    """

    initial: Array
    mount: Array
    edges: Sequence[Edge]
    prior_stops: Sequence[int]
    prior_poses: Array
    prior_covariance: Array
    mount_covariance: Array | None
    guesses: Sequence[Edge] = ()

    @property
    def every(self) -> list[Edge]:
        """Matches, then guesses."""
        return [*self.edges, *self.guesses]


@dataclass(frozen=True)
class GraphSolution:
    """What follows.

    Parameters
    ----------
    poses : (n, 3) array
        Robot poses in the GTV frame.
    mount : (3,) array
        Laser frame in the robot frame.
    covariance : (3n + 3, 3n + 3) array
        Joint covariance of the poses and, last, the mount.
    chi_squared : float
        Of the edges, with their robust weights, and of the surveyed poses.
    degrees_of_freedom : int
        Of the edges.
    weights : (m,) array
        Robust weights.
    """

    poses: Array
    mount: Array
    covariance: Array
    chi_squared: float
    degrees_of_freedom: int
    weights: Array

    @property
    def scale(self) -> float:
        """Factor on the edges' standard deviations that their misfit asks for, at least 1."""
        return float(np.sqrt(max(self.chi_squared / max(self.degrees_of_freedom, 1), 1.0)))


def solve_graph(
    graph: Graph, robust_width: float = 4.0, least_misfit: float = LEAST_MISFIT
) -> GraphSolution:
    """Poses and mount that explain the matches and what was surveyed best.

    Parameters
    ----------
    graph : Graph
        What is known.
    robust_width : float
        Edges whose residual exceeds so many standard deviations are weighed down (Cauchy).
    least_misfit : float
        Least factor on the edges' covariances; 1 where these are right and the noise that edges
        of one stop share is in the covariance of the surveyed poses.

    Raises
    ------
    GtvalError
        If there is no edge or no prior, or the equations have no solution.

    Notes
    -----
    Residual of an edge: the pose between (R_i X)^-1 R_j X and the match, whitened. Gauss-Newton
    with iterated weights on sparse normal equations; the joint covariance is their inverse,
    scaled by the misfit of the edges if that exceeds what their covariances allow.
    """
    if not graph.edges or not len(graph.prior_stops):
        raise GtvalError("no accepted match, or no surveyed stop: nothing to place the scans with")
    poses, mount = graph.initial.copy(), graph.mount.copy()
    weights = np.ones(len(graph.every))
    for _ in range(MAX_STEPS):
        residuals, chi = _edge_residuals(graph, poses, mount)
        weights = 1 / (1 + chi / (3 * robust_width**2))
        equations = _equations(graph, poses, mount, residuals, weights)
        step = -equations.factor(_OPEN).solve(equations.gradient)
        poses = wrapped(poses + step[:-3].reshape(-1, 3))
        mount = mount + step[-3:]
        if np.abs(step).max() < 1e-9:
            break
    return _solution(graph, poses, mount, weights, least_misfit)


def _solution(
    graph: Graph, poses: Array, mount: Array, weights: Array, least_misfit: float
) -> GraphSolution:
    """The solution with its covariance, the edges scaled by their misfit.

    Matches of one scan with many others share that scan's noise: loops close better than the
    covariances of the edges say, and the pose is *not* known better by having many edges. The
    share of the covariance that the misfit of the loops does not show is taken as noise of the
    stops (`stop_noise`) and added to each of them.
    """
    residuals, chi = _edge_residuals(graph, poses, mount)
    count = len(graph.edges)
    off = wrapped(poses[list(graph.prior_stops)] - graph.prior_poses).ravel()
    total = float((weights * chi)[:count].sum())
    total += float(off @ np.linalg.solve(graph.prior_covariance, off))
    unknowns = 3 * (len(poses) - len(graph.prior_stops) + (graph.mount_covariance is None))
    freedom = _determined(graph.edges) - unknowns
    misfit = total / freedom if freedom > 0 else 1.0
    scale = max(misfit, least_misfit)
    scaled = weights / np.where(np.arange(len(weights)) < count, scale, 1.0)
    information = _equations(graph, poses, mount, residuals, scaled).matrix()
    try:
        covariance = np.linalg.inv(information.toarray())
    except np.linalg.LinAlgError:
        raise GtvalError("the matches do not determine the poses") from None
    shared = max(1.0 - scale, 0.0)
    for stop, noise in stop_noise(graph.edges, poses, mount).items():
        part = slice(3 * stop, 3 * stop + 3)
        covariance[part, part] += shared * noise
    covariance = (covariance + covariance.T) / 2
    return GraphSolution(poses, mount, covariance, total, freedom, weights[:count])


def _determined(edges: Sequence[Edge]) -> int:
    """Number of directions that the edges determine to less than a metre, or a radian."""
    return int((np.linalg.eigvalsh(np.array([edge.covariance for edge in edges])) < 1).sum())


def stop_noise(edges: Sequence[Edge], poses: Array, mount: Array) -> dict[int, Array]:
    """Covariance of each stop's robot pose from the noise of its own scans.

    Half of an edge's covariance is the noise of either of its two scans; seen from the other
    stop it needs turning only, for it acts at the stop's own laser frame. The mean over the
    stop's edges, by their information, carried from laser frame to robot pose.
    """
    found: dict[int, list[Array]] = {}
    for edge in edges:
        back = inverse(edge.pose)
        noise = edge.covariance if edge.noise is None else edge.noise
        turned_back = inverse_covariance_of(edge.pose, noise)
        for stop, pose, covariance in (
            (edge.end, edge.pose, noise),
            (edge.start, back, turned_back),
        ):
            turn = np.eye(3)
            turn[:2, :2] = rotation(pose[2]).T
            information: Array = np.asarray(np.linalg.inv(turn @ covariance @ turn.T / 2))
            found.setdefault(stop, []).append(information)
    result = {}
    for stop, informations in found.items():
        laser = compose(poses[stop], mount)
        _, by_offset = compose_jacobians(laser, np.zeros(3))
        by_laser, _ = compose_jacobians(laser, inverse(mount))
        jacobian = by_laser @ by_offset
        mean = np.linalg.inv(np.mean(informations, axis=0))
        result[stop] = jacobian @ mean @ jacobian.T
    return result


def predicted(first: Array, second: Array, mount: Array) -> Array:
    """Laser frame at the second stop in the laser frame at the first: (R_i X)^-1 R_j X."""
    return between(compose(first, mount), compose(second, mount))


def _edge_residuals(graph: Graph, poses: Array, mount: Array) -> tuple[Array, Array]:
    """(m, 3) predicted less matched poses, and their (m,) squared Mahalanobis lengths."""
    start, end = ends_of(graph.every).T
    measured = np.array([edge.pose for edge in graph.every])
    residual = wrapped(predicted(poses[start], poses[end], mount) - measured)
    covariance = np.array([edge.covariance for edge in graph.every])
    solved = np.linalg.solve(covariance, residual[..., None])[..., 0]
    return residual, (residual * solved).sum(-1)


def _edge_jacobians(first: Array, second: Array, mount: Array) -> tuple[Array, Array, Array]:
    """(m, 3, 3) derivatives of `predicted` by the first pose, the second and the mount."""
    start, end = compose(first, mount), compose(second, mount)
    start_by_pose, start_by_mount = compose_jacobians(first, mount)
    end_by_pose, end_by_mount = compose_jacobians(second, mount)
    by_start, by_end = compose_jacobians(inverse(start), end)
    by_start = by_start @ inverse_jacobian(start)
    return (
        by_start @ start_by_pose,
        by_end @ end_by_pose,
        by_start @ start_by_mount + by_end @ end_by_mount,
    )


def _equations(
    graph: Graph, poses: Array, mount: Array, residuals: Array, weights: Array
) -> Equations:
    """All terms: matches and guesses, surveyed poses, the measured mount."""
    n = len(poses)
    start, end = ends_of(graph.every).T
    information = np.linalg.inv(np.array([edge.covariance for edge in graph.every]))
    jacobians = np.stack(
        _edge_jacobians(poses[start], poses[end], np.broadcast_to(mount, (len(start), 3))), axis=1
    )
    where = np.stack([start, end, np.full(len(start), n)], axis=1)
    equations = Equations(n + 1)
    equations.add(where, jacobians, information * weights[:, None, None], residuals)
    stops = list(graph.prior_stops)
    off = wrapped(poses[stops] - graph.prior_poses)
    equations.add_known(stops, np.linalg.inv(graph.prior_covariance), off)
    if graph.mount_covariance is not None:
        off = wrapped(mount - graph.mount)
        equations.add_known([n], np.linalg.inv(graph.mount_covariance), off)
    return equations
