"""Pose graph: robot poses at all stops, and the mount, from matches, surveyed poses and priors.

One least-squares problem serves both uses. Laser GT: one surveyed reference stop, a measured
mount, and all accepted matches give the poses of the other stops. Mount calibration: surveyed
poses of many stops and the same matches give the mount (AX = XB in the plane, with the errors of
the poses in it).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

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
from laser_gt.scans.scan import Indices
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.factored import Factored
from validation.poses.nets import Net, sparse_factor

MAX_STEPS = 50
"""Bound on the steps of Gauss-Newton. A judgement: it converges in a few from the initial guess of
any chain of matches; the bound ends what weights that change to and fro would keep going."""
LEAST_MISFIT = 0.02
"""Least factor on the edges' covariances: no loop closes perfectly but by chance. A judgement: a
seventh of the stated standard deviations; the rest is then noise of the stops."""
SMALL = 300
"""Stops up to which the covariance of all is kept once one is asked for: 6.5 MB, worked out in a
tenth of a second; from more on each is worked out alone, in some milliseconds."""
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
    prior_covariance : Factored
        Covariance of those poses.
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
    prior_covariance: Factored
    mount_covariance: Array | None
    guesses: Sequence[Edge] = ()

    @property
    def every(self) -> list[Edge]:
        """Matches, then guesses."""
        return [*self.edges, *self.guesses]


@dataclass(frozen=True, repr=False)
class GraphSpread:
    """Covariance of the poses and the mount of a solved graph, worked out as far as it is asked.

    Parameters
    ----------
    information : (3n + 3 + r, 3n + 3 + r) sparse array
        Of the poses, the mount, and r errors that surveyed poses share.
    noise : (n, 3, 3) array
        What each pose errs beside what follows from it.
    """

    information: Any
    noise: Array

    @cached_property
    def _factor(self) -> Any:
        try:
            return sparse_factor(self.information)
        except RuntimeError:
            raise GtvalError("the matches do not determine the poses") from None

    @cached_property
    def _whole(self) -> Array:
        """(3n + 3, 3n + 3) all of it, of a small graph."""
        whole: Array = self._columns(np.arange(3 * len(self.noise) + 3))
        return whole

    def _columns(self, flat: Indices) -> Array:
        """(3n + 3, m) columns of the poses and the mount, without the noise."""
        right = np.zeros((self.information.shape[0], len(flat)))
        right[flat, np.arange(len(flat))] = 1.0
        return np.asarray(self._factor.solve(right)[: 3 * len(self.noise) + 3])

    def between(self, stops: Sequence[int]) -> Array:
        """(3p, 3p) covariance of p poses together."""
        flat = (3 * np.array(stops)[:, None] + np.arange(3)).ravel()
        whole = len(self.noise) <= SMALL
        found = (self._whole[:, flat] if whole else self._columns(flat))[flat]
        for at, stop in enumerate(stops):
            part = slice(3 * at, 3 * at + 3)
            found[part, part] += self.noise[stop]
        return np.asarray((found + found.T) / 2)

    @cached_property
    def _of_mount(self) -> Array:
        """(3n + 3, 3) covariance of the poses and the mount with the mount."""
        return self._columns(3 * len(self.noise) + np.arange(3))

    @property
    def mount(self) -> Array:
        """(3, 3) covariance of the mount."""
        found = self._of_mount[-3:]
        return np.asarray((found + found.T) / 2)

    @property
    def by_mount(self) -> Array:
        """(3n, 3) how the poses follow an error of the mount."""
        return np.asarray(np.linalg.solve(self.mount, self._of_mount[:-3].T).T)

    @cached_property
    def _for_known_mount(self) -> Net:
        """That of the poses for a known mount, without the noise."""
        size = 3 * len(self.noise)
        try:
            return Net.of(self.information[:size, :size].tocsc(), 3)
        except RuntimeError:
            raise GtvalError("the matches do not determine the poses") from None

    def for_known_mount(self, by_pose: Array) -> Factored:
        """Covariance of poses that follow those of the graph by (n, 3, 3), for a known mount."""
        from scipy import sparse  # noqa: PLC0415  (loaded when a graph is solved)

        n = len(self.noise)
        rows = np.arange(n + 1)
        back = sparse.bsr_array((np.linalg.inv(by_pose), rows[:-1], rows), shape=(3 * n, 3 * n))
        net, turned = self._for_known_mount, np.swapaxes(by_pose, 1, 2)
        information = (back.T @ net.information @ back).tocsc()
        moved = Net((information + information.T) / 2, net.by, by_pose @ net.blocks @ turned)
        return Factored(by_pose @ self.noise @ turned, np.zeros((n, 3, 0)), np.zeros(0), moved)


@dataclass(frozen=True)
class GraphSolution:
    """What follows.

    Parameters
    ----------
    poses : (n, 3) array
        Robot poses in the GTV frame.
    mount : (3,) array
        Laser frame in the robot frame.
    spread : GraphSpread
        Covariance of the poses and the mount.
    chi_squared : float
        Of the edges, with their robust weights, and of the surveyed poses.
    degrees_of_freedom : int
        Of the edges.
    weights : (m,) array
        Robust weights.
    """

    poses: Array
    mount: Array
    spread: GraphSpread
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
    with iterated weights on sparse normal equations; the covariance is their inverse, the edges
    scaled by their misfit if that exceeds what their covariances allow.
    """
    if not graph.edges or not len(graph.prior_stops):
        raise GtvalError("no accepted match, or no surveyed stop: nothing to place the scans with")
    poses, mount = graph.initial.copy(), graph.mount.copy()
    known, stops = graph.prior_covariance, np.array(graph.prior_stops, dtype=np.intp)
    shared, end = np.zeros(len(known.signs)), 3 * len(poses)
    terms = _Terms.of(graph)
    for _ in range(MAX_STEPS):
        residuals, chi = terms.residuals(poses, mount)
        weights = 1 / (1 + chi / (3 * robust_width**2))
        equations = terms.equations(graph, poses, mount, residuals, weights)
        off = wrapped(poses[stops] - graph.prior_poses)
        equations.add_surveyed(stops, known, off, shared)
        step = -equations.factor(_OPEN).solve(equations.gradient)
        poses = wrapped(poses + step[:end].reshape(-1, 3))
        mount = mount + step[end : end + 3]
        shared = shared + step[end + 3 :]
        if np.abs(step[: end + 3]).max() < 1e-9:
            break
    return _solution(graph, terms, (poses, mount, shared), weights, least_misfit)


