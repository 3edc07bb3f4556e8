"""The pose of one body seen by cameras, and carrying parts, that are themselves known only so well.

The unknowns of cameras and parts do not take part in the search: what they do to the seen points
is linear over what their covariance allows, so it is added to the covariance of the points. Each
step then has six unknowns, and ends where an adjustment of all unknowns would end.
"""

from dataclasses import dataclass, replace

import numpy as np

from validation.poses.angles import Array
from vision_gt.least_squares.adjustment import MAX_STEPS, MOST_DAMPING, SINGULAR, SMALL_GAIN
from vision_gt.least_squares.setups import (
    Setup,
    Views,
    linearised_at,
    shared_slots,
    whiten,
)
from vision_gt.optics.transforms import rotation_matrices, rotation_vectors

_MAX_REWEIGHTINGS, _SMALL_CHANGE = 20, 1e-4
"""Of the robust weights at one pose, and what ends them: a change of the weights' roots that
changes a residual by less than a thousandth of its sigma. Twenty is a judgement."""


@dataclass(frozen=True)
class BodyPose:
    """The pose that fits best.

    Parameters
    ----------
    R, t : (3, 3) and (3,) arrays
        T_world_body.
    covariance : (6, 6) array
        From the points' noise and the prior, cameras and parts.
    own_covariance : (6, 6) array
        The part of it that comes from the points' noise and the prior.
    sensitivity : (6, g) array
        Change of the pose by the unknowns of cameras and parts.
    chi_square : float
        Of the points about the prediction, cameras and parts moving within their covariance.
    cost : float
        Half the sum of squares, of robust losses and of the priors.
    freedom : int
        Degrees of freedom.
    """

    R: Array
    t: Array
    covariance: Array
    own_covariance: Array
    sensitivity: Array
    chi_square: float
    cost: float
    freedom: int


@dataclass(frozen=True)
class _State:
    """The problem at one pose; all with the robust weights' roots multiplied in.

    ``left`` (2 n,) is what is left of the residuals once cameras and parts have moved as they
    should; ``inverse`` (2 n, 2 n) that of the covariance of the residuals.
    """

    R: Array
    t: Array
    off: Array
    cost: float
    left: Array
    residual: Array
    by_body: Array
    by_shared: Array
    inverse: Array


