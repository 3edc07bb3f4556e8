"""From scans to robot poses: initial guess, pairs, matches, judgement, decisions, graph."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from laser_gt.campaign.inputs import LaserInputs
from laser_gt.logs.decisions import Decision
from laser_gt.matching.genetic import GeneticSettings, genetic_match
from laser_gt.matching.gpm import associate
from laser_gt.matching.judgement import MatchSettings, judged, match
from laser_gt.matching.kiss import odometry, register
from laser_gt.matching.verdicts import Match
from laser_gt.placing.graph import Edge, Graph, GraphSolution, connected_stops, solve_graph
from laser_gt.placing.guesses import guess_deviations
from laser_gt.placing.loops import Loop, with_loops
from laser_gt.placing.pairs import CandidatePairs, PairSettings, candidate_pairs
from laser_gt.placing.placement import Placement, place
from laser_gt.scans.planar import between, compose
from laser_gt.settings import LaserSettings
from validation.errors import GtvalError
from validation.poses.angles import Array

Engine = Literal["scanmatch", "genetic"]
Report = Callable[[str, float], None]
GAUGE = 1e-12
"""Variance with which a graph is held at its first anchor."""


@dataclass(frozen=True)
class Surveyed:
    """Surveyed poses of some stops, in the GTV frame.

    Parameters
    ----------
    stops : tuple of str
        Their names.
    poses : (p, 3) array
        Robot poses.
    joint : (3p, 3p) array
        Joint covariance.
    """

    stops: tuple[str, ...]
    poses: Array
    joint: Array

    def select(self, stops: Sequence[str]) -> "Surveyed":
        """Some of the stops, in that order."""
        rows = np.array([self.stops.index(stop) for stop in stops], dtype=int)
        flat = (3 * rows[:, None] + np.arange(3)).ravel()
        return Surveyed(tuple(stops), self.poses[rows], self.joint[np.ix_(flat, flat)])


@dataclass(frozen=True)
class Trajectory:
    """First guess of all laser frames, in the frame of the first.

    Parameters
    ----------
    poses : (n, 3) array
        Laser frames.
    source : str
        Where they come from, in words.
    doubtful : tuple of str
        Stops that could not be placed with confidence.
    from_scans : bool
        Whether the scans were matched in a row, for want of odometry.
    """

    poses: Array
    source: str
    doubtful: tuple[str, ...] = ()
    from_scans: bool = False


@dataclass(frozen=True)
class Matching:
    """All matches by one engine.

    Parameters
    ----------
    engine : {"scanmatch", "genetic"}
        What found them.
    matches : list of Match
        After loops and decisions.
    loops : list of Loop
        All triples.
    convergence : mapping
        Best fitness by generation, for each pair of stops (genetic only).
    """

    engine: Engine
    matches: list[Match]
    loops: list[Loop]
    convergence: Mapping[tuple[str, str], Array] = field(default_factory=dict)

    @property
    def accepted(self) -> list[Match]:
        """Matches that the graph is made of."""
        return [match for match in self.matches if match.verdict == "accept"]


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
    lost : tuple of str
        Stops without.
    anchors : tuple of str
        Surveyed stops that placed the laser frame.
    """

    matching: Matching
    graph: GraphSolution
    placement: Placement
    stops: tuple[str, ...]
    lost: tuple[str, ...]
    anchors: tuple[str, ...]


def first_trajectory(inputs: LaserInputs) -> Trajectory:
    """Laser frames by odometry, or by matching the scans in a row where there is none."""
    given = inputs.laser_odometry
    if given is not None:
        return Trajectory(between(given[0], given), "odometry")
    found = odometry(inputs.sweeps)
    doubtful = tuple(inputs.stops[i] for i in found.doubtful)
    return Trajectory(found.poses, "scans matched in a row (kiss-icp)", doubtful, from_scans=True)


