"""The robot's pose from all corners of all markers that a camera sees."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag
from scipy.spatial.transform import RigidTransform
from scipy.special import chdtrc

from validation.errors import GtvalError
from validation.poses.angles import Array
from vision_gt.images.markers import MarkerView
from vision_gt.least_squares.marginal_pose import BodyPose, MarginalPose
from vision_gt.least_squares.setups import CAMERA_UNKNOWNS, Setup, camera_slots
from vision_gt.network.adjustment import Network
from vision_gt.optics.camera import Camera, stacked_parameters
from vision_gt.optics.transforms import (
    mean_transform,
    planar_jacobian,
    planar_pose_of,
    rotation_matrices,
    rotation_vectors,
    stacked,
)
from vision_gt.robot.marker_poses import Layout, marker_solutions, marker_views, robot_candidates

AMBIGUOUS_EXCESS = 13.8
"""Difference of chi^2 below which the other solution is not a thousand times less likely:
2 ln 1000 = 13.8."""
_DISTINCT = np.deg2rad(3.0)
_DISTINCT_LENGTH = 0.02
"""Poses that differ by less (radians, metres) are one. A judgement: searches that end at the same
solution end much closer, and two solutions of a marker differ by twice its tilt."""
_MOST_STARTS = 4
"""Two markers with two solutions each; further ones repeat these."""
_HOPELESS, _HOPELESS_PIXELS = 25.0, 3.0
"""A first guess whose mean square is so many times the best one's, and so many pixels squared more,
is not tried: five times the best one's misfit, where a search moves a guess by less. A
judgement."""
_HUBER = 4.0
"""Unit-variance length from which on a corner counts less: one in 3000 is so far off by chance."""
_POOR_FIT = 0.01
"""Corners that fit worse than this by chance say that their noise is larger than stated. A
judgement: one pose in a hundred is called less certain than it is."""


@dataclass(frozen=True)
class Sighting:
    """The robot's markers in one camera's image.

    Parameters
    ----------
    camera : str
        Who took it.
    views : tuple of MarkerView
        At least one.
    """

    camera: str
    views: tuple[MarkerView, ...]


@dataclass(frozen=True)
class Floor:
    """The robot stands on the floor z = 0.

    Parameters
    ----------
    height, tilt : float
        Standard deviations of its height (metres) and of each tilt (radians): how uneven the
        floor is, and how well the reference pattern lay on it.
    """

    height: float
    tilt: float


@dataclass(frozen=True)
class RobotPose:
    """A pose with what speaks for and against it.

    Parameters
    ----------
    best : BodyPose
        The pose in space.
    covariance : (6, 6) array
        From corner noise, layout, cameras and intrinsic parameters.
    sensitivity : (6, t) array
        Change of the pose by the cameras' (15 each) and the markers' (6 each) unknowns, in the
        order of the network and the layout: poses that share them err together.
    cameras : tuple of str
        Whose images were used.
    numbers : tuple of int
        Markers used.
    second : BodyPose or None
        The second solution, if there is one.
    excess : float
        By how much chi^2 of the second solution is larger; infinite without one.
    floor_p : float
        How likely a robot on the floor looks so high or tilted by chance, by the corners alone.
    """

    best: BodyPose = field(repr=False)
    covariance: Array
    sensitivity: Array = field(repr=False)
    cameras: tuple[str, ...]
    numbers: tuple[int, ...]
    second: BodyPose | None = field(repr=False)
    excess: float
    floor_p: float

    @cached_property
    def T_gtv_robot(self) -> RigidTransform:
        """The pose in space."""
        return stacked(self.best.R, self.best.t)

    @property
    def ambiguous(self) -> bool:
        """Whether the second solution cannot be ruled out."""
        return self.excess < AMBIGUOUS_EXCESS

    @property
    def p_value(self) -> float:
        """How likely so bad a fit of the corners is by chance."""
        return float(chdtrc(max(self.best.freedom, 1), self.best.chi_square))

    @property
    def planar(self) -> tuple[Array, Array]:
        """x, y, theta, and their covariance (3, 3)."""
        jacobian = planar_jacobian(self.best.R)
        return planar_pose_of(self.best.R, self.best.t), jacobian @ self.covariance @ jacobian.T


def robot_pose(
    sightings: Sequence[Sighting],
    network: Network,
    layout: Layout,
    floor: Floor,
    *,
    on_floor: bool = False,
) -> RobotPose | None:
    """The pose that fits all corners; None if the views give no pose at all.

    Parameters
    ----------
    sightings : sequence of Sighting
        Of one moment: one camera's, or several to merge them.
    network : Network
        Cameras with their covariance.
    layout : Layout
        Markers with their covariance.
    floor : Floor
        How even it is. Whether the robot stands on it is tested.
    on_floor : bool
        Take the robot as standing on it.

    Raises
    ------
    GtvalError
        Naming the markers that the layout does not have.

    Notes
    -----
    Cameras, intrinsic parameters and markers err with the covariance they come with, so that a
    badly known marker counts less (see `MarginalPose`). Every distinct solution of every marker
    starts a search of its own; two that end apart and fit alike are ambiguous.
    """
    problem = _Problem(sightings, network, layout)
    if not problem.sightings:
        return None
    solutions = problem.solutions(floor if on_floor else None)
    if not solutions:
        return None
    best = solutions[0]
    freedom = max(best.freedom, 1)
    second, excess = None, np.inf
    if len(solutions) > 1:
        second = solutions[1]
        # Where corners are worse than stated, so is their power to tell the two apart.
        excess = 2 * (second.cost - best.cost) / max(best.chi_square / freedom, 1.0)
    unbound = problem.solved(best.R, best.t, None) if on_floor else best
    own = best.own_covariance
    if chdtrc(freedom, best.chi_square) < _POOR_FIT:
        own = own * best.chi_square / freedom
    covariance = own + best.sensitivity @ problem.covariance @ best.sensitivity.T
    sensitivity = np.zeros((6, len(network.covariance) + len(layout.covariance)))
    sensitivity[:, problem.slots] = best.sensitivity
    return RobotPose(
        best,
        0.5 * (covariance + covariance.T),
        sensitivity,
        tuple(s.camera for s in problem.sightings),
        tuple(sorted({v.number for s in problem.sightings for v in s.views})),
        second,
        float(excess),
        _floor_p(unbound, floor),
    )


class _Problem:
    """One moment's corners, and the cameras and markers that they depend on."""

    def __init__(self, sightings: Sequence[Sighting], network: Network, layout: Layout) -> None:
        self.network, self.layout = network, layout
        self.sides = dict(zip(layout.numbers, layout.sides.tolist(), strict=True))
        self.sightings = [sighting for sighting in sightings if sighting.views]
        seen = {view.number for sighting in sightings for view in sighting.views}
        if unknown := seen - set(self.sides):
            raise GtvalError(f"the layout has no marker {', '.join(map(str, sorted(unknown)))}")
        if not self.sightings:
            return
        self.cameras = [network.index(s.camera) for s in self.sightings]
        self.markers = sorted({v.number for s in self.sightings for v in s.views})
        self.parts = [layout.index(number) for number in self.markers]
        self.views = marker_views(
            [(i, 0, s.views) for i, s in enumerate(self.sightings)], self.markers, self.sides
        )
        R, t = network.placed
        self.R_camera, self.t_camera = R[self.cameras], t[self.cameras]
        self.slots, self.covariance = self._shared()
        R_part, t_part = layout.placed
        known = Setup(
            self.R_camera,
            self.t_camera,
            stacked_parameters([network.cameras[i] for i in self.cameras]),
            np.zeros((0, 3, 3)),
            np.zeros((0, 3)),
            R_part[self.parts],
            t_part[self.parts],
        )
        self.problem = MarginalPose(self.views, known, self.covariance, _HUBER)

    def _shared(self) -> tuple[Array, Array]:
        """Places of the shared unknowns among all cameras' and markers', and their covariance."""
        cameras = np.concatenate(
            [np.arange(s.start, s.stop) for s in map(camera_slots, self.cameras)]
        )
        first = CAMERA_UNKNOWNS * len(self.network.cameras)
        parts = np.concatenate([6 * p + np.arange(6) for p in self.parts])
        n, m = len(cameras), len(parts)
        covariance = np.zeros((n + m, n + m))
        covariance[:n, :n] = self.network.covariance[np.ix_(cameras, cameras)]
        covariance[n:, n:] = self.layout.covariance[np.ix_(parts, parts)]
        return np.concatenate([cameras, first + parts]), covariance

    def solved(self, R: Array, t: Array, floor: Floor | None) -> BodyPose:
        """The solution from one start of the robot's pose."""
        if floor is not None:
            heading = np.arctan2(R[1, 0], R[0, 0])
            R, t = rotation_matrices(np.array([0, 0, heading])), np.array([t[0], t[1], 0.0])
        return self.problem.solve(R, t, floor_information(floor))

    def solutions(self, floor: Floor | None) -> list[BodyPose]:
        """All distinct solutions, best first."""
        found: list[BodyPose] = []
        for R, t in self._starts():
            try:
                done = self.solved(R, t, floor)
            except np.linalg.LinAlgError:
                continue
            if all(_distinct((done.R, done.t), (other.R, other.t)) for other in found):
                found.append(done)
        return sorted(found, key=lambda one: one.cost)

    def _starts(self) -> list[tuple[Array, Array]]:
        """Distinct first guesses R, t of the robot's pose, best first."""
        guesses: list[tuple[float, Array, Array]] = []
        for place, sighting in enumerate(self.sightings):
            R_camera, t_camera = self.R_camera[place], self.t_camera[place]
            camera = self.network.cameras[self.cameras[place]]
            found = robot_candidates(sighting.views, camera, self.layout)
            guesses += [
                (float(misfit), R_camera @ R, R_camera @ t + t_camera)
                for misfit, R, t in zip(*found, strict=True)
            ]
        guesses.sort(key=lambda guess: guess[0])
        starts: list[tuple[Array, Array]] = []
        for misfit, R, t in guesses:
            if misfit > _HOPELESS * guesses[0][0] + _HOPELESS_PIXELS**2:
                break
            if all(_distinct((R, t), other, 3.0) for other in starts):
                starts.append((R, t))
        return starts[:_MOST_STARTS]


