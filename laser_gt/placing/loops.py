"""Loops over triples of scans: three right matches close, a wrong one does not."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from laser_gt.matching.verdicts import VERDICTS, Match, Verdict
from laser_gt.scans.planar import (
    CONTRADICTION,
    compose,
    compose_jacobians,
    inverse,
    inverse_covariance_of,
)
from validation.poses.angles import Array

FLOOR = np.diag([0.003**2, 0.003**2, 0.001**2])
"""Allowed for what the covariances leave out: 3 mm and 1 mrad of surfaces that are not flat.
A judgement: half of the standard deviations up to which a match is accepted."""


@dataclass(frozen=True)
class Loop:
    """A triple of stops and how well its three matches close.

    Parameters
    ----------
    stops : (str, str, str)
        The triple.
    chi_squared : float
        Of the misclosure, the composed pose that should be the identity; 3 degrees of freedom.
    """

    stops: tuple[str, str, str]
    chi_squared: float

    @property
    def closes(self) -> bool:
        """Whether noise explains the misclosure."""
        return self.chi_squared <= CONTRADICTION


def triples(matches: Sequence[Match]) -> list[Loop]:
    """All loops of three among the matches that are not rejected."""
    usable = {(m.reference, m.moving): m for m in matches if m.verdict != "refuted"}
    neighbours: dict[str, set[str]] = {}
    for a, b in usable:
        neighbours.setdefault(a, set()).add(b)
        neighbours.setdefault(b, set()).add(a)
    found = []
    for a in sorted(neighbours):
        for b, c in combinations(sorted(neighbours[a]), 2):
            if a < b and c in neighbours[b]:
                found.append(_loop(usable, (a, b, c)))
    return found


def _edge(matches: dict[tuple[str, str], Match], start: str, end: str) -> tuple[Array, Array]:
    """Pose and covariance from one stop to another, in whichever direction it was matched."""
    if (start, end) in matches:
        return matches[start, end].by_scans
    pose, covariance = matches[end, start].by_scans
    return inverse(pose), inverse_covariance_of(pose, covariance)


def way(steps: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Pose and covariance at the end of steps, each seen from the end of the one before."""
    pose, covariance = steps[0]
    for step, step_covariance in steps[1:]:
        by_first, by_second = compose_jacobians(pose, step)
        covariance = by_first @ covariance @ by_first.T + by_second @ step_covariance @ by_second.T
        pose = compose(pose, step)
    return pose, covariance


def _loop(matches: dict[tuple[str, str], Match], stops: tuple[str, str, str]) -> Loop:
    """The way from the first stop over the others back to it."""
    a, b, c = stops
    pose, covariance = way([_edge(matches, *ends) for ends in ((a, b), (b, c), (c, a))])
    chi_squared = float(pose @ np.linalg.solve(covariance + FLOOR, pose))
    return Loop(stops, chi_squared)


def with_loops(matches: Sequence[Match]) -> tuple[list[Match], list[Loop]]:
    """The matches with what their loops say of them; and the loops.

    Notes
    -----
    A match that breaks most of its loops may be wrong, whatever was said of it before.
    """
    loops = triples(matches)
    closed: dict[frozenset[str], list[bool]] = {}
    for loop in loops:
        for pair in combinations(loop.stops, 2):
            closed.setdefault(frozenset(pair), []).append(loop.closes)
    told = [_told(one, closed.get(frozenset((one.reference, one.moving)), [])) for one in matches]
    return told, loops


def _told(match: Match, outcome: list[bool]) -> Match:
    """The match after what its loops say, True for each that closes."""
    broken = outcome.count(False)
    if broken <= len(outcome) / 2:
        return match
    reason = f"breaks {broken} of its {len(outcome)} loops of three scans"
    verdicts: tuple[Verdict, Verdict] = (match.verdict, "may be wrong")
    worse = max(verdicts, key=VERDICTS.index)
    return replace(match, verdict=worse, reasons=(*match.reasons, reason))
