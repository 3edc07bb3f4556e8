"""Least squares over all that cameras see of rigid things: one engine for all the geometry here.

Cameras stand in a world. Bodies (a board held up, the robot at a stop) lie in the world, parts
(the two patterns of a bar, the markers of a robot) lie on bodies, points lie on parts. Camera
calibration, the camera network, the marker layout and robot poses are all this one problem with
different things known; the bodies, of which there are many, are eliminated first.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from validation.angles import Array
from validation.errors import GtvalError
from vision_gt.setups import CAMERA_UNKNOWNS, Arrays, Setup, Views, linearised_at, whiten

Mask = npt.NDArray[np.bool_]

_MAX_STEPS = 60
_SMALL_GAIN = 1e-8
_SINGULAR = 1e-11


class NotDeterminedError(GtvalError):
    """The observations leave something undetermined."""


@dataclass(frozen=True)
class Knowledge:
    """What is known before looking, about the setup that the adjustment starts from.

    Parameters
    ----------
    shared : (g, g) array
        Information matrix (inverse covariance) of the shared unknowns.
    bodies : (b, 6, 6) array
        Information of each body.
    free : (g,) array of bool
        Shared unknowns that are estimated; the others are exact.
    """

    shared: Array
    bodies: Array
    free: Mask


def nothing_known(setup: Setup) -> Knowledge:
    """All free, and no prior information."""
    g, b = setup.shared, len(setup.T_world_body)
    return Knowledge(np.zeros((g, g)), np.zeros((b, 6, 6)), np.ones(g, dtype=bool))


@dataclass(frozen=True)
class Adjustment:
    """The setup that fits best.

    Parameters
    ----------
    setup : Setup
        Estimates.
    covariance : (g, g) array
        Of the shared unknowns; zero rows for those held fixed.
    body_covariances : (b, 6, 6) array
        Of each body, with what it inherits from the shared unknowns.
    residuals : (n, 2) array
        Seen minus predicted, unit-variance.
    weights : (n,) array
        1, or less for points that the robust loss holds back.
    cost : float
        Half the sum of squares, of robust losses and of the prior.
    freedom : int
        Degrees of freedom.
    converged : bool
        Whether the last step was negligible.
    """

    setup: Setup
    covariance: Array
    body_covariances: Array
    residuals: Array
    weights: Array
    cost: float
    freedom: int
    converged: bool

    @property
    def m0(self) -> float:
        """Residuals in units of what was stated; 1 if the stated errors are right."""
        squares = (self.weights[:, None] * self.residuals**2).sum()
        return float(np.sqrt(squares / max(self.freedom, 1)))


def adjust(
    views: Views,
    start: Setup,
    knowledge: Knowledge | None = None,
    huber: float | None = 4.0,
    describe: Callable[[int], str] | None = None,
) -> Adjustment:
    """The setup with the least sum of (robust) squares, and its covariance.

    Parameters
    ----------
    views : Views
        What was seen.
    start : Setup
        Where to start; also the mean of what ``knowledge`` knows.
    knowledge : Knowledge, optional
        Priors, and what is held fixed; nothing by default.
    huber : float, optional
        Length of a unit-variance residual from which on the loss is linear; None for squares.
    describe : callable, optional
        Name of a shared unknown, for the error message.

    Raises
    ------
    NotDeterminedError
        If the views and the knowledge leave an unknown undetermined.

    Notes
    -----
    Levenberg-Marquardt with analytic derivatives; bodies eliminated by the Schur complement
    (Triggs et al., "Bundle adjustment - a modern synthesis", 2000, section 6). Covariances are
    those of the linearised problem at the solution.
    """
    known = knowledge or nothing_known(start)
    problem = _Problem(views, start, known, huber)
    at = Arrays.of(start)
    state = problem.evaluate(at)
    if not np.isfinite(state.cost):
        raise NotDeterminedError("the start puts seen points behind their camera")
    damping, converged = 1e-4, False
    for _ in range(_MAX_STEPS):
        step = _step(problem, state, damping)
        if step is None:
            damping *= 10
            if damping > 1e8:
                break
            continue
        trial = at.moved(*step)
        candidate = problem.evaluate(trial)
        if candidate.cost <= state.cost * (1 + 1e-14):
            gain = state.cost - candidate.cost
            at, state, damping = trial, candidate, max(damping / 10, 1e-12)
            converged = gain <= _SMALL_GAIN * max(state.cost, 1e-3) or _tiny(step)
            if converged:
                break
        else:
            damping *= 10
            if damping > 1e8:
                converged = _tiny(step)
                break
    return _result(problem, at.setup, state, converged, describe)


def _tiny(step: tuple[Array, Array]) -> bool:
    return bool(max(np.abs(s).max(initial=0.0) for s in step) < 1e-10)


@dataclass(frozen=True)
class _State:
    """Normal equations at one setup, whole and by body."""

    cost: float
    residual: Array
    weights: Array
    shared: Array
    shared_right: Array
    body: Array
    body_right: Array
    mixed: Array


class _Problem:
    """What does not change between steps."""

    def __init__(self, views: Views, start: Setup, known: Knowledge, huber: float | None) -> None:
        self.views, self.start, self.known, self.huber = views, start, known, huber
        self.whitening = whiten(views.covariance)
        self.origin = Arrays.of(start)
        self.has_prior = bool(known.shared.any() or known.bodies.any())
        self.free = np.flatnonzero(known.free)
        c = len(start.T_world_camera)
        slots = np.concatenate(
            [
                CAMERA_UNKNOWNS * views.camera[:, None] + np.arange(CAMERA_UNKNOWNS),
                CAMERA_UNKNOWNS * c + 6 * views.part[:, None] + np.arange(6),
            ],
            axis=1,
        )
        # Views that share camera, part and body share their columns: one product for each.
        keys = np.column_stack([views.body, views.camera, views.part])
        order = np.lexsort(keys.T[::-1])
        _, first = np.unique(keys[order], axis=0, return_index=True)
        self.groups = [
            (rows, int(views.body[rows[0]]), slots[rows[0]])
            for rows in np.split(order, np.sort(first)[1:])
        ]

    def evaluate(self, at: Arrays) -> _State:
        """Cost and normal equations; infinite cost where a point falls behind its camera."""
        lin = linearised_at(self.views, at, self.whitening)
        size = np.linalg.norm(lin.residual, axis=1)
        weights, losses = _huber(size, self.huber)
        known = self.known
        g, b = len(known.shared), len(at.R_body)
        shared_off, body_off = np.zeros(g), np.zeros((b, 6))
        if self.has_prior:
            shared_off, body_off = at.change_from(self.origin)
        cost = float(losses.sum() + 0.5 * shared_off @ known.shared @ shared_off)
        cost += float(0.5 * np.einsum("bi,bij,bj->", body_off, known.bodies, body_off))
        if not np.isfinite(cost):
            cost = np.inf
        shared, mixed = known.shared.copy(), np.zeros((b, g, 6))
        shared_right = -known.shared @ shared_off
        body = known.bodies.copy()
        body_right = -np.einsum("bij,bj->bi", known.bodies, body_off)
        if np.isfinite(cost):
            root = np.sqrt(weights)[:, None]
            r = root * lin.residual
            Jg = root[..., None] * np.concatenate([lin.by_camera, lin.by_part], axis=2)
            Jb = root[..., None] * lin.by_body
            for rows, one, slots in self.groups:
                jg, jb, rest = Jg[rows].reshape(-1, 21), Jb[rows].reshape(-1, 6), r[rows].ravel()
                shared[np.ix_(slots, slots)] += jg.T @ jg
                shared_right[slots] += jg.T @ rest
                body[one] += jb.T @ jb
                body_right[one] += jb.T @ rest
                mixed[one][slots] += jg.T @ jb
        free = self.free
        return _State(
            cost,
            lin.residual,
            weights,
            shared[np.ix_(free, free)],
            shared_right[free],
            body,
            body_right,
            mixed[:, free],
        )


def _huber(size: Array, limit: float | None) -> tuple[Array, Array]:
    """Weights and losses of unit-variance residuals of lengths (n,)."""
    if limit is None:
        return np.ones_like(size), 0.5 * size**2
    far = size > limit
    weights = np.where(far, limit / np.where(far, size, 1.0), 1.0)
    return weights, np.where(far, limit * (size - 0.5 * limit), 0.5 * size**2)


def _step(problem: _Problem, state: _State, damping: float) -> tuple[Array, Array] | None:
    """Damped changes of shared unknowns (g,) and bodies (b, 6); None if they cannot be solved."""
    b = len(state.body)
    diagonal = np.arange(6)
    body = state.body.copy()
    body[:, diagonal, diagonal] *= 1 + damping
    body[:, diagonal, diagonal] += 1e-12
    shared = state.shared.copy()
    index = np.arange(len(shared))
    shared[index, index] *= 1 + damping
    try:
        inverse = np.linalg.inv(body) if b else body
        carried = state.mixed @ inverse
        reduced = shared - np.einsum("bgi,bhi->gh", carried, state.mixed)
        right = state.shared_right - np.einsum("bgi,bi->g", carried, state.body_right)
        scale = 1 / np.sqrt(np.maximum(np.diagonal(shared), 1e-300))
        free = scale * np.linalg.solve(scale[:, None] * reduced * scale, scale * right)
    except np.linalg.LinAlgError:
        return None
    moved = np.einsum(
        "bij,bj->bi", inverse, state.body_right - np.einsum("bgi,g->bi", state.mixed, free)
    )
    if not (np.isfinite(free).all() and np.isfinite(moved).all()):
        return None
    whole = np.zeros(problem.start.shared)
    whole[problem.free] = free
    return whole, moved


def _result(
    problem: _Problem,
    setup: Setup,
    state: _State,
    converged: bool,
    describe: Callable[[int], str] | None,
) -> Adjustment:
    """Covariances at the solution."""
    _check_bodies(state.body)
    inverse = np.linalg.inv(state.body) if len(state.body) else state.body
    carried = state.mixed @ inverse
    reduced = state.shared - np.einsum("bgi,bhi->gh", carried, state.mixed)
    free = _inverse_of_reduced(reduced, np.diagonal(state.shared), problem, describe)
    g = setup.shared
    covariance = np.zeros((g, g))
    covariance[np.ix_(problem.free, problem.free)] = free
    bodies = inverse + np.swapaxes(carried, 1, 2) @ free @ carried
    unknowns = len(problem.free) + 6 * len(state.body)
    prior = problem.known.shared[np.ix_(problem.free, problem.free)]
    known = int(np.linalg.matrix_rank(prior)) if prior.any() else 0
    known += sum(
        int(np.linalg.matrix_rank(information))
        for information in problem.known.bodies
        if information.any()
    )
    return Adjustment(
        setup,
        covariance,
        bodies,
        state.residual,
        state.weights,
        state.cost,
        2 * len(problem.views) + known - unknowns,
        converged,
    )


def _check_bodies(body: Array) -> None:
    """Raise if a body is not determined even with all else known."""
    for number, matrix in enumerate(body):
        scale = 1 / np.sqrt(np.maximum(np.diagonal(matrix), 1e-300))
        if np.linalg.eigvalsh(scale[:, None] * matrix * scale)[0] < _SINGULAR:
            raise NotDeterminedError(f"too little is seen of body {number} to place it")


def _inverse_of_reduced(
    reduced: Array, diagonal: Array, problem: _Problem, describe: Callable[[int], str] | None
) -> Array:
    """Covariance of the free shared unknowns; an error that names what is not determined."""
    if not len(reduced):
        return reduced
    scale = 1 / np.sqrt(np.maximum(diagonal, 1e-300))
    values, vectors = np.linalg.eigh(scale[:, None] * reduced * scale)
    if values[0] < _SINGULAR:
        worst = int(problem.free[np.argmax(np.abs(vectors[:, 0]))])
        name = describe(worst) if describe else f"unknown {worst}"
        raise NotDeterminedError(f"the images do not determine {name}")
    return np.asarray(scale[:, None] * (vectors / values) @ vectors.T * scale)
