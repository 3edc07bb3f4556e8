"""Names and numbers written in each other's place."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from survey.causes.lead import Lead, Log, longest_gain
from survey.causes.linear import Linear
from survey.causes.start import poses_of_marks, restarted
from survey.causes.trial import CAUCHY, Rows, Trial, renamed, with_point
from survey.estimation.geometry import rotate
from survey.readings.point_names import robot_point
from validation.poses.angles import Array

WORTH = 15.0
"""Decrease of the misfit from which exchanged names are tried: less than any exchange costs."""
MOST_OF_A_KIND = 6
"""Hypotheses of one kind that are solved: the linearised survey orders them well enough."""
FAR = 4.0
"""Standardised misfit from which a single reading may have been exchanged with another."""
MOST_ROWS = 60
"""Readings with the largest misfit among which exchanged ones are looked for."""


def name_leads(trial: Trial, linear: Linear, log: Log) -> Iterator[Lead]:
    """Exchanged targets, exchanged rig points, wrong numbers of stops, exchanged rows."""
    look = _Look(trial, linear, log)
    for leads in (
        _exchanged_targets(look),
        _exchanged_rig_points(look),
        _stop_numbers(look),
        _new_stops(look),
        _exchanged_rows(look),
        _slipped_rows(look),
    ):
        best = sorted((lead for lead in leads if lead.gain > WORTH), key=lambda one: -one.gain)
        yield from best[:MOST_OF_A_KIND]


class _Look:
    """Distances between all points at the robust solution, and how badly the readings fit them."""

    def __init__(self, trial: Trial, linear: Linear, log: Log) -> None:
        self.trial, self.log = trial, log
        self.net, self.at = trial.network, linear.fit.at
        n = len(self.net.distance)
        # The true misfit of a reading is what the others say of it.
        self.misfit = linear.at_start[:n] * trial.used[:n]
        self.stations = log.groups(log.station)

    def rows_of_marks(self) -> list[Rows]:
        """Distances that end at each mark, in the order read."""
        order, net = self.log.order, self.net
        ends = np.concatenate([net.first[order], net.second[order]])
        once = np.tile(order, 2)
        rank = np.tile(np.arange(len(order)), 2)
        sort = np.lexsort([rank, ends])
        first = np.searchsorted(ends[sort], net.mark, "left")
        last = np.searchsorted(ends[sort], net.mark, "right")
        return [once[sort[a:b]] for a, b in zip(first, last, strict=True)]

    def cost_of(self, rows: Rows, first: Array, second: Array) -> Array:
        """(r,) squared standardised misfit of distances, were they between these places (r, 2)."""
        off = self.net.distance[rows] - np.linalg.norm(first - second, axis=-1)
        return np.asarray((off / self.net.sigma[rows]) ** 2)

    def here_and_there(self, station: str, rows: Rows) -> tuple[Rows, Rows]:
        """Ends of readings at a station, and their targets."""
        a, b = self.net.first[rows], self.net.second[rows]
        own = np.array(
            [(robot_point(self.net.points[i]) or (self.net.points[i],))[0] == station for i in a]
        )
        return np.where(own, a, b), np.where(own, b, a)


def _exchanged_targets(look: _Look) -> Iterator[Lead]:
    """Two targets that stand for each other in all the readings of a station."""
    places = 0
    found = []
    for station, rows in look.stations.items():
        here, there = look.here_and_there(station, rows)
        targets = [t for t in np.unique(there) if robot_point(look.net.points[t]) is None]
        P = look.at.points
        size = len(targets)
        places += size * (size - 1) // 2
        now = np.minimum(look.misfit[rows] ** 2, 1e8)
        if now.max(initial=0.0) < FAR**2:
            continue
        # worse[a, b]: all readings to a, were they to b.
        own = np.array([now[there == t].sum() for t in targets])
        other = np.array(
            [
                [look.cost_of(rows[there == t], P[here[there == t]], P[s]).sum() for s in targets]
                for t in targets
            ]
        )
        gain = own[:, None] + own[None, :] - other - other.T
        for i, j in zip(*np.nonzero(np.triu(gain > WORTH, 1)), strict=True):
            found.append((float(gain[i, j]), station, targets[i], targets[j], rows, there))
    found.sort(key=lambda one: -one[0])
    for gain, station, a, b, rows, there in found[:MOST_OF_A_KIND]:
        yield _exchange_lead(look, gain, station, int(a), int(b), rows, there, float(places))


def _exchange_lead(
    look: _Look, gain: float, station: str, a: int, b: int, rows: Rows, there: Rows, places: float
) -> Lead:
    def build(base: Trial) -> Trial:
        swapped = renamed(renamed(base, rows[there == a], a, b), rows[there == b], b, a)
        return restarted(swapped, station) if station in base.network.poses else swapped

    names = (look.net.points[a], look.net.points[b])
    touched = rows[(there == a) | (there == b)]
    return Lead("exchanged_targets", "station", (station, *names), touched, gain, places, build)


def _exchanged_rig_points(look: _Look) -> Iterator[Lead]:
    """Two points of the rig that stand for each other at a stop."""
    net = look.net
    places = float(len(net.poses) * max(len(net.rig_names) * (len(net.rig_names) - 1) // 2, 1))
    for row, stop in enumerate(net.poses):
        own = np.flatnonzero(net.mark_pose == row)
        marks = {str(q): look.at.points[net.mark[q]] for q in own}
        if len(marks) < 3:
            continue
        body = {str(q): net.rig[net.mark_rig[q]] for q in own}
        spread = (2 * net.marking_sigma) ** 2 + net.rig_sigma**2 + float(np.mean(net.sigma)) ** 2
        now = _laid(marks, body, spread)
        if now <= WORTH:
            continue
        for a, b in combinations(own, 2):
            swapped = {**body, str(a): body[str(b)], str(b): body[str(a)]}
            then = _laid(marks, swapped, spread)
            if now - then > WORTH:
                yield _rig_exchange_lead(look, stop, int(a), int(b), now - then, places)


def _laid(marks: dict[str, Array], body: dict[str, Array], variance: float) -> float:
    """Misfit of the rig laid onto marks as well as it goes."""
    names = list(marks)
    arms, seen = np.array([body[n] for n in names]), np.array([marks[n] for n in names])
    return min(
        float(((p[:2] + rotate(p[2], arms) - seen) ** 2).sum() / variance)
        for p in poses_of_marks(marks, body)
    )


def _rig_exchange_lead(look: _Look, stop: str, a: int, b: int, gain: float, places: float) -> Lead:
    net = look.net

    def build(base: Trial) -> Trial:
        rig = base.network.mark_rig.copy()
        rig[[a, b]] = rig[[b, a]]
        return restarted(replace(base, network=replace(base.network, mark_rig=rig)), stop)

    names = (net.rig_names[net.mark_rig[a]], net.rig_names[net.mark_rig[b]])
    points = (net.mark[a], net.mark[b])
    rows = np.flatnonzero(np.isin(net.first, points) | np.isin(net.second, points))
    return Lead("exchanged_rig_points", "station", (stop, *names), rows, gain, places, build)


def _stop_numbers(look: _Look) -> Iterator[Lead]:
    """Readings of one mark that were written under the number of another stop."""
    net, P = look.net, look.at.points
    if np.abs(look.misfit).max(initial=0.0) < FAR:
        return
    runs = look.rows_of_marks()
    places = float(sum(len(rows) > 1 for rows in runs) * max(len(net.poses) - 1, 1))
    marks = {net.points[mark]: q for q, mark in enumerate(net.mark)}
    for q, (mark, rows) in enumerate(zip(net.mark.tolist(), runs, strict=True)):
        target = np.where(net.first[rows] == mark, net.second[rows], net.first[rows])
        now = np.minimum(_by_pose(look, q, rows, target), 1e8)
        if len(rows) < 2 or now.max() < FAR**2:
            continue
        body = int(net.mark_rig[q])
        arms = rotate(look.at.poses[:, 2], np.broadcast_to(net.rig[body], (len(net.poses), 2)))
        stands = look.at.poses[:, :2] + arms
        cost = np.array([look.cost_of(rows, place, P[target]) for place in stands])
        cost = np.minimum(cost, 1e8)
        for t, stop in enumerate(net.poses):
            if t == int(net.mark_pose[q]):
                continue
            part = longest_gain(now - cost[t])
            if part is None:
                continue
            start, end = part
            gain = float((now - cost[t])[start:end].sum())
            fits = float(np.median(cost[t][start:end]))
            if gain > WORTH and fits < 100 * CAUCHY**2 and end - start >= 2:
                other = marks.get(f"{stop}/{net.rig_names[body]}")
                yield _number_lead(look, q, rows[start:end], t, other, gain, places)


def _by_pose(look: _Look, q: int, rows: Rows, target: Rows) -> Array:
    """Squared misfit of a mark's readings with the mark where the stop's pose puts it."""
    net = look.net
    state = look.at.poses[int(net.mark_pose[q])]
    place = state[:2] + rotate(state[2], net.rig[net.mark_rig[q]])
    return look.cost_of(rows, place, look.at.points[target])


def _number_lead(
    look: _Look, q: int, rows: Rows, stop: int, other: int | None, gain: float, places: float
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


def _new_stops(look: _Look) -> Iterator[Lead]:
    """Stops whose readings, from one on, are those of a stop that has no number of its own."""
    for stop, rows in look.stations.items():
        if stop not in look.net.poses or np.median(np.abs(look.misfit[rows])) < 1.0:
            bad = np.abs(look.misfit[rows]) > FAR
            if stop not in look.net.poses or bad.sum() < LEAST_OF_A_STOP:
                continue
        seen: set[tuple[int, int]] = set()
        first = 0
        for k, row in enumerate(rows):
            pair = (int(look.net.first[row]), int(look.net.second[row]))
            if pair in seen:
                first = k
                break
            seen.add(pair)
        marks = {m for r in rows[first:] for m in (look.net.first[r], look.net.second[r])}
        marks &= {int(m) for m in look.net.mark}
        if LEAST_OF_A_STOP <= first <= len(rows) - LEAST_OF_A_STOP and len(marks) > 1:
            gain = float(np.minimum(look.misfit[rows] ** 2, 1e6).sum())
            yield _new_stop_lead(look, stop, rows[first:], gain)


LEAST_OF_A_STOP = 6
"""Readings that a stop without a number has at least: three determine it and three check it."""


NEW_STOP = 45.0
"""Cost of the pose of a stop that nobody listed: three numbers, each known to a ten-thousandth of
its range, 3 times 2 log(10^4 / sqrt(2 pi)) = 50, less where fewer readings fix it."""


def _new_stop_lead(look: _Look, stop: str, rows: Rows, gain: float) -> Lead:
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


def _exchanged_rows(look: _Look) -> Iterator[Lead]:
    """Two readings that stand in each other's row."""
    net, P = look.net, look.at.points
    bad = np.argsort(-np.abs(look.misfit))[:MOST_ROWS]
    bad = bad[np.abs(look.misfit[bad]) > FAR]
    if len(bad) < 2:
        return
    D = np.linalg.norm(P[net.first[bad]] - P[net.second[bad]], axis=1)
    cross = ((net.distance[bad][None, :] - D[:, None]) / net.sigma[bad][:, None]) ** 2
    now = look.misfit[bad] ** 2
    gain = now[:, None] + now[None, :] - cross - cross.T
    n = len(net.distance)
    for i, j in zip(*np.nonzero(np.triu(gain > WORTH, 1)), strict=True):
        rows = np.sort(bad[[i, j]])
        yield _rows_lead(look, rows, rows[::-1], float(gain[i, j]), n * (n - 1) / 2, "rows")


