"""Sparse normal equations of a graph of planar poses, gathered block by block."""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from laser_gt.scans.scan import Indices
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.factored import Factored
from validation.poses.nets import sparse_factor


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
    more : int
        Number of other unknowns, after these: errors that poses which are known share.
    """

    def __init__(self, count: int, more: int = 0) -> None:
        self.gradient = np.zeros(3 * count + more)
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

    def add_known(self, where: int, information: Array, off: Array) -> None:
        """Add a pose that is known itself.

        Parameters
        ----------
        where : int
            Which.
        information : (3, 3) array
            Inverse of its covariance.
        off : (3,) array
            The pose less what is known of it.
        """
        at = np.array([[where]], dtype=np.intp)
        self.add(at, np.eye(3)[None, None], information[None], off[None])

    def add_surveyed(self, where: Indices, known: Factored, off: Array, shared: Array) -> None:
        """Add poses that are known, with errors that they share; these are the other unknowns.

        Parameters
        ----------
        where : (p,) int array
            Which.
        known : Factored
            Their covariance, without a net.
        off : (p, 3) array
            The poses less what is known of them.
        shared : (r,) array
            The errors that they share, in standard deviations, as the columns of the factor.
        """
        own, factor, signs, _ = known
        information: Array = np.asarray(np.linalg.inv(own))
        weighted = information @ factor
        off = off - factor @ shared
        flat = 3 * where[:, None] + np.arange(3)
        last = len(self.gradient) - len(signs) + np.arange(len(signs))
        self._keep(information, flat[:, :, None], flat[:, None, :])
        self._keep(-weighted, flat[:, :, None], last[None, None, :])
        self._keep(-weighted, flat[:, :, None], last[None, None, :], turned=True)
        inside = np.diag(signs) + np.einsum("nkr,nks->rs", factor, weighted)
        self._keep(inside, last[:, None], last[None, :])
        np.add.at(self.gradient, flat, (information @ off[..., None])[..., 0])
        self.gradient[last] += signs * shared - np.einsum("nkr,nk->r", weighted, off)

    def _keep(
        self, values: Array, rows: Indices, columns: Indices, *, turned: bool = False
    ) -> None:
        rows, columns = np.broadcast_to(rows, values.shape), np.broadcast_to(columns, values.shape)
        if turned:
            rows, columns = columns, rows
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
        try:
            return sparse_factor(self.matrix())
        except RuntimeError:
            raise GtvalError(otherwise) from None