def _solution(
    graph: Graph,
    terms: "_Terms",
    found: tuple[Array, Array, Array],
    weights: Array,
    least_misfit: float,
) -> GraphSolution:
    """The solution with its covariance, the edges scaled by their misfit.

    Matches of one scan with many others share that scan's noise: loops close better than the
    covariances of the edges say, and the pose is *not* known better by having many edges. The
    share of the covariance that the misfit of the loops does not show is taken as noise of the
    stops (`stop_noise`) and added to each of them.
    """
    poses, mount, shared = found
    residuals, chi = terms.residuals(poses, mount)
    count, known = len(graph.edges), graph.prior_covariance
    stops = np.array(graph.prior_stops, dtype=np.intp)
    off = wrapped(poses[stops] - graph.prior_poses)
    total = float((weights * chi)[:count].sum())
    total += float(np.einsum("nk,nkp->", off, known.solve(off[..., None])))
    unknowns = 3 * (len(poses) - len(stops) + (graph.mount_covariance is None))
    freedom = _determined(terms.covariances[:count]) - unknowns
    misfit = total / freedom if freedom > 0 else 1.0
    scale = max(misfit, least_misfit)
    scaled = weights / np.where(np.arange(len(weights)) < count, scale, 1.0)
    equations = terms.equations(graph, poses, mount, residuals, scaled)
    equations.add_surveyed(stops, known, off, shared)
    noise = np.zeros((len(poses), 3, 3))
    if scale < 1.0:
        noise = (1.0 - scale) * stop_noise(graph.edges, poses, mount)
    spread = GraphSpread(equations.matrix(), noise)
    return GraphSolution(poses, mount, spread, total, freedom, weights[:count])


