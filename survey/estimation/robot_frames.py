"""Robot frames from distances between their marked points and the world points."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Self

import numpy as np
import numpy.typing as npt

from survey.estimation.distance_fit import (
    DistanceFit,
    Rows,
    coordinate_sigma,
    solutions_of_many,
)
from survey.estimation.geometry import (
    circle_intersections,
    mirror_in_line,
    multilaterate,
    rigid_alignment,
    rotate,
)
from survey.estimation.iterated_ekf import Estimate, Model, StackedModel, iterated_ekf_stacked
from survey.estimation.measurement import linearise
from survey.estimation.world_points import WorldPoints
from survey.readings.point_names import robot_point
from survey.readings.readings import Readings
from validation.campaign.folder import RobotFrame
from validation.poses.angles import Array, wrap

TIE = 16.3
"""Costs nearer than this (chi-squared, 3 degrees of freedom, 0.1 %) do not tell poses apart."""
GOOD_REST = 4.0
"""Chi-squared for each degree of freedom up to which readings, taken as independent, agree: about
0.1 % with five degrees of freedom, more rarely with more."""
_FEW = 7
"""Below this many readings every meeting point of circles is tried as a start: with seven, some
mark has three, and a place of its own."""


@dataclass(frozen=True)
class RobotFrameFit:
    """One surveyed pose.

    Parameters
    ----------
    pose : str
        Its id.
    state : (3,) array
        x, y in metres, theta in radians in (-pi, pi], in the Vframe.
    covariance : (3, 3) array
        World points, marks and rig included.
    cost : float
        Chi-squared with ``redundancy`` degrees of freedom.
    redundancy : int
        Readings less three.
    guess : (3,) array
        The start: by hand where given, by closed form otherwise.
    passes : int
        Passes of the filter.
    """

    pose: str
    state: Array
    covariance: Array
    cost: float
    redundancy: int
    guess: Array
    passes: int


@dataclass(frozen=True)
class NotPosed:
    """A pose that the readings do not determine, and why; ``candidates`` (c, 3) if several fit."""

    pose: str
    reason: str
    candidates: Array


@dataclass(frozen=True)
class PoseReadings(DistanceFit):
    """The usable readings of one pose.

    Parameters
    ----------
    world_index, rig_index : (m,) array of int
        Rows of each reading in the world points and in the rig.
    """

    body: Array
    world_index: npt.NDArray[np.intp]
    rig_index: npt.NDArray[np.intp]

    def select(self, rows: Rows) -> Self:
        """The given readings."""
        return replace(
            super().select(rows),
            world_index=self.world_index[rows],
            rig_index=self.rig_index[rows],
        )


def pose_readings(
    pose: str, readings: Readings, world: WorldPoints, rig: RobotFrame
) -> PoseReadings:
    """The readings between a pose's marks and located world points."""
    return next(own for _, own in _readings_of_all([pose], readings.of_pose(pose), world, rig))


def solve_robot_frames(
    poses: Sequence[str],
    readings: Readings,
    world: WorldPoints,
    rig: RobotFrame,
    guesses: Mapping[str, Array],
) -> tuple[list[RobotFrameFit], list[NotPosed]]:
    """Every pose on its own, and those that the readings leave open.

    Parameters
    ----------
    poses : sequence of str
        Their ids.
    readings : Readings
        All readings.
    world : WorldPoints
        The located points with their joint covariance.
    rig : RobotFrame
        Nominal rig points and their sigmas.
    guesses : mapping of str to (3,) array
        Hand-measured first guesses, where there are any.

    Notes
    -----
    AD2.3, "Robot-frame", second filter. The document takes world points and marks as
    independent in every reading; here an error of a world point, or of a mark, is shared by all
    the readings that use it, with full covariances.
    """
    found, missing = [], []
    open_poses = []
    for pose, own in _readings_of_all(poses, readings, world, rig):
        fault = why_undetermined(own)
        if fault:
            missing.append(NotPosed(pose, fault, np.empty((0, 3))))
        else:
            open_poses.append((pose, own, closed_form_guess(own)))
    starts = [_starts(own, closed, guesses.get(pose)) for pose, own, closed in open_poses]
    solutions = solutions_of_many([own for _, own, _ in open_poses], starts)
    single = [k for k, (minima, costs) in enumerate(solutions) if _is_single(minima, costs)]
    estimates = dict(
        zip(
            single,
            refined(
                [open_poses[k][1] for k in single], [solutions[k][0][0] for k in single], world, rig
            ),
            strict=True,
        )
    )
    for k, (pose, own, closed) in enumerate(open_poses):
        first = guesses.get(pose, closed)
        result = _solve(pose, own, world, rig, first, *solutions[k], estimates.get(k))
        if isinstance(result, RobotFrameFit):
            found.append(result)
        else:
            missing.append(result)
    order = {pose: i for i, pose in enumerate(poses)}
    return found, sorted(missing, key=lambda lost: order[lost.pose])


