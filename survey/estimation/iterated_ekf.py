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

from survey.estimation.filterpy_filter import extended_kalman_filter
from validation.poses.angles import Array

PASSES = 20
"""As in the document."""
STEP_TOLERANCE = 1e-9
"""A pass that moves the estimate by less (metres, radians) is the last: far below the millimetre
of a reading, and above the rounding of coordinates of a kilometre (1e-13)."""
WORKING_ELEMENTS = 15_000
"""Starts times readings iterated at a time: enough to make the cost of a call small, few enough
for the cache and for the allocator to keep the memory from one operation to the next."""

Model = Callable[[Array], tuple[Array, Array, Array]]
"""State (n,) -> h (m,), H (m, n), R (m, m)."""

BatchModel = Callable[[Array, npt.NDArray[np.intp]], tuple[Array, Array, Array]]
"""States (b, n) and which of the starts they come from (b,) -> h (b, m), H (b, m, n), variances
(b, m)."""


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
    ekf = extended_kalman_filter(dim_x=n, dim_z=n)
    ekf.x = np.array(start, dtype=float)
    prior = np.diag(np.square(prior_sigma))
    ekf.R = np.eye(n)
    converged, done = False, 0
    for done in range(1, passes + 1):  # noqa: B007  (reported below)
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
    """As many whitened combinations of the readings as unknowns, their derivative, and the cost."""
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
        States (b, n), and which starts they come from (b,), to h (b, m), H (b, m, n) and the
        variances (b, m) of h, readings being independent. It is quickest where each column of H
        lies in memory in one piece.
    starts : (b, n) array
        First guesses.
    prior_sigma : (n,) array
        sigma[0], restored at every pass.
    passes : int
        At most so many.

    Notes
    -----
    The same iteration as `iterated_ekf`, in its information form: the step is
    -(H^T R^-1 H + P0^-1)^-1 H^T R^-1 h. Only so many starts are iterated at a time; those that
    have settled make room for the next, so that a few slow ones keep nobody waiting and the
    arrays stay small.
    """
    state = np.array(starts, dtype=float)
    b = len(state)
    used = np.zeros(b, dtype=np.intp)
    converged = np.zeros(b, dtype=bool)
    cost = np.full(b, np.nan)
    prior = 1 / np.square(np.asarray(prior_sigma, dtype=float))
    room = _working_set(model, state)
    active = np.arange(min(room, b))
    following = active.size
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        while active.size:
            step, cost[active] = _gauss_newton_step(model, state[active], active, prior)
            state[active] -= step
            used[active] += 1
            size = np.abs(step).max(-1)
            converged[active] = size < STEP_TOLERANCE
            stays = (size >= STEP_TOLERANCE) & (size < np.inf) & (used[active] < passes)
            last = min(following + room - int(stays.sum()), b)
            active = np.append(active[stays], np.arange(following, last))
            following = last
        for rows in np.array_split(np.flatnonzero(~converged), b // room + 1):
            h, _, variance = model(state[rows], rows)
            cost[rows] = (h**2 / variance).sum(-1)  # the last pass of these moved far
    return Estimates(state, cost, used, converged)


StackedModel = Callable[[Array, npt.NDArray[np.intp]], tuple[Array, Array, Array]]
"""States (b, n) and which of the starts they come from (b,) -> h (b, m), H (b, m, n), R
(b, m, m)."""


def iterated_ekf_stacked(
    model: StackedModel, starts: Array, prior_sigma: Array, passes: int = PASSES
) -> list[Estimate]:
    """`iterated_ekf` of many unknown states, each with its own readings that depend on each other.

    Parameters
    ----------
    model : callable
        States (b, n), and which starts they come from (b,), to h (b, m), H (b, m, n) and R
        (b, m, m). Who has fewer readings than m fills up with h = 0, H = 0, R = 1.
    starts : (b, n) array
        First guesses.
    prior_sigma : (n,) array
        sigma[0], restored at every pass.
    passes : int
        At most so many.

    Raises
    ------
    numpy.linalg.LinAlgError
        If an R is not positive definite.

    Notes
    -----
    The same iteration in its information form, as in `iterated_ekf_batch`; the covariance is that
    of the last pass, linearised where that began.
    """
    state = np.array(starts, dtype=float)
    b, n = state.shape
    prior = np.diag(1 / np.square(prior_sigma))
    used, converged = np.zeros(b, dtype=np.intp), np.zeros(b, dtype=bool)
    covariance, cost = np.empty((b, n, n)), np.empty(b)
    active = np.arange(b)
    for done in range(1, passes + 1):
        h, H, _ = _whitened(model, state[active], active)
        covariance[active] = np.linalg.inv(np.swapaxes(H, 1, 2) @ H + prior)
        pull = covariance[active] @ np.swapaxes(H, 1, 2) @ h[..., None]
        state[active] -= pull[..., 0]
        used[active] = done
        converged[active] = np.abs(pull).max((1, 2)) < STEP_TOLERANCE
        active = active[~converged[active]]
        if not active.size:
            break
    for rows in np.array_split(np.arange(b), b // STACKED + 1):
        cost[rows] = _whitened(model, state[rows], rows)[2]
    return [
        Estimate(x, (P + P.T) / 2, float(c), int(u), bool(ok))
        for x, P, c, u, ok in zip(state, covariance, cost, used, converged, strict=True)
    ]


def _whitened(
    model: StackedModel, states: Array, rows: npt.NDArray[np.intp]
) -> tuple[Array, Array, Array]:
    """Readings (b, m) and H (b, m, n) in units of their root covariance, and h^T R^-1 h (b,)."""
    parts = []
    for some in np.array_split(np.arange(len(rows)), len(rows) // STACKED + 1):
        h, H, R = model(states[some], rows[some])
        white = np.linalg.solve(np.linalg.cholesky(R), np.concatenate([H, h[..., None]], axis=-1))
        parts.append((white[..., -1], white[..., :-1], (white[..., -1] ** 2).sum(-1)))
    h, H, cost = (np.concatenate(part) for part in zip(*parts, strict=True))
    return h, H, cost


STACKED = 128
"""States iterated at a time: with 48 readings each their R have 2.4 MB."""


def _working_set(model: BatchModel, state: Array) -> int:
    """How many starts to iterate at a time."""
    readings = model(state[:1], np.arange(1))[0].size if len(state) else 1
    return max(WORKING_ELEMENTS // max(readings, 1), 1)


def _gauss_newton_step(
    model: BatchModel, state: Array, rows: npt.NDArray[np.intp], prior: Array
) -> tuple[Array, Array]:
    """What to subtract from each state (b, n), and the cost (b,) before that."""
    h, H, variance = model(state, rows)
    n = state.shape[-1]
    weight = 1 / variance
    columns = [H[..., i] for i in range(n)]
    information: list[list[Array]] = []
    gradient = []
    for i in range(n):
        weighted = weight * columns[i]
        gradient.append(np.einsum("bm,bm->b", weighted, h))
        row = [np.einsum("bm,bm->b", weighted, columns[j]) for j in range(i + 1)]
        row[i] += prior[i]
        information.append(row)
    step = np.stack(_solve_small(information, gradient), axis=-1)
    return step, np.einsum("bm,bm->b", weight * h, h)


def _solve_small(lower: list[list[Array]], right: list[Array]) -> list[Array]:
    """Solutions of b symmetric n x n systems at once by Cholesky; NaN where not positive.

    ``lower[i][j]`` (b,), j <= i, are the elements of the matrices, ``right[i]`` (b,) the right
    sides. Loops over the few elements, so that each operation runs over the whole batch.
    """
    n = len(right)
    root: list[list[Array]] = []
    middle: list[Array] = []
    for i in range(n):
        row: list[Array] = []
        for j in range(i):
            rest = sum((row[k] * root[j][k] for k in range(j)), start=np.float64(0.0))
            row.append((lower[i][j] - rest) / root[j][j])
        row.append(np.sqrt(lower[i][i] - sum((r * r for r in row), start=np.float64(0.0))))
        root.append(row)
        rest = sum((row[k] * middle[k] for k in range(i)), start=np.float64(0.0))
        middle.append((right[i] - rest) / row[i])
    solution = middle
    for i in reversed(range(n)):
        rest = sum((root[k][i] * solution[k] for k in range(i + 1, n)), start=np.float64(0.0))
        solution[i] = (middle[i] - rest) / root[i][i]
    return solution
