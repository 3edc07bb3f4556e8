"""Which causes are there: every set of them weighed against every other."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from scipy import special

from validation.poses.angles import Array
from validation.statistics.hypotheses import LOST, RIVAL, TAKES_PART
from validation.trajectories.causes.chain import CAUSES, PARAMETERS, columns
from validation.trajectories.causes.fit import LOOSE, Fit, Weights, fit, single_pose_sizes
from validation.trajectories.causes.matching import Matched

FALSE_ALARM = 0.05
"""Chance that any cause is claimed where there is none."""
CHANCE = 100.0
"""The same where the drive does not show both sets together. The squares of a frame and of a delay
on a straight line, 1,000 to 3,000 poses, a reference of 50 Hz and 1 mm, differed by 11 to 51 by
chance; those of causes that are none differ by thousands."""
FEWEST_FREE = 3.0
"""Degrees of freedom at least: with fewer, Student's t has no variance."""
REFITTED = 8
"""Sets that are fitted again without a straight line put for the chain. The order of the sets by
the line is right wherever two are close: what they differ by is then near the noise."""
CLOSE = 40.0
"""Of the criterion: sets that are worse by more than this by the line are not fitted again."""

Set = tuple[str, ...]


@dataclass(frozen=True)
class Candidate:
    """One set of causes.

    Parameters
    ----------
    causes : tuple of str
        In the order of `CAUSES`.
    fit : Fit
        To all poses.
    criterion : float
        Squares and a price for each cause: what it would gain by chance.
    """

    causes: Set
    fit: Fit
    criterion: float


@dataclass(frozen=True)
class Choice:
    """The causes chosen, and those that would do as well.

    Parameters
    ----------
    candidates : tuple of Candidate
        Those fitted, the best first; of each, the drive determines all parameters.
    chosen : Candidate
        The best.
    rivals : tuple of tuple of str
        Other sets that fit as well, the simplest of them.
    alike : tuple of (str, str)
        Pairs of causes that no size would tell apart on this drive.
    unseen : tuple of str
        Causes that would not show on this drive.
    freedom : float
        Degrees of freedom that effective poses leave.
    """

    candidates: tuple[Candidate, ...]
    chosen: Candidate
    rivals: tuple[Set, ...]
    alike: tuple[Set, ...]
    unseen: Set
    freedom: float


def all_sets() -> list[Set]:
    """Every set of causes; a wrong heading of the mount alone is never beside a wrong mount."""
    names = [name for name in CAUSES if name != "turn"]
    found = []
    for used in product((False, True), repeat=len(names)):
        one = tuple(name for name, on in zip(names, used, strict=True) if on)
        found.append(one)
        if "mount" in one:
            found.append(tuple("turn" if name == "mount" else name for name in one))
    return sorted(found, key=lambda one: (len(one), one))


def freedom(weights: Weights) -> float:
    """Degrees of freedom by which the noise is known: those of the kind of cells that has fewer."""
    places, headings = 2 * float(weights.effective[0]), float(weights.effective[1])
    return max(min(places, headings) - 1, FEWEST_FREE)


def prices(dof: float, false_alarm: float) -> dict[str, float]:
    """What each cause must gain in squares so as to be claimed: more than chance gives it."""
    level = false_alarm / len(CAUSES)
    return {
        cause: len(names) * float(special.fdtri(len(names), dof, 1 - level))
        for cause, names in CAUSES.items()
    }


