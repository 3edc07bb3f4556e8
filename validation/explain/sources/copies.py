"""Whether tables are copies of one another, or derived from one another, without saying so."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from validation.explain.fitting.noise import MEDIANS
from validation.explain.fitting.pairs import Pairs
from validation.poses.angles import Array, wrap

ALIKE = 0.2
"""Differences of positions and of headings that are both below this part of those to any other
source are implausibly small. A judgement: two independent sources that differ so little are both
seven times better than every other one."""
EXACT = 0.02
"""The same where positions or headings alone are as alike."""
PLAUSIBLE = 0.4
"""Differences above this part of what both sources state are no sign of a copy, however much better
both are than the rest. A judgement: stated deviations are seldom too large by 2.5, in positions and
in headings at once; in one of them they may be, by up to ten (`BARELY`)."""
BARELY = 0.1
FEWEST = 6
"""Stops in common from which on tables are compared after a frame and a mount are taken out, which
take six of their eighteen numbers."""


@dataclass(frozen=True)
class Copies:
    """Sources that are copies of one another.

    Parameters
    ----------
    names : tuple of str
        Two or more.
    apart : float
        Typical distance between them, in metres, a frame and a mount taken out.
    others : float
        The least typical distance of one of them from any other source.
    """

    names: tuple[str, ...]
    apart: float
    others: float


def find_copies(
    names: Sequence[str],
    poses: Array,
    independent: Sequence[Sequence[str]] = (),
    pairs: Sequence[Pairs] = (),
) -> tuple[Copies, ...]:
    """Groups of sources whose differences are implausibly small.

    Parameters
    ----------
    names : sequence of str
        The S sources.
    poses : (S, n, 3) array
        Of each at the same stops; NaN where missing.
    independent : sequence of sequence of str
        Sources of which somebody has stated that they are independent.
    pairs : sequence of Pairs, optional
        Of the first source with those that follow, for what two should differ by as they state.
    """
    size = len(names)
    if size < 3:
        return ()
    apart = np.full((size, size, 2), np.inf)
    for a, b in combinations(range(size), 2):
        apart[a, b] = apart[b, a] = _apart(poses[a], poses[b])
    apart_by = [set(group) for group in independent]
    typical = _stated_differences(pairs, size) * np.sqrt(MEDIANS)
    plausible = (apart > PLAUSIBLE * typical).any(-1) & (apart > BARELY * typical).all(-1)
    joined: list[set[int]] = []
    for a, b in combinations(range(size), 2):
        if any({names[a], names[b]} <= group for group in apart_by) or plausible[a, b]:
            continue
        if _are_copies(apart, a, b):
            group = {a, b}
            for other in [one for one in joined if one & group]:
                group |= other
                joined.remove(other)
            joined.append(group)
    return tuple(_told(group, names, apart) for group in joined)


def _stated_differences(pairs: Sequence[Pairs], size: int) -> Array:
    """(S, S, 2) what the validation and systems should differ by; NaN where that is not stated.

    The validation is the first source, the systems follow in the order of their pairs.
    """
    result = np.full((size, size, 2), np.nan)
    own = np.full((len(pairs), 2), np.nan)
    for row, one in enumerate(pairs):
        if one.stated and len(one):
            both = _variances(one.validation_covariances + one.gt_covariances)
            result[0, row + 1] = result[row + 1, 0] = np.sqrt(both)
            own[row] = _variances(one.gt_covariances)
    systems = slice(1, len(pairs) + 1)
    result[systems, systems] = np.sqrt(own[:, None] + own)
    return result


def _variances(covariances: Array) -> Array:
    """(2,) median variance of a coordinate and of a heading."""
    diagonal = np.median(np.diagonal(covariances, axis1=-2, axis2=-1), axis=0)
    return np.array([diagonal[:2].mean(), diagonal[2]])


def _are_copies(apart: Array, a: int, b: int) -> bool:
    """Whether two sources are far closer to each other than to the rest."""
    own = apart[a, b]
    if not np.isfinite(own).all():
        return False
    away = np.minimum(apart[a], apart[b])
    others = [k for k in range(len(apart)) if k not in {a, b} and (away[k] > 2 * own).any()]
    others = [k for k in others if np.isfinite(away[k]).all()]
    if not others:
        return False
    ratio = own / np.maximum(away[others].min(0), 1e-12)
    return bool((ratio < ALIKE).all() or (ratio < EXACT).any())


def _told(group: set[int], names: Sequence[str], apart: Array) -> Copies:
    inside = sorted(group)
    outside = [k for k in range(len(names)) if k not in group]
    between = [apart[a, b, 0] for a, b in combinations(inside, 2)]
    others = apart[np.ix_(inside, outside)][..., 0].min() if outside else np.inf
    return Copies(tuple(names[k] for k in inside), float(max(between)), float(others))


def _apart(a: Array, b: Array) -> Array:
    """(2,) typical difference of positions and headings, a frame and a mount taken out."""
    both = np.isfinite(a).all(1) & np.isfinite(b).all(1)
    if both.sum() < FEWEST:
        return np.full(2, np.inf)
    a, b = a[both], b[both]
    difference = a - b
    turns = wrap(difference[:, 2])
    middle = float(np.angle(np.median(np.cos(turns)) + 1j * np.median(np.sin(turns))))
    turns = wrap(turns - middle)
    heading, n = a[:, 2], len(a)
    x, y = (a[:, :2] - a[:, :2].mean(0)).T
    zero, one = np.zeros(n), np.ones(n)
    rows_x = [one, zero, -y, np.cos(heading), -np.sin(heading)]
    rows_y = [zero, one, x, np.sin(heading), np.cos(heading)]
    design = np.concatenate([np.column_stack(rows_x), np.column_stack(rows_y)])
    target, weights = difference[:, :2].T.ravel(), np.ones(2 * n)
    for _ in range(6):
        root = np.sqrt(weights)
        found = np.linalg.lstsq(design * root[:, None], target * root, rcond=1e-8)[0]
        left = (target - design @ found).reshape(2, n)
        lengths = np.hypot(*left)
        typical = max(float(np.median(lengths)), 1e-12)
        weights = np.tile(1 / (1 + (lengths / (2 * typical)) ** 2), 2)
    angle = float(np.median(np.abs(turns - np.median(turns))))
    return np.array([typical, max(angle, 1e-12)])
