"""Normal equations of a fusion, solved along the chain."""

from dataclasses import dataclass

import numpy as np

from validation.poses.angles import Array
from validation.trajectories.smoothing.chain import CHUNK, Band, Factor
from validation.trajectories.smoothing.prior import information
from validation.trajectories.smoothing.problem import (
    Problem,
    Residuals,
    frame_columns,
    step_columns,
)

FAR, FAST = 1e4, 1e2
"""Standard deviations of the first pose, m and rad, and of its rates, m/s and rad/s, before
anything is seen: so wide that they tell nothing, and keep a single pose from having rates without
bound."""


@dataclass(frozen=True)
class Weights:
    """Inverse covariances.

    Parameters
    ----------
    frames : (f, m, m) array
        Of the frames, with the weights of outliers.
    strengths : (m,) array
        Of the prior.
    odometry : (n - 1, m, m) array or None
        In the fixed frame, zero where there is no odometry.
    """

    frames: Array
    strengths: Array
    odometry: Array | None


@dataclass(frozen=True)
class Solved:
    """Solution of the normal equations.

    Parameters
    ----------
    changes : (n, 2m) array
        Of poses and rates.
    shared : (s,) array
        Changes of the shared unknowns.
    factor : Factor
        Of the chain, given the shared unknowns.
    slopes : (n, 2m, s) array
        How the chain changes with the shared unknowns.
    shared_covariance : (s, s) array
        Of the shared unknowns.
    """

    changes: Array
    shared: Array
    factor: Factor
    slopes: Array
    shared_covariance: Array


def solve(
    problem: Problem, found: Residuals, weights: Weights, shared: Array, hold: bool = False
) -> Solved:
    """One step of Gauss and Newton.

    Parameters
    ----------
    problem, found, weights
        The measurements, their residuals and their weights.
    shared : (s,) array
        The shared unknowns as they are, which are known to be near zero.
    hold : bool
        Whether these stay as they are.

    Raises
    ------
    GtvalError
        If the poses do not determine the trajectory.
    """
    n, m = len(problem.times), problem.m
    s = 0 if hold else len(problem.shared_of)
    band = Band(n, 2 * m)
    right = np.zeros((n, 2 * m, 1 + s))
    corner = np.zeros((s, 1 + s))
    for start in range(0, n, CHUNK):
        _fill(problem, found, weights, band, right, corner, (start, min(start + CHUNK, n)), s)
    if s:
        known = 1 / problem.shared**2
        corner[:, 1:] += np.diag(known)
        corner[:, 0] -= known * shared
    factor = band.factor()
    found_all = factor.solve(right.reshape(n * 2 * m, 1 + s)).reshape(right.shape)
    changes, slopes = found_all[..., 0], -found_all[..., 1:]
    if not s:
        return Solved(changes, np.zeros(len(shared)), factor, slopes, np.zeros((0, 0)))
    columns = right[..., 1:].reshape(n * 2 * m, s)
    schur = corner[:, 1:] + columns.T @ slopes.reshape(n * 2 * m, s)
    covariance = np.asarray(np.linalg.inv((schur + schur.T) / 2))
    step = covariance @ (corner[:, 0] - columns.T @ changes.ravel())
    return Solved(changes + slopes @ step, step, factor, slopes, covariance)


def _fill(
    problem: Problem,
    found: Residuals,
    weights: Weights,
    band: Band,
    right: Array,
    corner: Array,
    knots: tuple[int, int],
    s: int,
) -> None:
    """Blocks of some knots, and the steps from them to the next ones."""
    (a, b), m, n = knots, problem.m, len(problem.times)
    diagonal = np.zeros((b - a, 2 * m, 2 * m))
    below = np.zeros((b - a, 2 * m, 2 * m))
    k = np.arange(m)
    first_of_all = np.append(True, ~problem.linked)[a:b]
    diagonal[:, k, k] += FAR**-2 * first_of_all[:, None]
    diagonal[:, m + k, m + k] += FAST**-2 * first_of_all[:, None]
    _add_frames(problem, found, weights, diagonal, right, corner, knots, s)
    # The end of the step before a comes from that step, computed anew rather than kept.
    first, last = max(a - 1, 0), min(b, n - 1)
    ahead, at_start, at_end, to_start, to_end = _steps(
        problem, found, weights, corner, (first, last), a, s
    )
    own = slice(a - first, last - first)
    diagonal[: last - a] += at_start[own]
    below[: last - a] = ahead[own]
    right[a:last] += to_start[own]
    after = slice(0, min(b - 1, last) - first)
    diagonal[first + 1 - a : first + 1 - a + after.stop] += at_end[after]
    right[first + 1 : first + 1 + after.stop] += to_end[after]
    band.fill(a, diagonal, below)


