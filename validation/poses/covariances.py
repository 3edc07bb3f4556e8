"""What makes a matrix a covariance."""

from collections.abc import Sequence

import numpy as np

from validation.poses.angles import Array

_AT_ONCE = 8192
"""Matrices that are tested at a time."""


def covariance_fault(covariance: Array) -> str | None:
    """Why a matrix is not a covariance, in words; None if it is one or is all NaN."""
    if np.isnan(covariance).all():
        return None
    if not np.isfinite(covariance).all():
        return "has numbers that are missing or not finite"
    scale = np.sqrt(np.abs(np.diagonal(covariance)))
    if (np.diagonal(covariance) <= 0).any():
        return "has a variance that is not positive"
    with np.errstate(over="ignore"):
        correlation = covariance / scale[:, None] / scale
    if not np.allclose(correlation, correlation.T, rtol=0, atol=1e-6):
        return "is not symmetric"
    if np.abs(correlation).max() > 1 + 1e-6 or np.linalg.eigvalsh(correlation).min() <= 1e-12:
        return "is not positive definite"
    return None


def all_sound(covariances: Array) -> bool:
    """Whether each matrix of many (n, k, k) is a covariance, or all NaN, as `covariance_fault`."""
    if len(covariances) > _AT_ONCE:  # memory: some copies are made
        pieces = range(0, len(covariances), _AT_ONCE)
        return all(all_sound(covariances[start : start + _AT_ONCE]) for start in pieces)
    stated = covariances[~np.isnan(covariances).all((1, 2))]
    variance = np.diagonal(stated, axis1=1, axis2=2)
    if not (np.isfinite(stated).all() and (variance > 0).all()):
        return False
    scale = np.sqrt(variance)
    with np.errstate(over="ignore", invalid="ignore"):
        correlation = stated / scale[:, :, None] / scale[:, None, :]
        asymmetry = np.abs(correlation - np.swapaxes(correlation, 1, 2)).max(initial=0.0)
    if not (asymmetry <= 1e-6 and np.abs(correlation).max(initial=0.0) <= 1 + 1e-6):
        return False
    return bool((np.linalg.eigvalsh(correlation) > 1e-12).all())


def bad_place(names: Sequence[str], values: Array, covariance: Array) -> tuple[str, str | None]:
    """The columns of a covariance that is none, and the value where one alone is to blame."""
    variances = np.diagonal(covariance)
    if (bad := np.flatnonzero(variances <= 0)).size:
        # Where row i of the upper triangle begins: its own diagonal element.
        first = int(bad[0] * (2 * len(variances) - bad[0] + 1) // 2)
        return names[first], f"{values[first]:g}"
    if (bad := np.flatnonzero(~np.isfinite(values))).size:
        return names[int(bad[0])], None
    return f"{names[0]} to {names[-1]}", None
