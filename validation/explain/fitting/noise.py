"""Noise of a pose pair: mostly what its covariance says, now and then far more.

Position and heading of a pose can go wrong separately (a mark read badly, an angle mistyped), so
each of the two is a *cell* with a contaminated normal distribution of its own. It is a proper
density, the same for every explanation, so that explanations can be compared by likelihood
without first deciding which poses to throw away.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array

Mask = npt.NDArray[np.bool_]
"""True where something is used, there, or bad."""

DIMENSIONS = np.array([2.0, 1.0])
"""Numbers in each of the two cells of a pose: position and heading."""

MEDIANS = np.array([2 * np.log(2), 0.4549364231195724])
"""Medians of chi-squared with as many degrees of freedom."""

GROSS_SHARE = 0.05
"""Assumed share of cells with a gross error. A judgement: one stop in ten of a careful survey has
one. It counts only near the border between good and gross, by its logarithm."""

WIDTHS = np.array([1.0, 4.0, 16.0, 64.0, 256.0])
"""Standard deviations of good and of gross errors, in units of the stated one. In steps of 4, so
that an error of any size up to metres has a width near by: halfway between two, a factor of 2 off,
the density is within e^0.7 of that of the right width."""

_SHARES = np.array([1 - GROSS_SHARE, *([GROSS_SHARE / 4] * 4)])


class Precision(NamedTuple):
    """Inverse covariances of a pose pair and of its two cells taken alone, with their log dets.

    ``joint`` (..., 3, 3), ``position`` (..., 2, 2), ``heading`` (...), and the ``log_...`` of the
    determinants of the covariances themselves (...).
    """

    joint: Array
    position: Array
    heading: Array
    log_joint: Array
    log_position: Array
    log_heading: Array


class Weighed(NamedTuple):
    """What the noise model makes of residuals.

    ``log_density`` (...) of each pose, ``precision`` (..., 3, 3) to weigh it by in least squares,
    and ``weights`` (..., 2) of its position and its heading, 1 for a good and 0 for a gross one.
    """

    log_density: Array
    precision: Array
    weights: Array


def regular(matrices: Array) -> Array:
    """Symmetric matrices (..., d, d) without negative directions, made fit to be inverted.

    A covariance that is carried along a long arm, or a sum of weights of very different sizes,
    may be singular once it is rounded. Where the least eigenvalue of its correlations says so,
    the diagonal grows until that is `ROUNDING`; all others stay as they are, to the last bit.
    """
    matrices = np.asarray(matrices, dtype=float)
    diagonal = np.diagonal(matrices, axis1=-2, axis2=-1)
    size = np.sqrt(np.maximum(diagonal, np.finfo(float).tiny))
    correlations = matrices / size[..., :, None] / size[..., None, :]
    missing = np.zeros(matrices.shape[:-2])
    # Eigenvalues are slow, and far from zero where the determinant is.
    close = determinant(correlations) < CLOSE
    least = np.linalg.eigvalsh(correlations[close])[..., 0]
    missing[close] = np.maximum(ROUNDING - least, 0.0)
    if not missing.any():
        return matrices
    added = (missing[..., None] * size**2)[..., None] * np.eye(matrices.shape[-1])
    return np.asarray(matrices + added)


ROUNDING = 1e-6
"""Part of a variance that is put back where rounding has taken it. `precision` inverts a block
and then what is left: from numbers good to u = 2e-16, what is left of a matrix with a lost
direction is ROUNDING, known to about u / ROUNDING, which must be far smaller: ROUNDING is far
above the root of u, 1.5e-8. In correlations it makes a difference beyond 0.999999 only."""

CLOSE = 1e-3
"""Determinant of correlations below which eigenvalues are looked at. Rounding makes eigenvalues
negative by far less than 0.03, the size that two of them need for a product above this."""


def determinant(matrices: Array) -> Array:
    """Determinants (...) of symmetric matrices (..., d, d), in formulas where they are small.

    Cramer's rule for d up to 3: ten times quicker for thousands of them, and as exact as an
    elimination where they are `regular`.
    """
    size = matrices.shape[-1]
    if size > 3:
        return np.asarray(np.linalg.det(matrices))
    a = matrices[..., 0, 0]
    if size == 1:
        return np.asarray(a)
    b, c = matrices[..., 0, 1], matrices[..., 1, 1]
    if size == 2:
        return np.asarray(a * c - b * b)
    d, e, f = matrices[..., 0, 2], matrices[..., 1, 2], matrices[..., 2, 2]
    return np.asarray(a * (c * f - e * e) - b * (b * f - e * d) + d * (b * e - c * d))


def inverse(matrices: Array) -> Array:
    """Inverses of symmetric, `regular` matrices (..., d, d); by Cramer's rule for d up to 2."""
    size = matrices.shape[-1]
    if size > 2:
        return np.asarray(np.linalg.inv(matrices))
    if size == 1:
        return np.asarray(1 / matrices)
    turned = np.empty(matrices.shape)
    turned[..., 0, 0], turned[..., 1, 1] = matrices[..., 1, 1], matrices[..., 0, 0]
    turned[..., 0, 1] = turned[..., 1, 0] = -matrices[..., 0, 1]
    return np.asarray(turned / determinant(matrices)[..., None, None])


