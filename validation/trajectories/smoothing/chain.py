"""Normal equations of a chain: each block is linked to the next one only.

The matrix is block-tridiagonal. It is held as a band and factored by LAPACK; the covariances of the
blocks, and of each with the next, come from one recursion backwards (the one of Rauch, Tung and
Striebel, in the form of the factor), without the inverse of the whole.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky_banded
from scipy.linalg.lapack import dpbtrs

from validation.errors import GtvalError
from validation.poses.angles import Array

CHUNK = 2048
"""Blocks that are handled at once: 12 by 12 numbers of so many are 2 MB, whatever the length."""


class Band:
    """The lower band of a symmetric block-tridiagonal matrix of n blocks of b by b.

    Parameters
    ----------
    n, b : int
        Blocks, and the rows of one.
    """

    def __init__(self, n: int, b: int) -> None:
        self.n, self.b = n, b
        # A row of this array is a column of the matrix, from its diagonal down: LAPACK's band.
        self.columns = np.zeros((n * b, 2 * b))

    def fill(self, start: int, diagonal: Array, below: Array) -> None:
        """Put blocks in their place.

        Parameters
        ----------
        start : int
            First block.
        diagonal : (c, b, b) array
            Blocks start, start + 1, ...
        below : (c, b, b) array
            The block below each of them; that of the last block of all is zero.
        """
        b, count = self.b, len(diagonal)
        part = self.columns[start * b : (start + count) * b].reshape(count, b, 2 * b)
        for column in range(b):
            part[:, column, : b - column] = diagonal[:, column:, column]
            part[:, column, b - column : 2 * b - column] = below[:, :, column]

    def factor(self) -> "Factor":
        """The Cholesky factor, in place of the matrix.

        Raises
        ------
        GtvalError
            If the data do not determine all blocks.
        """
        try:
            factored = cholesky_banded(
                self.columns.T, overwrite_ab=True, lower=True, check_finite=False
            )
        except np.linalg.LinAlgError as error:
            raise GtvalError("the poses do not determine the trajectory") from error
        return Factor(self.n, self.b, factored.T)


@dataclass(frozen=True)
class Factor:
    """Cholesky factor of a `Band`.

    Parameters
    ----------
    n, b : int
        Blocks, and the rows of one.
    columns : (n b, 2 b) array
        Columns of the factor, from the diagonal down.
    """

    n: int
    b: int
    columns: Array

    @property
    def log_determinant(self) -> float:
        """Natural logarithm of the determinant of the matrix."""
        return 2 * float(np.log(self.columns[:, 0]).sum())

    def solve(self, right: Array) -> Array:
        """The solution for right sides (n b, r)."""
        solution, _ = dpbtrs(self.columns.T, np.asfortranarray(right), lower=1)
        return np.asarray(solution).reshape(right.shape)

    def _blocks(self, start: int, stop: int) -> tuple[Array, Array]:
        """Blocks of the factor on the diagonal and below it, two (c, b, b)."""
        b, count = self.b, stop - start
        part = self.columns[start * b : stop * b].reshape(count, b, 2 * b)
        diagonal, below = np.zeros((count, b, b)), np.empty((count, b, b))
        for column in range(b):
            diagonal[:, column:, column] = part[:, column, : b - column]
            below[:, :, column] = part[:, column, b - column : 2 * b - column]
        return diagonal, below

    def covariances(self) -> Iterator[tuple[int, Array, Array]]:
        """Blocks of the inverse, in chunks from the last to the first.

        Yields
        ------
        start : int
            First block of the chunk.
        inverse : (c + 1, b, b) array
            Blocks on the diagonal, and the one after the chunk; zero after the last of all.
        beside : (c, b, b) array
            Of each block (rows) with the next (columns).

        Notes
        -----
        With L the factor, G = L_kk^-T L_(k+1)k^T: S_k = (L_kk L_kk^T)^-1 + G S_(k+1) G^T and
        S_k,k+1 = -G S_(k+1).
        """
        b = self.b
        after = np.zeros((b, b))
        for stop in range(self.n, 0, -CHUNK):
            start = max(0, stop - CHUNK)
            diagonal, below = self._blocks(start, stop)
            root = np.linalg.inv(diagonal)
            gains = np.swapaxes(below @ root, 1, 2)
            own = np.swapaxes(root, 1, 2) @ root
            inverse = np.empty((stop - start + 1, b, b))
            inverse[-1] = after
            for k in range(stop - start - 1, -1, -1):
                gain = gains[k]
                after = own[k] + gain.dot(after).dot(gain.T)
                inverse[k] = after
            yield start, inverse, -gains @ inverse[1:]