def _readings_of_all(
    poses: Sequence[str], readings: Readings, world: WorldPoints, rig: RobotFrame
) -> Iterator[tuple[str, PoseReadings]]:
    """Each pose with its `pose_readings`, all sorted out at once."""
    place = {name: i for i, name in enumerate(world.names)}
    rig_row = {name: i for i, name in enumerate(rig.points)}
    rows: dict[str, list[tuple[int, int, int]]] = {pose: [] for pose in poses}
    marks = {name: robot_point(name) for name in readings.rows_of_point}
    for i, (a, b) in enumerate(zip(readings.start, readings.end, strict=True)):
        for here, there in ((a, b), (b, a)):
            mark = marks[here]
            if mark and there in place and mark[0] in rows and mark[1] in rig_row:
                rows[mark[0]].append((i, place[there], rig_row[mark[1]]))
    body = np.array(list(rig.points.values()), dtype=float)
    known_sigma = coordinate_sigma(world.covariance)
    body_sigma = float(np.sqrt(rig.mark_variance))
    positions = world.positions
    for pose, own in rows.items():
        row, world_index, rig_index = np.array(own, dtype=np.intp).reshape(-1, 3).T
        yield (
            pose,
            PoseReadings(
                known=positions[world_index],
                body=body[rig_index],
                distance=readings.distance[row],
                sigma=readings.sigma[row],
                world_index=world_index,
                rig_index=rig_index,
                known_sigma=known_sigma[world_index],
                body_sigma=body_sigma,
            ),
        )


def _solve(
    pose: str,
    own: PoseReadings,
    world: WorldPoints,
    rig: RobotFrame,
    first: Array,
    minima: Array,
    costs: Array,
    estimate: Estimate | None,
) -> RobotFrameFit | NotPosed:
    """One pose at the best of its minima, refined, or why it is not determined."""
    if len(minima) == 0:
        return _hopeless(pose, own, world, rig)
    if estimate is None:
        tied = minima[costs - costs[0] < TIE]
        reason = (
            f"{len(tied)} poses fit its readings equally well; measure a further rig point or "
            "world point"
        )
        return NotPosed(pose, reason, tied)
    if not estimate.converged:
        return _hopeless(pose, own, world, rig)
    state = np.append(estimate.state[:2], wrap(estimate.state[2]))
    return RobotFrameFit(
        pose,
        state,
        estimate.covariance,
        estimate.cost,
        len(own) - 3,
        first,
        estimate.passes,
    )


def _is_single(minima: Array, costs: Array) -> bool:
    """Whether one of the poses that fit is so much better that it is the one."""
    return len(minima) > 0 and not (len(minima) > 1 and costs[1] - costs[0] < TIE)


def refined(
    fits: Sequence[PoseReadings], starts: Sequence[Array], world: WorldPoints, rig: RobotFrame
) -> list[Estimate]:
    """The filter's estimates with all that readings share, of many poses at once."""
    if not fits:
        return []
    return iterated_ekf_stacked(
        _stacked_model(fits, world, rig), np.array(starts), fits[0].prior_sigma
    )


def _hopeless(pose: str, own: PoseReadings, world: WorldPoints, rig: RobotFrame) -> NotPosed:
    """A pose whose readings contradict each other, with those that could be wrong by metres."""
    states, suspects = [], []
    names = list(rig.points)
    for row in range(len(own)):
        fit = best_fit(own.select(np.arange(len(own)) != row))
        if fit is not None and fit[1] < GOOD_REST * (len(own) - 4):
            states.append(fit[0])
            mark, point = names[own.rig_index[row]], world.names[own.world_index[row]]
            suspects.append(f"{pose}/{mark}–{point}: {own.distance[row]:.3f} m")
    reason = "its readings contradict each other by far"
    if suspects:
        reason += f"; the others agree without {' or without '.join(suspects)}"
    return NotPosed(pose, f"{reason}. Measure again", np.array(states).reshape(-1, 3))


def best_fit(own: PoseReadings) -> tuple[Array, float] | None:
    """The pose that fits best and its cost, however bad; None if readings are too few to tell.

    Readings are taken as independent, and no tie is looked for.
    """
    if why_undetermined(own) or len(own) == 3:  # three readings fit any labelling
        return None
    starts = pose_starts(own)
    minima, costs = own.solutions(starts)
    if len(minima):
        return minima[0], float(costs[0])
    at_starts = own.costs(starts)
    return starts[at_starts.argmin()], float(at_starts.min())


def why_undetermined(own: PoseReadings) -> str | None:
    """Why the readings cannot give a pose, by counting; None if they can."""
    if len(own) < 3:
        return f"{len(own)} usable reading(s) for three unknowns; measure at least four"
    if len(set(own.rig_index)) < 2:
        return "all readings are from one rig point: its heading is not determined"
    if len(set(own.world_index)) < 2:
        return "all readings are to one world point: the pose may turn about it"
    return None


