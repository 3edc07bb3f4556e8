"""Two targets that stand for each other, at a station or for a time."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from survey.causes.lead import Lead, longest_gain
from survey.causes.look import CAPPED, FAR, MOST_OF_A_KIND, WORTH, Look
from survey.causes.start import placed, restarted
from survey.causes.trial import Rows, Trial, renamed
from validation.poses.angles import Array


def exchanged_targets(look: Look) -> Iterator[Lead]:
    """Two targets that stand for each other in all readings of a station, or of several in turn."""
    targets = _targets(look)
    if len(targets) < 2:
        return
    stations = list(look.stations)
    gain = np.zeros((len(stations), len(targets), len(targets)))
    seen = np.zeros((len(stations), len(targets)), dtype=bool)
    for k, station in enumerate(stations):
        rows = look.stations[station]
        here, there = look.here_and_there(station, rows)
        own = np.isin(there, targets)
        of = np.searchsorted(targets, there)
        seen[k, of[own]] = True
        gain[k] = _gain(look, rows[own], here[own], of[own], targets)
    if not (gain > WORTH).any():
        return
    places = float((seen.sum(1) * (seen.sum(1) - 1) // 2).sum())
    found: list[tuple[float, int, int, int, int]] = []
    for i, j in zip(*np.nonzero(np.triu((gain > WORTH).any(0), 1)), strict=True):
        of_pair = gain[:, i, j]
        single = np.flatnonzero(of_pair > WORTH).tolist()
        found += [(float(of_pair[k]), k, k + 1, int(i), int(j)) for k in single]
        first, last = longest_gain(of_pair) or (0, 0)
        if 1 < last - first < len(stations):
            found.append((float(of_pair[first:last].sum()), first, last, int(i), int(j)))
    found.sort(key=lambda one: -one[0])
    held = {int(point) for point in look.net.fixed}
    for worth, first, last, i, j in found[: 2 * MOST_OF_A_KIND]:
        pair = (int(targets[i]), int(targets[j]))
        some, rest = stations[first:last], stations[:first] + stations[last:]
        alike = places * (1 if len(some) == 1 else len(stations))
        lead = _lead(look, worth, some, pair, alike)
        if len(rest) > 1 and (first == 0 or last == len(stations)) and not {*pair} & held:
            yield _or_elsewhere(lead, _lead(look, worth, rest, pair, alike))
        else:
            yield lead


def _or_elsewhere(one: Lead, other: Lead) -> Lead:
    """Two marks exchanged until a time or after it: the same readings, of which fewer are named."""
    fewer, more = sorted((one, other), key=lambda lead: len(lead.rows))
    if not len(fewer.rows):
        return one
    return replace(fewer, equal=(more,), also=("at all other places",))


MOST_TARGETS = 40
"""Targets among which exchanged ones are looked for: those with the readings that fit worst."""


def _targets(look: Look) -> Rows:
    """Points that are no marks, and that have a reading that fits badly."""
    net = look.net
    worst = np.zeros(len(net.points))
    for ends in (net.first, net.second):
        np.maximum.at(worst, ends, np.abs(look.misfit))
    worst[net.mark] = 0.0
    bad = np.argsort(-worst)[:MOST_TARGETS]
    return np.sort(bad[worst[bad] > FAR])


def _gain(look: Look, rows: Rows, here: Rows, of: Rows, targets: Rows) -> Array:
    """(t, t) decrease of the misfit of a station were each two targets exchanged."""
    P, size = look.at.points, len(targets)
    now = np.minimum(look.misfit[rows] ** 2, CAPPED)
    if now.max(initial=0.0) < FAR**2:
        # Nothing to gain, all the same something to lose.
        now = np.zeros(len(rows))
    then = np.minimum(look.cost_of(rows[:, None], P[here][:, None], P[targets][None]), CAPPED)
    each = np.zeros((size, len(rows)))
    each[of, np.arange(len(rows))] = 1.0
    worse = each @ then  # all readings to a, were they to b
    own = each @ now
    return np.asarray(own[:, None] + own[None, :] - worse - worse.T)


def _lead(
    look: Look, gain: float, stations: list[str], pair: tuple[int, int], places: float
) -> Lead:
    touched, there = _readings(look, stations, pair)
    a, b = pair

    def build(base: Trial) -> Trial:
        swapped = renamed(renamed(base, touched[there == a], a, b), touched[there == b], b, a)
        if len(stations) > 1:
            for point in set(pair) - {int(i) for i in base.network.fixed}:
                swapped = placed(swapped, point)
        for station in stations:
            if station in base.network.poses:
                swapped = restarted(swapped, station)
        return swapped

    names = (look.net.points[a], look.net.points[b])
    one = len(stations) == 1
    subject = (stations[0], *names) if one else (stations[0], *names, stations[-1])
    extent = "station" if one else "block"
    return Lead("exchanged_targets", extent, subject, touched, gain, places, build)


def _readings(look: Look, stations: list[str], pair: tuple[int, int]) -> tuple[Rows, Rows]:
    """Readings of some stations to two targets, and to which of them."""
    rows, targets = [], []
    for station in stations:
        own = look.stations[station]
        _, there = look.here_and_there(station, own)
        kept = np.isin(there, pair)
        rows.append(own[kept])
        targets.append(there[kept])
    return np.concatenate(rows), np.concatenate(targets)
