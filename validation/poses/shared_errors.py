"""What the errors of different poses of tables have in common, without a matrix of all poses."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from validation.poses.nets import Net
from validation.poses.pose_table import PoseTable


@dataclass(frozen=True)
class SharedErrors:
    """The covariance between different ones of n poses of k numbers each.

    Parameters
    ----------
    factor : (n, k, r) array
        That between two different poses is the product of their rows; a survey of any number of
        stops has one column for each unknown of its marks.
    signs : (r,) array
        1 or -1 for each column, which is added or taken away.
    whole : (n, k, n, k) array, optional
        What is added to it, where no factor is known; zero between a pose and itself.
    net : Net, optional
        What is added to it of poses in a net, between different ones.
    """

    factor: Array
    signs: Array
    whole: Array | None = None
    net: Net | None = None

    def select(self, rows: npt.NDArray[np.intp]) -> "SharedErrors":
        """Of the poses in the given rows."""
        whole = None if self.whole is None else self.whole[rows][:, :, rows]
        net = None if self.net is None else self.net.select(rows)
        return SharedErrors(self.factor[rows], self.signs, whole, net)

    def only(self, numbers: npt.NDArray[np.intp]) -> "SharedErrors":
        """Of some of the numbers of each pose."""
        whole = None if self.whole is None else self.whole[:, numbers][..., numbers]
        net = None if self.net is None else self.net.only(numbers)
        return SharedErrors(self.factor[:, numbers], self.signs, whole, net)

    def matrix(self) -> Array:
        """(n, k, n, k) covariance between different poses; zero between a pose and itself."""
        signed = self.factor * self.signs
        found = np.einsum("nkr,mlr->nkml", signed, self.factor, optimize=True)
        if self.whole is not None:
            found = found + self.whole
        if self.net is not None:
            found = found + self.net.matrix().reshape(found.shape)
        found[np.arange(len(found)), :, np.arange(len(found))] = 0.0
        return np.asarray(found)

    def seen_by(self, gain: Array) -> Array:
        """(p, p) covariance of ``gain`` (p, n, k) times the errors, without what poses have alone.

        It is no covariance of its own: poses alone are left out, so it may be negative.
        """
        each = np.einsum("pnk,nkr->npr", gain, self.factor)
        together = each.sum(0)
        found = (together * self.signs) @ together.T
        found = found - np.einsum("npr,nqr->pq", each * self.signs, each)
        if self.whole is not None:
            found = found + np.einsum("pni,nimj,qmj->pq", gain, self.whole, gain)
        if self.net is not None:
            moved = self.net.times(np.moveaxis(gain, 0, 2))
            moved = moved - self.net.blocks @ np.moveaxis(gain, 0, 2)
            found = found + np.einsum("pnk,nkq->pq", gain, moved)
        return np.asarray(found)


def shared_errors(tables: Sequence[PoseTable]) -> SharedErrors | None:
    """Those of tables of the same stops, independent of each other; None where none states any.

    Parameters
    ----------
    tables : sequence of PoseTable
        With a joint covariance, or a factor or net in its place, or neither.
    """
    parts: list[tuple[Array, Array]] = []
    whole: Array | None = None
    net: Net | None = None
    for table in tables:
        n, k = table.poses.shape
        if table.net is not None:
            net = table.net.beside(net)
        if table.factor is not None:
            parts.append(table.shared_part())
        elif table.joint is not None:
            between = np.array(table.joint, dtype=float).reshape(n, k, n, k)
            between[np.arange(n), :, np.arange(n)] = 0.0
            whole = between if whole is None else whole + between
    if not parts and whole is None and net is None:
        return None
    factor = np.concatenate([np.zeros((n, k, 0)), *(rows for rows, _ in parts)], axis=2)
    signs = np.concatenate([np.zeros(0), *(one for _, one in parts)])
    return SharedErrors(factor, signs, whole, net)