def choose(
    matched: Matched, everything: Fit, weights: Weights, false_alarm: float = FALSE_ALARM
) -> Choice:
    """The causes of a source's errors.

    A set is better than another if its squares with the price of its causes are less: so a cause
    is chosen only if it gains more than chance would in the share ``false_alarm`` of clean drives,
    divided among the causes.

    Parameters
    ----------
    matched : Matched
        The poses.
    everything : Fit
        All causes at once; the line around it sorts the sets.
    weights : Weights
        Of the cells, the same for all sets.
    false_alarm : float
        Chance that any cause is claimed where there is none.
    """
    dof = freedom(weights)
    price = prices(dof, false_alarm)
    unit = single_pose_sizes(matched, everything.parameters, weights)
    rough = []
    for causes in all_sets():
        if lost_parameters(everything.products, unit, columns(causes)):
            continue
        squares, begin = _by_line(everything, columns(causes))
        rough.append((squares + sum(price[one] for one in causes), causes, begin))
    rough.sort(key=lambda one: one[0])
    made = []
    for rank, (value, causes, begin) in enumerate(rough):
        best = rank < REFITTED and value - rough[0][0] < CLOSE
        if best or len(causes) < 2:
            found = fit(matched, weights, columns(causes), begin)
            if len(causes) < 2:
                plain = fit(matched, weights, columns(causes), np.zeros(len(PARAMETERS)))
                found = min(found, plain, key=lambda one: one.squares)
            cost = found.squares + sum(price[one] for one in causes)
            if not lost_parameters(found.products, unit, found.columns):
                made.append(Candidate(causes, found, cost))
    made.sort(key=lambda one: one.criterion)
    alike, unseen = _not_told(made[0].fit.products, unit)
    return Choice(tuple(made), made[0], _rivals(made, unit), alike, unseen, dof)


def _by_line(everything: Fit, free: tuple[int, ...]) -> tuple[float, Array]:
    """Squares and parameters of a set, by the line around the fit of all causes."""
    at = everything.parameters
    out = [column for column in range(len(at)) if column not in free]
    step = np.zeros(len(at))
    step[out] = -at[out]
    kept = list(free)
    if kept:
        pull = everything.gradient + everything.information @ step
        known = everything.information[np.ix_(kept, kept)] + np.diag(1 / LOOSE[kept] ** 2)
        step[kept] = -np.linalg.solve(known, pull[kept])
    squares = everything.squares + 2 * everything.gradient @ step
    return float(squares + step @ everything.information @ step), at + step


def lost_parameters(products: Array, unit: Array, free: tuple[int, ...]) -> tuple[str, ...]:
    """Parameters in combinations that the drive does not show, where these are free.

    Notes
    -----
    Eigenvectors of the information in units of what changes a single pose by its noise, as for
    stops; of the motion that reference and source both see, so that noise is no motion.
    """
    if not free:
        return ()
    at = np.ix_(free, free)
    values, vectors = np.linalg.eigh(products[at] * np.outer(unit, unit)[at])
    lost = (np.abs(vectors[:, values < 1 / LOST**2]) > TAKES_PART).any(1)
    return tuple(PARAMETERS[column] for column, one in zip(free, lost, strict=True) if one)


def _not_told(products: Array, unit: Array) -> tuple[tuple[Set, ...], Set]:
    """Pairs of causes that this drive does not tell apart, and causes that it does not show."""
    names = [name for name in CAUSES if name != "turn"]
    unseen = tuple(one for one in names if lost_parameters(products, unit, columns([one])))
    seen = [name for name in names if name not in unseen]
    alike = tuple(
        pair for pair in combinations(seen, 2) if lost_parameters(products, unit, columns(pair))
    )
    return alike, unseen


def _rivals(made: Sequence[Candidate], unit: Array) -> tuple[Set, ...]:
    """The simplest sets that fit as well as the first one and do not contain it.

    Two fits with different delays meet different noise of the reference, so that their squares
    differ by chance even where both move every pose alike. Where the drive does not show the two
    sets together, such a difference does not tell them apart.
    """
    chosen = made[0]
    sets = []
    for one in made[1:]:
        if _within(chosen.causes, one.causes) or _within(one.causes, chosen.causes):
            continue
        together = columns((*chosen.causes, *one.causes))
        alike = lost_parameters(chosen.fit.products, unit, together)
        if one.fit.squares - chosen.fit.squares < (CHANCE if alike else RIVAL):
            sets.append(one.causes)
    few = [one for one in sets if len(one) <= len(chosen.causes) + 1]
    return tuple(
        one for one in few if not any(other != one and _within(other, one) for other in few)
    )


def _within(small: Iterable[str], large: Iterable[str]) -> bool:
    """Whether one set of causes can do all that another can."""
    return set(columns(small)) <= set(columns(large))
