"""Matches that may be wrong, decided by the graph of those that are used.

Each is a switch: off until the rest of the graph confirms it. What the used matches say of a pair
confirms or refutes its match; matches between parts that nothing joins yet confirm each other. A
match that nothing checks stays as it is, and joins stops only where there is no other way.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from itertools import pairwise

import numpy as np

from laser_gt.matching.verdicts import Match, Verdict
from laser_gt.placing.anchors import edge_of
from laser_gt.placing.equations import ends_of
from laser_gt.placing.graph import Edge, Graph, GraphSolution, GraphSpread, solve_graph
from laser_gt.placing.guesses import guess_deviations
from laser_gt.placing.loops import FLOOR, way
from laser_gt.placing.pairs import parts_of
from laser_gt.scans.planar import (
    CONTRADICTION,
    between,
    compose,
    compose_jacobians,
    inverse,
    inverse_covariance_of,
    inverse_jacobian,
    wrapped,
)
from laser_gt.scans.scan import Indices
from validation.poses.angles import Array
from validation.poses.factored import Factored

GAUGE = 1e-12
"""Variance with which a graph is held at its first stop: a micrometre and a microradian, a
thousandth of any error that counts, and far enough from zero for the equations to be solved."""

TELLING = 0.05
"""Standard deviation in metres (and radians) up to which a prediction can confirm a match. A
judgement: a wrong pose is another one by 0.1 m or more, two of these."""

CONFIRMING = 2
"""Loops through different third parts that confirm a match between two, over those that it does not
close. A judgement: one may close by chance or share its third stop's fault."""

CONTRADICTING = 4 * CONTRADICTION
"""Squared distance, in standard deviations, from what all matches together say, beyond which an
imprecise one may be wrong. Four times: in real buildings, where furniture has moved and walls are
not straight, right ones are off by twice what they state here and there."""

WRONG_SHARE = 0.1
"""Chance that a match is wrong which may be wrong and which nothing checks. Measured: 5 of 114 in
one building, 32 of some 520 in slices of two logs; taken for a tenth."""


@dataclass(frozen=True)
class Part:
    """What the matches that are used say: the graph, and the part that each stop belongs to."""

    solution: GraphSolution
    parts: Indices

    def step(self, start: int, end: int) -> tuple[Array, Array]:
        """Pose and covariance of a stop seen from another of the same part."""
        first, second = self.solution.poses[[start, end]]
        by_back, by_second = compose_jacobians(inverse(first), second)
        jacobian = np.hstack([by_back @ inverse_jacobian(first), by_second])
        covariance = jacobian @ self.solution.spread.between([start, end]) @ jacobian.T
        return between(first, second), covariance


def decided(
    stops: Sequence[str], poses: Array, matches: Sequence[Match], sigmas: Sequence[float]
) -> list[Match]:
    """The matches, those that may be wrong with what the graph of the others says of them.

    Parameters
    ----------
    stops : sequence of str
        All that were scanned.
    poses : (n, 3) array
        Initial guess of the laser frames.
    matches : sequence of Match
        Judged, and compared with their loops.
    sigmas : (float, float)
        Of the guess from stop to stop, metres and radians.

    Notes
    -----
    What is confirmed joins the graph, and the rest is asked again. A prediction that is not known
    to `TELLING` does not confirm a match, and refutes it only where it contradicts it all the
    same. Of the matches between two parts (or across a part that knows its own ends badly), those
    that agree with each other to `TELLING` are confirmed together, and else the one that closes
    most loops, `CONFIRMING` at least: a wrong pose would have to be wrong by the same in both.
    Two that are ambiguous may well be: among equal niches both are wrong by a niche. They confirm
    each other not.

    An imprecise match far from what all together say (`CONTRADICTING`), the farthest first, is left
    to the graph of the others in the same way: along a corridor, doors that look alike a metre
    apart determine a pose that is wrong by as much.
    """
    where = {stop: number for number, stop in enumerate(stops)}
    found = list(matches)
    doubted: set[int] = set()
    while True:
        open_rows = [row for row, one in enumerate(found) if one.verdict == "may be wrong"]
        used = [edge_of(where, one) for one in found if one.used]
        part = graph_of(poses, used, sigmas)
        told = _inside(part, found, where, open_rows) or _across(part, found, where, open_rows)
        told = told or _contradicting(part, found, where, doubted)
        if not told:
            return found
        doubted |= told.keys()
        found = [told.get(row, one) for row, one in enumerate(found)]