def precision(covariance: Array) -> Precision:
    """Inverses that `weigh` needs, from covariances (..., 3, 3) of x, y, theta."""
    covariance = regular(covariance)
    plane, heading = covariance[..., :2, :2], covariance[..., 2, 2]
    position = inverse(plane)
    # The joint inverse from the blocks (Schur complement of the position).
    cross = covariance[..., :2, 2]
    gain = (position @ cross[..., None])[..., 0]
    rest = heading - (gain * cross).sum(-1)
    joint = np.empty(covariance.shape)
    joint[..., :2, :2] = position + gain[..., :, None] * gain[..., None, :] / rest[..., None, None]
    joint[..., :2, 2] = joint[..., 2, :2] = -gain / rest[..., None]
    joint[..., 2, 2] = 1 / rest
    log_position = np.log(determinant(plane))
    return Precision(
        joint, position, 1 / heading, log_position + np.log(rest), log_position, np.log(heading)
    )


def scaled_precision(known: Precision, scale: Array) -> Precision:
    """The precision (B, n) of noise whose standard deviations are multiplied.

    Parameters
    ----------
    known : Precision
        Of the noise as it is, (n) or (B, n).
    scale : (B, 2) array
        Factors on the standard deviations of positions and of headings.
    """
    size = scale[:, [0, 0, 1]]
    length, angle = scale[:, 0, None], scale[:, 1, None]
    log_position = known.log_position + 4 * np.log(length)
    log_heading = known.log_heading + 2 * np.log(angle)
    return Precision(
        known.joint / (size[:, :, None] * size[:, None, :])[:, None],
        known.position / (length**2)[..., None, None],
        known.heading / angle**2,
        known.log_joint + 4 * np.log(length) + 2 * np.log(angle),
        log_position,
        log_heading,
    )


def weigh(residuals: Array, known: Precision) -> Weighed:
    """Log density, precision and weights of residuals under the contaminated noise.

    Parameters
    ----------
    residuals : (..., 3) array
        x, y in metres, theta in radians, wrapped.
    known : Precision
        Of the good errors.

    Notes
    -----
    Where both cells are good their correlation is used; where one is gross they are independent.
    The expected precision given the residual makes weighted least squares an EM iteration:
    Little (1988), "Robust estimation of the mean and covariance matrix from data with missing
    values", for contaminated normals.
    """
    position, heading = residuals[..., :2], residuals[..., 2]
    squares = np.stack(
        [
            np.einsum("...i,...ij,...j->...", position, known.position, position),
            heading**2 * known.heading,
        ],
        -1,
    )
    log_good, log_all, weights = _cells(squares)
    log_alone = np.stack([known.log_position, known.log_heading], -1) / 2
    joint_square = np.einsum("...i,...ij,...j->...", residuals, known.joint, residuals)
    log_both_good = 2 * np.log(_SHARES[0]) - (joint_square + known.log_joint) / 2
    alone = np.exp((log_good - log_all).sum(-1))  # chance that both are good, if independent
    log_rest = (log_all - log_alone).sum(-1) + np.log1p(-np.minimum(alone, 1 - 1e-12))
    log_sum = np.logaddexp(log_both_good, log_rest)
    both = np.exp(log_both_good - log_sum)
    # Weights of each cell where not both are good: what is left of the independent case.
    left = (weights - alone[..., None]) / np.maximum(1 - alone[..., None], 1e-12)
    left = np.clip(left, 0.0, 1.0) * (1 - both[..., None])
    full = both[..., None, None] * known.joint
    full[..., :2, :2] += left[..., 0, None, None] * known.position
    full[..., 2, 2] += left[..., 1] * known.heading
    return Weighed(
        log_sum - 1.5 * np.log(2 * np.pi), full, np.clip(both[..., None] + left, 0.0, 1.0)
    )


def _cells(squares: Array) -> tuple[Array, Array, Array]:
    """Log density of a good and of any error in each cell, and its weight.

    Parameters
    ----------
    squares : (..., 2) array
        Squared residuals of position and heading in units of the covariance.
    """
    dimensions = DIMENSIONS[:, None]
    exponents = -0.5 * squares[..., None] / WIDTHS**2
    terms = np.log(_SHARES) - dimensions * np.log(WIDTHS) + exponents
    peak = terms.max(-1, keepdims=True)
    raised = np.exp(terms - peak)
    total = raised.sum(-1)
    weights = (raised / WIDTHS**2).sum(-1) / total
    return terms[..., 0], peak[..., 0] + np.log(total), weights


def masked_precision(known: Precision, cells: Mask) -> Array:
    """Precision (..., 3, 3) where each cell is either used whole or left out.

    Parameters
    ----------
    known : Precision
        Of the good errors.
    cells : (..., 2) array of bool
        Whether position and heading are used.
    """
    both = cells[..., 0] & cells[..., 1]
    full = np.where(both[..., None, None], known.joint, 0.0)
    only = cells & ~both[..., None]
    full[..., :2, :2] += only[..., 0, None, None] * known.position
    full[..., 2, 2] += only[..., 1] * known.heading
    return full
