"""Fits of an explanation to pose pairs: robust, with or without known noise, many at once."""

from dataclasses import dataclass

import numpy as np

from validation.explain.fitting.models import UNITS, Corrected, ErrorModel, correct
from validation.explain.fitting.noise import (
    DIMENSIONS,
    MEDIANS,
    Mask,
    Precision,
    masked_precision,
    precision,
    scaled_precision,
    weigh,
)
from validation.explain.fitting.pairs import Pairs
from validation.poses.angles import Array, wrap

ITERATIONS = 60
"""Steps of a fit at most. Of 675 fits to 25 simulated campaigns of four sources, 99 % ended within
16 steps, and the longest took 59."""

_TOLERANCE = 1e-4
"""In standard deviations: a step this small changes no digit that is told."""

SMALLEST_SCALE = np.array([1e-6, 1e-6])
"""Metres and radians: a micrometre is far below what any of these sensors resolves, and far above
what rounding makes of coordinates of a kilometre."""

LEAST_P = float(np.finfo(float).tiny)
"""p-values end here: a zero would claim certainty where only the arithmetic ends."""

_SPIKE = 0.35
"""The noise level may not fall below this part of the median residual, so that a fit through a
few poses exactly, with all others gross, is never the best. A judgement between 1, where the noise
of good poses could not shrink below the median, and 0, where such a fit has no bound."""

_KEPT = 0.7
"""A noise level that is estimated from another fit's does not fall below this part of it. A
judgement: leaving one pose out of ten lowers it by a twentieth; more than 0.7 is the spike."""


@dataclass(frozen=True)
class Fit:
    """One explanation fitted to B versions of the same pairs.

    Parameters
    ----------
    model : ErrorModel
        What was fitted.
    parameters : (B, k) array
        In the order of ``model.fitted``.
    information : (B, k, k) array
        Inverse of their covariance, as the least-squares weights give it.
    scale : (B, 2) array
        Noise of positions and headings: standard deviations (m, rad) where none is stated,
        factors of the stated ones otherwise.
    log_likelihood : (B,) array
        Of the pairs included, the reference's slip among them.
    corrected : Corrected
        Of all pairs, the excluded ones too.
    residuals : (B, n, 3) array
        Validation minus corrected pose.
    covariances : (B, n, 3, 3) array
        Noise of the residuals.
    weights : (B, n, 2) array
        Of positions and headings.
    observations : int
        Numbers fitted to, the three of the slip included.
    estimated : bool
        Whether the scale was estimated.
    """

    model: ErrorModel
    parameters: Array
    information: Array
    scale: Array
    log_likelihood: Array
    corrected: Corrected
    residuals: Array
    covariances: Array
    weights: Array
    observations: int
    estimated: bool

    @property
    def covariance(self) -> Array:
        """(B, k, k) covariance of the parameters; infinite variances where undetermined."""
        return covariance_of(self.information)


