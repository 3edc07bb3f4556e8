"""The covariance of many poses in few numbers: what each has alone, and a factor of the rest."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from validation.poses.pose_table import PoseTable
from validation.poses.shared_errors import shared_errors

Indices = npt.NDArray[np.intp]


def least_variances(table: PoseTable) -> Array:
    """(n, k) variances that rounding may take from those of a table."""
    return np.asarray(1e-9 * np.diagonal(table.covariances, axis1=1, axis2=2))


class Factored(NamedTuple):
    """A covariance of n poses of k numbers without a matrix of all of them.

    ``own`` (n, k, k) is what each has alone. That of different poses is ``factor`` (n, k, r), by
    its ``signs`` (r,) of 1 and -1, times its transpose, which all have beside what is their own.
    """

    own: Array
    factor: Array
    signs: Array

    @classmethod
    def of(cls, table: PoseTable) -> "Factored":
        """That of a table without a matrix of all poses."""
        return cls(table.own_covariances(), *table.shared_part())

    def beside(self, other: "Factored") -> "Factored":
        """The sum with that of other errors of the same poses, independent of these."""
        factor, signs = (self.factor, other.factor), (self.signs, other.signs)
        return Factored(self.own + other.own, np.concatenate(factor, axis=2), np.concatenate(signs))

    def without(self, by: Array, of: Array, used: Indices, n: int) -> "Factored":
        """Of the first n poses, less what ``by`` (n k, r) takes of the ``used`` numbers by ``of``.

        Notes
        -----
        Of what poses have alone, D, (1 - by of) D (1 - by of)' is D - by M' - M by' + by P by' with
        M = D of' and P = of D of': a few columns more.
        """
        count, k = self.own.shape[:2]
        columns = len(self.signs)
        rows, numbers = np.divmod(used, k)
        # (r, m k) of D: each used number follows those of its own pose.
        seen = np.zeros((len(of), count, k))
        seen[:, rows, numbers] = of
        moved = np.einsum("rnj,njl->rnl", seen, self.own)
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
        )

    def more(self, by: Array, of: Array, known: PoseTable, sign: float = 1.0) -> "Factored":
        """With what ``by`` gives of the errors of other poses by ``of`` added, or taken away."""
        each = of.reshape(len(of), *known.poses.shape)
        weight = np.einsum("rnj,njl,snl->rs", each, known.covariances, each)
        together = shared_errors([known])
        if together is not None:
            weight = weight + together.seen_by(each)
        values, vectors = np.linalg.eigh((weight + weight.T) / 2)
        columns = by @ (vectors * np.sqrt(np.maximum(values, 0.0)))
        columns = columns.reshape(*self.own.shape[:2], -1)
        return Factored(
            self.own,
            np.concatenate([self.factor, columns], axis=2),
            np.concatenate([self.signs, np.full(columns.shape[2], sign)]),
        )

    def less(self, by: Array, of: Array, known: PoseTable) -> "Factored":
        """The same with that taken away."""
        return self.more(by, of, known, -1.0)

    def given_to(self, table: PoseTable) -> PoseTable:
        """A table with this covariance, made positive where rounding has taken it."""
        n, k = table.poses.shape
        added = least_variances(table)[:, :, None] * np.eye(k)
        shared = (self.factor * self.signs) @ np.swapaxes(self.factor, 1, 2)
        covariances = self.own + shared + added
        covariances = _positive((covariances + np.swapaxes(covariances, 1, 2)) / 2, added)
        flat = self.factor.reshape(n * k, len(self.signs))
        return replace(table, covariances=covariances, joint=None, factor=flat, signs=self.signs)


def _positive(blocks: Array, floor: Array) -> Array:
    """(n, k, k) covariances with no variance below a floor, and positive definite."""
    size = np.sqrt(np.maximum(np.diagonal(blocks, axis1=1, axis2=2), 0.0))
    lacking = np.maximum(np.diagonal(floor, axis1=1, axis2=2) - size**2, 0.0)
    blocks = blocks + lacking[:, :, None] * np.eye(blocks.shape[1])
    size = np.sqrt(np.diagonal(blocks, axis1=1, axis2=2))
    least = np.linalg.eigvalsh(blocks / size[:, :, None] / size[:, None, :])[:, 0]
    short = np.maximum(1e-9 - least, 0.0)
    return np.asarray(blocks + (short[:, None] * size**2)[:, :, None] * np.eye(blocks.shape[1]))
