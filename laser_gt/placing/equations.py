"""Sparse normal equations of a graph of planar poses, gathered block by block."""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from laser_gt.scans.scan import Indices
from validation.errors import GtvalError
from validation.poses.angles import Array


class Joined(Protocol):
    """What joins two poses of a graph."""

    @property
    def start(self) -> int:
        """The one pose."""

    @property
    def end(self) -> int:
        """The other."""


def ends_of(edges: Sequence[Joined]) -> Indices:
    """(m, 2) poses that each edge joins."""
    return np.array([(edge.start, edge.end) for edge in edges], dtype=np.intp).reshape(-1, 2)


class Equations:
    """Information matrix and gradient of n unknown poses of three numbers each.

    Parameters
    ----------
    count : int
        n, the mount included where it is an unknown.
    """

    def __init__(self, count: int) -> None:
        self.gradient = np.zeros(3 * count)
        self._parts: list[tuple[Array, Indices, Indices]] = []

    def add(self, where: Indices, jacobians: Array, information: Array, off: Array) -> None:
        """Add measurements of three numbers each.

        Parameters
        ----------
        where : (m, k) array
            The k poses that each depends on.
        jacobians : (m, k, 3, 3) array
            Derivatives of the residuals by these poses.
        information : (m, 3, 3) array
            Inverse covariances of the measurements.
        off : (m, 3) array
            Residuals: predicted less measured.
        """
        weighted = np.swapaxes(jacobians, -1, -2) @ information[:, None]
        flat = 3 * where[..., None] + np.arange(3)
        self._keep(
            weighted[:, :, None] @ jacobians[:, None],
            flat[:, :, None, :, None],
            flat[:, None, :, None, :],
        )
        np.add.at(self.gradient, flat, (weighted @ off[:, None, :, None])[..., 0])

    def add_known(self, where: npt.ArrayLike, information: npt.ArrayLike, off: Array) -> None:
        """Add poses that are known themselves, all together.

        Parameters
        ----------
        where : (p,) array-like of int
            Which poses.
        information : (3p, 3p) array-like
            Inverse of their joint covariance.
        off : (p, 3) array
            The poses less what is known of them.
        """
        flat = (3 * np.asarray(where, dtype=np.intp)[:, None] + np.arange(3)).ravel()
        known = np.asarray(information, dtype=float)
        self._keep(known, flat[:, None], flat[None, :])
        self.gradient[flat] += known @ off.ravel()

    def _keep(self, values: Array, rows: Indices, columns: Indices) -> None:
        rows, columns = np.broadcast_to(rows, values.shape), np.broadcast_to(columns, values.shape)
        self._parts.append((values.ravel(), rows.ravel(), columns.ravel()))

    def matrix(self) -> Any:
        """The information matrix, (3n, 3n), sparse."""
        from scipy import sparse  # noqa: PLC0415  (loaded when a graph is solved)

        values, rows, columns = (np.concatenate(part) for part in zip(*self._parts, strict=True))
        size = self.gradient.size
        return sparse.coo_array((values, (rows, columns)), shape=(size, size)).tocsc()

    def factor(self, otherwise: str) -> Any:
        """The factored information matrix.

        Raises
        ------
        GtvalError
            With the text ``otherwise``, if it is singular.
        """
        from scipy.sparse.linalg import splu  # noqa: PLC0415

        try:
            return splu(self.matrix(), permc_spec="MMD_AT_PLUS_A")
        except RuntimeError:
            raise GtvalError(otherwise) from None
