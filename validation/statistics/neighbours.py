"""Errors that depend on their neighbours: how long they last, and what that makes of an estimate.

Noise of a table is taken as a part that lasts, with correlation ``exp(-lag / length)``, and a part
that is new in each pose. Lengths and shares are weighed against each other and against errors
without memory by their restricted likelihood, and what is told of an estimate is the mixture.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import special
from scipy.linalg import cho_solve_banded, cholesky_banded

from validation.poses.angles import Array
from validation.statistics.dependence import Spread

Rows = npt.NDArray[np.bool_]

RECORD_LENGTHS = (0.7, 1.2, 2.0, 3.5, 6.0, 10.0, 18.0, 32.0, 60.0, 120.0)
"""Lengths of the record, in correlation lengths, that are weighed; from errors that only seem
constant (0.7) to those that last two poses of 240. Steps of 1.7, as in
`validation.statistics.dependence`."""
SHORTEST = 0.5
"""Correlation length, in steps, below which errors have no memory: neighbours share 0.14."""
WHITE_SHARES = (0.0, 0.025, 0.1, 0.35)
"""White part of the variance beside the part that lasts, that of the survey first of all. With 0
and 0.3 only, a survey of a fifth of the errors makes lasting ones look quick: of 60 poses with a
correlation of 0.95 an interval of three missed the truth in 20 % of the tables, so in 4 %."""
WITHOUT = 0.5
"""Weight of errors without memory before any is seen."""
FEWEST = 8
"""Poses from which on neighbours are tested: with fewer, errors of 0.8 are found in less than half
of the tables."""
BY_CHANCE = 0.05
"""Share of the tables of independent errors, at most, of which neighbours are said to depend on
each other: one in twenty, the level of all intervals. `EVIDENCE` holds it."""
RATE = f"Of tables of independent errors, {100 * BY_CHANCE:.0f} % at most are told so"
EVIDENCE, FOR_FEW = -0.1, 9.0
"""Logarithm of the odds (with over without memory, the priors apart) from which on neighbours are
said to depend on each other: the first, and the second over the number of poses. 1,000 tables each:
so in 5 % of the tables of 8, 12 and 20 independent poses, in 3 % of 30 and in 2 % of 60; in 93 % of
20 poses with a correlation of 0.5, in all of 20 with 0.8."""
SHORT = 3.6
"""Correlation lengths below which a record is too short to tell a constant from what lasts."""
WITHHELD = 0.58
"""Weight of such a record from which on an interval is withheld. 600 tables each, beside a survey
of a fifth of typical errors: so in 16 % of the tables of 20 poses with a correlation of 0.5, in
69 % with 0.8 and 83 % with 0.95, and in less than 1 % of independent ones; an interval of one of
three means that misses the truth is printed in 11, 4 and 10 % of them, of independent ones in
15 %."""
HALF_STEP = 1.15
"""Times that an interval under a memory is wider: the true length lies up to half a step of 1.7
from one that is weighed, which changes the standard deviation of a mean by the root of 1.7 ** 0.5.
Of 300 poses with 0.8 and some white noise, an interval then misses in 2 % (else 5 %)."""


class Memory(NamedTuple):
    """How errors last: ``length`` in steps (0 for not at all), ``white`` share of the variance."""

    length: float
    white: float


@lru_cache(maxsize=64)
def memories(span: float) -> tuple[tuple[Memory, ...], tuple[float, ...]]:
    """What is weighed on a record of so many steps, no memory first, and the logs of its priors."""
    lengths = [span / one for one in RECORD_LENGTHS if span / one >= SHORTEST]
    rest = [Memory(length, white) for length in lengths for white in WHITE_SHARES]
    share = np.log((1 - WITHOUT) / max(len(rest), 1))
    return (Memory(0.0, 0.0), *rest), (float(np.log(WITHOUT)), *[float(share)] * len(rest))


class Correlation:
    """The correlation matrix of n poses under one memory, never written out.

    Parameters
    ----------
    steps : (n,) array
        Where the poses are along their order or time, in steps, increasing.
    memory : Memory
        Of their errors.
    """

    def __init__(self, steps: Array, memory: Memory) -> None:
        self.memory, n = memory, len(steps)
        self.log_determinant = 0.0
        if not memory.length:
            return
        kept = np.exp(-np.diff(steps) / memory.length)
        fresh = -np.expm1(-2 * np.diff(steps) / memory.length)
        band = np.zeros((2, n))
        band[1] = 1.0
        band[1, :-1] += kept**2 / fresh
        band[1, 1:] += kept**2 / fresh
        band[0, 1:] = -kept / fresh
        self._slow = cholesky_banded(band, check_finite=False)
        self.log_determinant = float(np.log(fresh).sum())
        if memory.white:
            both = band / (1 - memory.white)
            both[1] += 1 / memory.white
            self._both = cholesky_banded(both, check_finite=False)
            self.log_determinant += n * np.log(memory.white * (1 - memory.white))
            self.log_determinant += 2 * float(np.log(self._both[1]).sum())
        else:
            self._band = band

    def inverse(self, values: Array) -> Array:
        """(n, m) inverse times values."""
        if not self.memory.length:
            return values
        white = self.memory.white
        if white:
            inner = cho_solve_banded((self._both, False), values / white, check_finite=False)
            return np.asarray((values - inner) / white)
        made = self._band[1][:, None] * values
        made[:-1] += self._band[0, 1:, None] * values[1:]
        made[1:] += self._band[0, 1:, None] * values[:-1]
        return np.asarray(made)

    def times(self, values: Array) -> Array:
        """(n, m) matrix times values."""
        if not self.memory.length:
            return values
        slow = cho_solve_banded((self._slow, False), values, check_finite=False)
        return np.asarray((1 - self.memory.white) * slow + self.memory.white * values)


@lru_cache(maxsize=512)
def _correlation(steps: bytes, memory: Memory) -> Correlation:
    return Correlation(np.frombuffer(steps), memory)


def correlation(steps: Array, memory: Memory) -> Correlation:
    """The correlation matrix, kept for the next question about the same poses."""
    if len(steps) > _KEPT:
        return Correlation(steps, memory)
    return _correlation(np.ascontiguousarray(steps, dtype=float).tobytes(), memory)


_KEPT = 400
"""Poses up to which factors are kept: some 10 kB each."""


@dataclass(frozen=True)
class Weighed:
    """Memories of one kind of errors, weighed.

    Parameters
    ----------
    steps : (n,) array
        Of the poses that count.
    memories : tuple of Memory
        The m of them, no memory first.
    weights : (m,) array
        Of belief.
    variances : (m, c) array
        Of the errors of each component under each.
    gain : float
        Log of the odds of any memory over none, the priors apart.
    """

    steps: Array
    memories: tuple[Memory, ...]
    weights: Array
    variances: Array
    gain: float

    @property
    def short(self) -> float:
        """Weight of a record of few correlation lengths."""
        span = self.steps[-1] - self.steps[0]
        return float(sum(w for w, m in zip(self.weights, self.memories, strict=True)
                         if m.length * SHORT > span))  # fmt: skip

    @property
    def length(self) -> float:
        """Typical correlation length in steps, of what lasts."""
        inside = self.weights[1:]
        if not inside.sum():
            return 0.0
        logs = np.log([one.length for one in self.memories[1:]])
        return float(np.exp(inside @ logs / inside.sum()))

    @property
    def neighbours(self) -> float:
        """Correlation of neighbours one step apart."""
        each = [(1 - m.white) * np.exp(-1 / m.length) if m.length else 0.0 for m in self.memories]
        return float(self.weights @ np.array(each))

    def effective(self, power: int = 1) -> float:
        """Independent errors that tell a mean (power 1) or a mean square (2) as well."""
        n, found = len(self.steps), []
        for one in self.memories:
            slow = Memory(one.length / power, 0.0)
            ones = np.ones((n, 1))
            total = float(correlation(self.steps, slow).times(ones).sum())
            share = (1 - one.white) ** power
            found.append(n * n / (share * total + (1 - share) * n))
        return float(np.exp(self.weights @ np.log(found)))


def weigh(steps: Array, residuals: Array, slopes: Array) -> Weighed:
    """Memories weighed by the residuals of a fit.

    Parameters
    ----------
    steps : (n,) array
        Where the poses are, in steps, increasing.
    residuals : (n, c) array
        Of c components that share a memory, each with a variance of its own.
    slopes : (n, c, k) array
        Their derivatives by what was fitted.

    Notes
    -----
    Restricted likelihood (Patterson and Thompson 1971), each component for itself: a fit takes
    away the slowest part of the errors, and is given it back.
    """
    n, count = residuals.shape
    tried, priors = memories(float(steps[-1] - steps[0]))
    bases = [_basis(slopes[:, column]) for column in range(count)]
    stacked = np.concatenate([*bases, residuals], axis=1)
    edges = np.cumsum([0, *(basis.shape[1] for basis in bases)])
    logs, variances = np.zeros(len(tried)), np.zeros((len(tried), count))
    for row, memory in enumerate(tried):
        between = correlation(steps, memory)
        weighed = between.inverse(stacked)
        for column, basis in enumerate(bases):
            part = weighed[:, edges[column] : edges[column + 1]]
            values = weighed[:, edges[-1] + column]
            squares = float(residuals[:, column] @ values)
            if basis.shape[1]:
                information = basis.T @ part
                pull = basis.T @ values
                squares -= float(pull @ np.linalg.solve(information, pull))
                logs[row] -= np.linalg.slogdet(information)[1] / 2
            dof = max(n - basis.shape[1], 1)
            variances[row, column] = max(squares, 1e-300) / dof
            logs[row] -= between.log_determinant / 2
            logs[row] -= dof * np.log(variances[row, column]) / 2
    whole = logs + np.array(priors)
    weights = np.exp(whole - whole.max())
    weights /= weights.sum()
    rest = special.logsumexp(whole[1:]) - np.log(1 - WITHOUT) if len(tried) > 1 else logs[0]
    return Weighed(steps, tried, weights, variances, float(rest - logs[0]))


def no_memory(steps: Array, residuals: Array) -> Weighed:
    """What is known of errors (n, c) that tell nothing of their memory."""
    tried, _ = memories(float(steps[-1] - steps[0]))
    variances = np.full((len(tried), residuals.shape[1]), float(np.mean(residuals**2)) + 1e-300)
    return Weighed(steps, tried, np.eye(len(tried))[0], variances, 0.0)


def _basis(slopes: Array) -> Array:
    """(n, r) independent columns that span the slopes (n, k)."""
    size = np.linalg.norm(slopes, axis=0)
    scaled = slopes[:, size > 0] / size[size > 0]
    if not scaled.shape[1]:
        return np.asarray(scaled)
    vectors, values, _ = np.linalg.svd(scaled, full_matrices=False)
    return np.asarray(vectors[:, values > 1e-7 * values[0]])


def joint_gain(kinds: Sequence[Weighed]) -> float:
    """Log of the odds that one kind of errors or more has a memory, over none."""
    gains = np.array([one.gain for one in kinds])
    if len(gains) < 2:
        return float(gains.sum())
    return float(special.logsumexp([*gains, gains.sum()]) - np.log(len(gains) + 1))


def is_said(gain: float, n: int) -> bool:
    """Whether the log of the odds over n poses says that neighbours depend on each other."""
    return gain > EVIDENCE + FOR_FEW / max(n, 1)


class Told(NamedTuple):
    """Whether neighbours depend on each other in a table, and how that is known.

    ``kinds`` holds the memories of 'positions' and 'headings' with the columns they are of, and
    ``gain`` the log of the odds that there is one.
    """

    kinds: dict[str, tuple[Weighed, tuple[int, ...]]]
    gain: float

    @property
    def dependent(self) -> bool:
        """Whether neighbours are said to depend on each other."""
        return is_said(self.gain, max(len(one.steps) for one, _ in self.kinds.values()))

    @property
    def withheld(self) -> bool:
        """Whether errors last so long that no interval of a mean is given."""
        return self.dependent and max(one.short for one, _ in self.kinds.values()) > WITHHELD

    def of_column(self, column: int) -> tuple[Weighed, int]:
        """The memories of a component, and its place among those of its kind."""
        return next(
            (one, columns.index(column))
            for one, columns in self.kinds.values()
            if column in columns
        )

    @property
    def words(self) -> str:
        """How alike neighbours are, for a sentence."""
        said = [
            f"{name} of neighbours have a correlation of {one.neighbours:.1f} and last for about "
            f"{one.length:.2g} poses"
            for name, (one, _) in self.kinds.items()
            if one.weights[0] < WITHOUT
        ]
        return "; ".join(said) or "errors of neighbours are alike"


def neighbours_of(
    steps: Array, deviations: Array, kinds: Mapping[str, Sequence[int]]
) -> Told | None:
    """Whether the errors of neighbours are alike; None with too few poses.

    Parameters
    ----------
    steps : (n,) array
        Where the poses are along their order or time, in steps, increasing.
    deviations : (n, k) array
        Errors from their mean.
    kinds : mapping of str to sequence of int
        Columns of each kind of errors.
    """
    n = len(deviations)
    if n < FEWEST or (np.diff(steps) <= 0).any():
        return None
    found = {
        name: (weigh(steps, deviations[:, list(columns)], np.ones((n, len(columns), 1))),
               tuple(columns))
        for name, columns in kinds.items()
        if columns and (np.ptp(deviations[:, list(columns)], axis=0) > 0).all()
    }  # fmt: skip
    if not found:
        return None
    return Told(found, joint_gain([one for one, _ in found.values()]))


def spread_of_mean(one: Weighed, column: int, dof: int) -> Spread:
    """Distribution of the error of the mean of one component."""
    n = len(one.steps)
    ones = np.ones((n, 1))
    factors = [float(correlation(one.steps, m).times(ones).sum()) / n**2 for m in one.memories]
    scales = np.sqrt(one.variances[:, column] * np.array(factors))
    scales[1:] *= HALF_STEP
    return Spread(one.weights, scales, dof)
