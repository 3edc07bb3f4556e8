"""Errors that depend on their neighbours, in the fits of an explanation.

A fit weighs the poses as if they were independent: its values stay right, but not how sure they
are. Here its parameters get the covariance that errors with a memory give them, a mixture over the
memories that the residuals allow.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from validation.explain.fitting.fit import LEAST_P, Fit, covariance_of, known_part
from validation.explain.fitting.noise import DIMENSIONS, Mask, regular
from validation.explain.fitting.pairs import Pairs
from validation.poses.angles import Array
from validation.statistics.dependence import Spread
from validation.statistics.neighbours import (
    FEWEST,
    HALF_STEP,
    WITHHELD,
    Weighed,
    correlation,
    joint_gain,
    no_memory,
    weigh,
)

GOOD = 0.5
"""Weight of a cell from which on it counts: more good than bad."""
NO_ERROR = 1e-9
"""Metres or radians below which what is left are the last digits of equal numbers, which last."""
RARE = 1e-3
"""Weight of a memory below which it is left out: it moves no end of an interval by a percent."""
Kinds = tuple[Weighed, Weighed]
"""Memories of positions and of headings."""


@dataclass(frozen=True)
class Serial:
    """Parameters of a fit whose errors depend on their neighbours.

    Parameters
    ----------
    kinds : tuple of Weighed
        Memories of positions and of headings.
    weights : (m,) array
        Of the pairs of memories.
    covariances : (m, k, k) array
        Of the parameters under each.
    dof : float
        Degrees of freedom of the noise levels.
    """

    kinds: Kinds
    weights: Array
    covariances: Array
    dof: float

    @property
    def covariance(self) -> Array:
        """(k, k) over all memories."""
        return np.asarray(np.einsum("m,mkl->kl", self.weights, self.covariances))

    def spread(self, column: int) -> Spread:
        """Distribution of the error of one parameter."""
        scales = np.sqrt(np.maximum(self.covariances[:, column, column], 1e-300))
        return Spread(self.weights, scales, max(int(self.dof), 1))

    @property
    def withheld(self) -> str:
        """Why no interval can be given; empty if one can."""
        short = max(one.short for one in self.kinds)
        if short <= WITHHELD:
            return ""
        return "errors last so long that these poses are too few correlation lengths"

    def p_value(self, values: Array, columns: Sequence[int]) -> float:
        """Chance of so large values of some parameters, if they were zero."""
        block = regular(self.covariances[:, columns][:, :, columns])
        squares = np.einsum("i,mij,j->m", values, np.linalg.inv(block), values) / len(columns)
        tails = special.fdtrc(len(columns), max(self.dof, 1.0), squares)
        return max(float(self.weights @ tails), LEAST_P)


def joint_of(kinds: Sequence[Weighed]) -> float:
    """Log of the odds that one kind or more has a memory."""
    return joint_gain(kinds)


def memory_of(pairs: Pairs, found: Fit, cells: Mask | None = None) -> Kinds | None:
    """Memories of positions and headings, weighed by the residuals; None with too few poses."""
    good = found.weights[0] > GOOD if cells is None else cells
    if good.sum(0).min() < FEWEST:
        return None
    order = pairs.order
    n, k = len(pairs), len(found.model.fitted)
    slopes = np.broadcast_to(found.corrected.by_parameters, (1, n, 3, k))[0]
    kinds = []
    for kind, part in enumerate((slice(0, 2), slice(2, 3))):
        rows = np.flatnonzero(good[:, kind])
        rows = rows[np.argsort(order[rows], kind="stable")]
        steps = order[rows]
        if (np.diff(steps) <= 0).any():
            return None
        size = np.sqrt(np.diagonal(found.covariances[0], axis1=-2, axis2=-1))[rows, part]
        left = found.residuals[0][rows, part]
        if np.abs(left).max() < NO_ERROR:
            kinds.append(no_memory(steps, left))
            continue
        residuals = left / size
        own = slopes[rows][:, part] / size[..., None]
        kinds.append(weigh(steps, residuals, own))
    return kinds[0], kinds[1]


def serial(
    pairs: Pairs, found: Fit, cells: Mask | None = None, kinds: Kinds | None = None
) -> Serial | None:
    """What a fit's parameters are worth; None with too few poses.

    Notes
    -----
    The parameters are a linear function H of the errors, H = C J^T W, so their covariance is
    H S H^T for errors of covariance S, that of positions and headings each.
    """
    kinds = memory_of(pairs, found, cells) if kinds is None else kinds
    if kinds is None:
        return None
    good = found.weights[0] > GOOD if cells is None else cells
    n, k = len(pairs), len(found.model.fitted)
    slopes = np.broadcast_to(found.corrected.by_parameters, (1, n, 3, k))[0]
    root = good[:, [0, 0, 1]].astype(float)
    precision = root[:, :, None] * np.linalg.inv(regular(found.covariances[0])) * root[:, None, :]
    own = known_part(covariance_of(found.information)[0])
    gains = np.einsum("kl,nil,nij->njk", own, slopes, precision)
    sizes = np.sqrt(np.diagonal(found.covariances[0], axis1=-2, axis2=-1))
    parts = [
        _parts(pairs.order, gains[:, part], sizes[:, part], good[:, kind], kinds[kind])
        for kind, part in enumerate((slice(0, 2), slice(2, 3)))
    ]
    keep = [one.weights > RARE for one in kinds]
    first, second = (one.weights[kept] for one, kept in zip(kinds, keep, strict=True))
    weights = np.outer(first, second).ravel()
    both = parts[0][keep[0]][:, None] + parts[1][keep[1]][None]
    slip = len(found.model.parameters) < k and pairs.reference_pose is not None
    if slip:  # the slip's own row, which no memory touches
        both = both + _slip_row(found, own, k)
    both = both.reshape(len(weights), k, k)
    # Of the poses, not of their numbers: x, y and headings that last alike tell the same thing.
    dof = float((good.sum(0) * DIMENSIONS).sum() - k) / 3
    return Serial(kinds, weights / weights.sum(), both, max(dof, 1.0))


def _parts(order: Array, gains: Array, sizes: Array, good: Mask, one: Weighed) -> Array:
    """(m, k, k) what one kind of errors gives to the parameters' covariance."""
    rows = np.flatnonzero(good)
    rows = rows[np.argsort(order[rows], kind="stable")]
    scaled = gains[rows] * sizes[rows][..., None]
    result = []
    for row, memory in enumerate(one.memories):
        between = correlation(one.steps, memory)
        if one.weights[row] <= RARE:
            result.append(np.zeros((gains.shape[-1],) * 2))
            continue
        total = np.zeros((gains.shape[-1],) * 2)
        for column in range(scaled.shape[1]):
            part = scaled[:, column]
            total += one.variances[row, column] * (part.T @ between.times(part))
        result.append(total * (HALF_STEP**2 if memory.length else 1.0))
    return np.array(result)


