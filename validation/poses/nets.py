"""Errors of poses that hang in a net of measurements, by the sparse inverse of their covariance."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array

Indices = npt.NDArray[np.intp]
COLUMNS = 384
"""Columns of an inverse that are held at a time: 20 MB for 2,000 poses in the plane."""


@dataclass(frozen=True, repr=False)
class Net:
    """A covariance of n poses of k numbers that is an inverse of a sparse matrix.

    Poses that are found from measurements between neighbours all depend on each other, but each
    measurement joins two of them: the inverse of their covariance has few numbers.

    Parameters
    ----------
    information : (N, N) sparse array
        Inverse of the covariance of N unknowns.
    by : (n k, N) sparse array
        How the numbers of the poses follow the unknowns; where they are some of these, a 1 a row.
    blocks : (n, k, k) array
        Covariance of each pose.
    """

    information: Any
    by: Any
    blocks: Array

    @classmethod
    def of(cls, information: Any, k: int) -> "Net":
        """Of poses whose numbers are the unknowns of an information matrix, in their order.

        Raises
        ------
        RuntimeError
            If that is singular.
        """
        from scipy import sparse  # noqa: PLC0415  (loaded where there is a net)

        size = information.shape[0]
        blocks = inverse_blocks(sparse_factor(information), size, size // k, k)
        return cls(information, sparse.eye_array(size, format="csr"), blocks)

    @cached_property
    def _factor(self) -> Any:
        return sparse_factor(self.information)

    def __getstate__(self) -> dict[str, Any]:
        """Without the factored matrix, which cannot be sent to another process."""
        return {name: value for name, value in self.__dict__.items() if name != "_factor"}

    def times(self, values: Array) -> Array:
        """(n, k, p) the covariance times values (n, k, p)."""
        flat = values.reshape(self.by.shape[0], -1)
        found = self.by @ self._factor.solve(np.asarray(self.by.T @ flat, dtype=float))
        return np.asarray(found).reshape(values.shape)

    def solved_beside(self, own: Array, values: Array) -> Array:
        """(n, k, p) the inverse of the sum of this and of blocks (n, k, k), times values.

        Notes
        -----
        With B of the blocks, P of ``by`` and the information I, the inverse of B + P I^-1 P^T is
        B^-1 - B^-1 P (I + P^T B^-1 P)^-1 P^T B^-1, all of it sparse (Woodbury).
        """
        known = _diagonal(np.asarray(np.linalg.inv(own)))
        inner = sparse_factor(self.information + self.by.T @ known @ self.by)
        first = np.asarray(known @ values.reshape(known.shape[0], -1))
        moved = inner.solve(np.asarray(self.by.T @ first, dtype=float))
        return np.asarray(first - known @ (self.by @ moved)).reshape(values.shape)

    def select(self, rows: Indices) -> "Net":
        """Of the poses in the given rows."""
        k = self.blocks.shape[1]
        flat = (rows[:, None] * k + np.arange(k)).ravel()
        return Net(self.information, self.by[flat], self.blocks[rows])

    def only(self, numbers: Indices) -> "Net":
        """Of some of the numbers of each pose."""
        n, k = self.blocks.shape[:2]
        flat = (np.arange(n)[:, None] * k + numbers).ravel()
        return Net(self.information, self.by[flat], self.blocks[:, numbers][:, :, numbers])

    def turned(self, by: Array) -> "Net":
        """Of poses that follow these, each by its own (k, k) of ``by`` (n, k, k)."""
        moved = (_diagonal(by) @ self.by).tocsr()
        return Net(self.information, moved, by @ self.blocks @ np.swapaxes(by, 1, 2))

    def beside(self, other: "Net | None") -> "Net":
        """The sum with other errors of the same poses, independent of these."""
        from scipy import sparse  # noqa: PLC0415

        if other is None:
            return self
        both = sparse.block_diag((self.information, other.information), format="csc")
        by = sparse.hstack((self.by, other.by), format="csr")
        return Net(both, by, self.blocks + other.blocks)

    def matrix(self) -> Array:
        """(n k, n k) the covariance."""
        size = self.by.shape[0]
        count, k = self.blocks.shape[:2]
        found = self.times(np.eye(size).reshape(count, k, size)).reshape(size, size)
        return np.asarray((found + found.T) / 2)


def _diagonal(blocks: Array) -> Any:
    """(n k, n k) sparse matrix of blocks (n, k, k) on its diagonal."""
    from scipy import sparse  # noqa: PLC0415

    count, k = blocks.shape[:2]
    return sparse.bsr_array(
        (blocks, np.arange(count), np.arange(count + 1)), shape=(count * k,) * 2
    )


def sparse_factor(matrix: Any) -> Any:
    """A sparse symmetric matrix, factored: its ``solve`` solves equations.

    Raises
    ------
    RuntimeError
        If it is singular.
    """
    from scipy.sparse.linalg import splu  # noqa: PLC0415

    return splu(
        matrix.tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )


def inverse_blocks(factor: Any, size: int, count: int, k: int) -> Array:
    """(count, k, k) blocks on the diagonal of the inverse of a factored matrix, from the first on.

    Parameters
    ----------
    factor : object
        With ``solve``.
    size : int
        Of the matrix.
    count, k : int
        Number of the blocks, and theirs of numbers.
    """
    blocks = np.empty((count, k, k))
    step = max(COLUMNS // k, 1)
    for first in range(0, count, step):
        some = min(step, count - first)
        columns = factor.solve(np.eye(size, k * some, -k * first))
        block = columns[k * first : k * (first + some)].reshape(some, k, some, k)
        blocks[first : first + some] = block[range(some), :, range(some), :]
    return np.asarray((blocks + np.swapaxes(blocks, 1, 2)) / 2)
