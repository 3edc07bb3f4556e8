"""What more unknowns would gain, to first order, without solving anew.

A hypothesis adds columns to the design matrix. With everything else adjusted along, its information
is the Schur complement S = C'WC - C'WA (A'WA)^-1 A'WC, its slope g = C'Wr at the solution, and the
chi-squared falls by g'(S + P)^-1 g, where P is what is known of the numbers before looking.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.linalg import splu

from validation.poses.angles import Array
from vision_gt.causes.trial import Solved, slope_of_bounded
from vision_gt.least_squares.setups import (
    CAMERA_UNKNOWNS,
    Ints,
    Linearised,
    linearised_at,
    whiten,
)
from vision_gt.optics.transforms import planar_jacobian, planar_pose


@dataclass(frozen=True)
class Gain:
    """More unknowns, to first order.

    Parameters
    ----------
    information : (k, k) array
        Of the numbers, all else adjusted along.
    slope : (k,) array
        Of half the chi-squared.
    """

    information: Array
    slope: Array

    def sizes(self, prior: Array) -> Array:
        """(k,) the numbers, known before to standard deviations ``prior`` (k,)."""
        return np.asarray(np.linalg.solve(self.information + np.diag(prior**-2.0), self.slope))

    def worth(self, prior: Array) -> float:
        """What they gain less what it costs that they are free (see `occam`)."""
        return float(self.slope @ self.sizes(prior)) - self.occam(prior)

    def occam(self, prior: Array) -> float:
        """Log det of the prior covariance over that afterwards."""
        scaled = prior[:, None] * self.information * prior
        return float(np.linalg.slogdet(np.eye(len(prior)) + scaled)[1])


class Linear:
    """The equations at a solution, ready for more columns.

    Parameters
    ----------
    at : Solved
        The solution.
    bounded : bool
        Whether groups that do not fit count by the slope of their bounded misfit. The solution is
        not at rest under these weights; what it would still move is taken into account.
    """

    def __init__(self, at: Solved, *, bounded: bool = True) -> None:
        self.at = at
        evidence = at.evidence
        self.lin: Linearised = linearised_at(
            evidence.views, at.setup, whiten(evidence.views.covariance)
        )
        weights = at.adjustment.weights
        if bounded:
            weights = slope_of_bounded(at.misfits, at.counts)[evidence.group]
        self.root = np.sqrt(weights)
        known = evidence.knowledge
        self.free = np.flatnonzero(known.free)
        g, b = len(self.free), len(at.setup.R_body)
        self.place = np.full(len(known.free), -1)
        self.place[self.free] = np.arange(g)
        self.size = g + 6 * b
        self.A = self._design(np.arange(len(evidence.views)))
        bodies = g + 6 * np.arange(b)[:, None, None]
        i = bodies + np.arange(6)[:, None] + np.zeros((1, 6), dtype=int)
        j = bodies + np.arange(6) + np.zeros((6, 1), dtype=int)
        shared = known.shared[np.ix_(self.free, self.free)]
        rows, columns = np.nonzero(shared)
        # Nothing is singular: a part in 1e12 of what the images say, where they say nothing.
        normal = (self.A.T @ self.A).tocsc()
        least = 1e-12 * normal.diagonal().max()
        prior = coo_array(
            (
                np.concatenate(
                    [shared[rows, columns], known.bodies.ravel(), np.full(self.size, least)]
                ),
                (
                    np.concatenate([rows, i.ravel(), np.arange(self.size)]),
                    np.concatenate([columns, j.ravel(), np.arange(self.size)]),
                ),
            ),
            shape=(self.size, self.size),
        )
        self.solver = splu(csc_array(normal + prior.tocsc()))
        off, bodies_off = at.setup.change_from(evidence.setup)
        right = self.A.T @ (self.lin.residual * self.root[:, None]).ravel()
        right[:g] -= (known.shared @ off)[self.free]
        right[g:] -= (known.bodies @ bodies_off[..., None]).ravel()
        self.rest = self.solver.solve(right)

    def _design(self, rows: Ints) -> csc_array:
        """(2 r, u) weighted columns of all free unknowns."""
        views, lin = self.at.evidence.views, self.lin
        c = len(self.at.setup.R_camera)
        g = len(self.free)
        camera = CAMERA_UNKNOWNS * views.camera[rows][:, None] + np.arange(CAMERA_UNKNOWNS)
        part = CAMERA_UNKNOWNS * c + 6 * views.part[rows][:, None] + np.arange(6)
        body = g + 6 * views.body[rows][:, None] + np.arange(6)
        where = np.concatenate([self.place[camera], self.place[part], body], 1)
        values = np.concatenate([lin.by_camera[rows], lin.by_part[rows], lin.by_body[rows]], 2)
        values = values * self.root[rows][:, None, None]
        r = len(rows)
        row = np.broadcast_to(2 * np.arange(r)[:, None, None] + np.arange(2)[:, None], values.shape)
        column = np.broadcast_to(where[:, None], values.shape)
        used = column >= 0
        return coo_array(
            (values[used], (row[used], column[used])), shape=(2 * r, self.size)
        ).tocsc()

    def columns(self, rows: Ints, columns: Array) -> Gain:
        """More columns (r, 2, k) of the corners ``rows`` (r,).

        Parameters
        ----------
        rows : (r,) array of int
            Corners.
        columns : (r, 2, k) array
            Derivatives of their whitened predictions.
        """
        root = self.root[rows]
        C = (columns * root[:, None, None]).reshape(2 * len(rows), -1)
        residual = (self.lin.residual[rows] * root[:, None]).ravel()
        if len(rows) == len(self.root):
            A = self.A
        else:
            both = np.stack([2 * rows, 2 * rows + 1], 1).ravel()
            A = self.by_row[both]
        mixed = np.asarray(A.T @ C)
        S = C.T @ C - mixed.T @ self.solver.solve(mixed)
        return Gain(0.5 * (S + S.T), C.T @ residual - mixed.T @ self.rest)

    def stop_poses(self) -> tuple[Array, Array]:
        """(s, 3) poses x, y, theta of the stops, and their joint covariance (3 s, 3 s)."""
        rows = self.at.evidence.stop_bodies()
        setup = self.at.setup
        columns = np.zeros((self.size, 3 * len(rows)))
        for k, row in enumerate(rows):
            place = len(self.free) + 6 * row
            columns[place : place + 6, 3 * k : 3 * k + 3] = planar_jacobian(setup.R_body[row]).T
        covariance = columns.T @ self.solver.solve(columns)
        T = setup.T_world_body
        poses = np.array([planar_pose(T[int(row)]) for row in rows]).reshape(-1, 3)
        return poses, 0.5 * (covariance + covariance.T)

    @cached_property
    def by_row(self) -> csr_array:
        """The design by its rows."""
        return self.A.tocsr()

    def released(self, slots: Ints, information: Array, off: Array, numbers: Ints) -> Gain:
        """What it gains to let some numbers of a thing go from where they were stated to be.

        Parameters
        ----------
        slots : (k,) array of int
            Of the thing's unknowns: shared ones first, then six of each body.
        information : (k, k) array
            With which they are held.
        off : (k,) array
            How far from there they are now.
        numbers : (m,) array of int
            Which of the k are let go.
        """
        columns = np.zeros((self.size, len(slots)))
        columns[slots, np.arange(len(slots))] = 1.0
        covariance = self.solver.solve(columns)[slots]
        S = information - information @ covariance @ information
        slope = information @ (off + self.rest[slots])
        return Gain((0.5 * (S + S.T))[np.ix_(numbers, numbers)], slope[numbers])
