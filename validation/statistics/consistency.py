"""Do errors fit the covariances stated for them? Normalised errors and chi-squared intervals."""

from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import special

from validation.poses.angles import Array
from validation.poses.common_origin import LEAST_SHARE
from validation.poses.factored import Factored

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
    return _square_beside(white @ (errors / size), rest, len(white))


def square_of_factored(
    errors: Array, covariance: Factored, slopes: Array | None = None
) -> tuple[float, int] | None:
    """The same of poses that share errors by a factor, without a matrix of all poses.

    Parameters
    ----------
    errors : (n, k) array
        Of n poses.
    covariance : Factored
        Of them.
    slopes : (n, k, p) array, optional
        Of parameters that were fitted.

    Returns
    -------
    (float, int) or None
        None where what a pose has alone leaves a direction that is zero by construction.
    """
    variances = np.diagonal(covariance.blocks, axis1=1, axis2=2)
    if not (variances > 0).all():
        return None
    size = np.sqrt(variances)
    net = 0.0 if covariance.net is None else covariance.net.blocks
    scaled = (covariance.own + net) / size[:, :, None] / size[:, None, :]
    if np.linalg.eigvalsh(scaled).min(initial=np.inf) <= LEAST_SHARE:
        return None
    columns = errors[..., None]
    if slopes is not None:
        columns = np.concatenate([columns, slopes], axis=2)
    white, left_out = _whitened(columns, covariance, LEAST_SHARE)
    return _square_beside(white[:, 0], white[:, 1:], errors.size - left_out)


def whitened(values: Array, covariance: Factored) -> Array:
    """Values (n, k, p) in directions of unit variance, of poses that share errors in few numbers.

    Parameters
    ----------
    values : (n, k, p) array
        In p columns.
    covariance : Factored
        Of errors.

    Returns
    -------
    (m, p) array
        Of the same squares and products as the values by the inverse of the covariance.

    Raises
    ------
    ValueError
        If what a pose has alone, or the whole, is not positive definite.
    """
    return _whitened(values, covariance, 0.0)[0]


def _whitened(values: Array, covariance: Factored, least: float) -> tuple[Array, int]:
    """The same, and how many directions are left out.

    These have no more than the share ``least`` of the variance that poses have without the factor:
    they are zero by construction.

    Notes
    -----
    With L L^T = B of what poses have without the factor, L^-1 F = Q R and the signs S, the
    covariance is L (1 + Q R S R^T Q^T) L^T: it is 1 beside the few directions Q, and in them that
    of a small matrix.
    """
    columns = values.shape[2]
    both = np.concatenate([values, covariance.factor], axis=2)
    try:
        if covariance.net is None:
            root = np.linalg.cholesky(covariance.own)
            white = np.linalg.solve(root, both).reshape(values[..., 0].size, -1)
            inside, R = np.linalg.qr(white[:, columns:])
            within = inside.T @ white[:, :columns]
            beside = white[:, :columns] - inside @ within
        else:
            products = np.einsum("nkp,nkq->pq", both, covariance.weighed(both), optimize=True)
            R, within, beside = _by_products(products, columns)
    except np.linalg.LinAlgError:
        raise ValueError("a covariance is not positive definite") from None
    sizes, ways = np.linalg.eigh(np.eye(len(R)) + (R * covariance.signs) @ R.T)
    if least == 0.0 and sizes.min(initial=1.0) <= 0:
        raise ValueError("a covariance is not positive definite")
    kept = sizes > least
    told = (ways[:, kept].T @ within) / np.sqrt(sizes[kept])[:, None]
    return np.concatenate([told, beside]), int((~kept).sum())


def _by_products(products: Array, columns: int) -> tuple[Array, Array, Array]:
    """R, Q^T V and what is left of V, by the products of whitened V and F: as good as these."""
    inside = products[columns:, columns:]
    size = np.sqrt(np.maximum(np.diagonal(inside), 1e-300))
    values, vectors = np.linalg.eigh(inside / size[:, None] / size)
    kept = values > 1e-12 * max(float(values.max(initial=0.0)), 1e-300)
    root = np.sqrt(values[kept])[:, None]
    R = root * vectors[:, kept].T * size
    within = vectors[:, kept].T @ (products[columns:, :columns] / size[:, None]) / root
    left, ways = np.linalg.eigh(products[:columns, :columns] - within.T @ within)
    return R, within, np.sqrt(np.maximum(left, 0.0))[:, None] * ways.T


def _square_beside(left: Array, slopes: Array | None, freedom: int) -> tuple[float, int]:
    """Square of white errors beside what fitted parameters could take away, and its freedom."""
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
