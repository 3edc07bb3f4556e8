"""Readings that were written under the number of another stop."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from survey.causes.lead import Lead, largest_gains, longest_gain, look_elsewhere
from survey.causes.look import CAPPED, FAR, WORTH, Look
from survey.causes.start import place_from, restarted
from survey.causes.trial import CAUCHY, Rows, Trial, renamed, with_point
from survey.estimation.geometry import rotate
from validation.poses.angles import Array


def stop_numbers(look: Look) -> Iterator[Lead]:
    """Readings of one mark that were written under the number of another stop."""
    net, P = look.net, look.at.points
    if np.abs(look.misfit).max(initial=0.0) < FAR:
        return
    runs = look.rows_of_marks()
    places = float(sum(len(rows) > 1 for rows in runs) * max(len(net.poses) - 1, 1))
    worth = WORTH + look_elsewhere(look.trial, places)
    marks = {net.points[mark]: q for q, mark in enumerate(net.mark)}
    suspect = _badly_laid(look)
    for q, (mark, rows) in enumerate(zip(net.mark.tolist(), runs, strict=True)):
        if not suspect[q]:
            continue
        target = np.where(net.first[rows] == mark, net.second[rows], net.first[rows])
        now = np.minimum(_by_pose(look, q, rows, target), CAPPED)
        if (now >= FAR**2).sum() < 2:
            continue
        body = int(net.mark_rig[q])
        arms = rotate(look.at.poses[:, 2], np.broadcast_to(net.rig[body], (len(net.poses), 2)))
        stands = look.at.poses[:, :2] + arms
        cost = np.minimum(look.cost_of(rows, stands[:, None], P[target]), CAPPED)
        for t in _possible(now, cost, int(net.mark_pose[q]), worth):
            stop = net.poses[t]
            part = longest_gain(now - cost[t])
            if part is None:
                continue
            start, end = part
            gain = float((now - cost[t])[start:end].sum())
            if gain > worth and end - start >= 2 and _fits(cost[t][start:end]):
                other = marks.get(f"{stop}/{net.rig_names[body]}")
                yield _number_lead(look, q, rows[start:end], t, other, gain, places)


def _badly_laid(look: Look) -> npt.NDArray[np.bool_]:
    """(q,) marks with readings that fit badly where the stops' poses put the marks."""
    net, P = look.net, look.at.points.copy()
    P[net.mark] = _laid_marks(look)
    bad = look.cost_of(np.arange(len(net.first)), P[net.first], P[net.second]) >= FAR**2
    worst = np.zeros(len(net.points), dtype=bool)
    for ends in (net.first, net.second):
        worst[ends[bad]] = True
    return worst[net.mark]


def _laid_marks(look: Look) -> Array:
    """(q, 2) places of the marks as the poses put them."""
    net, state = look.net, look.at.poses[look.net.mark_pose]
    return np.asarray(state[:, :2] + rotate(state[:, 2], net.rig[net.mark_rig]))


def _fits(cost: Array) -> bool:
    """Whether most of some readings fit within some centimetres."""
    return float(np.median(cost)) < 100 * CAUCHY**2


def _possible(now: Array, then: Array, own: int, least: float) -> list[int]:
    """Stops t, but ``own``, at which some of the costs ``then`` (t, m) are so much less than now.

    It is the sum over a run of the readings that counts.
    """
    worth = largest_gains(now - then) > least
    worth[own] = False
    return np.flatnonzero(worth).tolist()


def _by_pose(look: Look, q: int, rows: Rows, target: Rows) -> Array:
    """Squared misfit of a mark's readings with the mark where the stop's pose puts it."""
    net = look.net
    state = look.at.poses[int(net.mark_pose[q])]
    place = state[:2] + rotate(state[2], net.rig[net.mark_rig[q]])
    return look.cost_of(rows, place, look.at.points[target])


def _number_lead(
    look: Look, q: int, rows: Rows, stop: int, other: int | None, gain: float, places: float
) -> Lead:
    net = look.net
    mark, body = int(net.mark[q]), int(net.mark_rig[q])
    wrong, right = net.poses[int(net.mark_pose[q])], net.poses[stop]

    def build(base: Trial) -> Trial:
        if other is not None:
            moved = renamed(base, rows, mark, int(base.network.mark[other]))
        else:
            state = base.start.poses[stop]
            place = state[:2] + rotate(state[2], base.network.rig[body])
            made, new = with_mark(base, f"{right}/{net.rig_names[body]}", place, stop, body)
            moved = renamed(made, rows, mark, new)
        return restarted(restarted(moved, wrong), right)

    subject = (wrong, right, net.rig_names[body])
    return Lead("stop_number", "rows", subject, rows, gain, places, build)


