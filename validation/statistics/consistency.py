"""Do errors fit the covariances stated for them? Normalised errors and chi-squared intervals."""

from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import special

from validation.poses.angles import Array
from validation.poses.common_origin import LEAST_SHARE

Verdict = Literal["below", "inside", "above"]


class Interval(NamedTuple):
    """Two ends, low <= high."""

    low: float
    high: float


class ConsistencyTest(NamedTuple):
    """A weighted sum of squares against the interval in which it should fall.

    ``mean`` is the sum divided by the number of poses and ``interval`` the one for the mean,
    with ``per_pose`` degrees of freedom each (its expected value; no whole number where some
    were spent on a fit). ``method`` says what was summed.
    """

    mean: float
    interval: Interval
    poses: int
    per_pose: float
    p_value: float
    confidence: float
    verdict: Verdict
    method: str


def nees(errors: npt.ArrayLike, covariances: npt.ArrayLike) -> Array:
    """Normalised error squared e' P^-1 e; chi-squared with k degrees of freedom if P is right.

    Parameters
    ----------
    errors : (..., k) array_like
        Errors, angles wrapped.
    covariances : (..., k, k) array_like
        Their covariances; NaN where not stated.

    Returns
    -------
    (...) array
        NaN where the covariance is not stated, never 0 in its place.

    Raises
    ------
    ValueError
        If a stated covariance is not positive definite.

    Notes
    -----
    Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation
    (2001), section 5.4.2. Scaled to correlations first, as metres and radians may differ by
    many orders of magnitude.
    """
    errors, covariances = np.asarray(errors, dtype=float), np.asarray(covariances, dtype=float)
    stated = np.isfinite(covariances).all((-1, -2))
    variances = np.diagonal(covariances, axis1=-2, axis2=-1)
    if (variances[stated] <= 0).any():
        raise ValueError("a covariance has a variance that is not positive")
    sigma = np.where(stated[..., None], np.sqrt(np.abs(variances)), 1.0)
    correlation = covariances / (sigma[..., :, None] * sigma[..., None, :])
    correlation = np.where(stated[..., None, None], correlation, np.eye(errors.shape[-1]))
    try:
        factor = np.linalg.cholesky(correlation)
    except np.linalg.LinAlgError:
        raise ValueError("a covariance is not positive definite") from None
    whitened = np.linalg.solve(factor, (errors / sigma)[..., None])[..., 0]
    return np.asarray(np.where(stated, np.square(whitened).sum(-1), np.nan))


def joint_square(
    errors: Array, covariance: Array, slopes: Array | None = None, every: int = 1
) -> tuple[float, int]:
    """The normalised square of errors, and over how many directions that are free to err.

    Parameters
    ----------
    errors : (m,) array
        All together.
    covariance : (m, m) array
        Of them, of any rank: directions with less than `LEAST_SHARE` of a variance are zero by
        construction.
    slopes : (m, p) array, optional
        Of parameters that were fitted to the errors: what they could take away does not count.
    every : int
        Numbers of a pose: errors of one unit come again after so many.
    """
    variances = np.diagonal(covariance).reshape(-1, every)
    # Else a number that is zero by construction would be as large as its rounding.
    size = np.sqrt(np.maximum(variances, 0.01 * np.median(variances, axis=0))).ravel()
    values, vectors = np.linalg.eigh(covariance / size[:, None] / size)
    kept = values > LEAST_SHARE
    white = (vectors[:, kept] / np.sqrt(values[kept])).T
    rest = None if slopes is None else white @ (slopes / size[:, None])
    return _square_beside(white @ (errors / size), rest)


def square_with_factor(
    errors: Array, blocks: Array, factor: Array, slopes: Array
) -> tuple[float, int] | None:
    """The same of poses that share errors by a factor, without a matrix of all poses.

    Parameters
    ----------
    errors : (n, k) array
        Of n poses.
    blocks : (n, k, k) array
        Covariance of what each has alone.
    factor : (n, k, r) array
        Of what they share: that of all is the blocks and the factor times its transpose.
    slopes : (n, k, p) array
        Of parameters that were fitted.

    Returns
    -------
    (float, int) or None
        None where the blocks leave a direction that is zero by construction.
    """
    variances = np.diagonal(blocks, axis1=1, axis2=2) + np.square(factor).sum(2)
    size = np.sqrt(variances)
    if not (variances > 0).all():
        return None
    scaled = blocks / size[:, :, None] / size[:, None, :]
    if np.linalg.eigvalsh(scaled).min(initial=np.inf) <= LEAST_SHARE:
        return None
    white = whitened(np.concatenate([errors[..., None], slopes], axis=2), blocks, factor)
    return _square_beside(white[:, 0], white[:, 1:])


