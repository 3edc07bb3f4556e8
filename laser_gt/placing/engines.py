"""All pairs matched by one engine, judged, and compared with their loops and the decisions."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from laser_gt.logs.decisions import Decision
from laser_gt.matching.genetic import GeneticSettings, genetic_match
from laser_gt.matching.gpm import associate
from laser_gt.matching.judgement import MatchSettings, judged, match
from laser_gt.matching.kiss import register
from laser_gt.matching.verdicts import VERDICTS, JudgementSettings, Match, Verdict
from laser_gt.placing.anchors import edge_of
from laser_gt.placing.guesses import guess_deviations
from laser_gt.placing.loops import Loop, with_loops
from laser_gt.placing.pairs import bridges, nearest_pairs, parts_of
from laser_gt.placing.submaps import matched_as_submaps, sees_half
from laser_gt.placing.switches import decided, graph_of
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.planar import between
from laser_gt.scans.scan import Flags, Indices
from validation.poses.angles import Array

Engine = Literal["scanmatch", "genetic"]
Report = Callable[[str, float], None]
BY_HAND = MatchSettings(guess_length=0.1, guess_angle=0.1)
"""How well a guess is known that a person gave: to 10 cm and 6 degrees. A judgement: what can be
read off a picture of two scans."""


@dataclass(frozen=True)
class EngineSettings:
    """How pairs are matched.

    Parameters
    ----------
    guess_sigmas : (float, float)
        Standard deviations of the guess from one stop to the next, metres and radians.
    initial : {"local", "gpm", "kiss"}
        What the scan matcher starts from: the guess, or what another matcher makes of it.
    genetic : GeneticSettings
        Of the genetic aligner.
    genetic_pairs : int
        Nearest neighbours of a stop that it matches first.
    seed : int
        Of its chance.
    judgement : JudgementSettings
        Limits of the verdicts.

    Notes
    -----
    ``genetic_pairs``: a judgement. A match takes the genetic aligner a third of a second, and
    three pairs at each stop make a graph with loops; what they leave apart is matched after them.
    """

    guess_sigmas: tuple[float, float]
    initial: Literal["local", "gpm", "kiss"] = "local"
    genetic: GeneticSettings = field(default_factory=GeneticSettings)
    genetic_pairs: int = 3
    seed: int = 1
    judgement: JudgementSettings = field(default_factory=JudgementSettings)


@dataclass(frozen=True)
class PairJob:
    """A pair to be matched, and all that its match depends on.

    Parameters
    ----------
    reference, moving : Prepared
        The two sweeps.
    guess : (3,) array
        Frame of the second in that of the first.
    limits : MatchSettings
        How well that is known, and the limits of the verdict.
    settings : EngineSettings
        How pairs are matched.
    engine : {"scanmatch", "genetic"}
        By what.
    """

    reference: Prepared
    moving: Prepared
    guess: Array
    limits: MatchSettings
    settings: EngineSettings
    engine: Engine

    @property
    def names(self) -> tuple[str, str]:
        """Of both stops."""
        return self.reference.name, self.moving.name


@dataclass(frozen=True)
class Raw:
    """A match before its loops and the decisions are asked.

    Parameters
    ----------
    match : Match
        From its guess.
    row : int
        Of its pair.
    curve : (g,) array or None
        Best fitness by generation (genetic only).
    """

    match: Match
    row: int = -1
    curve: Array | None = None


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
    raw : mapping
        The matches before loops and decisions, by their pairs of stops.
    """

    engine: Engine
    matches: list[Match]
    loops: list[Loop]
    convergence: Mapping[tuple[str, str], Array] = field(default_factory=dict)
    raw: Mapping[tuple[str, str], Raw] = field(default_factory=dict)

    @property
    def accepted(self) -> list[Match]:
        """Matches that are right and precise."""
        return self.of("accepted")

    @property
    def used(self) -> list[Match]:
        """Matches that the graph is made of: accepted, or imprecise."""
        return [match for match in self.matches if match.used]

    def of(self, verdict: Verdict) -> list[Match]:
        """Matches with a verdict."""
        return [match for match in self.matches if match.verdict == verdict]

    @property
    def counts(self) -> dict[Verdict, int]:
        """Number of matches of each verdict."""
        return {verdict: len(self.of(verdict)) for verdict in VERDICTS}

    @property
    def open_loops(self) -> int:
        """Number of loops that do not close."""
        return sum(not loop.closes for loop in self.loops)


Matcher = Callable[[Sequence[PairJob], Report], Sequence[Raw]]


