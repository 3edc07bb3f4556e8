"""The smoothed trajectory at times asked for, with covariances."""

from dataclasses import dataclass

import numpy as np

from validation.poses.angles import Array, wrap
from validation.trajectories.smoothing.equations import Solved
from validation.trajectories.smoothing.geometry import advance, difference
from validation.trajectories.smoothing.prior import in_between
from validation.trajectories.smoothing.problem import Problem, Rows, State, frame_columns

ERRORS_AT_ONCE = 8
"""Shared errors that are followed at once: of an hour of four cameras that is 60 MB."""


@dataclass(frozen=True)
class Weighed:
    """The frames as a solution took them; the least other weights or rates fit it no longer.

    Parameters
    ----------
    weights : (f, m, m) array
        Inverse covariances of the frames, with the weights of outliers.
    offset : (f,) array
        Seconds from the knots to the frames.
    along : (f, m) array
        Rates at the frames.
    """

    weights: Array
    offset: Array
    along: Array


def at_times(
    problem: Problem, state: State, solved: Solved, strengths: Array, times: Array
) -> tuple[Array, Array, Array]:
    """Poses (q, k), rates (q, m) and covariances of poses (q, m, m) at sorted times (q,).

    Parameters
    ----------
    problem, state
        The knots.
    solved : Solved
        At the state.
    strengths : (m,) array
        Of the prior.

    Notes
    -----
    Between two knots the prior's own mean, a cubic through poses and rates, with what the prior
    leaves open there; outside of them a straight line.
    """
    m, kind, n = problem.m, problem.kind, len(problem.times)
    left = np.clip(np.searchsorted(problem.times, times, side="right") - 1, 0, max(n - 2, 0))
    poses = np.empty((len(times), state.poses.shape[1]))
    rates = np.empty((len(times), m))
    covariances = np.empty((len(times), m, m))
    for start, inverse, beside in solved.factor.covariances():
        stop = start + len(beside)
        rows = np.flatnonzero((left >= start) & (left < stop))
        if not len(rows):
            continue
        some = left[rows]
        joint = _joint(solved, some, inverse, beside, some - start)
        first, second, free = _weights(problem.times, some, times[rows])
        moved = difference(kind, state.poses[some + 1], state.poses[some])
        v0, v1 = state.rates[some], state.rates[some + 1]
        motion = first[:, 0, 1, None] * v0
        motion += second[:, 0, 0, None] * moved + second[:, 0, 1, None] * v1
        poses[rows] = advance(kind, state.poses[some], motion)
        rates[rows] = first[:, 1, 1, None] * v0
        rates[rows] += second[:, 1, 0, None] * moved + second[:, 1, 1, None] * v1
        weights = np.concatenate([first[:, 0], second[:, 0]], axis=1)
        spread = np.einsum("qa,qaij->qij", weights, np.einsum("qaibj,qb->qaij", joint, weights))
        covariances[rows] = spread + free[:, None, None] * np.diag(strengths)
    if kind == "plane":
        poses[:, 2] = wrap(poses[:, 2])
    return poses, rates, (covariances + np.swapaxes(covariances, 1, 2)) / 2


def shared_covariances(
    problem: Problem, solved: Solved, seen: Weighed, common: Array, times: Array
) -> Array:
    """What errors that all frames share add (q, m, m) to the covariances at sorted times (q,).

    Parameters
    ----------
    problem, solved
        As for `at_times`.
    seen : Weighed
        The frames as they were for `solved`.
    common : (f, m, u) array
        Change of each frame's pose by each of u independent errors of variance one.

    Notes
    -----
    How the solution changes with each error is the solution for what the error adds to the frames,
    the shared unknowns (delays, scales of odometry) moving as they would. It is right only with the
    very weights of the solution: where jitter along the motion is most of a frame's noise, its
    inverse covariance is so stiff across the motion that a change of the rates by a thousandth
    made an error common to all frames move single poses by up to 70 times of it, or not at all.
    """
    n, m = len(problem.times), problem.m
    W, offset = seen.weights, seen.offset
    unknowns = solved.shared_covariance.shape[0]
    slopes = solved.slopes.reshape(n * 2 * m, -1)
    columns = frame_columns(problem, seen.along, slice(None)) if unknowns else None
    knot = problem.frames.knot
    starts = np.flatnonzero(np.diff(knot, prepend=-1))
    left = np.clip(np.searchsorted(problem.times, times, side="right") - 1, 0, max(n - 2, 0))
    first, second, _ = _weights(problem.times, left, times)
    weights = np.concatenate([first[:, 0], second[:, 0]], axis=1)
    found = np.zeros((len(times), m, m))
    for some in range(0, common.shape[2], ERRORS_AT_ONCE):
        pushed = W @ common[:, :, some : some + ERRORS_AT_ONCE]
        both = np.concatenate([pushed, offset[:, None, None] * pushed], axis=1)
        right = np.zeros((n, 2 * m, pushed.shape[2]))
        right[knot[starts]] = np.add.reduceat(both, starts)
        moved = solved.factor.solve(right.reshape(n * 2 * m, -1))
        if columns is not None:
            asked = slopes.T @ right.reshape(n * 2 * m, -1)
            asked -= np.einsum("fms,fmk->sk", columns, pushed)
            moved += slopes @ (solved.shared_covariance @ asked)
        moved = moved.reshape(n, 2, m, -1)
        ends = np.concatenate([moved[left], moved[left + 1]], axis=1)
        at = np.einsum("qa,qaik->qik", weights, ends)
        found += at @ np.swapaxes(at, 1, 2)
    return found


def _joint(solved: Solved, knots: Rows, inverse: Array, beside: Array, place: Rows) -> Array:
    """(q, 4, m, 4, m) covariances of pose, rate, next pose and next rate."""
    b = beside.shape[1]
    joint = np.empty((len(knots), 2 * b, 2 * b))
    joint[:, :b, :b], joint[:, b:, b:] = inverse[place], inverse[place + 1]
    joint[:, :b, b:] = beside[place]
    joint[:, b:, :b] = np.swapaxes(beside[place], 1, 2)
    if solved.slopes.shape[2]:
        both = np.concatenate([solved.slopes[knots], solved.slopes[knots + 1]], axis=1)
        joint += both @ solved.shared_covariance @ np.swapaxes(both, 1, 2)
    return joint.reshape(len(knots), 4, b // 2, 4, b // 2)


def _weights(knots: Array, left: Rows, times: Array) -> tuple[Array, Array, Array]:
    """Weights as `in_between` gives them, and straight lines outside of the knots."""
    width = knots[left + 1] - knots[left]
    share = (times - knots[left]) / width
    first, second, free = in_between(width, np.clip(share, 0.0, 1.0))
    before, after = np.minimum(share, 0.0) * width, np.maximum(share - 1.0, 0.0) * width
    # At a knot its pose has weight one and its rate none; outside the rate counts the time.
    first[:, 0, 1] += before
    second[:, 0, 1] += after
    return first, second, free + (np.abs(before) ** 3 + after**3) / 3
