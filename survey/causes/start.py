"""Where a trial starts: places that most readings agree on, whatever the others say."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from types import MappingProxyType

import numpy as np

from survey.causes.lead import MANY
from survey.causes.trial import CAUCHY, Rows, Trial
from survey.estimation.geometry import circle_intersections, rigid_alignment, rotate
from survey.estimation.network import Network, build_network, start_parameters
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
_ROUNDS = 3
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
    return located_trial(vframe, rig, readings, located, missing, single, _settled(solution))


def _settled(solution: SurveySolution) -> dict[str, Array]:
    """Marks of the stops of a large survey that all their readings agree on."""
    adjusted = solution.adjustment
    net, n = adjusted.network, len(adjusted.network.distance)
    if n <= MANY:
        return {}
    unit = np.full(len(net.points), len(net.poses))
    unit[net.mark] = net.mark_pose
    fine = np.ones(len(net.poses) + 1, dtype=bool)
    bad = np.abs(adjusted.residual[:n]) > FINE
    fine[unit[net.first[bad]]] = fine[unit[net.second[bad]]] = False
    left = solution.left_out.poses
    return {
        net.points[mark]: adjusted.parameters.points[mark]
        for mark, pose in zip(net.mark, net.mark_pose, strict=True)
        if fine[pose] and net.poses[pose] not in left
    }


FINE = 4.0
"""Standardised residual up to which a reading agrees: a stop of 48 has none above it (1 in 300)."""


def located_trial(
    vframe: Vframe,
    rig: RobotFrame,
    readings: Readings,
    located: Mapping[str, Array],
    missing: Sequence[str],
    single: Mapping[str, Array],
    settled: Mapping[str, Array] = MappingProxyType({}),
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
    settled : mapping of str to (2,) array
        Marks that need not be sought.
    """
    known: dict[str, Array] = {n: np.asarray(p, dtype=float) for n, p in vframe.points.items()}
    frame = np.array(list(known.values()))
    known |= located
    poses: dict[str, Array] = {}
    marks: dict[str, Array] = {}
    for _ in range(_ROUNDS):
        before = len(known)
        for name in missing:
            if name not in known:
                own = readings.touching([name], [*known, *marks])
                place = robust_place(own, known | marks)
                if place is not None:
                    known[name] = place
        if poses and len(known) == before:
            break
        poses, marks = _robust_stops(readings, known, rig, single, settled)
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
    return places_from([(centres, distances)])[0]


def places_from(many: Sequence[tuple[Array, Array]]) -> list[Array | None]:
    """The place (2,) that most of the distances (m,) from centres (m, 2) agree on, of each."""
    found: list[Array | None] = [None] * len(many)
    alike: dict[int, list[int]] = {}
    for i, (centres, _) in enumerate(many):
        if len(set(map(tuple, np.round(centres, 3).tolist()))) >= 3:
            alike.setdefault(len(centres), []).append(i)
    for same in alike.values():
        for first in range(0, len(same), PLACES_AT_A_TIME):
            some = same[first : first + PLACES_AT_A_TIME]
            stacked = (np.array([many[i][part] for i in some]) for part in (0, 1))
            for i, place in zip(some, _stacked_places(*stacked), strict=True):
                found[i] = place
    return found


PLACES_AT_A_TIME = 32
"""Places of as many readings that are sought together: 240 meeting points against 16 readings each
are 1 MB."""


def _stacked_places(centres: Array, distances: Array) -> Array:
    """The same of g places of m readings each: (g, m, 2) and (g, m) to (g, 2)."""
    g, m = distances.shape
    one, other = np.triu_indices(m, 1)
    apart = np.linalg.norm(centres[:, one] - centres[:, other], axis=-1)
    order = np.argsort(-apart, axis=1)[:, :MOST_CIRCLES]
    meet = np.take_along_axis(apart, order, 1) > _ROUGH
    item = np.arange(g)[:, None, None]
    ends = np.stack([one[order], other[order]], axis=-1)
    circles = centres[item, ends]
    circles[~meet] = [[0.0, 0.0], [1.0, 0.0]]  # one point has no circles that meet
    places = circle_intersections(circles, distances[item, ends]).reshape(g, -1, 2)
    x, y = (places[:, :, None, k] - centres[:, None, :, k] for k in (0, 1))
    off = np.sqrt(x * x + y * y) - distances[:, None]
    cost = np.log1p((off / (_ROUGH * CAUCHY)) ** 2).sum(-1)
    cost[np.repeat(~meet, 2, axis=1)] = np.inf
    best = places[np.arange(g), cost.argmin(1)]
    for _ in range(5):
        delta = best[:, None] - centres
        length = np.maximum(np.linalg.norm(delta, axis=-1), 1e-6)
        J = delta / length[..., None]
        r = distances - length
        weight = 1 / (1 + (r / _ROUGH / CAUCHY) ** 2)
        across = np.swapaxes(J, 1, 2)
        normal = (across * weight[:, None]) @ J + 1e-9 * np.eye(2)
        best = best + np.linalg.solve(normal, across @ (weight * r)[..., None])[..., 0]
    return np.asarray(best)