def _contradicting(
    part: Part, matches: Sequence[Match], where: dict[str, int], asked: set[int]
) -> dict[int, Match]:
    """The imprecise match farthest from what all say, if it may be wrong by that."""
    rows = [
        row for row, one in enumerate(matches) if one.verdict == "imprecise" and row not in asked
    ]
    if not rows:
        return {}
    edges = [edge_of(where, matches[row]) for row in rows]
    start, end = ends_of(edges).T
    off = wrapped(
        between(part.solution.poses[start], part.solution.poses[end])
        - np.array([edge.pose for edge in edges])
    )
    covariance = np.array([edge.covariance for edge in edges])
    squared = (off * np.linalg.solve(covariance, off[..., None])[..., 0]).sum(-1)
    worst = int(squared.argmax())
    if squared[worst] <= CONTRADICTING:
        return {}
    one = matches[rows[worst]]
    text = f"{np.sqrt(squared[worst]):.0f} standard deviations from what all matches say"
    return {rows[worst]: replace(one, verdict="may be wrong", reasons=(*one.reasons, text))}


def guess_edges(poses: Array, parts: Indices, sigmas: Sequence[float]) -> list[Edge]:
    """The motions of the initial guess between the stops of each part, in their order."""
    edges = []
    for part in np.unique(parts).tolist():
        for start, end in pairwise(np.flatnonzero(parts == part).tolist()):
            length, angle = guess_deviations(poses, start, end, sigmas).tolist()
            covariance = np.diag([length**2, length**2, angle**2])
            edges.append(Edge(start, end, between(poses[start], poses[end]), covariance))
    return edges


def graph_of(poses: Array, used: Sequence[Edge], sigmas: Sequence[float]) -> Part:
    """The graph of laser frames from the matches that are used, each part held at one stop."""
    parts = parts_of(len(poses), ends_of(used))
    if not used:
        from scipy import sparse  # noqa: PLC0415  (loaded when a graph is solved)

        fixed = sparse.eye_array(3 * len(poses) + 3, format="csc") / GAUGE
        spread = GraphSpread(fixed, np.zeros((len(poses), 3, 3)))
        return Part(GraphSolution(poses, np.zeros(3), spread, 0.0, 0, np.ones(0)), parts)
    _, first = np.unique(parts, return_index=True)
    graph = Graph(
        initial=spanning(poses, used, first.tolist(), np.zeros(3)),
        mount=np.zeros(3),
        edges=used,
        prior_stops=first.tolist(),
        prior_poses=poses[first],
        prior_covariance=held(len(first)),
        mount_covariance=np.eye(3) * GAUGE,
        guesses=guess_edges(poses, parts, sigmas),
    )
    return Part(solve_graph(graph), parts)


def held(count: int) -> Factored:
    """Covariance of stops that hold a graph."""
    return Factored.alone(np.tile(GAUGE * np.eye(3), (count, 1, 1)))


def spanning(robot: Array, edges: Sequence[Edge], starts: Sequence[int], mount: Array) -> Array:
    """First robot poses by following the most certain edges out from the starts."""
    poses, known = robot.copy(), np.zeros(len(robot), dtype=bool)
    order = sorted(edges, key=lambda edge: float(np.trace(edge.covariance)))
    at: list[list[int]] = [[] for _ in robot]
    for rank, edge in enumerate(order):
        at[edge.start].append(rank)
        at[edge.end].append(rank)
    waiting: list[int] = []
    for stop in starts:
        known[stop] = True
        for rank in at[stop]:
            heappush(waiting, rank)
    while waiting:
        edge = order[heappop(waiting)]
        if known[edge.start] == known[edge.end]:
            continue
        step = compose(compose(mount, edge.pose), inverse(mount))
        new = edge.end if known[edge.start] else edge.start
        if new == edge.end:
            poses[new] = compose(poses[edge.start], step)
        else:
            poses[new] = compose(poses[edge.end], inverse(step))
        known[new] = True
        for rank in at[new]:
            heappush(waiting, rank)
    return poses


def _inside(
    part: Part, matches: Sequence[Match], where: dict[str, int], rows: Sequence[int]
) -> dict[int, Match]:
    """Matches inside of a part that its graph confirms or refutes."""
    told = {}
    for row in rows:
        one = matches[row]
        start, end = where[one.reference], where[one.moving]
        if part.parts[start] != part.parts[end]:
            continue
        squared, telling = _closes([one.by_scans, part.step(end, start)])
        if squared > CONTRADICTION:
            text = f"refuted by the graph: {np.sqrt(squared):.1f} standard deviations away"
            told[row] = replace(one, verdict="refuted", reasons=(*one.reasons, text))
        elif telling:
            told[row] = _confirmed(one, "confirmed by the graph of the other matches")
    return told


