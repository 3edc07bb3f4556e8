"""Names and numbers written in each other's place."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from survey.causes.lead import Lead, Log, longest_gain
from survey.causes.linear import Linear
from survey.causes.look import FAR, MOST_OF_A_KIND, WORTH, Look
from survey.causes.numbers import new_stops, stop_numbers, stop_runs
from survey.causes.start import poses_of_marks, restarted
from survey.causes.targets import exchanged_targets
from survey.causes.trial import Rows, Trial
from survey.estimation.geometry import rotate
from validation.poses.angles import Array

MOST_ROWS = 60
"""Readings with the largest misfit among which exchanged ones are looked for."""


def name_leads(trial: Trial, linear: Linear, log: Log) -> Iterator[Lead]:
    """Exchanged targets, exchanged rig points, wrong numbers of stops, exchanged rows."""
    look = Look(trial, linear, log)
    for leads in (
        exchanged_targets(look),
        _exchanged_rig_points(look),
        stop_numbers(look),
        stop_runs(look),
        new_stops(look),
        _exchanged_rows(look),
        _slipped_rows(look),
    ):
        best = sorted((lead for lead in leads if lead.gain > WORTH), key=lambda one: -one.gain)
        yield from best[:MOST_OF_A_KIND]


def _exchanged_rig_points(look: Look) -> Iterator[Lead]:
    """Two points of the rig that stand for each other at a stop."""
    net = look.net
    places = float(len(net.poses) * max(len(net.rig_names) * (len(net.rig_names) - 1) // 2, 1))
    spread = (2 * net.marking_sigma) ** 2 + net.rig_sigma**2 + float(np.mean(net.sigma)) ** 2
    pose = look.at.poses[net.mark_pose]
    off = pose[:, :2] + rotate(pose[:, 2], net.rig[net.mark_rig]) - look.at.points[net.mark]
    at_stop = np.bincount(net.mark_pose, (off**2).sum(1), len(net.poses)) / spread
    for row in np.flatnonzero(at_stop > WORTH).tolist():  # the best of all poses fits no worse
        stop = net.poses[row]
        own = np.flatnonzero(net.mark_pose == row)
        marks = {str(q): look.at.points[net.mark[q]] for q in own}
        if len(marks) < 3:
            continue
        body = {str(q): net.rig[net.mark_rig[q]] for q in own}
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


def _rig_exchange_lead(look: Look, stop: str, a: int, b: int, gain: float, places: float) -> Lead:
    net = look.net

    def build(base: Trial) -> Trial:
        rig = base.network.mark_rig.copy()
        rig[[a, b]] = rig[[b, a]]
        return restarted(replace(base, network=replace(base.network, mark_rig=rig)), stop)

    names = (net.rig_names[net.mark_rig[a]], net.rig_names[net.mark_rig[b]])
    points = (net.mark[a], net.mark[b])
    rows = np.flatnonzero(np.isin(net.first, points) | np.isin(net.second, points))
    return Lead("exchanged_rig_points", "station", (stop, *names), rows, gain, places, build)


def _exchanged_rows(look: Look) -> Iterator[Lead]:
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
    look: Look, rows: Rows, source: Rows, gain: float, places: float, extent: str
) -> Lead:
    def build(base: Trial) -> Trial:
        distance = base.network.distance.copy()
        distance[rows] = look.trial.network.distance[source]
        changed = replace(base, network=replace(base.network, distance=distance))
        for stop in {look.log.station[row] for row in rows}:
            if stop in changed.network.poses:
                changed = restarted(changed, stop)
        return changed

    names = tuple(
        f"{look.net.points[look.net.first[r]]}–{look.net.points[look.net.second[r]]}" for r in rows
    )
    return Lead("exchanged_rows", extent, names, rows, gain, places, build)


def _slipped_rows(look: Look) -> Iterator[Lead]:
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
        gain = float((now - then)[start:end].sum())
        lead = _rows_lead(look, rows, order[source[start:end]], gain, 2.0 * n * n, "slipped")
        # At one end a row shows what belongs to its neighbour, and its own reading is lost.
        lost = start - 1 if step < 0 else end
        yield _without(lead, int(order[lost])) if 0 <= lost < n else lead


def _without(lead: Lead, row: int) -> Lead:
    """The same with one reading left out."""

    def build(base: Trial) -> Trial:
        made = lead.build(base)
        return replace(made, dropped=made.dropped | {row})

    return replace(lead, build=build)


LEAST_SLIPPED = 3
"""Readings of a run that slipped: two are exchanged rows, or blunders."""