def covariance_of(information: Array) -> Array:
    """(..., k, k) inverse of an information matrix, infinite where it has none."""
    size = np.sqrt(np.maximum(np.diagonal(information, axis1=-2, axis2=-1), 0.0))
    safe = np.where(size > 0, size, 1.0)
    scaled = information / (safe[..., :, None] * safe[..., None, :])
    values, vectors = np.linalg.eigh(scaled)
    known = values > 1e-10
    inverse = np.where(known, 1 / np.where(known, values, 1.0), 0.0)
    result = (vectors * inverse[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    result = result / (safe[..., :, None] * safe[..., None, :])
    lost = ((vectors**2) * ~known[..., None, :]).sum(-1) > 1e-6
    lost = lost | (size <= 0)
    diagonal = np.arange(information.shape[-1])
    result[..., diagonal, diagonal] = np.where(lost, np.inf, result[..., diagonal, diagonal])
    return np.asarray(result)


def known_part(covariance: Array) -> Array:
    """The covariance (..., k, k) as if undetermined parameters were known and did not move."""
    known = np.isfinite(np.diagonal(covariance, axis1=-2, axis2=-1))
    return np.where(known[..., :, None] & known[..., None, :], covariance, 0.0)


def fit(
    pairs: Pairs,
    model: ErrorModel,
    *,
    estimate_scale: bool | None = None,
    include: Mask | None = None,
    cells: Mask | None = None,
    start: Fit | None = None,
    begin: Array | None = None,
    iterations: int = ITERATIONS,
) -> Fit:
    """The explanation's parameters and the noise level that the pairs make most likely.

    Parameters
    ----------
    pairs : Pairs
        The n pairs.
    model : ErrorModel
        What to fit.
    estimate_scale : bool, optional
        Whether the noise level is estimated; by default where it is not stated, or contradicted.
    include : (B, n) array of bool, optional
        Pairs that each of B fits uses; all by default.
    cells : (n, 2) array of bool, optional
        Positions and headings to use in an ordinary (not robust) weighted least-squares fit.
    start : Fit, optional
        Where to start, and whose noise level not to fall far below.
    begin : (k,) array, optional
        Parameters to start from; zero by default.
    iterations : int
        At most so many.

    Notes
    -----
    Gauss-Newton steps with the expected precision of the contaminated noise, i.e. EM; the noise
    level is updated along. Covariances of GT poses are carried through the chain at each iterate.
    """
    if include is None:
        include = np.ones((1, len(pairs)), dtype=bool)
    problem = _Problem(
        pairs,
        model,
        include,
        cells,
        estimated=pairs.estimated if estimate_scale is None else estimate_scale,
    )
    batch, limits = len(include), _limits(pairs, model)
    parameters = np.zeros((batch, len(model.fitted)))
    if begin is not None:
        parameters = np.clip(np.broadcast_to(begin, parameters.shape), -limits, limits)
    scale = np.ones((batch, 2))
    floor = SMALLEST_SCALE
    if start is not None:
        parameters = np.broadcast_to(start.parameters, parameters.shape).copy()
        scale = np.broadcast_to(start.scale, scale.shape)
        floor = np.maximum(floor, _KEPT * start.scale)
    elif problem.estimated:
        scale = problem.median_scale(parameters)
    for _ in range(iterations):
        step, information, moved = problem.iterate(parameters, scale, floor, start is None)
        parameters = np.clip(parameters + step, -limits, limits)
        size = np.abs(step) * np.sqrt(np.maximum(np.einsum("bii->bi", information), 0))
        change = np.abs(np.log(moved / scale)).max(initial=0.0)
        scale = moved
        if size.max(initial=0.0) < _TOLERANCE and change < _TOLERANCE:
            break
    return problem.finish(_turned_back(parameters, model), scale)


def _turned_back(parameters: Array, model: ErrorModel) -> Array:
    """Parameters with their angles in (-pi, pi]."""
    angles = np.array([name.endswith("theta") for name in model.fitted], dtype=bool)
    if not angles.any() or np.abs(parameters[:, angles]).max() <= np.pi:
        return parameters
    return np.where(angles, wrap(parameters), parameters)


def _limits(pairs: Pairs, model: ErrorModel) -> Array:
    """(k,) largest size that a parameter may take, so that no step leads out of the arithmetic.

    No two poses differ by more than the largest coordinates of both tables together, and a shift
    of ten times that explains nothing. A scale is bounded by `MOST_SCALE`, a time offset by
    `LONGEST`.
    """
    extent = 1 + np.abs(pairs.validation[:, :2]).max() + np.abs(pairs.gt[:, :2]).max()
    most = {"s": LONGEST, "": MOST_SCALE}
    return np.array([most.get(UNITS[name], 10 * extent) for name in model.fitted])


MOST_SCALE = 0.25
"""No instrument's scale is wrong by more; wrong units are, and are told beforehand."""

LONGEST = 1e9
"""Seconds; 30 years, as between two clocks that count from different days."""


class _Problem:
    """Residuals and weights of pairs, with the slip of the reference as one more row."""

    def __init__(
        self,
        pairs: Pairs,
        model: ErrorModel,
        include: Mask,
        cells: Mask | None,
        *,
        estimated: bool,
    ) -> None:
        self.pairs, self.model, self.estimated = pairs, model, estimated
        self.slip_row = pairs.reference_pose is not None
        batch = len(include)
        # Where the GT has no covariances of its own, the noise changes by its scale only.
        self.constant = None if pairs.gt_covariances.any() else precision(self._own_noise())
        extra = np.ones((batch, 1), dtype=bool)
        self.include = np.concatenate([include, extra], 1) if self.slip_row else include
        self.cells = cells
        if cells is not None:
            used = np.broadcast_to(cells, (batch, len(pairs), 2)) & include[..., None]
            both = np.ones((batch, 1, 2), dtype=bool)
            self.used = np.concatenate([used, both], 1) if self.slip_row else used

    def _own_noise(self) -> Array:
        """(m, 3, 3) covariances of the validation poses, that of the slip last."""
        pairs = self.pairs
        if not self.slip_row:
            return pairs.validation_covariances
        own = pairs.reference_covariance
        return np.concatenate(
            [pairs.validation_covariances, (np.eye(3) if own is None else own)[None]]
        )

    def known(self, noise: Array, scale: Array) -> Precision:
        """Precision of the rows."""
        if self.constant is None:
            return precision(noise)
        return scaled_precision(self.constant, scale)

    def corrected(self, parameters: Array) -> Corrected:
        """Corrected poses of all pairs."""
        pairs = self.pairs
        tied, moving = pairs.reference_pose, pairs.motion
        return correct(self.model, parameters, pairs.gt, tied, moving, pairs.places)

    def rows(self, parameters: Array, scale: Array) -> tuple[Corrected, Array, Array, Array]:
        """Corrected poses, and residuals, their derivatives and covariances with the slip row."""
        pairs, batch = self.pairs, len(parameters)
        made = self.corrected(parameters)
        shape = (batch, len(pairs))
        residuals = pairs.validation - np.broadcast_to(made.poses, (*shape, 3))
        residuals[..., 2] = wrap(residuals[..., 2])
        slopes = np.broadcast_to(made.by_parameters, (*shape, 3, parameters.shape[1]))
        noise = np.broadcast_to(pairs.validation_covariances, (*shape, 3, 3))
        if pairs.gt_covariances.any():
            by = made.by_pose
            noise = noise + by @ pairs.gt_covariances @ np.swapaxes(by, -1, -2)
        if self.slip_row:
            residuals, slopes, noise = self._with_slip(parameters, residuals, slopes, noise)
        size = np.concatenate([scale[:, [0, 0]], scale[:, [1]]], 1)
        noise = noise * (size[:, :, None] * size[:, None, :])[:, None]
        return made, residuals, slopes, noise

    def _with_slip(
        self, parameters: Array, residuals: Array, slopes: Array, noise: Array
    ) -> tuple[Array, Array, Array]:
        """The row that says: the reference's validation pose is as good as any."""
        batch, k = parameters.shape
        row, slope = np.zeros((batch, 1, 3)), np.zeros((batch, 1, 3, k))
        if self.model.slip:
            row[:, 0] = -parameters[:, -3:]
            slope[:, 0, range(3), range(k - 3, k)] = 1.0
        covariance = self.pairs.reference_covariance
        own = np.broadcast_to(np.eye(3) if covariance is None else covariance, (batch, 1, 3, 3))
        return (
            np.concatenate([residuals, row], 1),
            np.concatenate([slopes, slope], 1),
            np.concatenate([noise, own], 1),
        )

    def weighed(self, residuals: Array, known: Precision) -> tuple[Array, Array, Array]:
        """Precision and weights of each row, and the log density of each, zero if excluded."""
        if self.cells is not None:
            weights = self.used.astype(float)
            used = masked_precision(known, self.used)
            square = np.einsum("bni,bnij,bnj->bn", residuals, used, residuals)
            both = self.used.all(-1)
            log_det = np.where(
                both,
                known.log_joint,
                self.used[..., 0] * known.log_position + self.used[..., 1] * known.log_heading,
            )
            numbers = self.used @ DIMENSIONS
            return used, weights, -(square + log_det + numbers * np.log(2 * np.pi)) / 2
        found = weigh(residuals, known)
        inside = self.include
        return (
            found.precision * inside[..., None, None],
            found.weights * inside[..., None],
            found.log_density * inside,
        )

    def iterate(
        self, parameters: Array, scale: Array, floor: Array, guard: bool
    ) -> tuple[Array, Array, Array]:
        """The next step, the information and the next scale."""
        _, residuals, slopes, noise = self.rows(parameters, scale)
        known = self.known(noise, scale)
        used, weights, _ = self.weighed(residuals, known)
        weighted = np.einsum("bnij,bnjk->bnik", used, slopes)
        information = np.einsum("bnik,bnil->bkl", slopes, weighted)
        gradient = np.einsum("bnik,bni->bk", weighted, residuals)
        step = _solve(information, gradient)
        if not self.estimated:
            return step, information, scale
        after = residuals - np.einsum("bnik,bk->bni", slopes, step)
        return step, information, self.next_scale(after, known, weights, scale, floor, guard)

    def next_scale(
        self,
        residuals: Array,
        known: Precision,
        weights: Array,
        scale: Array,
        floor: Array,
        guard: bool,
    ) -> Array:
        """The noise level that the weighted residuals show, kept off zero."""
        squares = _cell_squares(residuals, known)
        inside = self.include if self.cells is None else self.used.any(-1)
        count = (
            inside.sum(1)[:, None] * DIMENSIONS
            if self.cells is None
            else self.used.sum(1) * DIMENSIONS
        )
        found = scale * np.sqrt((weights * squares).sum(1) / np.maximum(count, 1.0))
        if guard and self.cells is None:
            median = np.sqrt(np.median(squares, axis=1) / MEDIANS) * scale
            found = np.maximum(found, _SPIKE * median)
        return np.asarray(np.maximum(found, floor if self.cells is None else SMALLEST_SCALE))

    def median_scale(self, parameters: Array) -> Array:
        """Where the noise level starts: from the median residual."""
        unit = np.ones((len(parameters), 2))
        _, residuals, _, noise = self.rows(parameters, unit)
        squares = _cell_squares(residuals, self.known(noise, unit))
        return np.maximum(np.sqrt(np.median(squares, axis=1)), 1e-4)

    def finish(self, parameters: Array, scale: Array) -> Fit:
        """The fit at its last parameters."""
        made, residuals, slopes, noise = self.rows(parameters, scale)
        used, weights, log_density = self.weighed(residuals, self.known(noise, scale))
        information = np.einsum("bnik,bnil->bkl", slopes, used @ slopes)
        n = len(self.pairs)
        counted = self.include.sum(1) * 3 if self.cells is None else self.used.sum((1, 2))
        if self.cells is not None:
            counted = (self.used * DIMENSIONS).sum((1, 2))
        return Fit(
            self.model,
            parameters,
            information,
            scale,
            log_density.sum(1),
            made,
            residuals[:, :n],
            noise[:, :n],
            weights[:, :n],
            int(counted[0]),
            self.estimated,
        )


def _cell_squares(residuals: Array, known: Precision) -> Array:
    """(B, m, 2) squared residuals of positions and headings in units of their covariance."""
    position = np.einsum("bni,bnij,bnj->bn", residuals[..., :2], known.position, residuals[..., :2])
    return np.stack([position, residuals[..., 2] ** 2 * known.heading], -1)


def _solve(information: Array, gradient: Array) -> Array:
    """Newton steps, zero along directions without information."""
    if not gradient.shape[1]:
        return gradient
    size = np.sqrt(np.maximum(np.einsum("bii->bi", information), 1e-300))
    scaled = information / (size[:, :, None] * size[:, None, :])
    inverse = np.linalg.pinv(scaled, rcond=1e-10, hermitian=True)
    return np.asarray(np.einsum("bij,bj->bi", inverse, gradient / size) / size)