def closed_form_guess(own: PoseReadings) -> Array:
    """A first guess without any hand measurement.

    Each mark with three or more readings is multilaterated and the rig laid onto them; with
    fewer, the best of all meeting points of circles with sixteen headings.

    Returns
    -------
    (3,) array
        x, y, theta.
    """
    marks, bodies = [], []
    for point in sorted(set(own.rig_index)):
        rows = own.rig_index == point
        if len(set(own.world_index[rows])) >= 3:
            marks.append(multilaterate(own.known[rows], own.distance[rows]))
            bodies.append(own.body[rows][0])
    if len(marks) >= 2:
        return rigid_alignment(np.array(bodies), np.array(marks))
    starts = _circle_starts(own)
    return np.asarray(starts[own.costs(starts).argmin()])


def _circle_starts(own: PoseReadings) -> Array:
    """(s, 3) poses that put a rig point on a meeting point of two circles, sixteen headings."""
    headings = np.arange(16) * np.pi / 8
    starts = []
    for i, j in combinations(range(len(own)), 2):
        if own.world_index[i] == own.world_index[j] or own.rig_index[i] != own.rig_index[j]:
            continue
        meet = circle_intersections(own.known[[i, j]], own.distance[[i, j]])
        for mark in meet:
            origin = mark - rotate(headings, own.body[i])
            starts.append(np.column_stack([origin, headings]))
    if not starts:
        centre = own.known.mean(0) - rotate(headings, own.body.mean(0))
        return np.column_stack([centre, headings])
    return np.concatenate(starts)


def pose_starts(own: PoseReadings) -> Array:
    """(s, 3) first guesses, from the readings alone, that lead to every pose that may fit."""
    return _starts(own, closed_form_guess(own), None)


def _starts(own: PoseReadings, closed: Array, guess: Array | None) -> Array:
    """First guesses that lead to every solution there may be."""
    quarter = np.arange(4) * np.pi / 2
    here = np.tile(closed, (4, 1))
    here[:, 2] += quarter
    mirrored = here.copy()
    mirrored[:, :2] = mirror_in_line(here[:, :2], own.known)
    starts = [here, mirrored]
    if guess is not None:
        starts.insert(0, np.asarray(guess, dtype=float)[None])
    if len(own) < _FEW:
        starts.append(_circle_starts(own))
    return np.concatenate(starts)


def full_model(own: PoseReadings, world: WorldPoints, rig: RobotFrame) -> Model:
    """State (3,) -> h (m,), H (m, 3), R (m, m), world points and marks shared by readings."""
    stacked = _stacked_model([own], world, rig)
    only = np.zeros(1, dtype=np.intp)

    def model(state: Array) -> tuple[Array, Array, Array]:
        h, H, R = stacked(state[None], only)
        return h[0], H[0], R[0]

    return model


def _stacked_model(
    fits: Sequence[PoseReadings], world: WorldPoints, rig: RobotFrame
) -> StackedModel:
    """The same for many poses; what one has fewer readings than another is filled up."""
    m = max(map(len, fits))
    lacking = [m - len(fit) for fit in fits]

    def filled(parts: Sequence[Array], value: float) -> Array:
        return np.array(
            [
                np.concatenate([part, np.full((more, *part.shape[1:]), value)])
                for part, more in zip(parts, lacking, strict=True)
            ]
        )

    known, body = (filled(part, 0.0) for part in ([f.known for f in fits], [f.body for f in fits]))
    distance = filled([fit.distance for fit in fits], 0.0)
    sigma = filled([fit.sigma for fit in fits], 0.0)
    real = filled([np.ones(len(fit)) for fit in fits], 0.0)
    point = filled([np.asarray(fit.world_index, dtype=float) for fit in fits], 0.0).astype(np.intp)
    mark = filled([np.asarray(fit.rig_index, dtype=float) for fit in fits], 0.0).astype(np.intp)
    k = len(world.covariance) // 2
    of_points = world.covariance.reshape(k, 2, k, 2).transpose(0, 2, 1, 3)
    of_mark = rig.mark_variance

    def model(states: Array, rows: npt.NDArray[np.intp]) -> tuple[Array, Array, Array]:
        at = linearise(states, known[rows], body[rows], distance[rows])
        here = real[rows][..., None]
        by_point, by_mark = at.W_known * here, at.W_body * here
        ends = point[rows]
        # Each pair of readings shares the covariance of its two world points, and their mark.
        R = np.zeros((len(rows), m, m))
        for a in range(2):
            for b in range(2):
                shared = of_points[ends[:, :, None], ends[:, None, :], a, b]
                R += by_point[:, :, None, a] * by_point[:, None, :, b] * shared
        same = mark[rows][:, :, None] == mark[rows][:, None, :]
        R += (by_mark @ np.swapaxes(by_mark, 1, 2)) * (same * of_mark)
        own = (at.W_distance * sigma[rows]) ** 2 + (1 - real[rows])
        R[:, np.arange(m), np.arange(m)] += own
        return at.h * real[rows], at.H * here, R

    return model


def pose_covariance(state: Array, own: PoseReadings, world: WorldPoints, rig: RobotFrame) -> Array:
    """(3, 3) covariance of a pose at which the filter rests, all that readings share included."""
    _, H, R = full_model(own, world, rig)(state)
    return np.asarray(np.linalg.inv(H.T @ np.linalg.solve(R, H)))
