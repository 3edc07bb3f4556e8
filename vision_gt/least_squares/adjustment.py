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

from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.statistics.robust import sigma_from_median
from vision_gt.least_squares.setups import (
    Linearised,
    Setup,
    Views,
    camera_slots,
    linearised_at,
    shared_slots,
    whiten,
)

Mask = npt.NDArray[np.bool_]

MAX_STEPS = 60
"""Of Levenberg-Marquardt. A judgement: good starts need five to ten."""
MOST_DAMPING = 1e8
"""From which on a step is smaller than rounding: the search has ended."""
SMALL_GAIN, _SMALL_SHARE = 1e-6, 1e-8
"""Of half the sum of squares: less than a thousandth of a standard deviation; and of its size."""
_SMALL_STEP = 1e-10
"""Metres, radians and pixels: less than anything that is measured here."""
SINGULAR = 1e-11
"""Least eigenvalue of a scaled normal matrix: below it rounding, some 1e-16 times a few hundred
unknowns and the square of their scales, may have made it."""


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

    @classmethod
    def nothing(cls, setup: Setup) -> "Knowledge":
        """No information, and all shared unknowns held fixed: to be filled in."""
        g, b = setup.shared, len(setup.R_body)
        return cls(np.zeros((g, g)), np.zeros((b, 6, 6)), np.zeros(g, dtype=bool))

    def add_camera(self, camera: int, covariance: Array) -> None:
        """Free a camera's intrinsic parameters with a covariance (9, 9), if it is not zero."""
        if covariance.any():
            slots = camera_slots(camera)
            inner = slice(slots.start + 6, slots.stop)
            self.free[inner] = np.diagonal(covariance) > 0
            self.shared[inner, inner] = np.linalg.pinv(covariance, hermitian=True)


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
    """

    setup: Setup
    covariance: Array
    body_covariances: Array
    residuals: Array
    weights: Array
    cost: float
    freedom: int

    @property
    def m0(self) -> float:
        """Residuals in units of what was stated; 1 if the stated errors are right."""
        squares = (self.weights[:, None] * self.residuals**2).sum()
        return float(np.sqrt(squares / max(self.freedom, 1)))


def adjust(
    views: Views,
    start: Setup,
    knowledge: Knowledge,
    huber: float | None = 4.0,
    describe: Callable[[int], str] | None = None,
    begin: Setup | None = None,
    steps: int = MAX_STEPS,
) -> Adjustment:
    """The setup with the least sum of (robust) squares, and its covariance.

    Parameters
    ----------
    views : Views
        What was seen.
    start : Setup
        Where to start; also the mean of what ``knowledge`` knows.
    knowledge : Knowledge
        Priors, and what is held fixed.
    huber : float, optional
        Length of a unit-variance residual from which on the loss is linear; None for squares.
    describe : callable, optional
        Name of a shared unknown, for the error message.
    begin : Setup, optional
        Where the search begins, where a better place than ``start`` is known.
    steps : int
        At the most.

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
    at = start if begin is None else begin
    problem = _Problem(views, start, knowledge, huber)
    state = problem.evaluate(at)
    if not np.isfinite(state.cost):
        raise NotDeterminedError("the start puts seen points behind their camera")
    damping = 1e-4
    for _ in range(steps):
        step = _step(problem, state, damping)
        if step is not None:
            trial = at.moved(*step)
            candidate = problem.evaluate(trial)
            if candidate.cost <= state.cost * (1 + 1e-14):
                gain = state.cost - candidate.cost
                at, state, damping = trial, candidate, max(damping / 10, 1e-12)
                if gain <= max(SMALL_GAIN, _SMALL_SHARE * state.cost) or _tiny(step):
                    break
                continue
        damping *= 10
        if damping > MOST_DAMPING:
            break
    return _result(problem, at, state, describe)


def robust_m0(adjustment: Adjustment) -> float:
    """Residuals in units of what was stated, from their median, with the freedom counted.

    Parameters
    ----------
    adjustment : Adjustment
        Of corners.
    """
    n = adjustment.residuals.size
    middle = float(sigma_from_median(adjustment.residuals))
    return middle * float(np.sqrt(n / max(adjustment.freedom, 1)))


