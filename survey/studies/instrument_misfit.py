"""Whether an instrument's errors are an offset, a scale and noise at all.

An edge that was changed half-way, a wrong row, or errors that come and go with the length are none
of these, and numbers for campaign.toml from them would spoil every reading.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.special import fdtrc, ndtri, stdtrit

from validation.poses.angles import Array

FALSE_ALARM = 0.01
"""Chance that each test objects to errors that are an offset, a scale and noise. A judgement: in
one check of fifty a person measures once more for nothing."""
MOST_PAIRS = 5000
"""Pairs of rows through which a first line is laid: all of 100 rows; of more, every so many. One of
them fits the good rows wherever more than half are good."""
CAUSE_COST = 2.0
"""Times the log of the rows that a cause must earn: its size and its place (Schwarz)."""


@dataclass(frozen=True)
class Misfit:
    """What does not fit.

    Parameters
    ----------
    bad_rows : tuple of int
        Rows that do not belong to the others.
    step_row : int or None
        The row from which on all readings are longer or shorter; None where there is no such.
    step : float
        By how much, metres.
    step_sigma : float
        Its standard deviation, metres.
    p_lengths : float
        Chance of errors that differ so much from length to length, if they are a line and noise;
        NaN where no length was measured twice.
    """

    bad_rows: tuple[int, ...] = ()
    step_row: int | None = None
    step: float = 0.0
    step_sigma: float = 0.0
    p_lengths: float = np.nan

    @property
    def is_found(self) -> bool:
        """Whether something does not fit."""
        return bool(self.bad_rows) or self.step_row is not None or self.p_lengths < FALSE_ALARM


def find_misfit(length: Array, error: Array, sigma: Array, *, with_scale: bool) -> Misfit:
    """What an offset, a scale and noise do not explain.

    Parameters
    ----------
    length, error : (n,) array
        Known lengths and reading less length, metres, in the order measured.
    sigma : (n,) array
        Standard deviations expected, metres. No error is called bad that these allow.
    with_scale : bool
        Whether the lengths show a scale error.

    Notes
    -----
    The line through two rows that leaves the least median of squares finds the good rows where
    they are the majority (Rousseeuw 1984); a row is bad where a t test against the others, over
    all rows at `FALSE_ALARM`, says so. A step is tested at every row. Whether bad rows or a step
    are the better cause is told by what is left over plus what each cause must earn.
    """
    n, k = len(length), 1 + with_scale
    if n < k + 4:
        return Misfit()
    design = np.stack([np.ones(n), length], axis=-1)[:, :k] / sigma[:, None]
    white = error / sigma
    bad = _bad_rows(design, white)
    row, step, step_sigma, left = _best_step(design, white, sigma)
    good = np.setdiff1d(np.arange(n), bad)
    rest = _left(design[good], white[good])
    scale = max(min(left / (n - k - 1), rest / max(len(good) - k, 1)), 1e-12)
    earned = CAUSE_COST * np.log(n)
    of_bad = rest / scale + earned * len(bad)
    of_step = left / scale + earned
    drop = (_left(design, white) - left) / max(left / (n - k - 1), 1e-12)
    if drop > stdtrit(n - k - 1, FALSE_ALARM / (n - 3) / 2) ** 2 and (not bad or of_step < of_bad):
        return Misfit((), row, step, step_sigma)
    if bad:
        return Misfit(tuple(bad))
    return Misfit(p_lengths=_lack_of_fit(length, design, white))


def _left(design: Array, white: Array) -> float:
    """Sum of squares that a least-squares fit leaves."""
    found = np.linalg.lstsq(design, white, rcond=None)[0]
    rest = white - design @ found
    return float(rest @ rest)


def _bad_rows(design: Array, white: Array) -> list[int]:
    """Rows that do not belong to the others."""
    n, k = design.shape
    line = _robust_line(design, white)
    off = np.abs(white - design @ line)
    spread = 1.4826 * (1 + 5 / (n - k)) * float(np.median(off))
    suspects = np.flatnonzero(off > -ndtri(FALSE_ALARM / (2 * n)) * max(spread, 1.0))
    while len(suspects):
        good = np.setdiff1d(np.arange(n), suspects)
        if len(good) <= k + 1:
            return []
        fitted = np.linalg.lstsq(design[good], white[good], rcond=None)[0]
        rest = white[good] - design[good] @ fitted
        dof = len(good) - k
        variance = max(float(rest @ rest) / dof, 1.0)
        inverse = np.linalg.inv(design[good].T @ design[good])
        arm = 1 + np.einsum("ni,ij,nj->n", design[suspects], inverse, design[suspects])
        ratio = np.abs(white[suspects] - design[suspects] @ fitted) / np.sqrt(variance * arm)
        kept = suspects[ratio > -stdtrit(dof, FALSE_ALARM / (2 * n))]
        if len(kept) == len(suspects):
            break
        suspects = kept
    return [int(row) for row in suspects]


def _robust_line(design: Array, white: Array) -> Array:
    """The line through as many rows as it has unknowns that leaves the least median of squares."""
    n, k = design.shape
    chosen = np.array(list(combinations(range(n), k)))
    chosen = chosen[:: -(-len(chosen) // MOST_PAIRS)]
    corner = design[chosen]
    if k == 2:
        chosen = chosen[np.abs(np.linalg.det(corner)) > 1e-9]
    lines = np.linalg.solve(design[chosen], white[chosen][..., None])[..., 0]
    off = np.median(np.abs(white - lines @ design.T), axis=1)
    return np.asarray(lines[int(off.argmin())])


def _best_step(design: Array, white: Array, sigma: Array) -> tuple[int, float, float, float]:
    """The row at which a step explains most, its size, its sigma, and what is left over.

    At least two rows are on either side: one alone is a bad row.
    """
    n, k = design.shape
    best = (2, 0.0, 0.0, np.inf)
    for row in range(2, n - 1):
        column = np.where(np.arange(n) >= row, 1.0, 0.0) / sigma
        more = np.column_stack([design, column])
        found, _, rank, _ = np.linalg.lstsq(more, white, rcond=None)
        if rank <= k:
            continue
        rest = white - more @ found
        left = float(rest @ rest)
        if left < best[3]:
            variance = left / (n - k - 1) * np.linalg.inv(more.T @ more)[k, k]
            best = (row, float(found[k]), float(np.sqrt(variance)), left)
    return best


def _lack_of_fit(length: Array, design: Array, white: Array) -> float:
    """F test of the errors between lengths against those of one and the same length."""
    places, group = np.unique(length, return_inverse=True)
    n, k, m = len(length), design.shape[1], len(places)
    if m <= k or n - m < 3:
        return np.nan
    means = np.bincount(group, white) / np.bincount(group)
    within = max(float(((white - means[group]) ** 2).sum()) / (n - m), 0.1)
    between = max(_left(design, white) - within * (n - m), 0.0) / (m - k)
    return float(fdtrc(m - k, n - m, between / within))