def floor_information(floor: Floor | None) -> Array:
    """(6, 6) information of a body that stands on the floor; nothing without one."""
    if floor is None:
        return np.zeros((6, 6))
    h, t = 1 / floor.height**2, 1 / floor.tilt**2
    return np.diag([0.0, 0.0, h, t, t, 0.0])


def _floor_p(unbound: BodyPose, floor: Floor) -> float:
    """Probability of standing so far off the floor, or so tilted, by chance."""
    R, t = unbound.R, unbound.t
    heading = rotation_matrices(np.array([0, 0, np.arctan2(R[1, 0], R[0, 0])]))
    off = np.array([t[2], *rotation_vectors(R @ heading.T)[:2]])
    covariance = unbound.covariance[2:5, 2:5]
    covariance = covariance + np.diag(np.square([floor.height, floor.tilt, floor.tilt]))
    return float(chdtrc(3, off @ np.linalg.solve(covariance, off)))


def _distinct(a: tuple[Array, Array], b: tuple[Array, Array], factor: float = 1.0) -> bool:
    """Whether two poses (R, t) differ by more than a least-squares solution does from itself."""
    apart = a[1] - b[1]
    cosine = 0.5 * (float((a[0] * b[0]).sum()) - 1)
    turned = cosine < np.cos(factor * _DISTINCT)
    return bool(turned or apart @ apart > (factor * _DISTINCT_LENGTH) ** 2)