def _across(
    part: Part, matches: Sequence[Match], where: dict[str, int], rows: Sequence[int]
) -> dict[int, Match]:
    """The largest group of matches between two parts that agree with each other."""
    groups = _between_parts(part, matches, where, rows)
    alike = {row for row in rows if matches[row].ambiguous}
    best: list[int] = []
    for edges in groups.values():
        for row, one in edges:
            agreeing = [
                at
                for at, other in edges
                if at == row or (not {at, row} <= alike and _agree(part, one, other))
            ]
            best = max(best, agreeing, key=len)
    if len(best) > 1:
        others = f"{len(best) - 1} other match{'es' * (len(best) > 2)}"
        text = f"confirmed by {others} between the same parts"
        return {row: _confirmed(matches[row], text) for row in best}
    closing = {
        row: _loops(part, groups, (row, one), alike)
        for edges in groups.values()
        for row, one in edges
    }
    row = max(closing, key=lambda at: closing[at], default=-1)
    if row < 0 or closing[row] < CONFIRMING:
        return {}
    return {row: _confirmed(matches[row], f"confirmed by {closing[row]} loops of three scans")}


Groups = dict[tuple[int, int], list[tuple[int, Edge]]]


def _between_parts(
    part: Part, matches: Sequence[Match], where: dict[str, int], rows: Sequence[int]
) -> Groups:
    """Open matches with their rows by the parts that they join, the lesser number first."""
    groups: Groups = {}
    for row in rows:
        edge = edge_of(where, matches[row])
        key = (int(part.parts[edge.start]), int(part.parts[edge.end]))
        if key[0] > key[1]:
            key, edge = (key[1], key[0]), _turned(edge)
        groups.setdefault(key, []).append((row, edge))
    return groups


def _loops(part: Part, groups: Groups, asked: tuple[int, Edge], alike: set[int]) -> int:
    """How many third parts close a loop with a match between two, less those that do not.

    Of a loop one match may be ambiguous, and not two: where all looks alike a metre further on,
    two that are wrong by a metre close it.
    """
    row, one = asked
    first, second = (int(part.parts[stop]) for stop in (one.start, one.end))
    closed = 0
    for third in np.unique(part.parts).tolist():
        if third in {first, second}:
            continue
        there = _directed(groups, second, third)
        back = _directed(groups, third, first)
        told = [
            _closes(_round(part, (one, go, come)))
            for at, go in there
            for by, come in back
            if len({row, at, by} & alike) <= 1
        ]
        telling = [squared <= CONTRADICTION for squared, tells in told if tells]
        closed += (1 if any(telling) else -1) if telling else 0
    return closed


def _directed(groups: Groups, start: int, end: int) -> list[tuple[int, Edge]]:
    """The matches from one part to another, turned where they were matched the other way."""
    edges = groups.get((min(start, end), max(start, end)), [])
    return edges if start < end else [(row, _turned(edge)) for row, edge in edges]


def _round(part: Part, edges: Sequence[Edge]) -> list[tuple[Array, Array]]:
    """The way along matches from part to part, and inside of each part to the next match."""
    steps = []
    for edge, after in zip(edges, [*edges[1:], edges[0]], strict=True):
        steps += [(edge.pose, edge.covariance), part.step(edge.end, after.start)]
    return steps


def _agree(part: Part, one: Edge, other: Edge) -> bool:
    """Whether two matches between the same parts place them alike, to `TELLING`."""
    squared, telling = _closes(_round(part, (one, _turned(other))))
    return telling and squared <= CONTRADICTION


def _turned(edge: Edge) -> Edge:
    """The same match seen from its other end."""
    covariance = inverse_covariance_of(edge.pose, edge.covariance)
    return Edge(edge.end, edge.start, inverse(edge.pose), covariance)


def _closes(steps: Sequence[tuple[Array, Array]]) -> tuple[float, bool]:
    """Squared misclosure of a loop in standard deviations, and whether it would show an error."""
    pose, covariance = way(steps)
    squared = float(pose @ np.linalg.solve(covariance + FLOOR, pose))
    worst = np.sqrt(np.append(np.linalg.eigvalsh(covariance[:2, :2]), covariance[2, 2]))
    return squared, bool((worst < TELLING).all())


def _confirmed(one: Match, text: str) -> Match:
    """A match that the graph confirms; its weaknesses remain."""
    verdict: Verdict = "accepted" if one.precise else "imprecise"
    return replace(one, verdict=verdict, reasons=(*one.reasons, text))