def _robust_stops(
    readings: Readings,
    known: Mapping[str, Array],
    rig: RobotFrame,
    single: Mapping[str, Array],
    settled: Mapping[str, Array],
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Poses (3,) and marks of the stops as most of their readings say; none of too few."""
    read: dict[str, dict[str, list[tuple[str, float]]]] = {pose: {} for pose in readings.poses}
    owner = {name: robot_point(name) for name in readings.rows_of_point}
    for a, b, distance in zip(readings.start, readings.end, readings.distance, strict=True):
        for here, there in ((a, b), (b, a)):
            mark = owner[here]
            if mark and mark[1] in rig.points and there in known:
                read[mark[0]].setdefault(here, []).append((there, float(distance)))
    names, many = [], []
    for at_stop in read.values():
        for name, own in at_stop.items():
            if name in settled:
                continue
            names.append(name)
            ends = np.array([known[there] for there, _ in own])
            many.append((ends, np.array([distance for _, distance in own])))
    found = {**dict(zip(names, places_from(many), strict=True)), **settled}
    poses: dict[str, Array] = {}
    marks: dict[str, Array] = {}
    for pose, at_stop in read.items():
        alone = single.get(pose)
        if sum(map(len, at_stop.values())) < 3:
            poses |= {} if alone is None else {pose: alone}
            continue
        order = [name for point in rig.points if (name := f"{pose}/{point}") in at_stop]
        placed = {name: place for name in order if (place := found[name]) is not None}
        body = {name: np.asarray(rig.points[name[len(pose) + 1 :]]) for name in order}
        candidates = poses_of_marks(placed, body) + ([] if alone is None else [alone])
        if candidates:
            near = [(body[name], known[there], d) for name in order for there, d in at_stop[name]]
            arms, ends, distance = (np.array(part) for part in zip(*near, strict=True))
            states = np.array(candidates)
            places = states[:, None, :2] + rotate(states[:, 2:], arms)
            off = np.linalg.norm(places - ends, axis=-1) - distance
            cost = np.log1p((off / _ROUGH / CAUCHY) ** 2).sum(1)
            poses[pose] = states[cost.argmin()]
            marks |= placed
    return poses, marks


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
    return all_restarted(trial, [stop], distance)


def all_restarted(trial: Trial, stops: Sequence[str], distance: Array | None) -> Trial:
    """The trial with stops located anew from its distances (n,), or corrected ones."""
    net, points, poses = trial.network, trial.start.points.copy(), trial.start.poses.copy()
    shown = net.distance if distance is None else distance
    row_of = {pose: row for row, pose in enumerate(net.poses)}
    wanted = np.zeros(len(net.poses), dtype=bool)
    wanted[[row_of[stop] for stop in stops]] = True
    own = np.flatnonzero(wanted[net.mark_pose])
    ends = _rows_of_points(trial, net.mark[own])
    many = []
    for q, rows in zip(own, ends, strict=True):
        other = np.where(net.first[rows] == net.mark[q], net.second[rows], net.first[rows])
        many.append((points[other], shown[rows]))
    at_stop: dict[int, list[tuple[int, Array | None]]] = {}
    for q, place in zip(own, places_from(many), strict=True):
        at_stop.setdefault(int(net.mark_pose[q]), []).append((int(q), place))
    for stop, some in at_stop.items():
        found = _laid_pose(net, [(q, place) for q, place in some if place is not None])
        if found is None:
            continue
        poses[stop] = found
        for mark, place in some:
            at = found[:2] + rotate(found[2], net.rig[net.mark_rig[mark]])
            points[net.mark[mark]] = at if place is None else place
    return replace(trial, start=replace(trial.start, points=points, poses=poses))


def _laid_pose(net: Network, marks: Sequence[tuple[int, Array]]) -> Array | None:
    """The pose (3,) that lays the rig onto all marks, or two of them, best; None of fewer."""
    places = {str(q): place for q, place in marks}
    body = {str(q): net.rig[net.mark_rig[q]] for q, _ in marks}
    found = np.array(poses_of_marks(places, body)).reshape(-1, 3)
    if not len(found):
        return None
    seen, arms = np.array(list(places.values())), np.array(list(body.values()))
    off = found[:, None, :2] + rotate(found[:, 2:], arms) - seen
    gaps = np.log1p((off**2).sum(-1) / _ROUGH**2).sum(1)
    return np.asarray(found[gaps.argmin()])


def _rows_of_points(trial: Trial, points: Rows) -> list[Rows]:
    """`distances_of` each of many points."""
    net = trial.network
    rows = np.setdiff1d(np.arange(len(net.first)), list(trial.dropped))
    ends = np.concatenate([net.first[rows], net.second[rows]])
    order = np.argsort(ends, kind="stable")
    first, last = (np.searchsorted(ends[order], points, side) for side in ("left", "right"))
    twice = np.tile(rows, 2)[order]
    return [np.unique(twice[a:b]) for a, b in zip(first, last, strict=True)]


def relocated(trial: Trial, distance: Array) -> Trial:
    """The trial with all world points and stops located anew from corrected distances (n,).

    World points that the Vframe leaves open are located from the stops that the others give.
    """
    net, points = trial.network, trial.start.points.copy()
    points[net.fixed] = net.nominal
    known = np.zeros(len(net.points), dtype=bool)
    known[net.fixed] = True
    world = np.setdiff1d(np.arange(len(net.points)), np.concatenate([net.fixed, net.mark]))
    for _ in range(_ROUNDS):
        lost = world[~known[world]]
        rows_of = _rows_of_points(trial, lost)
        many = []
        for point, rows in zip(lost, rows_of, strict=True):
            other = np.where(net.first[rows] == point, net.second[rows], net.first[rows])
            use = known[other]
            many.append((points[other[use]], distance[rows[use]]))
        for point, place in zip(lost, places_from(many), strict=True):
            if place is not None:
                points[point], known[point] = place, True
        made = replace(trial, start=replace(trial.start, points=points))
        made = all_restarted(made, net.poses, distance)
        points = made.start.points.copy()
        known[net.mark] = True
        if known[world].all():
            break
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
