"""A survey read in a certain way, and its least-squares solution.

A hypothesis about what went wrong is another way to read the same survey: names that mean
something else, a common error of some readings with one unknown size, a place that is not held.
Each is a trial with all unknowns of the joint adjustment, so that they can be compared.
"""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array, hstack

from survey.estimation.least_squares.split_covariance import (
    NotDeterminedError,
    SplitCovariance,
    split_inverse,
)
from survey.estimation.network import Network, Parameters, design
from validation.poses.angles import Array

Rows = npt.NDArray[np.intp]
Law = Literal["offset", "scale", "height"]
CAUCHY = 3.0
"""Standardised residual that gets half the weight in the robust solution: usual (2.4 is 95 % as
exact as least squares where nothing is wrong)."""
_PASSES = 25
_FAR_OFF = 9.0
_COARSE = 0.01
"""Share of chi-squared, where m0 is above 3, that is not worth another pass: what fits so badly is
known to be wrong, and m0 is told to two figures. Only of `_MANY` and more: of few, the order of
two large causes could hang on it."""
_MANY = 3000
"""Degrees of freedom from which on a pass costs more than it can tell."""
_ENOUGH = 1e-3
"""Decrease of chi-squared below which a pass brings nothing."""
TINY = 1e-9
"""Added to the diagonal of the scaled normal matrix: nothing is singular, and what is determined
changes by a part in 1e9."""


@dataclass(frozen=True)
class Effect:
    """An error that some distances share.

    Parameters
    ----------
    law : {"offset", "scale", "height"}
        A reading of the distance D shows D + b, D (1 + b), or sqrt(D^2 + b).
    rows : (r,) array of int
        Distances of the network.
    value : float
        Where b starts: metres, a ratio, or square metres.
    """

    law: Law
    rows: Rows
    value: float = 0.0


@dataclass(frozen=True)
class Trial:
    """One way to read a survey.

    Parameters
    ----------
    network : Network
        Unknowns and observations.
    start : Parameters
        Where to start.
    effects : tuple of Effect
        Common errors.
    dropped : frozenset of int
        Distances that are not used.
    released : frozenset of str
        Vframe points, marks and rig points that are not held at their nominal places.
    """

    network: Network
    start: Parameters
    effects: tuple[Effect, ...] = ()
    dropped: frozenset[int] = frozenset()
    released: frozenset[str] = frozenset()

    @cached_property
    def used(self) -> npt.NDArray[np.bool_]:
        """(o,) which observations are used."""
        net = self.network
        held = [net.points[i] not in self.released for i in net.fixed]
        held += [net.points[i] not in self.released for i in net.mark]
        held += [f"/{name}" not in self.released for name in net.rig_names]
        distances = np.ones(len(net.distance), dtype=bool)
        distances[list(self.dropped)] = False
        sides = np.ones(len(net.side_length), dtype=bool)
        return np.concatenate([distances, np.repeat(np.array(held, dtype=bool), 2), sides])

    @property
    def unknowns(self) -> int:
        """Number of unknowns, sizes of the common errors included."""
        return sum(self.network.sizes) + len(self.effects)

    @property
    def freedom(self) -> int:
        """Observations used less unknowns."""
        return int(self.used.sum()) - self.unknowns

    def equations(self, at: Parameters, values: Array) -> tuple[Array, csr_array]:
        """Standardised residuals (o,) and design matrix (o, u + e), zero where not used."""
        residual, jacobian = design(self.network, at)
        n, sigma = len(self.network.distance), self.network.sigma
        computed = self.network.distance - residual[:n] * sigma
        slope = np.ones(len(residual))
        columns: list[Array] = []
        for effect, b in zip(self.effects, values, strict=True):
            rows, D = effect.rows, computed[effect.rows]
            column = np.zeros((len(residual), 1))
            shown, gain, by_b = law(effect.law, D, float(b))
            computed[rows] = shown
            slope[rows] *= gain
            column[rows, 0] = by_b / sigma[rows]
            for earlier in columns:
                earlier[rows, 0] *= gain
            columns.append(column)
        residual[:n] = (self.network.distance - computed) / sigma
        use = self.used.astype(float)
        whole = jacobian.multiply((slope * use)[:, None])
        if columns:
            whole = hstack([whole, csr_array(np.hstack(columns) * use[:, None])])
        return residual * use, csr_array(whole)


def law(kind: Law, D: Array, b: float) -> tuple[Array, Array, Array]:
    """What a meter shows at distances D, and the derivatives by D and by b."""
    if kind == "offset":
        return D + b, np.ones_like(D), np.ones_like(D)
    if kind == "scale":
        return D * (1 + b), np.full_like(D, 1 + b), D
    shown = np.sqrt(np.maximum(D**2 + b, 1e-6))
    return shown, D / shown, 0.5 / shown


def length(kind: Law, shown: Array, b: float) -> tuple[Array, Array]:
    """Distances D at which a meter shows these values, and their derivatives by what is shown."""
    if kind == "offset":
        return shown - b, np.ones_like(shown)
    if kind == "scale":
        return shown / (1 + b), np.full_like(shown, 1 / (1 + b))
    D = np.sqrt(np.maximum(shown**2 - b, 1e-6))
    return D, shown / D


