"""Which of a few readings do not fit the others.

In the room there are no spare readings yet: of four readings of a mark, one wrong one leaves the
others barely checked. So every way to explain the misfit by leaving out one reading (or two) is
kept, and a person is told all of them rather than the likeliest alone.
"""

from dataclasses import dataclass
from itertools import combinations
from math import sqrt
from statistics import NormalDist

import numpy as np

from survey.entry.room.fits import (
    information_covariance,
    room_starts,
    stacked,
    test_values,
    why_open,
)
from survey.estimation.distance_fit import DistanceFit, Rows
from survey.estimation.world_points import TIE
from validation.poses.angles import Array

MISFIT_CHANCE = 1e-4
"""Chance that readings without any error are said not to fit together. A judgement: asked at each
of a thousand readings, it troubles people in one campaign of ten."""
_FEW = 8
"""Up to so many readings each is left out in turn; of more, only those that fit worst. A
judgement: the answer must come before the next number is typed."""
_TRIED = 4
"""So many that fit worst. A judgement: the wrong ones are among them unless half are wrong."""


@dataclass(frozen=True)
class Judgement:
    """What readings say together.

    Parameters
    ----------
    why_open : str or None
        Why they determine nothing yet; None where they do.
    states : (k, n) array
        Solutions that fit, the best first; none where nothing fits.
    covariances : (k, n, n) array
        Theirs, readings being independent.
    cost : float
        Chi-squared of the best, of the readings that fit.
    redundancy : int
        Readings that fit, less the unknowns.
    accepted : (m,) array of bool
        Readings that fit.
    explanations : tuple of tuple of int
        Sets of rows, each of which, left out, lets the others fit; empty where all fit.
    """

    why_open: str | None
    states: Array
    covariances: Array
    cost: float
    redundancy: int
    accepted: Array
    explanations: tuple[tuple[int, ...], ...] = ()

    @property
    def suspects(self) -> tuple[int, ...]:
        """Rows of all readings that may be wrong."""
        return tuple(dict.fromkeys(row for rows in self.explanations for row in rows))

    @property
    def m0(self) -> float | None:
        """Standard deviation of unit weight; None without redundancy."""
        return sqrt(self.cost / self.redundancy) if self.redundancy > 0 else None

    @property
    def is_unique(self) -> bool:
        """Whether there is one solution."""
        return len(self.states) == 1


def judge(fit: DistanceFit, near: Array | None = None) -> Judgement:
    """What readings say together, and which may be wrong.

    Parameters
    ----------
    fit : DistanceFit
        The readings.
    near : (s, n) array, optional
        Earlier solutions, which save the search for first guesses.
    """
    everything = np.arange(len(fit))
    why = why_open(fit)
    if why is not None:
        return _open(fit, why)
    rests = False
    for starts in (None,) if near is None else (near, None):
        states, costs = _solutions(fit, starts)
        rests = rests or len(states) > 0
        best = states[0] if len(states) else None if starts is None else starts[0]
        found = _accepted(fit, everything, states, costs) or _explained(fit, best, starts)
        if found is not None:
            return found
    if not rests:
        # Circles that only just touch: the iteration rests nowhere, and nothing is wrong.
        return _open(fit, "the readings do not say it sharply yet")
    return _open(fit, "the readings do not fit together", fits=False)


def _solutions(fit: DistanceFit, starts: Array | None) -> tuple[Array, Array]:
    """Solutions and costs; of a few readings there may be others than those near the starts."""
    use = starts is not None and len(fit) >= 3 * fit.unknowns
    return fit.solutions(starts if use and starts is not None else room_starts(fit))


def misfit_limit(degrees_of_freedom: int, chance: float = MISFIT_CHANCE) -> float:
    """Chi-squared that is exceeded by chance so rarely (Wilson and Hilferty's approximation).

    With no degree of freedom left, the square of one standardised residual at the same level:
    circles that do not meet cost something even then.
    """
    k = max(degrees_of_freedom, 1)
    z = NormalDist().inv_cdf(1 - chance)
    return float(k * (1 - 2 / (9 * k) + z * sqrt(2 / (9 * k))) ** 3)


def _open(fit: DistanceFit, why: str, *, fits: bool = True) -> Judgement:
    n = fit.unknowns
    everything = tuple(range(len(fit)))
    return Judgement(
        why,
        stacked([], n),
        np.empty((0, n, n)),
        0.0,
        0,
        np.full(len(fit), fits),
        () if fits else (everything,),
    )


def _solved(fit: DistanceFit, rows: Rows, near: Array | None) -> Judgement | None:
    """The solutions of some of the readings; None where they do not fit together."""
    part = fit.select(rows)
    if why_open(part) is not None:
        return None
    states, costs = _solutions(part, near)
    return _accepted(fit, rows, states, costs)


def _accepted(fit: DistanceFit, rows: Rows, states: Array, costs: Array) -> Judgement | None:
    """The judgement of solutions of some of the readings; None where they do not fit together."""
    part = fit.select(rows)
    redundancy = len(part) - part.unknowns
    if len(states) == 0 or costs[0] > misfit_limit(redundancy):
        return None
    worst = float(np.abs(test_values(part, states[0])[0]).max())
    if redundancy > 0 and worst > _worst_limit(len(rows)):
        return None
    states, cost = states[costs < costs[0] + TIE], float(costs[0])
    accepted = np.zeros(len(fit), dtype=bool)
    accepted[rows] = True
    covariances = np.array([information_covariance(part, state) for state in states])
    return Judgement(None, states, covariances, cost, redundancy, accepted)


def _worst_limit(readings: int) -> float:
    """|w| that the largest of so many correct readings hardly ever exceeds."""
    return NormalDist().inv_cdf(1 - MISFIT_CHANCE / (2 * readings))


def _explained(fit: DistanceFit, state: Array | None, near: Array | None) -> Judgement | None:
    """The readings without those that may be wrong; None where no one or two explain the misfit.

    ``state`` (n,) is where all of them together fit best, if the iteration rests anywhere;
    ``near`` (s, n) where they fitted before, if they did.
    """
    starts = None if near is None else near if state is None else np.vstack([near, state])
    suspects = _worst_rows(fit, state)
    for count in (1, 2):
        found = []
        for left_out in combinations(suspects, count):
            rows = np.setdiff1d(np.arange(len(fit)), left_out)
            if len(rows) < fit.unknowns or (count == 2 and len(rows) <= fit.unknowns):
                continue
            solved = _solved(fit, rows, starts)
            if solved is not None:
                found.append((solved.cost / max(solved.redundancy, 1), left_out, solved))
        if found:
            return _with_explanations(found)
    return None


def _with_explanations(found: list[tuple[float, tuple[int, ...], Judgement]]) -> Judgement:
    """What all explanations agree on: the readings that none of them leaves out."""
    found = sorted(found, key=lambda one: one[:2])
    states = np.concatenate([solved.states for *_, solved in found])
    covariances = np.concatenate([solved.covariances for *_, solved in found])
    best = found[0][2]
    accepted = np.logical_and.reduce([solved.accepted for *_, solved in found])
    return Judgement(
        None,
        states,
        covariances,
        best.cost,
        best.redundancy,
        accepted,
        tuple(left_out for _, left_out, _ in found),
    )


def _worst_rows(fit: DistanceFit, state: Array | None) -> list[int]:
    """The rows to leave out in turn: all of a few, else those that fit a state worst."""
    if len(fit) <= _FEW:
        return list(range(len(fit)))
    if state is None:
        return []
    w, _ = test_values(fit, state)
    return [int(row) for row in np.argsort(-np.abs(w))[:_TRIED]]
