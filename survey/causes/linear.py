"""What any further parameter would gain, from one linearisation of the survey.

With the design matrix J, the residuals v and N = J^T J, the residuals that the unknowns cannot
take up are v' = Q v, Q = I - J N^-1 J^T. A further parameter with the column g lowers chi-squared
by (g^T v')^2 / (g^T Q g): the score test, exact where the survey is linear.

N^-1 is kept split into blocks of the stops and what they share, so that no matrix grows with the
square of the readings or of the stops.
"""

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from survey.causes.trial import Fit, Rows
from survey.estimation.least_squares.split_covariance import SplitCovariance
from validation.poses.angles import Array

SomeRows = Callable[[int, int], Array]
UNSEEN = 0.02
"""Share of a parameter's effect that must be left in the residuals, or it is not tested: what the
survey takes up by 98 % shows only through what is not linear in it."""
FAINT = 1e-5
"""The same for a number that many readings share: a scale of all is taken up but for what the
Vframe says, a few readings of a thousand, and is known well all the same."""


class Linear:
    """A trial linearised where it was solved.

    Parameters
    ----------
    fit : Fit
        Robust, so that what few readings do wrong does not move the point of linearisation.
    """

    def __init__(self, fit: Fit) -> None:
        self.fit = fit
        self.at_start = fit.residual
        """(o,) residuals at the point of linearisation."""
        step = self.cofactors.times(fit.jacobian.T @ fit.residual)
        self.residual = np.asarray(fit.residual - fit.jacobian @ step)
        """(o,) residuals v' of least squares."""

    @property
    def chi_squared(self) -> float:
        """Of least squares, to first order."""
        return float(self.residual @ self.residual)

    @property
    def cofactors(self) -> SplitCovariance:
        """N^-1."""
        return self.fit.cofactors

    def reach(self, rows: Rows) -> Array:
        """(r, k) what J N^-1 J^T holds of the shared unknowns is its square, some observations."""
        return np.asarray(self.fit.jacobian[rows] @ self.cofactors.shared)

    def alone(self, rows: Rows) -> csr_array:
        """(r, r) the other part of J N^-1 J^T, within the stops, for some observations."""
        J = csr_array(self.fit.jacobian[rows])
        return csr_array(J @ self.cofactors.own @ J.T)

    def block(self, rows: Rows) -> Array:
        """(r, r) part of Q for some observations."""
        reach = self.reach(rows)
        return np.asarray(np.eye(len(rows)) - reach @ reach.T - self.alone(rows).toarray())

    def blocks(self, rows: Rows) -> Array:
        """(g, s, s) parts of Q for g groups of s observations, ``rows`` (g, s)."""
        reach = self.reach(rows.ravel()).reshape(*rows.shape, -1)
        taken = reach @ np.swapaxes(reach, 1, 2)
        J = self.fit.jacobian
        through = [csr_array(J[column] @ self.cofactors.own) for column in rows.T]
        for b, column in enumerate(rows.T):
            ours = J[column]
            for a, part in enumerate(through):
                taken[:, a, b] += np.asarray(part.multiply(ours).sum(axis=1)).ravel()
        return np.asarray(np.eye(rows.shape[1]) - taken)

    def column(self, row: int) -> Array:
        """(n,) column of Q of one distance, for all distances."""
        n = len(self.fit.trial.network.distance)
        J = self.fit.jacobian
        through = self.cofactors.times(J[[row]].toarray()[0])
        column = -np.asarray(J[:n] @ through)
        column[row] += 1
        return column

    @cached_property
    def redundancy(self) -> Array:
        """(n,) share of each distance that the others check."""
        n = len(self.fit.trial.network.distance)
        return 1 - self.cofactors.leverage(csr_array(self.fit.jacobian[:n]))

    def of_sets(self, columns: Array, sets: Sequence[Rows]) -> tuple[Array, Array, Array]:
        """Score, g^T Q g and g^T g (k,) of k columns: ``columns`` (n,) at the rows of each set."""
        masks = in_sets(columns, sets)
        through = csr_array(self.fit.jacobian[: len(columns)].T @ masks)
        shared = np.asarray(through.T @ self.cofactors.shared)
        alone = np.asarray((self.cofactors.own @ through).multiply(through).sum(axis=0)).ravel()
        whole = np.asarray(masks.power(2).sum(axis=0)).ravel()
        score = np.asarray(masks.T @ self.residual[: len(columns)])
        return score, whole - alone - (shared**2).sum(1), whole

    def between_sets(self, columns: Array, sets: Sequence[Rows]) -> tuple[Array, SomeRows]:
        """Score (k,) of the same, sets having no row in common, and rows a to b of g^T Q g (k, k).

        Of many stops the whole matrix is more than fits the memory.
        """
        masks = in_sets(columns, sets)
        through = csr_array(self.fit.jacobian[: len(columns)].T @ masks)
        shared = np.asarray(through.T @ self.cofactors.shared)
        near = csr_array(masks.T @ masks) - csr_array(through.T @ self.cofactors.own @ through)
        score = np.asarray(masks.T @ self.residual[: len(columns)])
        return score, lambda a, b: np.asarray(near[a:b].toarray() - shared[a:b] @ shared.T)


def in_sets(columns: Array, sets: Sequence[Rows]) -> csr_array:
    """(n, k) ``columns`` (n,) at the rows of each of k sets, zero elsewhere."""
    rows = np.concatenate([np.empty(0, dtype=np.intp), *sets])
    at = np.repeat(np.arange(len(sets)), [len(one) for one in sets])
    return csr_array((columns[rows], (rows, at)), shape=(len(columns), len(sets)))


def gains(score: Array, matrix: Array, whole: Array) -> tuple[Array, Array]:
    """Decrease of chi-squared, and size, of single parameters.

    Parameters
    ----------
    score, matrix, whole : (...) array
        g^T v', g^T Q g and g^T g of each.

    Returns
    -------
    gain, size : (...) array
        0 where the parameter is not seen (`FAINT`).
    """
    seen = matrix > FAINT * np.maximum(whole, 1e-12)
    safe = np.where(seen, matrix, 1.0)
    return np.where(seen, score**2 / safe, 0.0), np.where(seen, score / safe, 0.0)


def group_gains(linear: Linear, rows: Rows) -> Array:
    """Decrease of chi-squared (g,) if the observations of each group ``rows`` (g, s) were free."""
    if not rows.size:
        return np.zeros(len(rows))
    values, vectors = np.linalg.eigh(linear.blocks(rows))
    turned = np.einsum("gsk,gs->gk", vectors, linear.residual[rows])
    seen = values > UNSEEN
    return np.asarray(np.where(seen, turned**2 / np.where(seen, values, 1.0), 0.0).sum(1))