@dataclass(frozen=True)
class Fit:
    """A trial solved.

    Parameters
    ----------
    trial : Trial
        What was solved.
    at : Parameters
        Estimates.
    values : (e,) array
        Sizes of the common errors.
    residual : (o,) array
        Standardised, zero where not used.
    """

    trial: Trial
    at: Parameters
    values: Array
    residual: Array

    @property
    def chi_squared(self) -> float:
        """Of all observations used."""
        return float(self.residual @ self.residual)

    @property
    def freedom(self) -> int:
        """Observations used less unknowns."""
        return self.trial.freedom

    @property
    def m0(self) -> float:
        """Standard deviation of unit weight."""
        return float(np.sqrt(self.chi_squared / max(self.freedom, 1)))

    @cached_property
    def jacobian(self) -> csr_array:
        """(o, u + e) design matrix there."""
        return self.trial.equations(self.at, self.values)[1]

    @cached_property
    def cofactors(self) -> SplitCovariance:
        """Inverse of the normal matrix, nothing of it singular (`TINY`)."""
        return _inverse(self.trial.network, self.jacobian)

    def covariance(self, by: Array) -> Array:
        """(k, k) covariance of k linear functions of the unknowns, whose rows are ``by`` (k, u)."""
        return np.asarray(by @ self.cofactors.times(by.T))


def fit(trial: Trial, *, robust: bool = False, hopeless: float = np.inf) -> Fit:
    """The least-squares solution of a trial, from its start.

    Parameters
    ----------
    trial : Trial
        What to solve.
    robust : bool
        Weigh all observations by 1 / (1 + (r / `CAUCHY`)^2): what few of them say against the
        others counts little. The chi-squared is then that of all, at the robust solution.

    Notes
    -----
    Levenberg-Marquardt: a step that makes things worse is shortened.
    """
    at, values = trial.start, np.array([effect.value for effect in trial.effects])
    residual, jacobian = trial.equations(at, values)
    damping, cost = 0.0, _cost(residual, robust=robust)
    settled: SplitCovariance | None = None
    for _ in range(_PASSES):
        weight = 1 / (1 + (residual / CAUCHY) ** 2) if robust else np.ones_like(residual)
        weighted = csr_array(jacobian.multiply(np.sqrt(weight)[:, None]))
        gained = -np.inf
        with contextlib.suppress(NotDeterminedError):
            inverse = _inverse(trial.network, weighted, damping)
            step = inverse.times(jacobian.T @ (weight * residual))
            u = len(step) - len(values)
            there, size = at.moved(step[:u]), values + step[u:]
            ahead, slope = trial.equations(there, size)
            gained = cost - _cost(ahead, robust=robust)
        if not np.isfinite(gained) or gained < -_ENOUGH:
            damping = max(10 * damping, 1e-3)
            if damping > 1e6 or cost > hopeless:
                break
            continue
        at, values, residual, jacobian, cost = there, size, ahead, slope, cost - gained
        little = _ENOUGH * max(1.0, 1e-3 * cost)
        if damping == 0.0 and (
            gained < little or (not robust and _left(inverse, step, jacobian, residual) < little)
        ):
            settled = None if robust else inverse
            break
        bad = cost > _FAR_OFF * trial.freedom and trial.freedom > _MANY
        coarse = not robust and bad and gained < _COARSE * cost
        if coarse or (cost > hopeless and gained < cost / 2):
            break
        damping = damping / 10 if damping > 1e-4 else 0.0
    found = Fit(trial, at, values, residual)
    if settled is not None:  # of a step before that brought nothing: the same to a part in 1e3
        found.__dict__["cofactors"] = settled
    return found


def _left(inverse: SplitCovariance, step: Array, jacobian: csr_array, residual: Array) -> float:
    """What one more step would gain, by the inverse of a step before that hardly moved anything."""
    if np.abs(step).max(initial=0.0) > _NEAR:
        return np.inf
    slope = jacobian.T @ residual
    return float(slope @ inverse.times(slope))


_NEAR = 0.003
"""Metres and radians of a step that changes the normal matrix by a part in 1e3: that of 3 m."""


def _cost(residual: Array, *, robust: bool) -> float:
    if robust:
        return float(CAUCHY**2 * np.log1p((residual / CAUCHY) ** 2).sum())
    return float(residual @ residual)


def _inverse(network: Network, jacobian: csr_array, damping: float = 0.0) -> SplitCovariance:
    """Inverse of the normal matrix, each stop apart from what all share."""
    size = np.asarray(jacobian.power(2).sum(axis=0)).ravel()
    p, f, _ = network.sizes
    shared = np.ones(len(size), dtype=bool)
    shared[p : p + f] = False
    shared[(2 * network.mark[:, None] + np.arange(2)).ravel()] = False
    return split_inverse(jacobian, shared, np.where(size > 0, (TINY + damping) * size, 1.0))


def with_point(trial: Trial, name: str, place: Array) -> tuple[Trial, int]:
    """The trial with one more point, and its row."""
    net = trial.network
    network = replace(net, points=(*net.points, name))
    start = replace(trial.start, points=np.vstack([trial.start.points, place]))
    return replace(trial, network=network, start=start), len(net.points)


def renamed(trial: Trial, rows: Sequence[int] | Rows, old: int, new: int) -> Trial:
    """The trial with the point ``old`` of some distances read as the point ``new``."""
    first, second = trial.network.first.copy(), trial.network.second.copy()
    index = np.asarray(rows, dtype=np.intp)
    for ends in (first, second):
        ends[index] = np.where(ends[index] == old, new, ends[index])
    return replace(trial, network=replace(trial.network, first=first, second=second))