def _tiny(step: tuple[Array, Array]) -> bool:
    return bool(max(np.abs(s).max(initial=0.0) for s in step) < _SMALL_STEP)


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
        self.known, self.huber, self.origin = known, huber, start
        self.has_prior = bool(known.shared.any() or known.bodies.any())
        self.free = np.flatnonzero(known.free)
        # Views that share camera, part and body share their columns, and stand together: one
        # product for each such group.
        order = np.lexsort((views.part, views.camera, views.body))
        self.views = views.select(order)
        self.place = np.empty_like(order)
        self.place[order] = np.arange(len(order))
        self.whitening = whiten(self.views.covariance)
        keys = np.stack([self.views.body, self.views.camera, self.views.part])
        first = np.flatnonzero(np.append(True, (np.diff(keys, axis=1) != 0).any(0)))
        self.groups = list(zip(first, [*first[1:], len(order)], strict=True))
        self.bodies = self.views.body[first]
        self.slots = shared_slots(self.views.select(first), len(start.R_camera))

    def evaluate(self, at: Setup) -> _State:
        """Cost and normal equations; infinite cost where a point falls behind its camera."""
        lin = linearised_at(self.views, at, self.whitening)
        size = np.sqrt((lin.residual**2).sum(1))
        weights, losses = _huber(size, self.huber)
        known = self.known
        g, b = len(known.shared), len(at.R_body)
        shared, body, mixed = known.shared.copy(), known.bodies.copy(), np.zeros((b, g, 6))
        shared_right, body_right = np.zeros(g), np.zeros((b, 6))
        cost = float(losses.sum())
        if self.has_prior and at is not self.origin:
            shared_off, body_off = at.change_from(self.origin)
            shared_right = -known.shared @ shared_off
            body_right = -(known.bodies @ body_off[..., None])[..., 0]
            cost -= 0.5 * float(shared_off @ shared_right + (body_off * body_right).sum())
        if not np.isfinite(cost):
            cost = np.inf
        else:
            products = self._products(lin, weights)
            own, rows = self.slots, self.bodies
            np.add.at(shared, (own[:, :, None], own[:, None, :]), products[:, :21, :21])
            np.add.at(shared_right, own, products[:, :21, 27])
            np.add.at(body, rows, products[:, 21:27, 21:27])
            np.add.at(body_right, rows, products[:, 21:27, 27])
            np.add.at(mixed, (rows[:, None], own), products[:, :21, 21:27])
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

    def _products(self, lin: Linearised, weights: Array) -> Array:
        """(k, 28, 28) products of the columns of each group: camera, part, body, residual."""
        columns = np.empty((len(weights), 2, 28))
        columns[..., :15], columns[..., 15:21] = lin.by_camera, lin.by_part
        columns[..., 21:27], columns[..., 27] = lin.by_body, lin.residual
        columns *= np.sqrt(weights)[:, None, None]
        products = np.empty((len(self.groups), 28, 28))
        for (first, end), product in zip(self.groups, products, strict=True):
            rows = columns[first:end].reshape(-1, 28)
            np.matmul(rows.T, rows, out=product)
        return products


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
        reduced = shared - _summed(carried, state.mixed)
        right = state.shared_right - (carried @ state.body_right[..., None])[..., 0].sum(0)
        scale = 1 / np.sqrt(np.maximum(np.diagonal(shared), 1e-300))
        free = scale * np.linalg.solve(scale[:, None] * reduced * scale, scale * right)
    except np.linalg.LinAlgError:
        return None
    rest = state.body_right - free @ state.mixed
    moved = (inverse @ rest[..., None])[..., 0]
    if not (np.isfinite(free).all() and np.isfinite(moved).all()):
        return None
    whole = np.zeros(problem.origin.shared)
    whole[problem.free] = free
    return whole, moved


def _summed(a: Array, b: Array) -> Array:
    """(g, h) sum over the bodies of a (n, g, 6) times b (n, h, 6) transposed."""
    n, g, _ = a.shape
    left = np.swapaxes(a, 0, 1).reshape(g, 6 * n)
    return np.asarray(left @ np.swapaxes(b, 0, 1).reshape(b.shape[1], 6 * n).T)


def _result(
    problem: _Problem,
    at: Setup,
    state: _State,
    describe: Callable[[int], str] | None,
) -> Adjustment:
    """Covariances at the solution."""
    inverse = _inverse_of_bodies(state.body)
    carried = state.mixed @ inverse
    reduced = state.shared - _summed(carried, state.mixed)
    free = _inverse_of_reduced(reduced, np.diagonal(state.shared), problem, describe)
    g = at.shared
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
        at,
        covariance,
        bodies,
        state.residual[problem.place],
        state.weights[problem.place],
        state.cost,
        2 * len(problem.views) + known - unknowns,
    )


def _inverse_of_bodies(body: Array) -> Array:
    """Inverses (b, 6, 6); an error if a body is not determined even with all else known."""
    if not len(body):
        return body
    scale = 1 / np.sqrt(np.maximum(np.diagonal(body, axis1=1, axis2=2), 1e-300))
    values, vectors = np.linalg.eigh(scale[:, :, None] * body * scale[:, None])
    bad = np.flatnonzero(values[:, 0] < SINGULAR)
    if len(bad):
        raise NotDeterminedError(f"too little is seen of body {bad[0]} to place it")
    scaled = scale[:, :, None] * vectors
    return np.asarray((scaled / values[:, None]) @ np.swapaxes(scaled, 1, 2))


def _inverse_of_reduced(
    reduced: Array, diagonal: Array, problem: _Problem, describe: Callable[[int], str] | None
) -> Array:
    """Covariance of the free shared unknowns; an error that names what is not determined."""
    if not len(reduced):
        return reduced
    scale = 1 / np.sqrt(np.maximum(diagonal, 1e-300))
    # The largest eigenvalue of an inverse is at most its trace.
    inverse = _inverse(scale[:, None] * reduced * scale)
    if inverse is not None and np.trace(inverse) < 1 / SINGULAR:
        return np.asarray(scale[:, None] * inverse * scale)
    values, vectors = np.linalg.eigh(scale[:, None] * reduced * scale)
    if values[0] < SINGULAR:
        worst = int(problem.free[np.argmax(np.abs(vectors[:, 0]))])
        name = describe(worst) if describe else f"unknown {worst}"
        raise NotDeterminedError(f"the images do not determine {name}")
    return np.asarray(scale[:, None] * (vectors / values) @ vectors.T * scale)


def _inverse(matrix: Array) -> Array | None:
    """Of a positive definite matrix; None if it is not."""
    try:
        root = np.linalg.inv(np.linalg.cholesky(matrix))
    except np.linalg.LinAlgError:
        return None
    return np.asarray(root.T @ root)