def one_by_one(jobs: Sequence[PairJob], report: Report) -> list[Raw]:
    """The matches of pairs, in this process."""
    found = []
    for number, job in enumerate(jobs):
        report(f"{job.engine}: {' - '.join(job.names)}", number / len(jobs))
        found.append(match_pair(job))
    return found


def match_pairs(
    sweeps: Sequence[Prepared],
    poses: Array,
    pairs: Indices,
    decisions: Mapping[tuple[str, str], Decision],
    settings: EngineSettings,
    engine: Engine,
    report: Report,
    matcher: Matcher = one_by_one,
) -> Matching:
    """Every pair matched and judged, with what its loops and the decisions say of it.

    Parameters
    ----------
    sweeps : sequence of Prepared
        One for each stop, in the laser frame.
    poses : (n, 3) array
        Initial guess of the laser frames.
    pairs : (m, 2) int array
        Stops to be matched.
    decisions : mapping of (str, str) to Decision
        By the names of both stops, in either order.
    settings : EngineSettings
        How.
    engine : {"scanmatch", "genetic"}
        By what.
    report : callable
        Called with what is being done and the share done.
    matcher : callable
        Gives the matches of jobs (`match_pair`), in their order: by other processes, or those that
        were kept.

    Notes
    -----
    The genetic aligner matches the nearest neighbours of each stop first. As long as the matches
    that are used leave the stops in parts, it goes on with the shortest pairs between them, and,
    where a match between parts may be wrong, with the pairs that may confirm it.
    So it tries all pairs of which scan matching may have one that joins the parts.
    """
    tried = np.ones(len(pairs), dtype=bool)
    if engine == "genetic":
        tried[:] = False
        tried[nearest_pairs(poses, pairs, settings.genetic_pairs)] = True
        named = [frozenset(names) for names in decisions]
        tried |= [frozenset((sweeps[i].name, sweeps[j].name)) in named for i, j in pairs.tolist()]
    rows = np.flatnonzero(tried)
    raw: dict[int, Raw] = {}
    while True:
        jobs = []
        for i, j in pairs[rows].tolist():
            decision = decisions.get((sweeps[i].name, sweeps[j].name))
            guess, limits = _guess(poses, i, j, decision, settings)
            jobs.append(PairJob(sweeps[i], sweeps[j], guess, limits, settings, engine))
        before = len(raw)

        def told(what: str, share: float, before: int = before, new: int = len(jobs)) -> None:
            report(what, (before + share * new) / (before + new))

        made = matcher(jobs, told)
        raw |= {row: replace(one, row=row) for row, one in zip(rows.tolist(), made, strict=True)}
        found = {row: one.match for row, one in raw.items()}
        matches, loops = _told(sweeps, poses, found, decisions, settings)
        rows = _more(poses, pairs, tried, matches, settings.genetic_pairs)
        if not len(rows):
            break
        tried[rows] = True
    order = sorted(found)
    better = _as_submaps(sweeps, poses, matches, decisions, settings)
    if better:
        found |= {order[at]: one for at, one in better.items()}
        matches, loops = _told(sweeps, poses, found, decisions, settings)
    by_pair = {(one.match.reference, one.match.moving): one for one in raw.values()}
    convergence = {pair: one.curve for pair, one in by_pair.items() if one.curve is not None}
    return Matching(engine, matches, loops, convergence, by_pair)


def match_pair(job: PairJob) -> Raw:
    """One pair matched by an engine.

    Notes
    -----
    The chance of the genetic aligner is that of the seed and of the names of both stops: a match
    is the same whatever other pairs there are, and in which order and process they are matched.
    """
    reference, moving, guess = job.reference, job.moving, job.guess
    if job.engine == "genetic":
        drawn = hashlib.sha256("\0".join(job.names).encode()).digest()
        rng = np.random.default_rng([job.settings.seed, *drawn[:8]])
        search = job.settings.genetic
        winner = genetic_match(reference, moving, rng, [guess], search, middle=guess)
        found = judged(reference, moving, guess, winner.finalists, job.limits)
        return Raw(found, curve=winner.convergence)
    start = _start(reference, moving, guess, job.settings)
    return Raw(match(reference, moving, guess, job.limits, start))


def match_by_hand(
    reference: Prepared, moving: Prepared, guess: Array, settings: EngineSettings
) -> Match:
    """The match from a guess that a person gives, as a decision with it gives it.

    Parameters
    ----------
    reference, moving : Prepared
        The two sweeps.
    guess : (3,) array
        Moving laser frame in the reference laser frame.
    settings : EngineSettings
        How pairs are matched.
    """
    limits = replace(BY_HAND, judgement=settings.judgement)
    return match(reference, moving, guess, limits, _start(reference, moving, guess, settings))


