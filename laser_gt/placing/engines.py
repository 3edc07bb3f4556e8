"""All pairs matched by one engine, judged, and compared with their loops and the decisions."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from laser_gt.logs.decisions import Decision
from laser_gt.matching.genetic import GeneticSettings, genetic_match
from laser_gt.matching.gpm import associate
from laser_gt.matching.judgement import MatchSettings, judged, match
from laser_gt.matching.kiss import register
from laser_gt.matching.verdicts import VERDICTS, Match, Verdict
from laser_gt.placing.guesses import guess_deviations
from laser_gt.placing.loops import Loop, with_loops
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.planar import between
from laser_gt.scans.scan import Indices
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
    seed : int
        Of its chance.
    """

    guess_sigmas: tuple[float, float]
    initial: Literal["local", "gpm", "kiss"] = "local"
    genetic: GeneticSettings = field(default_factory=GeneticSettings)
    seed: int = 1


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
        return self.of("accept")

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


def match_pairs(
    sweeps: Sequence[Prepared],
    poses: Array,
    pairs: Indices,
    decisions: Mapping[tuple[str, str], Decision],
    settings: EngineSettings,
    engine: Engine,
    report: Report,
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
    """
    matches, convergence = [], {}
    generators = np.random.default_rng(settings.seed).spawn(len(pairs))
    for number, ((i, j), rng) in enumerate(zip(pairs.tolist(), generators, strict=True)):
        reference, moving = sweeps[i], sweeps[j]
        names = (reference.name, moving.name)
        report(f"{engine}: {' - '.join(names)}", number / len(pairs))
        guess = between(poses[i], poses[j])
        length, angle = guess_deviations(poses, i, j, settings.guess_sigmas).tolist()
        limits = MatchSettings(guess_length=length, guess_angle=angle)
        decision = decisions.get(names)
        if decision is not None and decision.guess is not None:
            guess, limits = decision.guess, BY_HAND
        if engine == "genetic":
            found = genetic_match(reference, moving, rng, [guess], settings.genetic, middle=guess)
            convergence[names] = found.convergence
            matches.append(judged(reference, moving, guess, found.finalists, limits))
        else:
            start = _start(reference, moving, guess, settings)
            matches.append(match(reference, moving, guess, limits, start))
    judged_matches, loops = with_loops(matches)
    return Matching(
        engine, [_obeying(one, decisions) for one in judged_matches], loops, convergence
    )


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
    if decision is None or decision.kind == "guess":
        return found
    verdict: Verdict = "accept" if decision.kind == "accept" else "reject"
    who = f" by {decision.by}" if decision.by else ""
    return replace(
        found, verdict=verdict, reasons=(*found.reasons, f"decided: {decision.kind}{who}")
    )
