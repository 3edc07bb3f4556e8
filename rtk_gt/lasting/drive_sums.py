"""What the distances of a whole drive say of an error that begins and ends at any two epochs.

Least squares of the error's three numbers, with the offsets and the distances free. Sums from the
first epoch on serve all beginnings and ends at once.
"""

from dataclasses import dataclass

import numpy as np

from rtk_gt.lasting.causes import USUAL
from rtk_gt.receivers.fixes import Ints
from validation.poses.angles import Array


@dataclass(frozen=True)
class DriveSums:
    """Sums over the epochs before each of n + 1 edges, weighted; of one receiver's error.

    Parameters
    ----------
    own : (k, k) array
        Information of the drive on offsets and distances.
    rest : (k,) array
        Their change without an error, metres.
    crossed : (n + 1, k, 3 or 4) array
        Products of their designs with that of the error.
    solved : (n + 1, k, 3 or 4) array
        The same, solved for offsets and distances.
    information : (n + 1, 3 or 4, 3 or 4) array
        Of the error, with offsets and distances known.
    right : (n + 1, 3 or 4) array
        Products of its design with the residuals.
    """

    own: Array
    rest: Array
    crossed: Array
    solved: Array
    information: Array
    right: Array

    @classmethod
    def of(cls, own: Array, error: Array, residuals: Array, weight: Array) -> "DriveSums":
        """From designs (n, p, k) and (n, p, 3), residuals (n, p) and their weight (p, p).

        A fourth column of the error's design is what its size adds besides, and counts once.
        """
        left = own.transpose(0, 2, 1) @ weight
        square = np.tensordot(left, own, ((0, 2), (0, 1)))
        square = square + 1e-9 * np.trace(square) * np.eye(len(square))
        weighed = error.transpose(0, 2, 1) @ weight
        crossed = _summed(left @ error)
        return cls(
            square,
            np.linalg.solve(square, (left @ residuals[..., None]).sum(0)[:, 0]),
            crossed,
            np.linalg.solve(square, crossed),
            _summed(weighed @ error),
            _summed((weighed @ residuals[..., None])[..., 0]),
        )

    def fit(self, first: Ints, last: Ints) -> tuple[Array, Array, Array]:
        """Sizes (m, 3), covariances (m, 3, 3) and gains (m,) of errors from a first epoch on.

        Parameters
        ----------
        first, last : (m,) int arrays
            The first epoch with the error, and the first without it again.
        """
        return _solved(*self._evidence(first, last))

    def gains_of(self, first: Ints, last: Ints, known: tuple[Array, Array]) -> Array:
        """(m,) gains of an error of a known size, with its covariance, in the epochs [first, last).

        The design is that about this size, with its fourth column.
        """
        information, score = self._evidence(first, last)
        size = np.append(known[0], 1.0)
        gains = 2 * score @ size - np.einsum("mab,a,b->m", information, size, size)
        right = (score - information @ size)[:, :3]
        free = information[:, :3, :3] + np.linalg.inv(known[1])
        better = np.linalg.solve(free, right[..., None])[..., 0]
        return np.asarray(gains + (better * right).sum(1))

    def size_of(self, first: int, last: int, known: tuple[Array, Array]) -> tuple[Array, Array]:
        """Size (3,) and covariance of such an error, by the drive and by what is known of it."""
        information, score = (
            some[0] for some in self._evidence(np.array([first]), np.array([last]))
        )
        right = (score - information @ np.append(known[0], 1.0))[:3]
        covariance = np.linalg.inv(information[:3, :3] + np.linalg.inv(known[1]))
        return known[0] + covariance @ right, np.asarray(covariance, dtype=float)

    def _evidence(self, first: Ints, last: Ints) -> tuple[Array, Array]:
        """Information on errors in the epochs [first, last), offsets free, and their scores."""
        crossed = self.crossed[last] - self.crossed[first]
        solved = self.solved[last] - self.solved[first]
        information = self.information[last] - self.information[first]
        information = information - np.swapaxes(crossed, 1, 2) @ solved
        score = self.right[last] - self.right[first] - np.einsum("mka,k->ma", crossed, self.rest)
        return information, score

    def change(self, first: int, last: int, size: Array) -> Array:
        """(k,) change of offsets and distances with an error of this size."""
        whole = np.append(size, np.ones(self.right.shape[1] - 3))
        return np.asarray(self.rest - (self.solved[last] - self.solved[first]) @ whole)

    def gain_of_slow(self, first: int, last: int, reach: int) -> float:
        """Gain of an error that comes, and goes, evenly over ``reach`` epochs to both sides.

        It is the mean of errors that begin and end earlier and later by up to as much. One that
        stays to the end of the drive does not go.
        """
        end = len(self.right) - 1
        shifts = np.arange(-reach, reach + 1)
        begins = first + shifts
        ends = np.full(len(shifts), last) if last == end else last + shifts
        begins, ends = np.clip(begins, 0, end), np.clip(ends, 0, end)
        crossed = (self.crossed[ends] - self.crossed[begins]).mean(0)
        right = (self.right[ends] - self.right[begins]).mean(0)
        # Two of them tell their product where both last.
        late, early = np.maximum.outer(begins, begins), np.minimum.outer(ends, ends)
        early = np.maximum(early, late)
        both = (self.information[early] - self.information[late]).mean((0, 1))
        information = both - crossed.T @ np.linalg.solve(self.own, crossed)
        score = right - crossed.T @ self.rest
        return float(_solved(information[None], score[None])[2][0])


def _solved(information: Array, score: Array) -> tuple[Array, Array, Array]:
    """Sizes (m, 3), covariances and gains; a fourth number is 1."""
    free = information[:, :3, :3] + np.eye(3) * USUAL**-2
    right = score[:, :3] - information[:, :3, 3:].sum(2)
    spreads = np.asarray(np.linalg.inv(free), dtype=float)
    sizes = np.einsum("mab,mb->ma", spreads, right)
    gains = (sizes * right).sum(1)
    if score.shape[1] > 3:
        gains = gains + 2 * score[:, 3] - information[:, 3, 3]
    return sizes, spreads, gains


def _summed(values: Array) -> Array:
    """(n + 1, ...) sums of the values before each edge."""
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
