"""Robot poses in the GTV frame, from matches and surveyed stops."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laser_gt.matching.verdicts import Match
from laser_gt.placing.anchors import Surveyed, edge_of
from laser_gt.placing.engines import Matching
from laser_gt.placing.equations import ends_of
from laser_gt.placing.graph import Edge, Graph, GraphSolution, solve_graph
from laser_gt.placing.guesses import guess_deviations
from laser_gt.placing.pairs import parts_of
from laser_gt.placing.placement import Placement, place
from laser_gt.placing.switches import WRONG_SHARE, guess_edges, held, spanning
from laser_gt.scans.planar import CONTRADICTION, compose, inverse
from laser_gt.scans.scan import Flags, Indices
from validation.errors import GtvalError
from validation.poses.angles import Array

NEITHER = 10.0
"""Factor on the variance of a guess with which it stands for an ambiguous match: the guesses are in
the graph already, and are not to count twice."""


@dataclass(frozen=True)
class Gap:
    """Stops that no chain of matches joins with a surveyed stop.

    Parameters
    ----------
    stops : tuple of str
        Joined with each other, or one alone.
    matches : tuple of Match
        Between these and placed stops: a person may decide on one of them.
    nearest : (str, str)
        The stop and the placed one that are nearest to each other by the initial guess.
    distance : float
        Between the two, metres.
    """

    stops: tuple[str, ...]
    matches: tuple[Match, ...]
    nearest: tuple[str, str]
    distance: float


@dataclass(frozen=True)
class LaserSolution:
    """Robot poses by one engine.

    Parameters
    ----------
    matching : Matching
        The matches.
    graph : GraphSolution
        Shape of the trajectory.
    placement : Placement
        Poses in the GTV frame of the stops in ``stops``.
    stops : tuple of str
        Stops with a pose: connected with an anchor.
    anchors : tuple of str
        Surveyed stops that placed the laser frame.
    parts : (n,) int array
        The part of the graph that each stop belongs to.
    hanging : tuple of (Match, tuple of str)
        Matches that may be wrong, that nothing checks, and the stops that are placed by each
        alone. Its covariance there counts in that one of some such matches is wrong.
    gaps : tuple of Gap
        Stops without a pose.
    """

    matching: Matching
    graph: GraphSolution
    placement: Placement
    stops: tuple[str, ...]
    anchors: tuple[str, ...]
    parts: Indices
    hanging: tuple[tuple[Match, tuple[str, ...]], ...]
    gaps: tuple[Gap, ...]

    @property
    def lost(self) -> tuple[str, ...]:
        """Stops without a pose."""
        return tuple(stop for gap in self.gaps for stop in gap.stops)


def solve(
    stops: Sequence[str],
    mount: Array,
    mount_sigmas: Array,
    trajectory: Array,
    matching: Matching,
    surveyed: Surveyed,
    guess_sigmas: Sequence[float] = (0.15, 0.1),
) -> LaserSolution:
    """Robot poses in the GTV frame.

    Parameters
    ----------
    stops : sequence of str
        All that were scanned.
    mount, mount_sigmas : (3,) arrays
        Laser frame in the robot frame, and how well it was measured.
    trajectory : (n, 3) array
        Initial guess of the laser frames.
    matching : Matching
        What was matched.
    surveyed : Surveyed
        Poses of the reference stops.
    guess_sigmas : (float, float)
        How good that guess is from stop to stop, metres and radians.

    Raises
    ------
    GtvalError
        If no match that is used reaches a reference stop.
    """
    where = {stop: number for number, stop in enumerate(stops)}
    roots = [where[stop] for stop in surveyed.stops if stop in where]
    edges = [edge_of(where, one) for one in matching.used]
    edges, hanging = _with_hanging(where, edges, matching, trajectory, roots, guess_sigmas)
    parts = parts_of(len(stops), ends_of(edges))
    kept = np.isin(parts, parts[roots]) & (np.bincount(parts, minlength=len(stops))[parts] > 1)
    if not kept.any():
        raise GtvalError(
            "no match that can be used reaches a surveyed stop; look at the matches with "
            "`gtval laser inspect` and decide on some, or survey more stops"
        )
    names = tuple(np.array(stops, dtype=object)[kept].tolist())
    _, numbers = np.unique(parts[kept], return_inverse=True)
    known = surveyed.select([stop for stop in surveyed.stops if stop in names])
    anchors = [names.index(stop) for stop in known.stops]
    starts = [anchors[int((numbers[anchors] == one).argmax())] for one in range(numbers.max() + 1)]
    inside = _renumbered(edges, kept)
    robot = compose(compose(mount, trajectory[kept]), inverse(mount))
    solution = solve_graph(
        Graph(
            initial=spanning(robot, inside, starts, mount),
            mount=mount,
            edges=inside,
            prior_stops=starts,
            prior_poses=robot[starts],
            prior_covariance=held(len(starts)),
            mount_covariance=np.diag(mount_sigmas**2),
            guesses=guess_edges(trajectory[kept], numbers, guess_sigmas),
        )
    )
    return LaserSolution(
        matching=matching,
        graph=solution,
        placement=place(solution, anchors, known.poses, known.covariance, numbers),
        stops=names,
        anchors=known.stops,
        parts=numbers,
        hanging=_named(stops, edges, hanging, roots),
        gaps=_gaps(stops, parts, kept, matching, trajectory),
    )


def _with_hanging(
    where: dict[str, int],
    edges: list[Edge],
    matching: Matching,
    trajectory: Array,
    roots: Sequence[int],
    sigmas: Sequence[float],
) -> tuple[list[Edge], list[Match]]:
    """The edges, and matches that may be wrong where nothing else joins stops with a root.

    The one with the fewest doubts comes first. Parts that have surveyed stops of their own are
    not joined, and what contradicts its guess joins nothing.
    """
    waiting = sorted(
        (one for one in matching.of("may be wrong") if one.surprise <= CONTRADICTION),
        key=lambda one: (len(one.reasons), float(np.trace(one.covariance))),
    )
    edges, taken = list(edges), []
    while True:
        parts = parts_of(len(where), ends_of(edges))
        rooted = np.isin(parts, parts[list(roots)])
        for one in waiting:
            start, end = where[one.reference], where[one.moving]
            if rooted[start] != rooted[end]:
                edge = edge_of(where, one)
                prior = guess_deviations(trajectory, start, end, sigmas)[[0, 0, 1]] ** 2
                # Of two poses that agree alike neither is taken: the guess is not biased to one.
                pose = one.guess if one.ambiguous else edge.pose
                share = NEITHER if one.ambiguous else WRONG_SHARE
                widened = edge.covariance + share * np.diag(prior)
                edges.append(Edge(start, end, pose, widened, edge.noise))
                taken.append(one)
                break
        else:
            return edges, taken


def _renumbered(edges: Sequence[Edge], kept: Flags) -> list[Edge]:
    """The edges between stops that are kept, with the numbers that these have among themselves."""
    number = np.cumsum(kept) - 1
    return [
        Edge(int(number[one.start]), int(number[one.end]), one.pose, one.covariance, one.noise)
        for one in edges
        if kept[one.start]
    ]


def _named(
    stops: Sequence[str], edges: Sequence[Edge], hanging: Sequence[Match], roots: Sequence[int]
) -> tuple[tuple[Match, tuple[str, ...]], ...]:
    """Each match that nothing checks, with the stops that have no pose without it."""
    found = []
    for one in hanging:
        ends = {stops.index(one.reference), stops.index(one.moving)}
        rest = [edge for edge in edges if {edge.start, edge.end} != ends]
        parts = parts_of(len(stops), ends_of(rest))
        apart = ~np.isin(parts, parts[list(roots)])
        whole = parts_of(len(stops), ends_of(edges))
        apart &= whole == whole[min(ends)]
        found.append((one, tuple(stops[row] for row in np.flatnonzero(apart).tolist())))
    return tuple(found)


def _gaps(
    stops: Sequence[str], parts: Indices, kept: Flags, matching: Matching, trajectory: Array
) -> tuple[Gap, ...]:
    """What is not placed, part by part, and what would close the gap."""
    from scipy.spatial import cKDTree  # noqa: PLC0415  (loaded when stops are placed)

    gaps = []
    placed = np.flatnonzero(kept)
    near, there = cKDTree(trajectory[placed, :2]), {stops[row] for row in placed.tolist()}
    for part in dict.fromkeys(parts[~kept].tolist()):
        rows = np.flatnonzero(parts == part)
        names = tuple(stops[row] for row in rows.tolist())
        inside = set(names)
        between_them = tuple(
            one
            for one in matching.matches
            if (one.reference in inside) != (one.moving in inside)
            and {one.reference, one.moving} & there
        )
        apart, nearest = near.query(trajectory[rows, :2])
        first = int(np.argmin(apart))
        ends = (names[first], stops[int(placed[nearest[first]])])
        gaps.append(Gap(names, between_them, ends, float(apart[first])))
    return tuple(gaps)
