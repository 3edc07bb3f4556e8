"""What is known of offsets and distances before the drive, and its share in the solution."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from rtk_gt.receivers.assumptions import VEHICLE_SIZE
from validation.poses.angles import Array


@dataclass(frozen=True)
class OffsetPrior:
    """Knowledge from elsewhere, each with its standard deviation; NaN where there is none.

    Parameters
    ----------
    offsets : (r, 3) array
        Offsets of the receivers, metres; that of the first is not used.
    offset_sigmas : (r, 3) array
        Their standard deviations.
    distances : (p,) array
        Measured distances of the antennas, metres.
    distance_sigmas : (p,) array
        Their standard deviations.
    """

    offsets: Array = field(default_factory=lambda: np.empty((0, 3)))
    offset_sigmas: Array = field(default_factory=lambda: np.empty((0, 3)))
    distances: Array = field(default_factory=lambda: np.empty(0))
    distance_sigmas: Array = field(default_factory=lambda: np.empty(0))

    def shifted(self, shift: Array) -> "OffsetPrior":
        """The same knowledge of what has to be added to ``shift`` (r, 3)."""
        if len(self.offsets) == 0:
            return self
        return replace(self, offsets=self.offsets - shift)


def posterior(
    signal: Array,
    directions: Array,
    right: Array,
    kappa_of: Callable[[Array], Array],
    signs: Array,
    prior: OffsetPrior,
) -> tuple[Array, Array, Array]:
    """Offsets from the drive and the prior, the curvature there, and the prior's share of it.

    Parameters
    ----------
    signal : (m,) array
        Information of the drive along the directions, 1/m^2; 0 where it has none.
    directions : (m, m) array
        The directions, one a column.
    right : (m,) array
        Right-hand side along the directions.
    kappa_of : callable
        (p,) constants (d^2 - |c|^2) / 2 that belong to given offsets.
    signs : (p, r - 1) array
        Which offset enters which pair.
    prior : OffsetPrior
        About the offsets counted from where `right` is.

    Notes
    -----
    Gauss-Newton: the measured distances are not linear in the offsets. Along directions that
    nothing determines the antennas are taken to be within `VEHICLE_SIZE` of each other.
    """
    m = len(signal)
    information = np.full(m, VEHICLE_SIZE**-2)
    wanted = np.zeros(m)
    if len(prior.offsets):
        stated = np.isfinite(prior.offsets[1:]).ravel()
        weight = np.where(stated, 1 / prior.offset_sigmas[1:].ravel() ** 2, 0.0)
        wanted = np.where(stated, np.nan_to_num(prior.offsets[1:]).ravel(), 0.0)
        wanted = wanted * weight / (weight + information)
        information = information + weight
    data = (directions * signal) @ directions.T
    pull = directions @ right + information * wanted
    base = data + np.diag(information)
    offsets: Array = np.asarray(np.linalg.solve(base, pull), dtype=float)
    measured = np.flatnonzero(np.isfinite(prior.distances))
    if len(measured) == 0:
        return offsets, base, np.diag(information)
    return _with_distances(offsets, base, pull, information, (kappa_of, signs), prior)


def _with_distances(
    offsets: Array,
    base: Array,
    pull: Array,
    information: Array,
    geometry: tuple[Callable[[Array], Array], Array],
    prior: OffsetPrior,
) -> tuple[Array, Array, Array]:
    """The same with measured distances, by damped Gauss-Newton from ``offsets``."""
    kappa_of, signs = geometry
    measured = np.isfinite(prior.distances)
    weight = np.where(measured, 1 / np.nan_to_num(prior.distance_sigmas, nan=1.0) ** 2, 0.0)
    wanted = np.nan_to_num(prior.distances)
    zero = kappa_of(np.zeros(len(offsets)))
    moves = np.stack([kappa_of(unit) - zero for unit in np.eye(len(offsets))], axis=1)

    def distances(at: Array) -> tuple[Array, Array]:
        centres = -(signs @ at.reshape(-1, 3))
        d = np.sqrt(np.maximum(2 * kappa_of(at) + np.square(centres).sum(1), 1e-6))
        toward = -(signs[:, :, None] * centres[:, None, :]).reshape(len(d), -1)
        return d, (toward + moves) / d[:, None]

    def cost(at: Array) -> float:
        off = distances(at)[0] - wanted
        return float(at @ base @ at - 2 * pull @ at + weight @ off**2)

    damping = 0.0
    for _ in range(50):
        d, slope = distances(offsets)
        gradient = pull - base @ offsets - slope.T @ (weight * (d - wanted))
        share = slope.T * weight @ slope
        curvature = base + share
        step = np.linalg.solve(curvature + damping * np.diag(np.diagonal(curvature)), gradient)
        if cost(offsets + step) <= cost(offsets) + 1e-12:
            offsets, damping = offsets + step, damping / 4 if damping > 1e-9 else 0.0
            if np.abs(step).max() < 1e-9:
                break
        else:
            damping = max(4 * damping, 1e-4)
    return offsets, curvature, np.diag(information) + share
