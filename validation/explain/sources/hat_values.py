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

from validation.explain.fitting.noise import DIMENSIONS, MEDIANS, Mask
from validation.poses.angles import Array, wrap

_MINIMUM = 3
"""Common poses that a pair must have to count: with two, one of which may be wrong, a mean square
says nothing."""

_LEAST = 0.1
"""Least part that a source has in the variance of its best difference, where that is bounded. A
judgement: a source taken for ten times better is believed nearly alone, and so few stops never
show more."""

_EFFICIENCY = 0.4
"""Degrees of freedom of a median of squares, as a part of those of their mean: 0.48 for two
numbers a square and 0.37 for one, from the density of chi-squared at its median."""


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
    bounded : (S, 2) array
        The variances that fit best if none is below a tenth of the least difference it is part
        of: what to weigh the sources by.
    quadratics : (S, 2, 3) array
        Variance of each estimate as a quadratic in its own true value: constant, linear and
        square coefficient.
    skewness : (S, 2) array
        Of each estimate's distribution.
    ceilings : (S, 2, 2) array
        The smallest mean square of a difference that each source takes part in, and its degrees
        of freedom: no source can be noisier than its difference from another.
    """

    names: tuple[str, ...]
    variances: Array
    sigmas: Array
    bounded: Array
    quadratics: Array
    skewness: Array
    ceilings: Array

    @property
    def determined(self) -> bool:
        """Whether all variances are."""
        return bool(np.isfinite(self.variances).all())

    def intervals(self, confidence: float = 0.95) -> Array:
        """(S, 2, 2) low and high end of each standard deviation; 0 and a ceiling if undetermined.

        Notes
        -----
        All variances that lie within the normal quantile of the estimate, each with the standard
        deviation that the estimate would have if it were the true one (a score interval, as
        Wilson's for proportions), and that are not above what any difference allows
        (chi-squared limit). The noise of the others is an estimate too, hence Student's quantile
        with the freedom of the tightest difference. The quantiles are corrected for the skewness
        of the estimate (Cornish and Fisher (1937), "Moments and cumulants in the specification
        of distributions", to first order).
        """
        most, dof = self.ceilings[..., 0], np.maximum(np.nan_to_num(self.ceilings[..., 1]), 1.0)
        z = special.stdtrit(dof, (1 + confidence) / 2)
        shift = np.nan_to_num(self.skewness) * (z * z - 1) / 6
        low = self._end(np.square(z + shift), -1.0)
        high = self._end(np.square(np.maximum(z - shift, 0.0)), 1.0)
        high = np.where(np.isnan(self.variances), np.nan, high)
        ceiling = most * dof / special.chdtri(dof, (1 + confidence) / 2)
        # An estimate far below zero says that the noise is not as independent as assumed.
        high = np.where(high > 0, high, np.inf)
        high = np.fmin(high, ceiling)
        # Beyond the ceiling the estimate is of no use for the lower end either.
        low = np.where((low > high) | (np.isnan(low) & ~np.isnan(high)), 0.0, low)
        return np.asarray(np.sqrt(np.stack([low, high], -1)))

    def _end(self, z2: Array, side: float) -> Array:
        """(S, 2) variance whose estimate would lie z standard deviations away from this one."""
        constant, linear, square = (self.quadratics[..., power] for power in range(3))
        a = 1 - z2 * square
        b = self.variances + z2 * linear / 2
        c = self.variances**2 - z2 * constant
        reach = np.sqrt(np.maximum(b * b - a * c, 0.0))
        end = (b + side * reach) / np.where(np.abs(a) > 1e-12, a, 1e-12)
        return np.where((a > 0) | (side < 0), np.maximum(end, 0.0), np.inf)


def source_variances(
    names: Sequence[str],
    poses: Array,
    good: Mask,
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
    columns = [np.stack(part, 1) for part in zip(*found, strict=True)]
    return SourceVariances(tuple(names), *columns)


def _one_kind(
    kind: int,
    pairs: Sequence[tuple[int, int]],
    poses: Array,
    good: Mask,
    lost: Array,
    robust: bool,
) -> tuple[Array, ...]:
    """What `SourceVariances` holds of one kind of cell."""
    size = len(poses)
    nothing = np.full(size, np.nan)
    kept, values, freedom, masks = [], [], [], []
    for a, b in pairs:
        difference = poses[a] - poses[b]
        difference[:, 2] = wrap(difference[:, 2])
        mask = good[a, :, kind] & good[b, :, kind] & np.isfinite(difference).all(1)
        if mask.sum() < _MINIMUM:
            continue
        count = float(mask.sum() * DIMENSIONS[kind])
        shares = _shares(count, float(lost[a, kind]), float(lost[b, kind]))
        dof = count * min(shares)
        if dof < 1:
            continue
        part = difference[mask, 2:] if kind else difference[mask, :2]
        squares = (part**2).sum(1)
        if robust:
            value = float(np.median(squares)) / MEDIANS[kind]
            dof = _EFFICIENCY * dof
        else:
            value = float(squares.sum()) / count
        kept.append((a, b, *shares))
        values.append(max(value, 1e-18))
        freedom.append(dof)
        masks.append(mask)
    if not kept:
        return (
            nothing,
            nothing,
            nothing,
            np.full((size, 3), np.nan),
            nothing,
            np.full((size, 2), np.nan),
        )
    design = np.zeros((len(kept), size))
    for row, (a, b, share_a, share_b) in enumerate(kept):
        design[row, a], design[row, b] = share_a, share_b
    solved = _least_squares(design, np.array(values), np.array(freedom), masks)
    return *solved, _ceilings(design, np.array(values), np.array(freedom))


def _ceilings(design: Array, values: Array, freedom: Array) -> Array:
    """(S, 2) the tightest upper limit's mean square and degrees of freedom."""
    upper = values * freedom / special.chdtri(freedom, 0.975)
    rows = []
    for part in design.T:
        mine = np.flatnonzero(part > 0)
        if not mine.size:
            rows.append([np.nan, np.nan])
            continue
        best = mine[int(np.argmin(upper[mine] / part[mine]))]
        rows.append([values[best] / part[best], freedom[best]])
    return np.array(rows)


def _shares(count: float, lost_a: float, lost_b: float) -> tuple[float, float]:
    """Which part of each source's variance is left in the mean square of a difference.

    A source that was fitted has its own noise reduced. The one that all others were fitted to
    (nothing lost) is reduced as much as the other of the pair, whose residuals these are.
    """
    own_a, own_b = lost_a or lost_b, lost_b or lost_a
    return max(1 - own_a / count, 0.0), max(1 - own_b / count, 0.0)


def _least_squares(
    design: Array,
    values: Array,
    freedom: Array,
    masks: Sequence[Mask],
) -> tuple[Array, ...]:
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
        positive = _bounded(design, values, np.asarray(inverse), least)
        covariance = _pair_covariance(design, positive, freedom, masks)
    sigma = np.sqrt(np.maximum(np.diagonal(spread), 0.0))
    solution = np.where(undetermined, np.nan, solution)
    sigma = np.where(undetermined, np.nan, sigma)
    weights = spread @ design.T @ inverse
    return (
        solution,
        sigma,
        np.where(undetermined, np.nan, positive),
        _quadratics(design, positive, weights, freedom, masks),
        _skewness(design, positive, weights, freedom, masks),
    )


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


def _signs(design: Array) -> Array:
    """(m, S) which source stands with which sign in each difference."""
    signs = (design > 0).astype(float)
    for row in signs:
        row[np.flatnonzero(row)[1]] = -1.0
    return signs


def _shared_stops(freedom: Array, masks: Sequence[Mask]) -> Array:
    """(m, m) twice the part of their stops that two pairs share, for their freedom."""
    used = np.array(masks, dtype=float)
    count = used.sum(1)
    overlap = used @ used.T / np.sqrt(count[:, None] * count)
    return np.asarray(2 * overlap / np.sqrt(freedom[:, None] * freedom))


def _pair_covariance(
    design: Array, variances: Array, freedom: Array, masks: Sequence[Mask]
) -> Array:
    """(m, m) covariance of the pair variances of normal errors: they share sources and stops."""
    signs = _signs(design)
    result = _shared_stops(freedom, masks) * ((signs * variances) @ signs.T) ** 2
    return np.asarray(result + np.eye(len(design)) * 1e-12 * np.trace(result))


def _quadratics(
    design: Array, variances: Array, weights: Array, freedom: Array, masks: Sequence[Mask]
) -> Array:
    """(S, 3) variance of each estimate as a quadratic in its own true variance."""
    signs, shared = _signs(design), _shared_stops(freedom, masks)
    rows = []
    for source, weight in enumerate(weights):
        others = np.where(np.arange(len(variances)) == source, 0.0, variances)
        base = (signs * others) @ signs.T
        own = np.outer(signs[:, source], signs[:, source])
        parts = (base**2, 2 * base * own, own**2)
        rows.append([float(weight @ (shared * part) @ weight) for part in parts])
    return np.array(rows)


def _skewness(
    design: Array, variances: Array, weights: Array, freedom: Array, masks: Sequence[Mask]
) -> Array:
    """(S,) skewness of each estimate: a quadratic form of normal errors, stop by stop.

    The cumulants of e^T B e with errors of covariance D are 2 tr (B D)^2 and 8 tr (B D)^3.
    """
    signs, used = _signs(design), np.array(masks, dtype=float)
    products = np.einsum("ma,mb->mab", signs, signs) * variances
    parts = used / used.sum(1, keepdims=True)
    forms = np.einsum("sm,mj,mab->sjab", weights, parts, products)
    second = np.einsum("sjab,sjba->s", forms, forms)
    third = np.einsum("sjab,sjbc,sjca->s", forms, forms, forms)
    # Per number in a cell and counting the freedom that is lost: fewer numbers, more skewness.
    numbers = float(np.mean(freedom / used.sum(1)))
    spread = np.sqrt(np.maximum(2 * second, 0.0) * numbers) ** 3
    return np.where(spread > 0, 8 * third * numbers / np.where(spread > 0, spread, 1.0), 0.0)
