"""Noise of each source alone, from the differences between three or more of them.

The three-cornered hat: var(a - b) = var(a) + var(b) for independent sources, so three pairs give
three variances. Gray and Allan (1974), "A method for estimating the frequency stability of an
individual oscillator".
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy import special

from validation.angles import Array, wrap

_MINIMUM = 3
"""Common poses that a pair must have to count."""

_LEAST = 0.1

DIMENSIONS = np.array([2.0, 1.0])
"""Numbers in a cell: position, heading."""

_MEDIANS = np.array([2 * np.log(2), 0.4549364231195724])
"""Medians of chi-squared with 2 and 1 degrees of freedom."""


@dataclass(frozen=True)
class SourceVariances:
    """Variances of S sources, of their positions (each coordinate) and of their headings.

    Parameters
    ----------
    names : tuple of str
        The sources.
    variances : (S, 2) array
        m^2 and rad^2; may come out below zero where a source is far better than the others; NaN
        where the pairs do not determine it.
    sigmas : (S, 2) array
        Standard deviations of the variances.
    dof : (S, 2) array
        Degrees of freedom that each variance is worth.
    bounded : (S, 2) array
        The variances that fit best if none is below a tenth of the least difference it is part
        of: what to weigh the sources by.
    """

    names: tuple[str, ...]
    variances: Array
    sigmas: Array
    dof: Array
    bounded: Array

    @property
    def determined(self) -> bool:
        """Whether all variances are."""
        return bool(np.isfinite(self.variances).all())

    def intervals(self, confidence: float = 0.95) -> Array:
        """(S, 2, 2) low and high end of each standard deviation.

        Notes
        -----
        The variance is taken as chi-squared with as many degrees of freedom as give its standard
        deviation (Satterthwaite); where it is not clear of zero, the interval starts at zero.
        """
        tail = (1 - confidence) / 2
        dof = np.maximum(self.dof, 1e-3)
        low = dof * self.variances / special.chdtri(dof, tail)
        high = dof * self.variances / special.chdtri(dof, 1 - tail)
        clear = self.variances > 2 * self.sigmas
        reach = np.maximum(self.variances, 0) - special.ndtri(tail) * self.sigmas
        low, high = np.where(clear, low, 0.0), np.where(clear, high, reach)
        unknown = ~np.isfinite(self.variances)
        low, high = np.where(unknown, np.nan, low), np.where(unknown, np.nan, high)
        return np.sqrt(np.maximum(np.stack([low, high], -1), 0.0))


def source_variances(
    names: Sequence[str],
    poses: Array,
    good: Array,
    *,
    lost_freedom: Array | None = None,
    apart: Sequence[tuple[str, ...]] = (),
    robust: bool = False,
) -> SourceVariances:
    """Variances of each source from all pairs of them.

    Parameters
    ----------
    names : sequence of str
        The S sources.
    poses : (S, n, 3) array
        Poses of each at the same stops, systematic parts taken out; NaN where missing.
    good : (S, n, 2) array of bool
        Positions and headings to use.
    lost_freedom : (S, 2) array, optional
        Degrees of freedom that fitting each source to the others took.
    apart : sequence of tuple of str
        Groups of sources whose errors may be common (one sensor); pairs within one are not used.
    robust : bool
        From medians instead of mean squares: rougher, but gross errors hardly matter.
    """
    lost = np.zeros((len(names), 2)) if lost_freedom is None else lost_freedom
    together = {frozenset(pair) for group in apart for pair in combinations(group, 2)}
    pairs = [
        pair
        for pair in combinations(range(len(names)), 2)
        if frozenset(names[s] for s in pair) not in together
    ]
    found = [_one_kind(kind, pairs, poses, good, lost, robust) for kind in range(2)]
    columns = [np.stack(part, -1) for part in zip(*found, strict=True)]
    return SourceVariances(tuple(names), *columns)


def _one_kind(
    kind: int,
    pairs: Sequence[tuple[int, int]],
    poses: Array,
    good: Array,
    lost: Array,
    robust: bool,
) -> tuple[Array, Array, Array, Array]:
    """Variances, standard deviations, degrees of freedom and bounded variances of one kind."""
    count = len(poses)
    nothing = np.full(count, np.nan)
    kept, values, freedom, masks = [], [], [], []
    for a, b in pairs:
        difference = poses[a] - poses[b]
        difference[:, 2] = wrap(difference[:, 2])
        mask = good[a, :, kind] & good[b, :, kind] & np.isfinite(difference).all(1)
        dof = mask.sum() * DIMENSIONS[kind] - lost[a, kind] - lost[b, kind]
        if mask.sum() < _MINIMUM or dof < 1:
            continue
        part = difference[mask, 2:] if kind else difference[mask, :2]
        squares = (part**2).sum(1)
        if robust:
            value = float(np.median(squares)) / _MEDIANS[kind]
            dof = 0.4 * dof  # efficiency of the median about that of 40 % of the data
        else:
            value = float(squares.sum()) / dof
        kept.append((a, b))
        values.append(max(value, 1e-18))
        freedom.append(dof)
        masks.append(mask)
    if not kept:
        return nothing, nothing, np.zeros(count), nothing
    design = np.zeros((len(kept), count))
    for row, (a, b) in enumerate(kept):
        design[row, a] = design[row, b] = 1.0
    return _least_squares(design, np.array(values), np.array(freedom), kept, masks)


def _least_squares(
    design: Array,
    values: Array,
    freedom: Array,
    pairs: Sequence[tuple[int, int]],
    masks: Sequence[Array],
) -> tuple[Array, Array, Array, Array]:
    """Generalised least squares, weighted by what the variances themselves say."""
    undetermined = (np.abs(_null_space(design)) > 1e-9).any(0)
    covariance = np.diag(2 * values**2 / freedom)
    solution = np.zeros(design.shape[1])
    least = np.array([values[row > 0].min(initial=np.inf) for row in design.T]) * _LEAST
    least = np.where(np.isfinite(least), least, 0.0)
    for _ in range(4):
        inverse = np.linalg.pinv(covariance, hermitian=True)
        normal = design.T @ inverse @ design
        spread = np.linalg.pinv(normal, hermitian=True)
        solution = spread @ design.T @ inverse @ values
        positive = _bounded(design, values, inverse, least)
        covariance = _pair_covariance(positive, freedom, pairs, masks)
    sigma = np.sqrt(np.maximum(np.diagonal(spread), 0.0))
    solution = np.where(undetermined, np.nan, solution)
    sigma = np.where(undetermined, np.nan, sigma)
    with np.errstate(divide="ignore", invalid="ignore"):
        dof = np.where(sigma > 0, 2 * solution**2 / sigma**2, 0.0)
    return solution, sigma, np.nan_to_num(dof), np.where(undetermined, np.nan, positive)


def _bounded(design: Array, values: Array, weight: Array, least: Array) -> Array:
    """Least squares with a lower bound on each variance, by fixing the worst offender in turn."""
    fixed = np.zeros(len(least), dtype=bool)
    solution = least.copy()
    for _ in range(len(least)):
        free = ~fixed
        part = design[:, free]
        rest = values - design[:, fixed] @ least[fixed]
        normal = np.linalg.pinv(part.T @ weight @ part, hermitian=True)
        solution = np.where(fixed, least, 0.0)
        solution[free] = normal @ part.T @ weight @ rest
        short = np.where(free, least - solution, -np.inf)
        if short.max() <= 0:
            break
        fixed[int(np.argmax(short))] = True
    return np.maximum(solution, least)


def _null_space(design: Array) -> Array:
    """Combinations of variances that the pairs do not show, one a row."""
    values, vectors = np.linalg.eigh(design.T @ design)
    return vectors[:, values < 1e-9].T


def _pair_covariance(
    variances: Array,
    freedom: Array,
    pairs: Sequence[tuple[int, int]],
    masks: Sequence[Array],
) -> Array:
    """Covariance of the pair variances of normal errors: they share sources and stops."""
    m = len(pairs)
    result = np.zeros((m, m))
    for i, (a, b) in enumerate(pairs):
        for j, (c, d) in enumerate(pairs):
            common = (a == c) * variances[a] + (b == d) * variances[b]
            common -= (a == d) * variances[a] + (b == c) * variances[b]
            overlap = (masks[i] & masks[j]).sum() / np.sqrt(masks[i].sum() * masks[j].sum())
            result[i, j] = 2 * common**2 * overlap / np.sqrt(freedom[i] * freedom[j])
    return result + np.eye(m) * 1e-12 * np.trace(result)