def _slip_row(found: Fit, own: Array, k: int) -> Array:
    """(k, k) the survey's error at the reference in the parameters' covariance."""
    cells = found.weights[0]
    slopes = np.broadcast_to(found.corrected.by_parameters, (1, *found.residuals[0].shape, k))[0]
    root = cells[:, [0, 0, 1]]
    precision = root[:, :, None] * np.linalg.inv(regular(found.covariances[0]))
    told = np.einsum("nik,nij,njl->kl", slopes, precision, slopes)
    rest = found.information[0] - told
    return np.asarray(own @ np.where(np.eye(k, dtype=bool), np.maximum(rest, 0.0), 0.0) @ own)


def says_dependent(criteria: Array, kinds: Sequence[Kinds | None]) -> float:
    """Log of the odds that errors have a memory, over all explanations.

    Parameters
    ----------
    criteria : (c,) array
        BIC of each without memory.
    kinds : sequence of pairs of Weighed
        Memories of each.

    Notes
    -----
    A cause along a smooth path looks like errors that last, and the other way round. So each
    explanation is taken with and without memory, and the sums over all are compared.
    """
    with_memory = [
        -value / 2 + joint_of(one) for value, one in zip(criteria, kinds, strict=True) if one
    ]
    without = [-value / 2 for value, one in zip(criteria, kinds, strict=True) if one]
    if not without:
        return -np.inf
    return float(special.logsumexp(with_memory) - special.logsumexp(without))