def find_pairs(
    inputs: LaserInputs, trajectory: Trajectory, settings: LaserSettings, most: int = 0
) -> CandidatePairs:
    """Pairs worth matching, and those that a decision names.

    Where the radius leaves stops without a chain of pairs to the others, it is made larger, to
    three times at most.
    """
    sweeps = [one.sweep for one in inputs.sweeps]
    for wider in (1.0, 1.5, 2.0, 3.0):
        limits = PairSettings(
            settings.pair_radius * wider,
            settings.pair_heading,
            settings.pair_overlap,
            most or settings.pairs_per_stop,
        )
        pairs = candidate_pairs(trajectory.poses, sweeps, limits)
        if _joined(len(sweeps), pairs):
            break
    have = {tuple(pair) for pair in pairs.index.tolist()}
    for reference, moving in inputs.decisions:
        pair = tuple(sorted((inputs.stops.index(reference), inputs.stops.index(moving))))
        if pair not in have:
            have.add(pair)
            pairs = CandidatePairs(
                np.vstack([pairs.index, [pair]]).astype(np.intp), np.append(pairs.overlap, np.nan)
            )
    return pairs


def _joined(count: int, pairs: CandidatePairs) -> bool:
    """Whether chains of pairs join all stops."""
    edges = [Edge(int(i), int(j), np.zeros(3), np.eye(3)) for i, j in pairs.index]
    return bool(connected_stops(count, edges, [0]).all())


def match_pairs(
    inputs: LaserInputs,
    trajectory: Trajectory,
    pairs: CandidatePairs,
    settings: LaserSettings,
    engine: Engine,
    report: Report,
) -> Matching:
    """Every candidate pair matched and judged, then held against its loops and the decisions."""
    matches, convergence = [], {}
    generators = np.random.default_rng(settings.seed).spawn(len(pairs.index))
    for number, ((i, j), rng) in enumerate(zip(pairs.index, generators, strict=True)):
        report(f"{engine}: {inputs.stops[i]} - {inputs.stops[j]}", number / len(pairs.index))
        decision = inputs.decisions.get((inputs.stops[i], inputs.stops[j]))
        guess = between(trajectory.poses[i], trajectory.poses[j])
        limits = _limits(settings, trajectory.poses, (int(i), int(j)), decision)
        if decision is not None and decision.guess is not None:
            guess = decision.guess
        reference, moving = inputs.sweeps[i], inputs.sweeps[j]
        if engine == "genetic":
            found = genetic_match(
                reference,
                moving,
                rng,
                [guess],
                GeneticSettings(settings.population, settings.generations),
                middle=guess,
            )
            convergence[reference.name, moving.name] = found.convergence
            matches.append(judged(reference, moving, guess, found.finalists, limits, "genetic"))
        else:
            start = None
            if settings.initial == "gpm":
                start = associate(reference, moving, guess, count=1)[0]
            elif settings.initial == "kiss":
                start = register(reference, moving, guess)
            matches.append(match(reference, moving, guess, limits, start))
    judged_matches, loops = with_loops(matches)
    decided = [_obeying(one, inputs.decisions) for one in judged_matches]
    return Matching(engine, decided, loops, convergence)


def _limits(
    settings: LaserSettings, poses: Array, pair: tuple[int, int], decision: Decision | None
) -> MatchSettings:
    """How well the guess of a pair is known: it gets worse with the stops in between."""
    if decision is not None and decision.guess is not None:
        return MatchSettings(guess_length=0.1, guess_angle=0.1)
    length, angle = guess_deviations(poses, *pair, settings.guess_sigmas)
    return MatchSettings(guess_length=float(length), guess_angle=float(angle))