def stop_runs(look: Look) -> Iterator[Lead]:
    """Readings of several marks in a row that were written under the number of another stop."""
    net, P = look.net, look.at.points
    poses = look.at.poses
    bodies = np.full(len(net.points), -1)
    bodies[net.mark] = net.mark_rig
    marks = {net.points[mark]: int(mark) for mark in net.mark}
    places = RUN_PLACES * len(net.poses) * max(len(net.poses) - 1, 1)
    worth = WORTH + look_elsewhere(look.trial, places)
    suspect = {*net.mark_pose[_badly_laid(look)].tolist()}
    for s, stop in enumerate(net.poses):
        if s not in suspect:
            continue
        rows = look.stations.get(stop, np.empty(0, dtype=np.intp))
        first, second = net.first[rows], net.second[rows]
        own = np.where(bodies[first] >= 0, first, second)
        target = np.where(bodies[first] >= 0, second, first)
        kept = (bodies[own] >= 0) & (bodies[target] < 0)
        rows, own, target = rows[kept], own[kept], target[kept]
        arms = net.rig[bodies[own]]
        here = poses[s, :2] + rotate(poses[s, 2], arms)
        bad = look.cost_of(rows, here, P[target]) >= FAR**2
        if len(set(own[bad].tolist())) < 2:
            continue
        there = poses[:, None, :2] + rotate(poses[:, None, 2], arms[None])
        cost = np.minimum(look.cost_of(rows[None], there, P[target][None]), CAPPED)
        for t in _possible(cost[s], cost, s, worth):
            run = longest_gain(cost[s] - cost[t])
            if run is None or len(set(own[slice(*run)].tolist())) < 2:
                continue
            some = slice(*run)
            gain = float((cost[s] - cost[t])[some].sum())
            if gain > worth and _fits(cost[t][some]):
                yield _run_lead(look, rows[some], own[some], (s, t), marks, gain, places)


RUN_PLACES = 20.0
"""Beginnings and ends of such a run among those that people choose: a mark, or the whole stop."""


def _run_lead(
    look: Look,
    rows: Rows,
    own: Rows,
    stops: tuple[int, int],
    marks: dict[str, int],
    gain: float,
    places: float,
) -> Lead:
    net = look.net
    wrong, right = (net.poses[k] for k in stops)
    body = dict(zip(net.mark.tolist(), net.mark_rig.tolist(), strict=True))

    def build(base: Trial) -> Trial:
        for mark in dict.fromkeys(own.tolist()):
            name = f"{right}/{net.rig_names[body[mark]]}"
            new = marks.get(name)
            if new is None:
                state = base.start.poses[stops[1]]
                place = state[:2] + rotate(state[2], net.rig[body[mark]])
                base, new = with_mark(base, name, place, stops[1], body[mark])
            base = renamed(base, rows[own == mark], mark, new)
        return restarted(restarted(base, wrong), right)

    names = " ".join(dict.fromkeys(net.rig_names[body[mark]] for mark in own.tolist()))
    return Lead("stop_number", "rows", (wrong, right, names), rows, gain, places, build)


def with_mark(trial: Trial, name: str, place: Array, pose: int, body: int) -> tuple[Trial, int]:
    """The trial with one more mark of a stop, and the row of its point."""
    made, row = with_point(trial, name, place)
    net = made.network
    network = replace(
        net,
        mark=np.append(net.mark, row),
        mark_pose=np.append(net.mark_pose, pose),
        mark_rig=np.append(net.mark_rig, body),
    )
    return replace(made, network=network), row