def published_pose(
    sighting: Sighting, camera: Camera, T_gtv_camera: RigidTransform, layout: Layout
) -> RigidTransform | None:
    """The robot's pose the document's way: one from each marker, their matrices averaged.

    Parameters
    ----------
    sighting : Sighting
        One camera's.
    camera : Camera
        That camera.
    T_gtv_camera : RigidTransform
        Where it is.
    layout : Layout
        The markers.

    Notes
    -----
    AD2.3, "Relative position between the markers": averaging of the elements of the
    roto-translation matrices, all markers alike.
    """
    poses = []
    for view in sighting.views:
        place = layout.index(view.number)
        solutions = marker_solutions(view, float(layout.sides[place]), camera)
        if solutions is not None:
            T_marker_robot = layout.T_robot_marker[place].inv()
            poses.append(T_gtv_camera * solutions.best * T_marker_robot)
    return mean_transform(RigidTransform.concatenate(poses)) if poses else None


def joint_covariance(poses: Sequence[RobotPose], network: Network, layout: Layout) -> Array:
    """(3 n, 3 n) covariance of x, y, theta of all poses together.

    Poses share cameras and markers, so they err together.
    """
    sensitivity, shared = _shared(poses, network, layout)
    joint = sensitivity @ shared @ sensitivity.T
    for i, pose in enumerate(poses):
        rows = slice(3 * i, 3 * i + 3)
        joint[rows, rows] = pose.planar[1]
    return np.asarray(0.5 * (joint + joint.T))


def joint_factor(poses: Sequence[RobotPose], network: Network, layout: Layout) -> Array:
    """(3 n, r) factor of it: that of two poses is the product of their rows.

    It has a column for each number of the cameras and the markers, however many poses there are.
    """
    sensitivity, shared = _shared(poses, network, layout)
    values, vectors = np.linalg.eigh(shared)
    known = values > 0
    return np.asarray(sensitivity @ (vectors[:, known] * np.sqrt(values[known])))


def _shared(poses: Sequence[RobotPose], network: Network, layout: Layout) -> tuple[Array, Array]:
    """How poses (3 n) follow cameras and markers, and the covariance of these."""
    jacobians = [planar_jacobian(pose.best.R) for pose in poses]
    sensitivity = np.concatenate([J @ p.sensitivity for J, p in zip(jacobians, poses, strict=True)])
    return sensitivity, block_diag(network.covariance, layout.covariance)


def best_of(poses: Mapping[str, RobotPose]) -> str | None:
    """Camera whose pose is known best and is not ambiguous; None if there is none."""
    sure = {name: pose for name, pose in poses.items() if not pose.ambiguous}
    if not sure:
        return None
    return min(sure, key=lambda name: float(np.trace(sure[name].planar[1][:2, :2])))
