"""Where the scanner sits on the robot, found from the data and compared with the tape measure.

AD2.3 measured X = 0.1780, Y = 0.1915, Theta = pi / 2 by hand, saw that scans did not come to lie
on each other through the surveyed poses, moved the values about by hand for one pair of scans,
and left it open. Here all pairs are used at once, and the result comes with its covariance.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laser_gt.campaign.inputs import LaserInputs
from laser_gt.campaign.solve import Surveyed, edges_of
from laser_gt.matching.verdicts import Match
from laser_gt.placing.graph import Edge, Graph, solve_graph
from laser_gt.scans.planar import CONTRADICTION, between, compose, compose_jacobians
from validation.errors import GtvalError
from validation.poses.angles import Array, wrap

MIN_TURN = 0.1
"""Smallest spread of turns, in radians, from which a mount's position can be seen."""


@dataclass(frozen=True)
class MountEstimate:
    """A mount from data.

    Parameters
    ----------
    mount : (3,) array
        Laser frame in the robot frame.
    covariance : (3, 3) array
        Its covariance.
    turn : float
        Root mean square turn between the stops of a pair, radians: without turns the position
        of the laser on the robot cannot be seen.
    pairs : int
        Pairs used.
    suspicious : tuple of int
        Pairs weighed down to less than a quarter: the match or the pose is wrong.
    """

    mount: Array
    covariance: Array
    turn: float
    pairs: int
    suspicious: tuple[int, ...] = ()

    @property
    def sigmas(self) -> Array:
        """(3,) standard deviations."""
        return np.sqrt(np.diagonal(self.covariance))

    @property
    def observed(self) -> bool:
        """Whether the robot turned enough for the position to be seen."""
        return self.turn >= MIN_TURN


@dataclass(frozen=True)
class MountCheck:
    """The stated mount beside the one found.

    Parameters
    ----------
    stated, stated_sigmas : (3,) arrays
        As measured by hand.
    found : MountEstimate
        From surveyed poses and matches.
    """

    stated: Array
    stated_sigmas: Array
    found: MountEstimate

    @property
    def difference(self) -> Array:
        """(3,) stated less found."""
        result = self.stated - self.found.mount
        result[2] = wrap(result[2])
        return result

    @property
    def agrees(self) -> bool:
        """Whether both sigmas explain the difference (99.9 %)."""
        covariance = self.found.covariance + np.diag(self.stated_sigmas**2)
        return float(self.difference @ np.linalg.solve(covariance, self.difference)) < CONTRADICTION


def check_mount(inputs: LaserInputs, matches: Sequence[Match], surveyed: Surveyed) -> MountCheck:
    """The mount from the surveyed poses of all stops and the accepted matches between them.

    Parameters
    ----------
    inputs : LaserInputs
        With the stated mount.
    matches : sequence of Match
        In the laser frame: they do not depend on the mount.
    surveyed : Surveyed
        Poses of at least two matched stops.

    Raises
    ------
    GtvalError
        If fewer than two accepted pairs join surveyed stops, or the robot never turned.
    """
    stops = [stop for stop in inputs.stops if stop in surveyed.stops]
    edges = edges_of(stops, [m for m in matches if m.reference in stops and m.moving in stops])
    if len(edges) < 2:
        raise GtvalError(
            "fewer than two accepted matches join surveyed stops; the mount cannot be checked"
        )
    known = surveyed.select(stops)
    turn = _turn([edge.pose for edge in edges])
    _refuse_straight(turn)
    graph = Graph(
        initial=known.poses,
        mount=_first_mount(known.poses, edges, inputs.mount),
        edges=edges,
        prior_stops=range(len(stops)),
        prior_poses=known.poses,
        prior_covariance=known.joint,
        mount_covariance=None,
    )
    solution = solve_graph(graph)
    suspicious = tuple(int(i) for i in np.flatnonzero(solution.weights < 0.25))
    found = MountEstimate(
        np.append(solution.mount[:2], wrap(solution.mount[2])),
        solution.covariance[-3:, -3:],
        turn,
        len(edges),
        suspicious,
    )
    return MountCheck(inputs.mount, inputs.mount_sigmas, found)


def _first_mount(poses: Array, edges: Sequence[Edge], stated: Array) -> Array:
    """Start for the graph: the linear solution, or the stated mount where that is no worse."""
    start = np.array([edge.start for edge in edges])
    end = np.array([edge.end for edge in edges])
    motions = between(poses[start], poses[end])
    laser = np.array([edge.pose for edge in edges])
    linear = linear_hand_eye(motions, laser)
    errors = [
        np.median(np.abs(closure(motions, laser, mount)[:, :2])) for mount in (linear, stated)
    ]
    return linear if errors[0] < errors[1] else stated


def _turn(laser: Sequence[Array]) -> float:
    """Root mean square turn of the pairs."""
    return float(np.sqrt(np.mean(wrap(np.array(laser)[:, 2]) ** 2)))


def _refuse_straight(turn: float) -> None:
    """Raise where the robot did not turn: the position of the laser does not show then."""
    if turn < MIN_TURN:
        raise GtvalError(
            f"between the stops the robot turns by {np.rad2deg(turn):.1f} degrees only; without "
            "turns the place of the laser on the robot cannot be seen. Add stops with other "
            "headings"
        )