class MarginalPose:
    """One body's views, with cameras and parts that are known with a covariance.

    Parameters
    ----------
    views : Views
        Points of one body.
    cameras, parts : Setup
        Where both are; the body in it is not used.
    covariance : (g, g) array
        Of the unknowns of cameras (15 each) and parts (6 each).
    huber : float
        Length of a unit-variance residual from which on the loss is linear.
    """

    def __init__(self, views: Views, known: Setup, covariance: Array, huber: float) -> None:
        self.views, self.known, self.huber = views, known, huber
        self.covariance = covariance
        self.whitening = whiten(views.covariance)
        n = len(views)
        slots = shared_slots(views, len(known.R_camera))
        rows = np.arange(2 * n).reshape(n, 2, 1)
        self._places = (rows * len(covariance) + slots[:, None]).ravel()

    def solve(self, R: Array, t: Array, prior: Array) -> BodyPose:
        """The least cost from one start.

        Parameters
        ----------
        R, t : (3, 3) and (3,) arrays
            The start; also the mean of what the prior knows.
        prior : (6, 6) array
            Information about the body.

        Raises
        ------
        numpy.linalg.LinAlgError
            If the views and the prior leave the pose undetermined.

        Notes
        -----
        Levenberg-Marquardt on the marginal problem: with the derivatives A by the body and B by
        cameras and parts, of residuals r of unit variance, the covariance of r is
        S = I + B C B^T. Robust weights w scale r, A and B by their roots. Then S^-1 r is what is
        left of r at the best cameras and parts, so robust losses are those of an adjustment of
        all unknowns.
        """
        origin = (R, t)
        state = self._at(R, t, prior, origin)
        damping = 1e-6
        for _ in range(MAX_STEPS):
            normal = state.by_body.T @ state.inverse @ state.by_body + prior
            right = state.by_body.T @ state.left - prior @ state.off
            damped = normal.copy()
            damped.flat[::7] *= 1 + damping
            step = np.asarray(np.linalg.solve(damped, right), dtype=float)
            moved = rotation_matrices(step[3:]) @ state.R, state.t + step[:3]
            if 0.5 * float(step @ right) <= SMALL_GAIN:
                # So small a step changes neither derivatives nor weights.
                return self._result(state, moved, prior)
            trial = self._at(*moved, prior, origin)
            if trial.cost <= state.cost * (1 + 1e-14):
                state, damping = trial, max(damping / 10, 1e-12)
            else:
                damping *= 10
            if damping > MOST_DAMPING:
                break
        return self._result(state, (state.R, state.t), prior)

    def _at(self, R: Array, t: Array, prior: Array, origin: tuple[Array, Array]) -> _State:
        """The problem at a pose; of infinite cost where a point falls behind its camera."""
        at = replace(self.known, R_body=R[None], t_body=t[None])
        lin = linearised_at(self.views, at, self.whitening)
        n, g = len(self.views), len(self.covariance)
        residual, by_body = lin.residual.ravel(), lin.by_body.reshape(2 * n, 6)
        by_shared = np.zeros((2 * n, g))
        derivatives = np.concatenate([lin.by_camera, lin.by_part], axis=2)
        by_shared.reshape(-1)[self._places] = derivatives.reshape(-1)
        off = np.zeros(6)
        if prior.any():
            off = np.concatenate([t - origin[1], rotation_vectors(R @ origin[0].T)])
        cost = 0.5 * float(off @ prior @ off)
        if not np.isfinite(residual).all():
            cost, empty = np.inf, np.zeros((2 * n, 2 * n))
            return _State(R, t, off, cost, residual, residual, by_body, by_shared, empty)
        roots, inverse = self._weighted(residual, by_shared)
        residual = roots * residual
        left = inverse @ residual
        size2 = np.square(left / roots).reshape(n, 2).sum(1)
        far = size2 > self.huber**2
        losses = np.where(far, self.huber * (np.sqrt(size2) - 0.5 * self.huber), 0.5 * size2)
        cost += float(losses.sum()) + 0.5 * float(left @ (residual - left))
        column = roots[:, None]
        return _State(
            R, t, off, cost, left, residual, column * by_body, column * by_shared, inverse
        )

    def _weighted(self, residual: Array, by_shared: Array) -> tuple[Array, Array]:
        """Roots of the robust weights (2 n,) and the inverse covariance of what they weigh."""
        added = by_shared @ self.covariance @ by_shared.T
        roots: Array = np.ones(len(residual))
        for _ in range(_MAX_REWEIGHTINGS):
            spread = roots[:, None] * added * roots
            spread.flat[:: len(roots) + 1] += 1.0
            inverse = np.asarray(np.linalg.inv(spread), dtype=float)
            size = np.sqrt(np.square(inverse @ (roots * residual) / roots).reshape(-1, 2).sum(1))
            weights = np.minimum(1.0, self.huber / np.maximum(size, 1e-12))
            new = np.repeat(np.sqrt(weights), 2)
            change = float(np.abs(new - roots).max())
            if change < _SMALL_CHANGE:
                break
            roots = new
        return roots, np.asarray(inverse)

    def _result(self, state: _State, at: tuple[Array, Array], prior: Array) -> BodyPose:
        """The pose R, t, and covariances from the problem there or next to it."""
        if not np.isfinite(state.cost):
            raise np.linalg.LinAlgError("seen points would be behind their camera")
        weighted = state.by_body.T @ state.inverse
        normal = weighted @ state.by_body + prior
        scale = 1 / np.sqrt(np.maximum(np.diagonal(normal), 1e-300))
        values, vectors = np.linalg.eigh(scale[:, None] * normal * scale)
        if values[0] < SINGULAR:
            raise np.linalg.LinAlgError("too little is seen of the body to place it")
        vectors = scale[:, None] * vectors
        covariance = vectors / values @ vectors.T
        gain = covariance @ weighted
        own = gain @ gain.T + covariance @ prior @ covariance
        return BodyPose(
            *at,
            covariance,
            own,
            -gain @ state.by_shared,
            float(state.left @ state.residual),
            state.cost,
            2 * len(self.views) - 6 + int(np.linalg.matrix_rank(prior) if prior.any() else 0),
        )
