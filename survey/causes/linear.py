"""What any further parameter would gain, from one linearisation of the survey.

With the design matrix J, the residuals v and N = J^T J, the residuals that the unknowns cannot
take up are v' = Q v, Q = I - J N^-1 J^T. A further parameter with the column g lowers chi-squared
by (g^T v')^2 / (g^T Q g): the score test, exact where the survey is linear.
"""

from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from survey.causes.trial import Fit, Rows
from validation.poses.angles import Array

DENSE = 3000
"""Distances up to which Q of all of them is kept: 72 MB."""
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
        step = fit.solve(fit.jacobian.T @ fit.residual)
        self.residual = np.asarray(fit.residual - fit.jacobian @ step)
        """(o,) residuals v' of least squares."""

    @property
    def chi_squared(self) -> float:
        """Of least squares, to first order."""
        return float(self.residual @ self.residual)

    @cached_property
    def _dense(self) -> Array | None:
        n = len(self.fit.trial.network.distance)
        if n > DENSE:
            return None
        return self._block(np.arange(n))

    @cached_property
    def _inverse(self) -> Array | None:
        """N^-1 where the unknowns are few: quicker than to solve for many columns."""
        J = self.fit.jacobian
        if J.shape[1] > DENSE:
            return None
        normal = (J.T @ J).toarray()
        size = np.sqrt(np.maximum(np.diagonal(normal), 1e-12))
        scaled = normal / np.outer(size, size) + 1e-9 * np.eye(len(size))
        return np.asarray(cho_solve(cho_factor(scaled), np.eye(len(size))) / np.outer(size, size))

    def _solve(self, right: Array) -> Array:
        return self.fit.solve(right) if self._inverse is None else self._inverse @ right

    def _block(self, rows: Rows) -> Array:
        J = self.fit.jacobian[rows]
        gain = self.fit.solve(J.T.toarray()).T if self._inverse is None else J @ self._inverse
        return np.asarray(np.eye(len(rows)) - (J @ gain.T).T)

    def block(self, rows: Rows) -> Array:
        """(r, r) part of Q for some observations."""
        n = len(self.fit.trial.network.distance)
        dense = self._dense if len(rows) == 0 or rows.max() < n else None
        return self._block(rows) if dense is None else dense[np.ix_(rows, rows)]

    @cached_property
    def redundancy(self) -> Array:
        """(n,) share of each distance that the others check."""
        n = len(self.fit.trial.network.distance)
        if self._dense is not None:
            return np.diagonal(self._dense)
        parts = np.array_split(np.arange(n), n // 500 + 1)
        return np.concatenate([np.diagonal(self._block(rows)) for rows in parts])

    def of_columns(self, columns: Array) -> tuple[Array, Array]:
        """Score g^T v' (k,) and g^T Q g (k, k) of columns (n, k) over the distances."""
        n = len(columns)
        J = self.fit.jacobian[:n]
        through = np.asarray(J.T @ columns)
        matrix = columns.T @ columns - through.T @ self._solve(through)
        return columns.T @ self.residual[:n], np.asarray(matrix)


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


def group_gain(linear: Linear, rows: Rows) -> tuple[float, Array]:
    """Decrease of chi-squared if some observations were free, and their errors (standardised)."""
    Q = linear.block(rows)
    values, vectors = np.linalg.eigh(Q)
    kept = values > UNSEEN
    turned = vectors[:, kept].T @ linear.residual[rows]
    size = vectors[:, kept] @ (turned / values[kept])
    return float((turned**2 / values[kept]).sum()), size