def told_anew(
    sweeps: Sequence[Prepared],
    poses: Array,
    matching: Matching,
    decisions: Mapping[tuple[str, str], Decision],
    settings: EngineSettings,
) -> Matching:
    """The matching if other decisions were made, no pair matched anew.

    What `match_pairs` gives with these decisions, as far as they are no guesses and no stops are
    joined by submaps.
    """
    found = {one.row: one.match for one in matching.raw.values()}
    matches, loops = _told(sweeps, poses, found, decisions, settings)
    return replace(matching, matches=matches, loops=loops)


def _told(
    sweeps: Sequence[Prepared],
    poses: Array,
    found: Mapping[int, Match],
    decisions: Mapping[tuple[str, str], Decision],
    settings: EngineSettings,
) -> tuple[list[Match], list[Loop]]:
    """The matches in the order of their pairs, with what loops, decisions and the graph say."""
    told, loops = with_loops([found[row] for row in sorted(found)])
    obeying = [_obeying(one, decisions) for one in told]
    stops = [sweep.name for sweep in sweeps]
    return decided(stops, poses, obeying, settings.guess_sigmas), loops


def _as_submaps(
    sweeps: Sequence[Prepared],
    poses: Array,
    matches: Sequence[Match],
    decisions: Mapping[tuple[str, str], Decision],
    settings: EngineSettings,
) -> dict[int, Match]:
    """Matches by their place that are used once scans of half a turn are merged into submaps.

    Only those that may be wrong and that would join what the used ones leave in parts.
    """
    where = {one.name: number for number, one in enumerate(sweeps)}
    half = [sees_half(one.sweep) for one in sweeps]
    open_ones = [
        (at, where[one.reference], where[one.moving])
        for at, one in enumerate(matches)
        if one.verdict == "may be wrong" and (one.reference, one.moving) not in decisions
    ]
    open_ones = [(at, i, j) for at, i, j in open_ones if half[i] and half[j]]
    if not open_ones:
        return {}
    used = [edge_of(where, one) for one in matches if one.used]
    part = graph_of(poses, used, settings.guess_sigmas)
    better = {}
    for at, i, j in open_ones:
        if part.parts[i] != part.parts[j]:
            guess, limits = _guess(poses, i, j, None, settings)
            one = matched_as_submaps(sweeps, part, (i, j), guess, limits)
            if one is not None and one.used:
                better[at] = one
    return better


def _guess(
    poses: Array, i: int, j: int, decision: Decision | None, settings: EngineSettings
) -> tuple[Array, MatchSettings]:
    """Where a stop is seen from another before they are matched, and how well that is known."""
    if decision is not None and decision.guess is not None:
        return decision.guess, replace(BY_HAND, judgement=settings.judgement)
    length, angle = guess_deviations(poses, i, j, settings.guess_sigmas).tolist()
    return between(poses[i], poses[j]), MatchSettings(
        guess_length=length, guess_angle=angle, judgement=settings.judgement
    )


def _more(poses: Array, pairs: Indices, tried: Flags, matches: list[Match], most: int) -> Indices:
    """Rows of the pairs that may join what the used matches leave in parts; none if none do.

    The matches are those of the pairs that were tried, in their order.
    """
    left = np.flatnonzero(~tried)
    used = np.array([one.used for one in matches], dtype=bool)
    parts = parts_of(len(poses), pairs[tried][used])
    rows = left[bridges(poses, pairs[left], parts, most)]
    if len(rows):
        return rows
    held_up = np.array([one.verdict == "may be wrong" for one in matches], dtype=bool)
    doubtful = pairs[tried][held_up]
    ends = doubtful[parts[doubtful[:, 0]] != parts[doubtful[:, 1]]]
    return np.asarray(left[np.isin(pairs[left], ends).any(1)])


def _start(
    reference: Prepared, moving: Prepared, guess: Array, settings: EngineSettings
) -> Array | None:
    """Where the scan matcher looks first, if not at the guess."""
    if settings.initial == "gpm":
        return np.asarray(associate(reference, moving, guess, count=1)[0])
    return register(reference, moving, guess) if settings.initial == "kiss" else None


def _obeying(found: Match, decisions: Mapping[tuple[str, str], Decision]) -> Match:
    """The match with the verdict that was decided on, where one was."""
    decision = decisions.get((found.reference, found.moving))
    if decision is None:
        return found
    if decision.kind == "guess":  # what a person saw is not the odometry, which the graph has too
        return replace(found, seen_pose=None, seen_covariance=None)
    verdict: Verdict = "accepted" if decision.kind == "accept" else "refuted"
    who = f" by {decision.by}" if decision.by else ""
    return replace(
        found, verdict=verdict, reasons=(*found.reasons, f"decided: {decision.kind}{who}")
    )