def new_stops(look: Look) -> Iterator[Lead]:
    """Stops whose readings, from one on, are those of a stop that has no number of its own."""
    rank = np.empty(len(look.log.order), dtype=np.intp)
    rank[look.log.order] = np.arange(len(look.log.order))
    stops, all_marks = {*look.net.poses}, {int(m) for m in look.net.mark}
    for stop, rows in look.stations.items():
        if stop not in stops or np.median(np.abs(look.misfit[rows])) < 1.0:
            bad = np.abs(look.misfit[rows]) > FAR
            if stop not in stops or bad.sum() < LEAST_OF_A_STOP:
                continue
        seen: set[tuple[int, int]] = set()
        first = 0
        for k, row in enumerate(rows):
            pair = (int(look.net.first[row]), int(look.net.second[row]))
            if pair in seen:
                first = k
                break
            seen.add(pair)
        # The laser stood elsewhere in between: what follows is all of the other stop.
        away = [k for k in range(1, first + 1) if rank[rows[k]] - rank[rows[k - 1]] > 1]
        first = away[-1] if away else _parted(look, stop, rows, first)
        if not LEAST_OF_A_STOP <= first <= len(rows) - LEAST_OF_A_STOP:
            continue
        others = rows[first:]
        if _in_turn(look, stop, others) and not _in_turn(look, stop, rows[:first]):
            others = rows[:first]
        marks = {m for r in others for m in (look.net.first[r], look.net.second[r])}
        marks &= all_marks
        if len(marks) > 1:
            gain = float(np.minimum(look.misfit[rows] ** 2, 1e6).sum())
            yield _new_stop_lead(look, stop, others, gain)


def _parted(look: Look, stop: str, rows: Rows, first: int) -> int:
    """Where readings of two stops are parted best, if a pair read before comes again at ``first``.

    There, or where the laser went to another mark.
    """
    if not first:
        return 0
    own, target = look.here_and_there(stop, rows)
    moved = (np.flatnonzero(own[1:] != own[:-1]) + 1).tolist()
    last = len(rows) - LEAST_OF_A_STOP
    edges = [k for k in dict.fromkeys([first, *moved]) if LEAST_OF_A_STOP <= k <= last]

    def misfit(some: slice) -> float:
        total = 0.0
        for mark in set(own[some].tolist()):
            ours = np.arange(len(rows))[some][own[some] == mark]
            ends = look.at.points[target[ours]]
            place = place_from(ends, look.net.distance[rows[ours]])
            if place is not None:
                total += float(np.minimum(look.cost_of(rows[ours], place, ends), CAPPED).sum())
        return total

    return min(edges, key=lambda k: misfit(slice(k)) + misfit(slice(k, None)), default=0)


def _in_turn(look: Look, stop: str, rows: Rows) -> bool:
    """Whether readings of a stop stand in time beside those of the stop numbered next to it."""
    order = look.log.order
    rank = np.flatnonzero(np.isin(order, rows))
    beside = [k for k in (int(rank[0]) - 1, int(rank[-1]) + 1) if 0 <= k < len(order)]
    names = [look.log.station[order[k]] for k in beside]
    numbers = [int(name) for name in names if name.isdecimal() and name in look.net.poses]
    return stop.isdecimal() and any(abs(number - int(stop)) == 1 for number in numbers)


LEAST_OF_A_STOP = 6
"""Readings that a stop without a number has at least: three determine it and three check it."""


NEW_STOP = 45.0
"""Cost of the pose of a stop that nobody listed: three numbers, each known to a ten-thousandth of
its range, 3 times 2 log(10^4 / sqrt(2 pi)) = 50, less where fewer readings fix it."""


def _new_stop_lead(look: Look, stop: str, rows: Rows, gain: float) -> Lead:
    net = look.net
    new = f"{stop} (second)"

    def build(base: Trial) -> Trial:
        old = base.network.poses.index(stop)
        pose = len(base.network.poses)
        network = replace(base.network, poses=(*base.network.poses, new))
        start = replace(base.start, poses=np.vstack([base.start.poses, base.start.poses[old]]))
        made = replace(base, network=network, start=start)
        for q in np.flatnonzero(net.mark_pose == old):
            mark, body = int(net.mark[q]), int(net.mark_rig[q])
            own = rows[(net.first[rows] == mark) | (net.second[rows] == mark)]
            if len(own):
                place = base.start.points[mark]
                made, row = with_mark(made, f"{new}/{net.rig_names[body]}", place, pose, body)
                made = renamed(made, own, mark, row)
        return restarted(restarted(made, stop), new)

    places = float(len(net.poses))
    return Lead("stop_number", "station", (stop, ""), rows, gain, places, build, cost=NEW_STOP)