def _determined(covariances: Array) -> int:
    """Number of directions that edges determine to less than a metre, or a radian."""
    return int((np.linalg.eigvalsh(covariances) < 1).sum())


def stop_noise(edges: Sequence[Edge], poses: Array, mount: Array) -> Array:
    """(n, 3, 3) covariance of each stop's robot pose from the noise of its own scans.

    Half of an edge's covariance is the noise of either of its two scans; seen from the other
    stop it needs turning only, for it acts at the stop's own laser frame. The mean over the
    stop's edges, by their information, carried from laser frame to robot pose.
    """
    moved = np.array([edge.pose for edge in edges])
    noise = np.array([edge.covariance if edge.noise is None else edge.noise for edge in edges])
    start, end = ends_of(edges).T
    # A scan's own axes are turned by the pose in which it is seen.
    turns = np.tile(np.eye(3), (2, len(edges), 1, 1))
    turns[0, :, :2, :2] = np.swapaxes(rotation(moved[:, 2]), -1, -2)
    turns[1, :, :2, :2] = np.swapaxes(rotation(inverse(moved)[:, 2]), -1, -2)
    seen = np.stack([noise, inverse_covariance_of(moved, noise)])
    each: Array = np.asarray(np.linalg.inv(turns @ seen @ np.swapaxes(turns, -1, -2) / 2))
    stops, n = np.concatenate([end, start]), len(poses)
    information = np.zeros((n, 3, 3))
    np.add.at(information, stops, each.reshape(-1, 3, 3))
    counts = np.bincount(stops, minlength=n)
    here = np.flatnonzero(counts)
    laser = compose(poses[here], np.broadcast_to(mount, (len(here), 3)))
    _, by_offset = compose_jacobians(laser, np.zeros_like(laser))
    by_laser, _ = compose_jacobians(laser, np.broadcast_to(inverse(mount), laser.shape))
    jacobian = by_laser @ by_offset
    mean = np.linalg.inv(information[here] / counts[here][:, None, None])
    found = np.zeros((n, 3, 3))
    found[here] = jacobian @ mean @ np.swapaxes(jacobian, 1, 2)
    return found


def predicted(first: Array, second: Array, mount: Array) -> Array:
    """Laser frame at the second stop in the laser frame at the first: (R_i X)^-1 R_j X."""
    return between(compose(first, mount), compose(second, mount))


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


class _Terms(NamedTuple):
    """The edges of a graph in arrays: ends (m, 2), poses (m, 3), covariances (m, 3, 3)."""

    ends: Indices
    poses: Array
    covariances: Array
    information: Array

    @classmethod
    def of(cls, graph: Graph) -> "_Terms":
        """Matches, then guesses."""
        every = graph.every
        covariances = np.array([edge.covariance for edge in every])
        poses = np.array([edge.pose for edge in every])
        return cls(ends_of(every), poses, covariances, np.linalg.inv(covariances))

    def residuals(self, poses: Array, mount: Array) -> tuple[Array, Array]:
        """(m, 3) predicted less matched poses, and their (m,) squared Mahalanobis lengths."""
        start, end = self.ends.T
        residual = wrapped(predicted(poses[start], poses[end], mount) - self.poses)
        return residual, np.einsum("mi,mij,mj->m", residual, self.information, residual)

    def equations(
        self, graph: Graph, poses: Array, mount: Array, residuals: Array, weights: Array
    ) -> Equations:
        """Of matches and guesses, and the measured mount; what is surveyed comes beside."""
        n, (start, end) = len(poses), self.ends.T
        each = np.broadcast_to(mount, (len(start), 3))
        jacobians = np.stack(_edge_jacobians(poses[start], poses[end], each), axis=1)
        where = np.column_stack([self.ends, np.full(len(start), n)])
        equations = Equations(n + 1, len(graph.prior_covariance.signs))
        equations.add(where, jacobians, self.information * weights[:, None, None], residuals)
        if graph.mount_covariance is not None:
            off = wrapped(mount - graph.mount)
            equations.add_known(n, np.asarray(np.linalg.inv(graph.mount_covariance)), off)
        return equations
