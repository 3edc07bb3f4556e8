"""The iterated extended Kalman filter of the document, for one start and for many at once.

Each pass starts again from the a-priori covariance and from the previous estimate, linearises
all readings there and updates. This is a Gauss-Newton descent, and it stops when a pass no
longer moves the estimate. The document re-linearises after every single reading and always runs
20 passes; linearising a pass at one point makes the result independent of the order of the
readings, and is what makes its fixed point the least-squares solution.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from filterpy.kalman import ExtendedKalmanFilter

from validation.angles import Array

PASSES = 20
STEP_TOLERANCE = 1e-9
"""A pass that moves the estimate by less (metres, radians) is the last."""

Model = Callable[[Array], tuple[Array, Array, Array]]
"""State (n,) -> h (m,), H (m, n), R (m, m)."""

BatchModel = Callable[[Array], tuple[Array, Array, Array]]
"""States (b, n) -> h (b, m), H (b, m, n), variances (b, m)."""


@dataclass(frozen=True)
class Estimate:
    """Where an iteration ended.

    Parameters
    ----------
    state : (n,) array
        Estimate.
    covariance : (n, n) array
        Its covariance.
    cost : float
        h^T R^-1 h there, chi-squared with m - n degrees of freedom if all sigmas are right.
    passes : int
        Passes used.
    converged : bool
        Whether the last pass moved it by less than the tolerance.
    """

    state: Array
    covariance: Array
    cost: float
    passes: int
    converged: bool


def iterated_ekf(model: Model, start: Array, prior_sigma: Array, passes: int = PASSES) -> Estimate:
    """The estimate that the iterated filter reaches from one start.

    Parameters
    ----------
    model : callable
        State (n,) to h (m,), its derivative H (m, n) and its covariance R (m, m).
    start : (n,) array
        First guess.
    prior_sigma : (n,) array
        sigma[0], restored at every pass.
    passes : int
        At most so many.

    Raises
    ------
    numpy.linalg.LinAlgError
        If R is not positive definite.

    Notes
    -----
    AD2.3, listings of the two filters. The m whitened readings are first turned (QR) so that n
    combinations of them hold all that they say of the state; the other m - n do not depend on
    it. The filter then inverts n x n instead of m x m matrices, and the vast a-priori covariance
    costs no digits.
    """
    n = len(start)
    ekf = ExtendedKalmanFilter(dim_x=n, dim_z=n)
    ekf.x = np.array(start, dtype=float)
    prior = np.diag(np.square(prior_sigma))
    ekf.R = np.eye(n)
    converged, done = False, 0
    for done in range(1, passes + 1):
        at = ekf.x
        residual, jacobian, _ = _compressed(model, at)
        ekf.P = prior.copy()
        ekf.update(-residual, HJacobian=lambda _x, H=jacobian: H, Hx=lambda _x: np.zeros(n))
        converged = bool(np.abs(ekf.x - at).max() < STEP_TOLERANCE)
        if converged:
            break
    _, _, cost = _compressed(model, ekf.x)
    return Estimate(ekf.x, (ekf.P + ekf.P.T) / 2, cost, done, converged)


def _compressed(model: Model, state: Array) -> tuple[Array, Array, float]:
    """n whitened combinations of the readings, their derivative, and the whole cost."""
    h, H, R = model(state)
    root = np.linalg.cholesky(R)
    white = np.linalg.solve(root, np.column_stack([H, h]))
    q, r = np.linalg.qr(white[:, :-1])
    return q.T @ white[:, -1], r, float(white[:, -1] @ white[:, -1])


@dataclass(frozen=True)
class Estimates:
    """Where a batch of iterations ended: arrays with a leading axis of b starts."""

    state: Array
    cost: Array
    passes: npt.NDArray[np.intp]
    converged: npt.NDArray[np.bool_]


def iterated_ekf_batch(
    model: BatchModel, starts: Array, prior_sigma: Array, passes: int = PASSES
) -> Estimates:
    """The estimates that the iterated filter reaches from many starts at once.

    Parameters
    ----------
    model : callable
        States (b, n) to h (b, m), H (b, m, n) and the variances (b, m) of h, readings being
        independent.
    starts : (b, n) array
        First guesses.
    prior_sigma : (n,) array
        sigma[0], restored at every pass.
    passes : int
        At most so many.

    Notes
    -----
    The same iteration as `iterated_ekf`, in its information form: the step is
    -(H^T R^-1 H + P0^-1)^-1 H^T R^-1 h. Starts that have settled leave the batch.
    """
    state = np.array(starts, dtype=float)
    b, n = state.shape
    used = np.full(b, passes, dtype=np.intp)
    converged = np.zeros(b, dtype=bool)
    cost = np.full(b, np.nan)
    active = np.arange(b)
    prior = np.diag(1 / np.square(prior_sigma))
    with np.errstate(over="ignore", invalid="ignore"):
        for done in range(1, passes + 1):
            h, H, variance = model(state[active])
            weighted = H / variance[..., None]
            information = np.swapaxes(weighted, -1, -2) @ H + prior
            gradient = (weighted * h[..., None]).sum(-2)
            step = _solve_small(information, gradient)
            cost[active] = (h**2 / variance).sum(-1)
            state[active] -= step
            size = np.abs(step).max(-1)
            settled = size < STEP_TOLERANCE
            converged[active[settled]] = True
            used[active[settled]] = done
            active = active[~settled & np.isfinite(size)]
            if active.size == 0:
                break
        if active.size:
            h, _, variance = model(state[active])
            cost[active] = (h**2 / variance).sum(-1)
    return Estimates(state, cost, used, converged)


def _solve_small(A: Array, b: Array) -> Array:
    """Solutions of (b, n, n) symmetric systems; NaN where singular."""
    if A.shape[-1] == 2:
        det = A[..., 0, 0] * A[..., 1, 1] - A[..., 0, 1] ** 2
        x = A[..., 1, 1] * b[..., 0] - A[..., 0, 1] * b[..., 1]
        y = A[..., 0, 0] * b[..., 1] - A[..., 0, 1] * b[..., 0]
        return np.stack([x, y], axis=-1) / np.where(det > 0, det, np.nan)[..., None]
    finite = np.isfinite(A).all((-1, -2))
    safe = np.where(finite[..., None, None], A, np.eye(A.shape[-1]))
    return np.where(finite[..., None], np.linalg.solve(safe, b[..., None])[..., 0], np.nan)