def _add_frames(
    problem: Problem,
    found: Residuals,
    weights: Weights,
    diagonal: Array,
    right: Array,
    corner: Array,
    knots: tuple[int, int],
    s: int,
) -> None:
    (a, b), m = knots, problem.m
    rows = slice(*np.searchsorted(problem.frames.knot, [a, b]))
    knot = problem.frames.knot[rows]
    if not len(knot):
        return
    W, e, tau = weights.frames[rows], found.frames[rows], found.offset[rows, None]
    columns = e[..., None]
    if s:
        G = frame_columns(problem, found.along, rows)
        columns = np.concatenate([columns, G], axis=2)
        WG = W @ G
        corner[:, 0] -= np.einsum("fms,fm->s", WG, e)
        corner[:, 1:] += np.einsum("fms,fmt->st", WG, G)
    pushed = W @ columns
    if s:
        # Residual and column stand on different sides: e - G x.
        pushed[..., 1:] *= -1
    blocks = np.empty((len(knot), 2 * m, 2 * m))
    blocks[:, :m, :m] = W
    blocks[:, :m, m:] = blocks[:, m:, :m] = tau[..., None] * W
    blocks[:, m:, m:] = tau[..., None] ** 2 * W
    starts = np.flatnonzero(np.diff(knot, prepend=-1))
    diagonal[knot[starts] - a] += np.add.reduceat(blocks, starts)
    both = np.concatenate([pushed, tau[..., None] * pushed], axis=1)
    right[knot[starts]] += np.add.reduceat(both, starts)


def _steps(
    problem: Problem,
    found: Residuals,
    weights: Weights,
    corner: Array,
    steps: tuple[int, int],
    first_own: int,
    s: int,
) -> tuple[Array, Array, Array, Array, Array]:
    """What steps add below the diagonal, and to the blocks and right sides of start and end."""
    (a, b), m = steps, problem.m
    dt = np.diff(problem.times)[a:b]
    W = information(dt, weights.strengths) * problem.linked[a:b, None, None]
    eye = np.eye(m)
    ends, starts = found.jacobians(slice(a, b))
    E = np.zeros((b - a, 2 * m, 2 * m))
    S = np.zeros((b - a, 2 * m, 2 * m))
    E[:, :m, :m], E[:, m:, m:] = ends, eye
    S[:, :m, :m], S[:, m:, m:] = starts, -eye
    S[:, :m, m:] = -dt[:, None, None] * eye
    WS, WE = W @ S, W @ E
    turned = np.swapaxes(E, 1, 2)
    ahead, at_end = turned @ WS, turned @ WE
    at_start = np.swapaxes(S, 1, 2) @ WS
    to_end = np.zeros((b - a, 2 * m, 1 + s))
    to_start = np.zeros((b - a, 2 * m, 1 + s))
    e = found.prior[a:b]
    to_end[..., 0] = -np.einsum("nij,ni->nj", WE, e)
    to_start[..., 0] = -np.einsum("nij,ni->nj", WS, e)
    if weights.odometry is not None:
        V, o = weights.odometry[a:b], found.odometry[a:b]
        # The odometry's residual changes by -ends with the end, by leads with the start.
        VE, VL = V @ -ends, V @ found.leads[a:b]
        ahead[:, :m, :m] += np.swapaxes(-ends, 1, 2) @ VL
        at_end[:, :m, :m] += np.swapaxes(-ends, 1, 2) @ VE
        at_start[:, :m, :m] += np.swapaxes(found.leads[a:b], 1, 2) @ VL
        columns = o[..., None]
        if s:
            G = step_columns(problem, found, slice(a, b))
            columns = np.concatenate([columns, -G], axis=2)
            own = slice(first_own - a, None)
            VG = V[own] @ G[own]
            corner[:, 0] -= np.einsum("nms,nm->s", VG, o[own])
            corner[:, 1:] += np.einsum("nms,nmt->st", VG, G[own])
        to_end[:, :m] -= np.swapaxes(VE, 1, 2) @ columns
        to_start[:, :m] -= np.swapaxes(VL, 1, 2) @ columns
    return ahead, at_start, at_end, to_start, to_end