def closure(robot: Array, laser: Array, mount: Array) -> Array:
    """(m, 3) poses between A X and X B, zero for the right mount X.

    Parameters
    ----------
    robot, laser : (m, 3) arrays
        Motions A of the robot and B of the laser frame.
    mount : (3,) array
        X.
    """
    mounts = np.broadcast_to(mount, robot.shape)
    return between(compose(robot, mounts), compose(mounts, laser))


def linear_hand_eye(robot: Array, laser: Array) -> Array:
    """The mount that closes A X = X B best in the linear sense.

    Parameters
    ----------
    robot, laser : (m, 3) arrays
        Motions of the robot and of the laser.

    Returns
    -------
    (3,) array
        Mount. For motions without turns its position is zero.

    Notes
    -----
    In the plane, (R_A - I) t - R_X t_B + t_A = 0 is linear in t and (cos, sin) of the mount. For
    each angle the best t is linear; the angle that leaves the least is found on a grid and made
    better by golden section.
    """
    from scipy.optimize import minimize_scalar  # noqa: PLC0415  (loaded when used)

    cosine, sine = np.cos(robot[:, 2]) - 1, np.sin(robot[:, 2])
    matrix = np.stack([np.stack([cosine, -sine], -1), np.stack([sine, cosine], -1)], -2)
    stacked = matrix.reshape(-1, 2)

    def solve(angle: float) -> tuple[Array, float]:
        c, s = np.cos(angle), np.sin(angle)
        right = laser[:, :2] @ np.array([[c, s], [-s, c]]) - robot[:, :2]
        place = np.linalg.lstsq(stacked, right.ravel(), rcond=1e-6)[0]
        return place, float(np.median(np.abs(stacked @ place - right.ravel())))

    grid = np.linspace(-np.pi, np.pi, 73)
    best = float(grid[np.argmin([solve(angle)[1] for angle in grid])])
    found = minimize_scalar(
        lambda a: solve(a)[1], bounds=(best - 0.1, best + 0.1), method="bounded"
    )
    return np.append(solve(float(found.x))[0], wrap(found.x))


def hand_eye(
    robot: Array, robot_covariance: Array, laser: Array, laser_covariance: Array
) -> MountEstimate:
    """The mount from motions of the robot and of the laser, AX = XB in the plane.

    Parameters
    ----------
    robot, laser : (m, 3) arrays
        Motions A between two stops by odometry or survey, and B by scan matching.
    robot_covariance, laser_covariance : (m, 3, 3) arrays
        Of each.

    Raises
    ------
    GtvalError
        If the robot did not turn.

    Notes
    -----
    Gauss-Newton on the closures, whitened by both covariances, with Cauchy weights; the
    covariance is scaled by the misfit.
    """
    turn = _turn(list(laser))
    _refuse_straight(turn)
    mount = linear_hand_eye(robot, laser)
    weights = np.ones(len(robot))
    information = np.eye(3)
    chi = weights
    for _ in range(50):
        residual = closure(robot, laser, mount)
        jacobian, whitener = _closure_terms(robot, robot_covariance, laser, laser_covariance, mount)
        chi = np.einsum("mi,mij,mj->m", residual, whitener, residual)
        spread = max(float(np.median(chi)) / 2.37, 1.0)
        weights = 1 / (1 + chi / (12 * spread))
        weighted = np.einsum("mji,mjk,m->mik", jacobian, whitener, weights)
        information = np.einsum("mij,mjk->ik", weighted, jacobian)
        step = -np.linalg.solve(information, np.einsum("mij,mj->i", weighted, residual))
        mount = mount + step
        if np.abs(step).max() < 1e-10:
            break
    freedom = max(3 * len(robot) - 3, 1)
    scale = max(float((weights * chi).sum()) / freedom, 1.0)
    return MountEstimate(
        np.append(mount[:2], wrap(mount[2])),
        np.asarray(np.linalg.inv(information) * scale),
        turn,
        len(robot),
        tuple(int(i) for i in np.flatnonzero(weights < 0.25)),
    )


def _closure_terms(
    robot: Array, robot_covariance: Array, laser: Array, laser_covariance: Array, mount: Array
) -> tuple[Array, Array]:
    """Derivative of the closure by the mount near zero, and the inverse of its covariance.

    With the closure small, moving A X by its right end moves the closure the other way, and
    moving X B moves it along, both turned into the frame at its end.
    """
    mounts = np.broadcast_to(mount, robot.shape)
    ax_by_a, ax_by_x = compose_jacobians(robot, mounts)
    xb_by_x, xb_by_b = compose_jacobians(mounts, laser)
    end = compose(robot, mounts)
    cosine, sine = np.cos(end[:, 2]), np.sin(end[:, 2])
    into = np.zeros((len(robot), 3, 3))
    into[:, 0, 0] = into[:, 1, 1] = cosine
    into[:, 0, 1], into[:, 1, 0], into[:, 2, 2] = sine, -sine, 1.0
    jacobian = into @ (xb_by_x - ax_by_x)
    by_a, by_b = into @ ax_by_a, into @ xb_by_b
    covariance = by_a @ robot_covariance @ np.swapaxes(by_a, -1, -2)
    covariance += by_b @ laser_covariance @ np.swapaxes(by_b, -1, -2)
    return jacobian, np.asarray(np.linalg.inv(covariance))
