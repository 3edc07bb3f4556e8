"""Where a trial starts: places that most readings agree on, whatever the others say."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from survey.causes.trial import CAUCHY, Rows, Trial
from survey.estimation.geometry import circle_intersections, rigid_alignment, rotate
from survey.estimation.network import build_network, start_parameters
from survey.estimation.solve import SurveySolution
from survey.readings.point_names import robot_point
from survey.readings.readings import Mask, Readings
from validation.campaign.folder import RobotFrame, Vframe
from validation.poses.angles import Array

MOST_CIRCLES = 120
"""Pairs of circles tried for a place: all pairs of sixteen readings."""
GOOD = 1.5
"""m0 up to which the joint adjustment is a start: whatever is wrong has moved no point far."""
_ROUGH = 0.01
"""Metres that are no misfit yet while only starts are sought: five sigmas of a usual reading."""
_ROUNDS = 2
"""Times that points not yet located are looked for, after the stops and after points of them."""


def whole_trial(
    solution: SurveySolution, vframe: Vframe, rig: RobotFrame, readings: Readings
) -> tuple[Trial, Mask]:
    """All that was read, as one trial, and which of the readings (n,) are in it."""
    adjusted = solution.adjustment
    if len(readings) == len(solution.used) and adjusted.m0 < GOOD:
        return Trial(adjusted.network, adjusted.parameters), np.ones(len(readings), dtype=bool)
    located = dict(zip(solution.world.names, solution.world.positions, strict=True))
    located |= {name: np.asarray(place) for name, place in solution.from_marks.items()}
    missing = [point.name for point in solution.world.missing if point.name not in located]
    single = {frame.pose: frame.state for frame in solution.frames}
    return located_trial(vframe, rig, readings, located, missing, single)


def located_trial(
    vframe: Vframe,
    rig: RobotFrame,
    readings: Readings,
    located: Mapping[str, Array],
    missing: Sequence[str],
    single: Mapping[str, Array],
) -> tuple[Trial, Mask]:
    """All that was read, as one trial, and which of the readings (n,) are in it.

    Points and stops that the chain of single solutions left open because their readings
    contradict each other are located by what most of their readings say.

    Parameters
    ----------
    vframe, rig : Vframe, RobotFrame
        Nominal frames.
    readings : Readings
        All readings.
    located : mapping of str to (2,) array
        World points that have a place.
    missing : sequence of str
        Those that have none.
    single : mapping of str to (3,) array
        Poses of the stops that have one.
    """
    known: dict[str, Array] = {n: np.asarray(p, dtype=float) for n, p in vframe.points.items()}
    frame = np.array(list(known.values()))
    known |= located
    poses: dict[str, Array] = {}
    marks: dict[str, Array] = {}
    for _ in range(_ROUNDS):
        for name in missing:
            if name not in known:
                place = robust_place(readings.touching([name], list(known)), known | marks)
                if place is not None:
                    known[name] = place
        for pose in readings.poses:
            found = _robust_stop(pose, readings, known, rig, single.get(pose))
            if found is not None:
                poses[pose], own = found
                marks |= own
    world = [name for name in known if name not in vframe.points]
    network, inside = build_network(vframe, rig, readings, world, list(poses))
    start = start_parameters(network, frame, {name: known[name] for name in world}, poses)
    # A mark starts where its own readings put it: that the rig says otherwise may be the cause.
    for q in network.mark:
        start.points[q] = marks.get(network.points[q], start.points[q])
    return Trial(network, start), inside


def robust_place(own: Readings, known: Mapping[str, Array]) -> Array | None:
    """The place (2,) that most distances from known points agree on; None if too few to tell."""
    rows = [i for i, end in enumerate(own.end) if end in known]
    centres = np.array([known[own.end[i]] for i in rows]).reshape(-1, 2)
    return place_from(centres, own.distance[rows])


def place_from(centres: Array, distances: Array) -> Array | None:
    """The place (2,) that most of the distances (m,) from centres (m, 2) agree on, or None."""
    if len({(round(x, 3), round(y, 3)) for x, y in centres}) < 3:
        return None
    pairs = np.array(list(combinations(range(len(centres)), 2)))
    apart = np.linalg.norm(centres[pairs[:, 0]] - centres[pairs[:, 1]], axis=1)
    order = np.argsort(-apart)[:MOST_CIRCLES]
    pairs = pairs[order[apart[order] > _ROUGH]]
    places = circle_intersections(centres[pairs], distances[pairs]).reshape(-1, 2)
    off = np.linalg.norm(places[:, None] - centres, axis=-1) - distances
    cost = np.log1p((off / _ROUGH / CAUCHY) ** 2).sum(-1)
    best = places[cost.argmin()]
    for _ in range(5):
        delta = best - centres
        length = np.maximum(np.linalg.norm(delta, axis=1), 1e-6)
        J = delta / length[:, None]
        r = distances - length
        weight = 1 / (1 + (r / _ROUGH / CAUCHY) ** 2)
        normal = (J * weight[:, None]).T @ J + 1e-9 * np.eye(2)
        best = best + np.linalg.solve(normal, J.T @ (weight * r))
    return np.asarray(best)


def _robust_stop(
    pose: str,
    readings: Readings,
    known: Mapping[str, Array],
    rig: RobotFrame,
    single: Array | None,
) -> tuple[Array, dict[str, Array]] | None:
    """Pose (3,) and marks of a stop as most of its readings say; None if too few."""
    names = [f"{pose}/{point}" for point in rig.points]
    body = {f"{pose}/{name}": np.asarray(place) for name, place in rig.points.items()}
    own = readings.touching(names, list(known))
    if len(own) < 3:
        return None if single is None else (single, {})
    marks = {}
    for name in names:
        place = robust_place(own.touching([name], list(known)), known)
        if place is not None:
            marks[name] = place
    candidates = list(poses_of_marks(marks, body))
    if single is not None:
        candidates.append(single)
    if not candidates:
        return None
    states = np.array(candidates)
    arms = np.array([body[name] for name in own.start])
    places = states[:, None, :2] + rotate(states[:, 2:], arms)
    off = np.linalg.norm(places - np.array([known[end] for end in own.end]), axis=-1)
    cost = np.log1p(((off - own.distance) / _ROUGH / CAUCHY) ** 2).sum(1)
    return states[cost.argmin()], marks


def poses_of_marks(marks: Mapping[str, Array], body: Mapping[str, Array]) -> list[Array]:
    """Poses (3,) that carry the rig onto all marks, and onto each two of them."""
    names = list(marks)
    sets = [names] if len(names) > 2 else []
    sets += [list(pair) for pair in combinations(names, 2)]
    return [
        rigid_alignment(np.array([body[n] for n in some]), np.array([marks[n] for n in some]))
        for some in sets
    ]


def restarted(trial: Trial, stop: str, distance: Array | None = None) -> Trial:
    """The trial with one stop located anew from its distances (n,), or corrected ones."""
    net, points = trial.network, trial.start.points.copy()
    shown = net.distance if distance is None else distance
    row = net.poses.index(stop)
    own = np.flatnonzero(net.mark_pose == row)
    marks: dict[str, Array] = {}
    for q in own:
        rows = distances_of(trial, int(net.mark[q]))
        other = np.where(net.first[rows] == net.mark[q], net.second[rows], net.first[rows])
        place = place_from(points[other], shown[rows])
        if place is not None:
            marks[net.points[net.mark[q]]] = place
    body = {net.points[net.mark[q]]: net.rig[net.mark_rig[q]] for q in own}
    poses = trial.start.poses.copy()
    found = poses_of_marks(marks, body)
    if not found:
        return trial
    gaps = [
        sum(
            np.log1p((np.linalg.norm(p[:2] + rotate(p[2], body[n]) - m) / _ROUGH) ** 2)
            for n, m in marks.items()
        )
        for p in found
    ]
    poses[row] = found[int(np.argmin(gaps))]
    for q in own:
        name = net.points[net.mark[q]]
        at = poses[row, :2] + rotate(poses[row, 2], body[name])
        points[net.mark[q]] = marks.get(name, at)
    return replace(trial, start=replace(trial.start, points=points, poses=poses))


def relocated(trial: Trial, distance: Array) -> Trial:
    """The trial with all world points and stops located anew from corrected distances (n,)."""
    net, points = trial.network, trial.start.points.copy()
    points[net.fixed] = net.nominal
    held = {*net.fixed.tolist()}
    marks = {*net.mark.tolist()}
    for point in range(len(net.points)):
        if point in held or point in marks:
            continue
        rows = distances_of(trial, point)
        other = np.where(net.first[rows] == point, net.second[rows], net.first[rows])
        fixed = np.isin(other, net.fixed)
        place = place_from(points[other[fixed]], distance[rows[fixed]])
        points[point] = points[point] if place is None else place
    made = replace(trial, start=replace(trial.start, points=points))
    for stop in net.poses:
        made = restarted(made, stop, distance)
    return made


def placed(trial: Trial, point: int) -> Trial:
    """The trial with one point where most of its distances put it."""
    net, points = trial.network, trial.start.points.copy()
    rows = distances_of(trial, point)
    other = np.where(net.first[rows] == point, net.second[rows], net.first[rows])
    place = place_from(points[other], net.distance[rows])
    if place is None:
        return trial
    points[point] = place
    return replace(trial, start=replace(trial.start, points=points))


def distances_of(trial: Trial, point: int) -> Rows:
    """Rows of the used distances that end at a point."""
    net = trial.network
    rows = np.flatnonzero((net.first == point) | (net.second == point))
    return np.array([i for i in rows if i not in trial.dropped], dtype=np.intp)


def stop_of(name: str) -> str | None:
    """The stop that a point belongs to."""
    mark = robot_point(name)
    return None if mark is None else mark[0]
