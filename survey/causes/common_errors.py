"""Errors that many readings share: an offset, a scale, a height."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from survey.causes.lead import Lead, Log, aligned, effect_size
from survey.causes.linear import Linear, SomeRows, gains
from survey.causes.trial import Effect, Law, Rows, Trial, law
from survey.readings.readings import Mask
from validation.poses.angles import Array

LEAST_ROWS = 4
"""Readings that a block in time has at least: fewer are blunders by nature."""
RARE = {"offset": 0.0, "scale": 0.5, "height": 3.0}
"""What it costs to say that some readings have an offset, a scale or a height of their own. At
eight of its sigmas a height of a stop's readings lengthens them nearly as an offset does, which
lies between it and a scale: were all three as likely before, three of four such offsets would be
told as one of the others."""
ROWS_TRIED = 1500
"""Readings up to which all blocks are tried; of more, those that begin and end where the laser is
moved, and then those near the best of them (`FINER`)."""


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
        regions = _regions(columns, linear, log, np.arange(n + 1))
    else:
        moved = np.flatnonzero(aligned([log.station[row] for row in order]))
        regions = _regions(columns, linear, log, moved)
        near = _edges_near(regions, moved)
        if len(near) > len(moved):
            regions = _regions(columns, linear, log, near)
    for extent, (region, edge) in regions.items():
        if region.found:
            a, b, gain, size = region.found
            yield _lead(kind, extent, (), order[edge[a] : edge[b]], gain, size, region.places)


def _edges_near(regions: Mapping[str, tuple["_Spread", Rows]], moved: Rows) -> Rows:
    """Edges with all readings of the stations in which the best blocks may begin and end."""
    edges = [moved]
    for region, _ in regions.values():
        if region.found and region.found[2] > FINER:
            for end in region.found[:2]:
                first, last = max(end - 1, 0), min(end + 1, len(moved) - 1)
                edges.append(np.arange(moved[first], moved[last]))
    return np.unique(np.concatenate(edges))


FINER = 40.0
"""Gain of a block of whole stations from which it is looked whether it begins or ends within one:
what a block of `ROWS_TRIED` readings costs at least."""


def _regions(
    columns: Array, linear: Linear, log: Log, edge: Rows
) -> dict[str, tuple["_Spread", Rows]]:
    """The blocks between some edges of the readings in their order, and those edges."""
    order, n = log.order, len(log.order)
    if len(edge) == n + 1:
        Q = linear.block(order)
        some_rows = _rows_of(Q * columns[order] * columns[order][:, None])
        score = columns[order] * linear.residual[order]
    else:
        score, some_rows = linear.between_sets(columns, np.split(order, edge[1:-1]))
    whole = np.concatenate([[0.0], np.cumsum(columns[order] ** 2)])[edge]
    s = np.concatenate([[0.0], np.cumsum(score)])
    natural = aligned([log.station[row] for row in order])[edge]
    last = len(edge) - 1
    diagonal = np.zeros(last + 1)
    for first, m in _summed(some_rows, last):
        own = first + np.arange(len(m))
        diagonal[own] = m[own - first, own]
    regions = {
        "until": _Spread(slice(0, 1), slice(1, last), natural),
        "from": _Spread(slice(1, last), slice(last, last + 1), natural),
        "block": _Spread(slice(1, last), slice(1, last), natural),
    }
    for first, m in _summed(some_rows, last):
        # For the blocks from these edges i to all edges j.
        own = first + np.arange(len(m))
        of_block = diagonal[own, None] + diagonal - 2 * m
        gain, size = gains(s - s[own, None], of_block, whole - whole[own, None])
        long = (edge - edge[own, None] >= LEAST_ROWS) & (gain > 0)
        evidence = np.where(long, gain - np.log(np.where(long, of_block, 1.0)), -np.inf)
        for region in regions.values():
            region.add(first, evidence, gain, size)
    return {extent: (region, edge) for extent, region in regions.items()}


class _Spread:
    """`spread_places` of the blocks from some edges to others, a few edges after the others."""

    def __init__(self, start: slice, end: slice, natural: Mask) -> None:
        self.start, self.end, self.natural = start, end, natural
        count = int(natural[start].sum()) * int(natural[end].sum())
        everywhere = (start.stop - start.start) * (end.stop - end.start)
        self.prior = [0.5 / max(everywhere, 1)]
        self.prior.append(self.prior[0] + 0.5 / max(count, 1))
        self.best, self.evidence, self.total = -np.inf, -np.inf, -np.inf
        self.found: tuple[int, int, float, float] | None = None

    @property
    def places(self) -> float:
        """Number of places that the best stands for."""
        return float(np.exp(self.evidence / 2 - self.total))

    def add(self, first: int, evidence: Array, gain: Array, size: Array) -> None:
        """Blocks from the edge ``first`` on (r, e)."""
        low, high = max(self.start.start, first), min(self.start.stop, first + len(evidence))
        if low >= high:
            return
        here = (slice(low - first, high - first), self.end)
        of = self.natural[low:high, None] & self.natural[self.end]
        each = evidence[here] + 2 * np.log(np.where(of, self.prior[1], self.prior[0]))
        if not np.isfinite(each).any():
            return
        self.total = float(np.logaddexp(self.total, logsumexp(each / 2)))
        i, j = (int(k) for k in np.unravel_index(each.argmax(), each.shape))
        if each[i, j] > self.best:
            self.best, self.evidence = float(each[i, j]), float(evidence[here][i, j])
            best = float(gain[here][i, j]), float(size[here][i, j])
            self.found = (low + i, self.end.start + j, *best)


_AT_A_TIME = 250_000
"""Elements of the matrix of all blocks that are made at a time."""


def _summed(some_rows: SomeRows, k: int) -> Iterator[tuple[int, Array]]:
    """Sums over the first i rows and j columns of a matrix (k, k): i, and rows from i on, (r, k+1).

    The whole of it, (k + 1, k + 1), is never there at once.
    """
    above = np.zeros((1, k + 1))
    yield 0, above
    size = max(_AT_A_TIME // k, 1)
    for a in range(0, k, size):
        rows = some_rows(a, min(a + size, k)).cumsum(1)
        below = above[-1, 1:] + rows.cumsum(0)
        above = np.hstack([np.zeros((len(below), 1)), below])
        yield a + 1, above


def _rows_of(matrix: Array) -> SomeRows:
    def some_rows(a: int, b: int) -> Array:
        return matrix[a:b]

    return some_rows


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
    alike = Counter(extent for extent, _, _ in sets)
    gain, size = gains(*linear.of_sets(columns, [rows for _, _, rows in sets]))
    for k, (extent, subject, rows) in enumerate(sets):
        if size[k] > 0 and len(rows) >= LEAST_ROWS:
            found = (rows, float(gain[k]), float(size[k]), float(alike[extent]))
            yield _lead("height", extent, subject, *found)
