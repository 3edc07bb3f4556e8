"""Where the scanner sits on the robot, found from the data and compared with the tape measure.

AD2.3 measured X = 0.1780, Y = 0.1915, Theta = pi / 2 by hand, saw that scans did not come to lie
on each other through the surveyed poses, moved the values about by hand for one pair of scans,
and left it open. Here all pairs are used at once, and the result comes with its covariance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laser_gt.matching.verdicts import Match
from laser_gt.placing.anchors import Surveyed, edges_of
from laser_gt.placing.equations import ends_of
from laser_gt.placing.graph import LEAST_MISFIT, Edge, Graph, solve_graph, stop_noise
from laser_gt.placing.pairs import parts_of
from laser_gt.placing.switches import GAUGE, held
from laser_gt.scans.planar import CONTRADICTION, between, compose, wrapped
from validation.errors import GtvalError
from validation.poses.angles import Array, wrap
from validation.poses.factored import Factored

MIN_TURN = 0.1
"""Smallest spread of turns, in radians, from which a mount's position can be seen: an error of a
match of 1 mm becomes one of 10 mm of the mount, no better than a tape measure."""


OPEN = (0.1, 0.1, 0.1)
"""Standard deviations, metres and radians, from which on a mount is not determined. A judgement: a
tape measure is twenty times better, and a mount off by 0.1 rad is seen by eye."""

TELLING = (0.01, 0.01, 0.01)
"""Standard deviations, metres and radians, up to which a mount that agrees with the stated one says
that this is right. A judgement: twice those of a tape measure; from four of them on, 4 cm, a wrong
mount shows, and one that is mixed up or read off by a decimetre does in any case."""


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
    """

    mount: Array
    covariance: Array
    turn: float
    pairs: int

    @property
    def sigmas(self) -> Array:
        """(3,) standard deviations."""
        return np.sqrt(np.diagonal(self.covariance))


@dataclass(frozen=True)
class MountCheck:
    """The stated mount beside the one found.

    Parameters
    ----------
    stated, stated_sigmas : (3,) arrays
        As measured by hand.
    found : MountEstimate
        From surveyed poses and matches, or from matches and odometry.
    of_point : bool
        Whether the survey tells that the stated one is right: the odometry is of another point.
    """

    stated: Array
    stated_sigmas: Array
    found: MountEstimate
    of_point: bool = False

    @property
    def difference(self) -> Array:
        """(3,) stated less found."""
        return wrapped(self.stated - self.found.mount)

    @property
    def sigmas(self) -> Array:
        """(3,) standard deviations of the difference."""
        return np.asarray(np.hypot(self.found.sigmas, self.stated_sigmas))

    @property
    def squares(self) -> float:
        """Squared standard deviations of the difference, of 3 degrees of freedom."""
        covariance = self.found.covariance + np.diag(self.stated_sigmas**2)
        return float(self.difference @ np.linalg.solve(covariance, self.difference))

    @property
    def agrees(self) -> bool:
        """Whether both sigmas explain the difference (99.9 %)."""
        return self.squares < CONTRADICTION

    @property
    def tells(self) -> bool:
        """Whether the data know the mount well enough to say that the stated one is right."""
        return bool((self.found.sigmas <= TELLING).all())

    @property
    def least_shown(self) -> Array:
        """(3,) least error of the stated mount that would show, if it is wrong in one number."""
        return np.asarray(np.sqrt(CONTRADICTION) * self.sigmas)

    @property
    def says(self) -> str:
        """What came out, in a few words."""
        if not self.agrees:
            return "the two do not agree"
        return (
            "the two agree"
            if self.tells
            else "these stops do not tell whether the stated one is right"
        )


def check_mount(
    stops: Sequence[str],
    mount: Array,
    mount_sigmas: Array,
    matches: Sequence[Match],
    surveyed: Surveyed,
) -> MountCheck:
    """The mount from the surveyed poses of all stops and the matches between them.

    Parameters
    ----------
    stops : sequence of str
        All that were scanned.
    mount, mount_sigmas : (3,) arrays
        As stated: laser frame in the robot frame.
    matches : sequence of Match
        In the laser frame: they do not depend on the mount.
    surveyed : Surveyed
        Poses of at least two matched stops.

    Raises
    ------
    GtvalError
        If fewer than two pairs join surveyed stops, or the robot never turned.
    """
    known = surveyed.select([stop for stop in stops if stop in surveyed.stops])
    edges = edges_of(known.stops, matches)
    if len(edges) < 2:
        raise GtvalError("fewer than two matches join surveyed stops; the mount cannot be checked")
    found = mount_of(known.poses, known.covariance, edges, mount)
    return MountCheck(mount, mount_sigmas, found)