def _obeying(found: Match, decisions: Mapping[tuple[str, str], Decision]) -> Match:
    """The match with the verdict that was decided on, where one was."""
    decision = decisions.get((found.reference, found.moving))
    if decision is None or decision.kind == "guess":
        return found
    verdict: Literal["accept", "reject"] = "accept" if decision.kind == "accept" else "reject"
    who = f" by {decision.by}" if decision.by else ""
    reasons = tuple(reason for reason in found.reasons if not reason.startswith("decided"))
    return replace(found, verdict=verdict, reasons=(*reasons, f"decided: {decision.kind}{who}"))


def edges_of(stops: Sequence[str], matches: Sequence[Match]) -> list[Edge]:
    """Accepted matches as edges of a graph."""
    where = {stop: number for number, stop in enumerate(stops)}
    return [
        Edge(where[one.reference], where[one.moving], one.pose, one.covariance)
        for one in matches
        if one.verdict == "accept"
    ]


def solve(
    inputs: LaserInputs, trajectory: Trajectory, matching: Matching, surveyed: Surveyed
) -> LaserSolution:
    """Robot poses in the GTV frame.

    Parameters
    ----------
    inputs, trajectory, matching
        What was read, guessed and matched.
    surveyed : Surveyed
        Poses of the reference stops.

    Raises
    ------
    GtvalError
        If no accepted match reaches a reference stop.
    """
    edges = edges_of(inputs.stops, matching.matches)
    root = _root(inputs.stops, edges, surveyed.stops)
    reached = connected_stops(len(inputs.stops), edges, [root])
    kept = [stop for stop, there in zip(inputs.stops, reached, strict=True) if there]
    where = {stop: number for number, stop in enumerate(kept)}
    edges = edges_of(
        kept, [m for m in matching.matches if m.reference in where and m.moving in where]
    )
    start = where[inputs.stops[root]]
    robot = compose(
        compose(inputs.mount, trajectory.poses[reached]), between(inputs.mount, np.zeros(3))
    )
    robot = between(robot[start], robot)
    solution = solve_graph(
        Graph(
            initial=_spanning(robot, edges, start, inputs.mount),
            mount=inputs.mount,
            edges=edges,
            prior_stops=[start],
            prior_poses=np.zeros((1, 3)),
            prior_covariance=np.eye(3) * GAUGE,
            mount_covariance=np.diag(inputs.mount_sigmas**2),
        )
    )
    anchors = [stop for stop in surveyed.stops if stop in where]
    known = surveyed.select(anchors)
    placement = place(solution, [where[stop] for stop in anchors], known.poses, known.joint)
    lost = tuple(stop for stop in inputs.stops if stop not in where)
    return LaserSolution(matching, solution, placement, tuple(kept), lost, tuple(anchors))


def _root(stops: Sequence[str], edges: Sequence[Edge], anchors: Sequence[str]) -> int:
    """The anchor whose connected part of the graph is the largest."""
    where = {stop: number for number, stop in enumerate(stops)}
    sizes = {
        where[anchor]: int(connected_stops(len(stops), edges, [where[anchor]]).sum())
        for anchor in anchors
        if anchor in where
    }
    if not sizes or max(sizes.values()) < 2:
        raise GtvalError(
            "no accepted match reaches a surveyed stop; look at the matches with "
            "`gtval laser inspect` and decide on some, or survey more stops"
        )
    return max(sizes, key=lambda stop: sizes[stop])


def _spanning(robot: Array, edges: Sequence[Edge], start: int, mount: Array) -> Array:
    """First poses by following the most certain matches out from the start."""
    poses = robot.copy()
    poses[start] = 0.0
    known = {start}
    waiting = sorted(edges, key=lambda edge: float(np.trace(edge.covariance)))
    back = between(mount, np.zeros(3))
    while True:
        for edge in waiting:
            if (edge.start in known) != (edge.end in known):
                step = compose(compose(mount, edge.pose), back)
                if edge.start in known:
                    poses[edge.end] = compose(poses[edge.start], step)
                else:
                    poses[edge.start] = compose(poses[edge.end], between(step, np.zeros(3)))
                known |= {edge.start, edge.end}
                break
        else:
            return poses
