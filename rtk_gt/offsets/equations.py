"""The conditions that distances of antennas put on offsets, linear and freed from noise."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import special

from rtk_gt.offsets.noise import LEAST_SPREAD, pair_incidence
from rtk_gt.receivers.steps import pair_differences
from validation.poses.angles import Array

SIGNIFICANT = 4.0
"""Rotation counts as such beyond so many standard deviations of what noise alone would show: noise
passes that once in 30,000 directions."""


@dataclass(frozen=True)
class Equations:
    """Linear conditions a = B_offsets (offsets) + kappa of every step and pair.

    ``a`` (t, p) and ``design`` (t, p, m) come from the recorded differences; ``shared`` (p, p)
    says how the noise of two pairs is related, ``signs`` (p, r - 1) which offset enters and
    ``incidence`` (p, r) which receiver.
    """

    differences: Array
    a: Array
    design: Array
    shared: Array
    signs: Array
    unit: Array
    incidence: Array


def equations_of(positions: Array, eta: float) -> Equations:
    """The conditions of recorded positions (t, r, 3), metres."""
    receivers = positions.shape[1]
    differences = pair_differences(positions)
    incidence = pair_incidence(receivers)
    signs = incidence[:, 1:]
    t, p = differences.shape[:2]
    # c = offset of first minus offset of second receiver of the pair, hence the minus.
    design = -(signs[None, :, :, None] * differences[:, :, None, :]).reshape(t, p, -1)
    unit = np.diag([1.0, 1.0, eta**2])
    half_squares = np.square(differences).sum(-1) / 2
    return Equations(
        differences, half_squares, design, incidence @ incidence.T, signs, unit, incidence
    )


class Residuals(NamedTuple):
    """What the conditions leave at given offsets, and the noise that this shows.

    ``residual`` (t, p), the pairs' vectors ``rods`` (t, p, 3) and ``centres`` (p, 3), the inverse
    covariance ``weight`` (p, p) for sigma_0 = 1, ``squares`` (t,) normalised with it, and their
    degrees of freedom ``dof``; ``sigma`` is the sigma_0 found.
    """

    residual: Array
    rods: Array
    centres: Array
    weight: Array
    squares: Array
    dof: float
    sigma: float


def residuals_at(
    equations: Equations, a: Array, place: tuple[Array, Array], weights: Array, *, robust: bool
) -> Residuals:
    """What is left at the offsets and kappa of ``place``."""
    offsets, kappa = place
    centres = -(equations.signs @ offsets.reshape(-1, 3))
    residual = a - equations.design @ offsets - kappa
    rods = equations.differences - centres
    spread = _residual_covariance(rods, equations, weights)
    weight = _inverse(spread)
    # Combinations of distances that noise does not change are no degrees of freedom.
    dof = round(float(np.trace(weight @ spread)), 3)
    squares = ((residual @ weight) * residual).sum(1)
    if robust:
        sigma = float(np.sqrt(np.median(squares) / special.chdtri(dof, 0.5)))
    else:
        sigma = float(np.sqrt(squares.mean() / dof))
    return Residuals(residual, rods, centres, weight, squares, dof, sigma)


@dataclass(frozen=True)
class Normal:
    """Weighted moments: information on offsets and kappa, freed from noise."""

    a: Array
    offsets: Array
    cross: Array
    kappa: Array
    right_offsets: Array
    right_kappa: Array
    noise: Array
    """Noise part of the offsets' information, already taken out."""
    mean: Array
    """(r - 1, 3) mean difference to the first receiver."""

    def kappa_of(self, offsets: Array) -> Array:
        """(p,) best kappa for given offsets."""
        return np.asarray(
            np.linalg.solve(self.kappa, self.right_kappa - self.cross.T @ offsets), dtype=float
        )


def normal_of(equations: Equations, weights: Array, W: Array, sigma: float) -> Normal:
    """Moments of the conditions, with the expected part of the noise subtracted."""
    C = sigma**2 * equations.unit
    # |D|^2 is too large by the trace of its noise on average.
    a = equations.a - np.diagonal(equations.shared) * np.trace(C) / 2
    m = equations.design.shape[2]
    weighted = weights[:, None, None] * (W @ equations.design)
    flat = weighted.reshape(-1, m)
    total = weights.sum()
    shared = W * equations.shared
    noise = total * np.kron(equations.signs.T @ shared @ equations.signs, C)
    mean = np.tensordot(weights, equations.differences, 1)
    noise_right = -(equations.signs.T @ shared @ mean @ C).ravel()
    return Normal(
        a=a,
        offsets=flat.T @ equations.design.reshape(-1, m) - noise,
        cross=weighted.sum(0).T,
        kappa=total * W,
        right_offsets=flat.T @ a.reshape(-1) - noise_right,
        right_kappa=W @ (weights @ a),
        noise=noise,
        mean=mean[: equations.signs.shape[1]] / total,
    )


def signal_of(normal: Normal, effective: float) -> tuple[Array, Array, Array]:
    """Information on each direction of the offsets, the directions, and their right-hand side.

    What does not stand out of the noise is set to 0: there the drive says nothing.
    """
    elimination = np.linalg.solve(normal.kappa, normal.cross.T)
    information = normal.offsets - normal.cross @ elimination
    right = normal.right_offsets - elimination.T @ normal.right_kappa
    values, directions = np.linalg.eigh((information + information.T) / 2)
    noise = np.diagonal(directions.T @ normal.noise @ directions)
    by_chance = np.sqrt((2 * noise**2 + 4 * noise * np.maximum(values, 0)) / effective)
    good = (values > SIGNIFICANT * by_chance) & (values > 1e-9 * values.max())
    return np.where(good, values, 0.0), directions, np.where(good, directions.T @ right, 0.0)


def _residual_covariance(rods: Array, equations: Equations, weights: Array) -> Array:
    """Covariance (p, p) of the conditions for sigma_0 = 1, averaged over the good steps."""
    weighted = weights[:, None, None] * (rods @ equations.unit)
    moments = np.tensordot(weighted, rods, ((0, 2), (0, 2)))
    return np.asarray(equations.shared * moments / weights.sum())


def _inverse(matrix: Array) -> Array:
    """Inverse of a covariance, with the smallest eigenvalues lifted.

    Four and more antennas in one plane have a combination of distances that noise changes in
    second order only; its variance of nearly 0 must not decide everything.
    """
    values, vectors = np.linalg.eigh(matrix)
    lifted = np.maximum(values, LEAST_SPREAD * values.max())
    inverse: Array = np.asarray((vectors / lifted) @ vectors.T, dtype=float)
    return inverse