def mount_of(
    poses: Array, covariance: Factored, edges: Sequence[Edge], stated: Array
) -> MountEstimate:
    """The mount from robot poses and matches between them, AX = XB in the plane.

    Parameters
    ----------
    poses : (n, 3) array
        Robot poses.
    covariance : Factored
        Of these.
    edges : sequence of Edge
        Matches.
    stated : (3,) array
        Where to start from, if the poses and matches show no better place.

    Raises
    ------
    GtvalError
        If the robot never turned, or the stops leave the mount open.

    Notes
    -----
    Matches of one stop with many others share the noise of its scan. What part of their noise they
    share shows in their loops, which close better than the matches' covariances say; it counts as
    noise of the stops, beside that of the survey, and the rest as the matches' own.
    """
    turn = float(np.sqrt(np.mean(wrap(np.array([edge.pose[2] for edge in edges])) ** 2)))
    if turn < MIN_TURN:
        raise GtvalError(
            f"between the stops the robot turns by {np.rad2deg(turn):.1f} degrees only; without "
            "turns the place of the laser on the robot cannot be seen. Add stops with other "
            "headings"
        )
    left_open = (
        "the mount is not determined by these stops: they leave its place open by more than "
        f"{OPEN[0] * 1e2:.0f} cm or {OPEN[2]:.1f} rad. Survey more of the stops, with headings "
        "that differ by a quarter turn"
    )
    first = _first_mount(poses, edges, stated)
    own = _own_share(poses, edges, first)
    noise = (1 - own) * stop_noise(edges, poses, first)
    graph = Graph(
        initial=poses,
        mount=first,
        edges=[replace(edge, covariance=own * edge.covariance) for edge in edges],
        prior_stops=range(len(poses)),
        prior_poses=poses,
        prior_covariance=covariance._replace(own=covariance.own + noise),
        mount_covariance=None,
    )
    try:
        solution = solve_graph(graph, least_misfit=1.0)
    except GtvalError:  # all poses are known: what has no solution is the mount
        raise GtvalError(left_open) from None
    spread = solution.spread.mount
    sigmas = np.sqrt(np.abs(np.diagonal(spread)))
    if not (np.isfinite(spread).all() and (sigmas < OPEN).all()):
        raise GtvalError(left_open)
    return MountEstimate(wrapped(solution.mount), spread, turn, len(edges))


def _own_share(poses: Array, edges: Sequence[Edge], mount: Array) -> float:
    """Share of the matches' noise that differs from match to match: how loops close without survey.

    One of each part of the stops is held. Where there is no loop, the least: then nothing speaks
    for more, and to share all is what scans do.
    """
    _, first = np.unique(parts_of(len(poses), ends_of(edges)), return_index=True)
    graph = Graph(
        initial=poses,
        mount=mount,
        edges=edges,
        prior_stops=first.tolist(),
        prior_poses=poses[first],
        prior_covariance=held(len(first)),
        mount_covariance=np.eye(3) * GAUGE,
    )
    found = solve_graph(graph)
    misfit = found.chi_squared / max(found.degrees_of_freedom, 1)
    return float(np.clip(misfit, LEAST_MISFIT, 1.0))


def _first_mount(poses: Array, edges: Sequence[Edge], stated: Array) -> Array:
    """Start for the graph: the linear solution, or the stated mount where that is no worse."""
    start, end = ends_of(edges).T
    motions = between(poses[start], poses[end])
    laser = np.array([edge.pose for edge in edges])
    linear = linear_hand_eye(motions, laser)
    errors = [
        np.median(np.abs(closure(motions, laser, mount)[:, :2])) for mount in (linear, stated)
    ]
    return linear if errors[0] < errors[1] else stated


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


NEAR = np.array([0.03, 0.03, 0.05])
"""Metres and radians within which a mount is another one with a slip of the pen put right. A
judgement: twice what a tape measure and a look along the robot are off by."""


def mount_slips(stated: Array) -> dict[str, Array]:
    """What a stated mount, (3,), may have been meant to be, by the slip of the pen in words."""
    x, y, theta = stated.tolist()
    slips = {
        "It was turned by half a turn": [x, y, theta + np.pi],
        "Its angle was stated in degrees": [x, y, np.deg2rad(theta)],
        "Its place was stated in millimetres": [x / 1e3, y / 1e3, theta],
        "Place and angle were stated in millimetres and degrees": [
            x / 1e3,
            y / 1e3,
            np.deg2rad(theta),
        ],
        "Its x has the wrong sign": [-x, y, theta],
        "Its y has the wrong sign": [x, -y, theta],
        "Its angle has the wrong sign": [x, y, -theta],
        "Its x and y were exchanged": [y, x, theta],
    }
    meant = {said: wrapped(np.array(values)) for said, values in slips.items()}
    return {
        said: one for said, one in meant.items() if (np.abs(wrapped(one - stated)) > NEAR).any()
    }


def mount_hint(stated: Array, found: Array) -> str:
    """A slip of the pen that makes of the mount found the one stated, in words; or nothing.

    Parameters
    ----------
    stated, found : (3,) array
        Laser frame in the robot frame.
    """
    if (np.abs(wrapped(stated - found)) < NEAR).all():
        return ""
    for said, meant in mount_slips(stated).items():
        if (np.abs(wrapped(meant - found)) < NEAR).all():
            return f"{said}, it seems. "
    return ""