def _rows_lead(
    look: _Look, rows: Rows, source: Rows, gain: float, places: float, extent: str
) -> Lead:
    def build(base: Trial) -> Trial:
        distance = base.network.distance.copy()
        distance[rows] = look.net.distance[source]
        changed = replace(base, network=replace(base.network, distance=distance))
        for stop in {look.log.station[row] for row in rows}:
            if stop in changed.network.poses:
                changed = restarted(changed, stop)
        return changed

    names = tuple(
        f"{look.net.points[look.net.first[r]]}–{look.net.points[look.net.second[r]]}" for r in rows
    )
    return Lead("exchanged_rows", extent, names, rows, gain, places, build)


def _slipped_rows(look: _Look) -> Iterator[Lead]:
    """Runs of readings that were written one row too early or too late."""
    net, P, order = look.net, look.at.points, look.log.order
    D = np.linalg.norm(P[net.first[order]] - P[net.second[order]], axis=1)
    shown, sigma = net.distance[order], net.sigma[order]
    n = len(order)
    now = np.minimum(look.misfit[order] ** 2, 1e6)
    for step in (1, -1):
        source = np.clip(np.arange(n) + step, 0, n - 1)
        then = np.minimum(((shown[source] - D) / sigma) ** 2, 1e6)
        run = longest_gain(now - then)
        if run is None or run[1] - run[0] < LEAST_SLIPPED:
            continue
        start, end = run
        rows = order[start:end]
        # The last of the run has lost its own reading: another stands there, or none.
        gain = float((now - then)[start:end].sum())
        yield _rows_lead(look, rows, order[source[start:end]], gain, 2.0 * n * n, "slipped")


LEAST_SLIPPED = 3
"""Readings of a run that slipped: two are exchanged rows, or blunders."""
