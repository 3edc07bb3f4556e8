"""The covariance of many unknowns of which most hang together only through a few.

The stops of a survey share world points, Vframe and rig, and nothing else. Given these, each stop
stands alone. So the inverse of the normal matrix is a sum of small blocks, one for each stop, and
of a product of two narrow matrices; the whole of it, which grows with the square of the stops, is
never needed.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.linalg import solve_triangular
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from validation.poses.angles import Array

Index = npt.NDArray[np.intp]
_ROWS = 20_000
"""Rows of a design matrix whose leverage is found at a time: with 500 shared unknowns 80 MB."""


_SMALL = 200_000
"""Multiplications of one matrix product, fewer than those that a BLAS library shares among
threads: on a busy machine their waiting takes more processor time than the product."""


class NotDeterminedError(Exception):
    """A normal matrix is singular; ``columns`` are those among which the undetermined one is."""

    def __init__(self, columns: Index) -> None:
        super().__init__("singular normal matrix")
        self.columns = columns


@dataclass(frozen=True)
class SplitCovariance:
    """A covariance: blocks, and what is shared.

    Parameters
    ----------
    own : (u, u) sparse array
        Blocks of unknowns that stand together once the shared ones are known.
    shared : (u, k) array
        With ``middle`` between it and its transpose what the shared unknowns add.
    middle : (k, k) array or None
        None for the identity.
    """

    own: csr_array
    shared: Array
    middle: Array | None = None

    def __len__(self) -> int:
        return len(self.shared)

    def _weighted(self) -> Array:
        return self.shared if self.middle is None else self.shared @ self.middle

    @property
    def variances(self) -> Array:
        """(u,) diagonal."""
        return np.asarray(self.own.diagonal() + (self._weighted() * self.shared).sum(1))

    def block(self, rows: Index) -> Array:
        """(r, r) covariance of the given unknowns."""
        added = self._weighted()[rows] @ self.shared[rows].T
        whole = self.own[rows][:, rows].toarray() + added
        return np.asarray((whole + whole.T) / 2)

    def blocks(self, rows: Index) -> Array:
        """(n, s, s) covariances of n groups of s unknowns, whose rows are ``rows`` (n, s)."""
        n, s = rows.shape
        if n == 0:  # a sparse matrix without indices gives one number, not none
            return np.zeros((0, s, s))
        added = self._weighted()[rows] @ np.swapaxes(self.shared[rows], 1, 2)
        at = np.broadcast_to(rows[:, :, None], (n, s, s)).ravel()
        to = np.broadcast_to(rows[:, None, :], (n, s, s)).ravel()
        whole = np.asarray(self.own[at, to]).reshape(n, s, s) + added
        return np.asarray((whole + np.swapaxes(whole, 1, 2)) / 2)

    def times(self, right: Array) -> Array:
        """The covariance times a vector (u,) or matrix (u, m)."""
        return np.asarray(self.own @ right + self._weighted() @ (self.shared.T @ right))

    def leverage(self, design: csr_array) -> Array:
        """(o,) a^T C a for every row a of a design matrix (o, u)."""
        out = np.empty(design.shape[0])
        weighted = self._weighted()
        for rows in range(0, len(out), _ROWS):
            part = design[rows : rows + _ROWS]
            added = ((part @ weighted) * (part @ self.shared)).sum(1)
            alone = np.asarray((part @ self.own).multiply(part).sum(axis=1)).ravel()
            out[rows : rows + _ROWS] = added + alone
        return out

    @cached_property
    def dense(self) -> Array:
        """(u, u) all of it; for small networks."""
        return self.block(np.arange(len(self)))

    def less(self, along: Array, variance: float) -> "SplitCovariance":
        """The same less the outer product of ``along`` (u,) over ``variance``."""
        k = self.shared.shape[1]
        middle = np.zeros((k + 1, k + 1))
        middle[:k, :k] = np.eye(k) if self.middle is None else self.middle
        middle[k, k] = -1 / variance
        return replace(self, shared=np.column_stack([self.shared, along]), middle=middle)

    def between(self, normal: csr_array) -> "SplitCovariance":
        """C M C for a matrix M of the same pattern as that of which C is the inverse."""
        carried = self.own @ (normal @ self.shared)
        k = self.shared.shape[1]
        one = np.eye(k)
        middle = np.block([[self.shared.T @ (normal @ self.shared), one], [one, np.zeros((k, k))]])
        own = csr_array(self.own @ normal @ self.own)
        return SplitCovariance(own, np.column_stack([self.shared, carried]), middle)


def split_inverse(
    design: csr_array, is_shared: npt.NDArray[np.bool_], added: Array | None = None
) -> SplitCovariance:
    """The inverse of design^T design, of which the diagonal may be added to.

    Parameters
    ----------
    design : (o, u) sparse array
        Standardised and weighted design matrix.
    is_shared : (u,) array of bool
        Unknowns that many others hang on. Any choice is right; a good one leaves small groups.
    added : (u,) array, optional
        Of the diagonal.

    Raises
    ------
    NotDeterminedError
        If the matrix is singular.

    Notes
    -----
    With N = [[A, B], [B^T, D]], A being the blocks of the groups, and S = D - B^T A^-1 B:
    N^-1 = [[A^-1, 0], [0, 0]] + R S^-1 R^T, R = [-A^-1 B; 1]. With S = L L^T the second part is
    (R L^-T)(R L^-T)^T. Both parts are positive, so nothing cancels in their sum.
    """
    normal = csr_array(design.T @ design)
    if added is not None:
        rows = np.arange(len(added))
        normal = normal + csr_array((added, (rows, rows)), shape=normal.shape)
    normal = normal.tocoo()
    row, column, value = normal.row, normal.col, normal.data
    u, shared = len(is_shared), np.flatnonzero(is_shared)
    place = np.zeros(u, dtype=np.intp)
    place[shared] = np.arange(len(shared))
    inner = ~is_shared[row] & ~is_shared[column]
    graph = csr_array((np.ones(inner.sum()), (row[inner], column[inner])), shape=(u, u))
    _, group = connected_components(graph, directed=False)
    own = np.flatnonzero(~is_shared)
    order = own[np.argsort(group[own], kind="stable")]
    _, first, count = np.unique(group[order], return_index=True, return_counts=True)
    position = np.zeros(u, dtype=np.intp)
    position[order] = np.arange(len(order)) - np.repeat(first, count)
    member = np.zeros(u, dtype=np.intp)
    member[order] = np.repeat(np.arange(len(first)), count)
    S = np.zeros((len(shared), len(shared)))
    outer = is_shared[row] & is_shared[column]
    S[place[row[outer]], place[column[outer]]] = value[outer]
    reach = np.zeros((u, len(shared)))
    reach[shared, place[shared]] = 1.0
    pieces: list[tuple[Array, Index]] = []
    for size in np.unique(count):
        chosen = np.flatnonzero(count == size)
        slot = np.full(len(first), -1, dtype=np.intp)
        slot[chosen] = np.arange(len(chosen))
        columns = order[first[chosen][:, None] + np.arange(size)]
        mine = ~is_shared[row]
        mine[mine] = slot[member[row[mine]]] >= 0
        A = np.zeros((len(chosen), size, size))
        at = mine & ~is_shared[column]
        A[slot[member[row[at]]], position[row[at]], position[column[at]]] = value[at]
        B = np.zeros((len(chosen), size, len(shared)))
        at = mine & is_shared[column]
        B[slot[member[row[at]]], position[row[at]], place[column[at]]] = value[at]
        inverse = _inverse(A, columns)
        gain = inverse @ B
        S -= _crossed(B, gain)
        reach[columns.ravel()] = -gain.reshape(-1, len(shared))
        pieces.append((inverse, columns))
    S = (S + S.T) / 2
    try:
        root = np.linalg.cholesky(S)
    except np.linalg.LinAlgError:
        raise NotDeterminedError(shared) from None
    one = np.eye(len(shared))
    upper = solve_triangular(root, one, lower=True, check_finite=False).T
    return SplitCovariance(_block_diagonal(pieces, u), _narrow(reach, upper))


def _crossed(B: Array, gain: Array) -> Array:
    """(k, k) sum over all groups of B^T gain, both (g, s, k)."""
    g, k = len(B), B.shape[-1]
    total = np.zeros((k, k))
    size = max(_SMALL // max(k * k, 1), 1)
    for first in range(0, g, size):
        some = slice(first, first + size)
        total += (np.swapaxes(B[some], 1, 2) @ gain[some]).sum(0)
    return total


def _narrow(tall: Array, square: Array) -> Array:
    """(u, k) the product of a tall matrix (u, k) and a square one, by blocks of rows."""
    u, k = tall.shape
    out = np.empty((u, k))
    size = max(_SMALL // max(k * k, 1), 1)
    for first in range(0, u, size):
        np.matmul(tall[first : first + size], square, out=out[first : first + size])
    return out


def _inverse(A: Array, columns: Index) -> Array:
    """Inverses of positive blocks (g, s, s); names those that are not by their columns (g, s)."""
    try:
        np.linalg.cholesky(A)
    except np.linalg.LinAlgError:
        scale = np.sqrt(np.maximum(np.diagonal(A, axis1=1, axis2=2), np.finfo(float).tiny))
        least = np.linalg.eigvalsh(A / scale[:, :, None] / scale[:, None, :])[:, 0]
        raise NotDeterminedError(columns[int(least.argmin())]) from None
    inverse = np.linalg.inv(A)
    return np.asarray((inverse + np.swapaxes(inverse, 1, 2)) / 2)


def _block_diagonal(pieces: list[tuple[Array, Index]], u: int) -> csr_array:
    """A sparse array (u, u) of blocks (g, s, s) at columns (g, s)."""
    if not pieces:
        return csr_array((u, u))
    rows = [np.repeat(at, at.shape[1], axis=1).ravel() for _, at in pieces]
    columns = [np.tile(at, (1, at.shape[1])).ravel() for _, at in pieces]
    values = np.concatenate([block.ravel() for block, _ in pieces])
    return csr_array((values, (np.concatenate(rows), np.concatenate(columns))), shape=(u, u))
