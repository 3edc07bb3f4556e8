"""The covariance of many poses in few numbers: what each has alone, and a factor of the rest."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from validation.poses.joint import LARGEST_WHOLE
from validation.poses.nets import Net
from validation.poses.pose_table import PoseTable

Indices = npt.NDArray[np.intp]
LEAST_OWN = 1e-9
"""Share of a pose's variance that it has alone at least, beside a net: equations with what it has
alone need some, and a hundred-thousandth of a standard deviation changes nothing."""


def least_variances(table: PoseTable) -> Array:
    """(n, k) variances that rounding may take from those of a table."""
    return np.asarray(1e-9 * np.diagonal(table.covariances, axis1=1, axis2=2))


class Factored(NamedTuple):
    """A covariance of n poses of k numbers without a matrix of all of them.

    ``own`` (n, k, k) is what each has alone. That of different poses is ``factor`` (n, k, r), by
    its ``signs`` (r,) of 1 and -1, times its transpose, which all have beside what is their own,
    and what they err as parts of a ``net``.
    """

    own: Array
    factor: Array
    signs: Array
    net: Net | None = None

    @classmethod
    def of(cls, table: PoseTable) -> "Factored":
        """That of a table; of one with a matrix of all poses by as many columns as it has."""
        if table.joint is not None:
            return cls.of_matrix(table.joint, len(table.components))
        return cls(table.own_covariances(), *table.shared_part(), table.net)

    @classmethod
    def alone(cls, own: Array) -> "Factored":
        """Of poses that are independent of each other, (n, k, k)."""
        return cls(own, np.zeros((*own.shape[:2], 0)), np.zeros(0))

    @classmethod
    def of_matrix(cls, matrix: Array, k: int) -> "Factored":
        """Of a covariance (n k, n k) of all poses together.

        Half of its least eigenvalue, scaled to correlations, is what each pose has alone.
        """
        size = np.sqrt(np.diagonal(matrix))
        values, vectors = np.linalg.eigh(matrix / size[:, None] / size)
        least = max(float(values[0]), LEAST_OWN) / 2
        columns = size[:, None] * vectors * np.sqrt(np.maximum(values - least, 0.0))
        own = least * np.square(size).reshape(-1, k)[:, :, None] * np.eye(k)
        return cls(own, columns.reshape(len(own), k, -1), np.ones(len(size)))

    @property
    def blocks(self) -> Array:
        """(n, k, k) covariance of each pose."""
        shared = np.asarray((self.factor * self.signs) @ np.swapaxes(self.factor, 1, 2))
        return self.own + shared + (0.0 if self.net is None else self.net.blocks)

    def matrix(self) -> Array:
        """(n k, n k) covariance of all poses together."""
        n, k = self.own.shape[:2]
        flat = self.factor.reshape(n * k, -1)
        found = (flat * self.signs) @ flat.T
        if self.net is not None:
            found = found + self.net.matrix()
        found.reshape(n, k, n, k)[np.arange(n), :, np.arange(n)] += self.own
        return np.asarray(found)

    def select(self, rows: Indices) -> "Factored":
        """Of the poses in the given rows."""
        net = None if self.net is None else self.net.select(rows)
        return Factored(self.own[rows], self.factor[rows], self.signs, net)

    def turned(self, by: Array) -> "Factored":
        """Of poses that follow these, each by its own (k, k) of ``by`` (n, k, k)."""
        own = by @ self.own @ np.swapaxes(by, 1, 2)
        net = None if self.net is None else self.net.turned(by)
        return Factored(own, by @ self.factor, self.signs, net)

    def products(self, gain: Array) -> Array:
        """(p, p) covariance of ``gain`` (p, n, k) times the errors."""
        moved = np.moveaxis(self._without_factor(np.moveaxis(gain, 0, 2)), 2, 0)
        seen = np.einsum("pnk,nkr->pr", gain, self.factor)
        return np.asarray(np.einsum("pnk,qnk->pq", gain, moved) + (seen * self.signs) @ seen.T)

    def _without_factor(self, values: Array) -> Array:
        """(n, k, p) what poses have alone and the net, times values (n, k, p)."""
        own = self.own @ values
        return own if self.net is None else own + self.net.times(values)

    def solve(self, values: Array) -> Array:
        """(n, k, p) the inverse of the covariance times values (n, k, p).

        Raises
        ------
        ValueError
            If the covariance is singular.
        """
        both = self.weighed(np.concatenate([values, self.factor], axis=2))
        count = values.shape[2]
        left, right = both[:, :, :count], both[:, :, count:]
        if not right.shape[2]:
            return left
        inner = np.diag(self.signs) + np.einsum("nkr,nks->rs", self.factor, right)
        seen = np.einsum("nkr,nkp->rp", self.factor, left)
        try:
            return np.asarray(left - right @ np.linalg.solve(inner, seen))
        except np.linalg.LinAlgError:
            raise ValueError("a covariance is singular") from None

    def weighed(self, values: Array) -> Array:
        """(n, k, p) the inverse of the covariance without the factor, times values (n, k, p)."""
        if self.net is None:
            return np.asarray(np.linalg.solve(self.own, values))
        size = np.sqrt(np.diagonal(self.blocks, axis1=1, axis2=2))
        least = np.linalg.eigvalsh(self.own / size[:, :, None] / size[:, None, :])[:, :1]
        added = np.maximum(LEAST_OWN - least, 0.0) * np.square(size)
        own = self.own + added[:, :, None] * np.eye(size.shape[1])
        return self.net.solved_beside(own, values)

    def beside(self, other: "Factored") -> "Factored":
        """The sum with that of other errors of the same poses, independent of these."""
        factor, signs = (self.factor, other.factor), (self.signs, other.signs)
        net = other.net if self.net is None else self.net.beside(other.net)
        own = self.own + other.own
        return Factored(own, np.concatenate(factor, axis=2), np.concatenate(signs), net)

    def with_columns(self, columns: Array) -> "Factored":
        """The sum with that of other errors by their factor, (n k, r)."""
        more = columns.reshape(*self.own.shape[:2], -1)
        ones = np.ones(more.shape[2])
        return self.beside(Factored(np.zeros_like(self.own), more, ones))

    def without(self, by: Array, of: Array, used: Indices, n: int) -> "Factored":
        """Of the first n poses, less what ``by`` (n k, r) takes of the ``used`` numbers by ``of``.

        Notes
        -----
        Of what poses have alone and in a net, D, (1 - by of) D (1 - by of)' is
        D - by M' - M by' + by P by' with M = D of' and P = of D of': a few columns more.
        """
        count, k = self.own.shape[:2]
        columns = len(self.signs)
        rows, numbers = np.divmod(used, k)
        # (r, m k) of D: each used number follows those of its own pose.
        seen = np.zeros((len(of), count, k))
        seen[:, rows, numbers] = of
        moved = np.moveaxis(self._without_factor(np.moveaxis(seen, 0, 2)), 2, 0)
        inside = moved[:, :n].reshape(len(of), -1).T
        weight = np.einsum("rnl,snl->rs", moved, seen)
        size = np.sqrt(np.abs(inside).max(initial=0.0) / max(np.abs(by).max(initial=0.0), 1e-300))
        size = size or 1.0
        none = np.zeros_like(weight)
        cross = -np.eye(len(weight)) * size
        values, vectors = np.linalg.eigh(np.block([[weight, cross], [cross, none]]))
        more = np.concatenate([by, inside / size], axis=1) @ (vectors * np.sqrt(np.abs(values)))
        taken = of @ self.factor.reshape(count * k, columns)[used]
        factor = self.factor[:n] - (by @ taken).reshape(n, k, columns)
        signs = np.where(values < 0, -1.0, 1.0)
        return Factored(
            self.own[:n],
            np.concatenate([factor, more.reshape(n, k, -1)], axis=2),
            np.concatenate([self.signs, signs]),
            None if self.net is None else self.net.select(np.arange(n)),
        )

    def more(self, by: Array, of: Array, known: "Factored", sign: float = 1.0) -> "Factored":
        """With what ``by`` gives of the errors of other poses by ``of`` added, or taken away."""
        weight = known.products(of.reshape(len(of), *known.own.shape[:2]))
        values, vectors = np.linalg.eigh((weight + weight.T) / 2)
        columns = by @ (vectors * np.sqrt(np.maximum(values, 0.0)))
        columns = columns.reshape(*self.own.shape[:2], -1)
        return Factored(
            self.own,
            np.concatenate([self.factor, columns], axis=2),
            np.concatenate([self.signs, np.full(columns.shape[2], sign)]),
            self.net,
        )

    def less(self, by: Array, of: Array, known: "Factored") -> "Factored":
        """The same with that taken away."""
        return self.more(by, of, known, -1.0)

    def stated_in(self, table: PoseTable) -> PoseTable:
        """A table with this covariance; of few poses with the matrix of all."""
        n, k = table.poses.shape
        if n * k <= LARGEST_WHOLE:
            return replace(table, covariances=self.blocks, joint=self.matrix())
        flat = self.factor.reshape(n * k, len(self.signs))
        return replace(table, covariances=self.blocks, factor=flat, signs=self.signs, net=self.net)

    def given_to(self, table: PoseTable) -> PoseTable:
        """A table with this covariance, made positive where rounding has taken it."""
        n, k = table.poses.shape
        added = least_variances(table)[:, :, None] * np.eye(k)
        covariances = self.blocks + added
        covariances = _positive((covariances + np.swapaxes(covariances, 1, 2)) / 2, added)
        flat = self.factor.reshape(n * k, len(self.signs))
        return replace(
            table,
            covariances=covariances,
            joint=None,
            factor=flat,
            signs=self.signs,
            net=self.net,
        )


def _positive(blocks: Array, floor: Array) -> Array:
    """(n, k, k) covariances with no variance below a floor, and positive definite."""
    size = np.sqrt(np.maximum(np.diagonal(blocks, axis1=1, axis2=2), 0.0))
    lacking = np.maximum(np.diagonal(floor, axis1=1, axis2=2) - size**2, 0.0)
    blocks = blocks + lacking[:, :, None] * np.eye(blocks.shape[1])
    size = np.sqrt(np.diagonal(blocks, axis1=1, axis2=2))
    least = np.linalg.eigvalsh(blocks / size[:, :, None] / size[:, None, :])[:, 0]
    short = np.maximum(1e-9 - least, 0.0)
    return np.asarray(blocks + (short[:, None] * size**2)[:, :, None] * np.eye(blocks.shape[1]))
