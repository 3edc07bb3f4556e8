"""Errors that many readings share: an offset, a scale, a height."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from survey.causes.lead import Lead, Log, aligned, effect_size, spread_places
from survey.causes.linear import Linear, gains
from survey.causes.trial import Effect, Law, Rows, Trial, law
from validation.poses.angles import Array

LEAST_ROWS = 4
"""Readings that a block in time has at least: fewer are blunders by nature."""
RARE = {"offset": 0.0, "scale": 0.5, "height": 2.0}
"""What it costs to say that some readings have an offset, a scale or a height of their own. At
eight of its sigmas a height of a stop's readings lengthens them nearly as an offset does, which
lies between it and a scale: were all three as likely before, three of four such offsets would be
told as one of the others."""
ROWS_TRIED = 1500
"""Readings up to which a block may begin and end at any; of more, it does so where the laser is
moved to another mark."""


def common_error_leads(trial: Trial, linear: Linear, log: Log) -> Iterator[Lead]:
    """All sets of readings that may share an offset, a scale or a height."""
    sets = list(sets_of(log))
    for kind in ("offset", "scale"):
        columns = _columns(trial, linear, kind)
        gain, size = gains(*linear.of_sets(columns, [rows for _, _, rows, _ in sets]))
        for k, (extent, subject, rows, places) in enumerate(sets):
            yield _lead(kind, extent, subject, rows, float(gain[k]), float(size[k]), places)
        yield from _blocks(kind, columns, linear, log)
    yield from _heights(trial, linear, log)


def sets_of(log: Log) -> Iterator[tuple[str, tuple[str, ...], Rows, float]]:
    """Extent, subject and rows of the sets that need no search, and how many there are alike."""
    n = len(log.order)
    yield "all", (), np.arange(n), 1.0
    for extent, names in (("station", log.station), ("observer", log.observer), ("day", log.day)):
        groups = log.groups(names)
        for name, rows in groups.items():
            if LEAST_ROWS <= len(rows) < n:
                yield extent, (name,), rows, float(len(groups))


def _columns(trial: Trial, linear: Linear, kind: Law) -> Array:
    """(n,) derivative of each standardised distance by b."""
    net = trial.network
    n = len(net.distance)
    D = net.distance - linear.at_start[:n] * net.sigma
    return np.asarray(law(kind, D, 0.0)[2] / net.sigma * trial.used[:n])


def _lead(
    kind: Law,
    extent: str,
    subject: tuple[str, ...],
    rows: Rows,
    gain: float,
    size: float,
    places: float,
) -> Lead:
    def build(base: Trial) -> Trial:
        return replace(base, effects=(*base.effects, Effect(kind, rows, size)))

    cost = 0.0 if extent in {"all", "walls", "point"} else RARE[kind]
    return Lead(kind, extent, subject, rows, gain, places, build, effect_size, cost=cost)


def _blocks(kind: Law, columns: Array, linear: Linear, log: Log) -> Iterator[Lead]:
    """The best blocks in time: until a reading, from one on, from one to another."""
    order, n = log.order, len(log.order)
    if n <= ROWS_TRIED:
        edge = np.arange(n + 1)
        Q = linear.block(order)
        matrix = Q * columns[order] * columns[order][:, None]
        score = columns[order] * linear.residual[order]
    else:
        moved = [i for i in range(1, n) if log.station[order[i]] != log.station[order[i - 1]]]
        edge = np.array([0, *moved, n])
        score, matrix = linear.between_sets(columns, np.split(order, edge[1:-1]))
    whole = np.concatenate([[0.0], np.cumsum(columns[order] ** 2)])[edge]
    s = np.concatenate([[0.0], np.cumsum(score)])
    m = np.zeros((len(edge), len(edge)))
    m[1:, 1:] = matrix.cumsum(0).cumsum(1)
    diagonal = np.diagonal(m)
    # For the block from edge i to edge j, all at once.
    of_block = diagonal[:, None] + diagonal[None, :] - m - m.T
    gain, size = gains(s[None, :] - s[:, None], of_block, whole[None, :] - whole[:, None])
    long = (edge[None, :] - edge[:, None] >= LEAST_ROWS) & (gain > 0)
    evidence = np.where(long, gain - np.log(np.where(long, of_block, 1.0)), -np.inf)
    natural = aligned([log.station[row] for row in order])[edge]
    last = len(edge) - 1
    for extent, i, j in (
        ("until", slice(0, 1), slice(1, last)),
        ("from", slice(1, last), slice(last, last + 1)),
        ("block", slice(1, last), slice(1, last)),
    ):
        found = spread_places(evidence[i, j], natural[i][:, None] & natural[j][None, :])
        if found is None:
            continue
        (a, b), places = found
        a, b = a + i.start, b + j.start
        rows = order[edge[a] : edge[b]]
        yield _lead(kind, extent, (), rows, float(gain[a, b]), float(size[a, b]), places)


def _heights(trial: Trial, linear: Linear, log: Log) -> Iterator[Lead]:
    """A point, all walls, or the readings of a stop, an observer or a day at another height."""
    columns = _columns(trial, linear, "height")
    net = trial.network
    marks = {int(i) for i in net.mark}
    sets: list[tuple[str, tuple[str, ...], Rows]] = []
    for point, name in enumerate(net.points):
        if point not in marks:
            rows = np.flatnonzero((net.first == point) | (net.second == point))
            sets.append(("point", (name,), rows))
    for extent, subject, rows, _ in sets_of(log):
        if extent != "station" or subject[0] in net.poses:
            sets.append((extent, subject, rows))
    floor = marks | {int(i) for i in net.fixed}
    mixed = [
        (int(a) in floor) != (int(b) in floor) for a, b in zip(net.first, net.second, strict=True)
    ]
    sets.append(("walls", (), np.flatnonzero(mixed)))
    alike = {extent: float(sum(one[0] == extent for one in sets)) for extent, _, _ in sets}
    gain, size = gains(*linear.of_sets(columns, [rows for _, _, rows in sets]))
    for k, (extent, subject, rows) in enumerate(sets):
        if size[k] > 0 and len(rows) >= LEAST_ROWS:
            found = (rows, float(gain[k]), float(size[k]), alike[extent])
            yield _lead("height", extent, subject, *found)