def whitened(values: Array, blocks: Array, factor: Array) -> Array:
    """(n k, p) values in directions of unit variance, of n poses that share errors by a factor.

    Parameters
    ----------
    values : (n, k, p) array
        In p columns.
    blocks : (n, k, k) array
        Covariance of what each pose has alone.
    factor : (n, k, r) array
        That of all is the blocks and the factor times its transpose.

    Raises
    ------
    ValueError
        If a block is not positive definite.

    Notes
    -----
    With L L^T = B, F = L^-1 factor and its singular values s and left vectors U, the covariance
    is L (1 + F F^T) L^T, and (1 + F F^T)^-1/2 = 1 - U diag(1 - (1 + s^2)^-1/2) U^T.
    """
    n, k, columns = values.shape
    try:
        root = np.linalg.cholesky(blocks)
    except np.linalg.LinAlgError:
        raise ValueError("a covariance is not positive definite") from None
    white = np.linalg.solve(root, np.concatenate([values, factor], axis=2)).reshape(n * k, -1)
    own, shared = white[:, :columns], white[:, columns:]
    vectors, sizes, _ = np.linalg.svd(shared, full_matrices=False)
    less = 1 - 1 / np.sqrt(1 + sizes**2)
    return np.asarray(own - vectors @ (less[:, None] * (vectors.T @ own)))


def _square_beside(left: Array, slopes: Array | None) -> tuple[float, int]:
    """Square of white errors beside what fitted parameters could take away, and its freedom."""
    freedom = len(left)
    if slopes is not None and slopes.shape[1]:
        basis, sizes, _ = np.linalg.svd(slopes, full_matrices=False)
        basis = basis[:, sizes > 1e-9 * max(float(sizes.max(initial=0.0)), 1e-300)]
        left = left - basis @ (basis.T @ left)
        freedom -= basis.shape[1]
    return float(left @ left), max(freedom, 0)


def normalised_errors(errors: npt.ArrayLike, covariances: npt.ArrayLike) -> Array:
    """Each component's error in units of its own standard deviation; NaN where not stated.

    Parameters
    ----------
    errors : (..., k) array_like
        Errors, angles wrapped.
    covariances : (..., k, k) array_like
        Their covariances.
    """
    variances = np.diagonal(np.asarray(covariances, dtype=float), axis1=-2, axis2=-1)
    return np.asarray(np.asarray(errors, dtype=float) / np.sqrt(variances))


def chi_squared_interval(dof: float, confidence: float = 0.95, n: int = 1) -> Interval:
    """Where the mean of n chi-squared values falls with the given probability.

    Parameters
    ----------
    dof : float
        Degrees of freedom of each.
    confidence : float
        Probability; the same share is left out at both ends.
    n : int
        Number of values averaged; 1 for a single value.

    Raises
    ------
    ValueError
        If dof or n is not positive.
    """
    if dof <= 0 or n < 1:
        raise ValueError(f"degrees of freedom and number must be positive, not {dof} and {n}")
    tail = (1 - confidence) / 2
    # chdtri inverts the survival function.
    low, high = special.chdtri(n * dof, [1 - tail, tail])
    return Interval(float(low / n), float(high / n))


def unit_weight_interval(dof: int, confidence: float = 0.95) -> Interval:
    """Where the variance of unit weight v'Pv / dof of an adjustment falls if its sigmas are right.

    Parameters
    ----------
    dof : int
        Redundancy: observations minus unknowns.
    confidence : float
        Probability.
    """
    interval = chi_squared_interval(dof, confidence)
    return Interval(interval.low / dof, interval.high / dof)


def verdict(value: float, interval: Interval) -> Verdict:
    """On which side of the interval the value lies, or inside it."""
    if value < interval.low:
        return "below"
    return "above" if value > interval.high else "inside"


def sum_test(
    total: float, poses: int, dof: float, confidence: float, method: str
) -> ConsistencyTest:
    """The test of a sum of squares that should be chi-squared with ``poses * dof`` degrees.

    Parameters
    ----------
    total : float
        Sum of NEES over the poses, or the joint NEES.
    poses : int
        Number of poses.
    dof : float
        Components of each, less what was spent on a fit.
    confidence : float
        Of the interval.
    method : str
        What was summed, in words.
    """
    interval = chi_squared_interval(dof, confidence, poses)
    upper = float(special.chdtrc(poses * dof, total))
    return ConsistencyTest(
        mean=total / poses,
        interval=interval,
        poses=poses,
        per_pose=dof,
        p_value=2 * min(upper, 1 - upper),
        confidence=confidence,
        verdict=verdict(total / poses, interval),
        method=method,
    )
