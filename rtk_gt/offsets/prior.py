"""What is known of offsets and distances before the drive, and its share in the solution."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from rtk_gt.receivers.assumptions import VEHICLE_SIZE
from rtk_gt.receivers.steps import receiver_pairs
from validation.poses.angles import Array

LEAN = 0.1
"""Radians that a vehicle leans on average over a record, as a standard deviation: a judgement.
Roads of 10 % are steep, and a record of several roads averages over them."""
HEIGHT_SIGMA = 0.02
"""Metres that stated heights of antennas are off: a judgement, a centimetre each."""
USUAL_ARM = 2.0
"""Metres between antennas where no distance is stated, for `LEAN`: a judgement, a car's roof."""


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
    heights : (r,) array
        Of the antennas on the vehicle, metres. A vehicle stands level within `LEAN`, which says
        roughly what the vertical offsets are.
    """

    offsets: Array = field(default_factory=lambda: np.empty((0, 3)))
    offset_sigmas: Array = field(default_factory=lambda: np.empty((0, 3)))
    distances: Array = field(default_factory=lambda: np.empty(0))
    distance_sigmas: Array = field(default_factory=lambda: np.empty(0))
    heights: Array = field(default_factory=lambda: np.empty(0))

    def shifted(self, shift: Array) -> "OffsetPrior":
        """The same knowledge of what has to be added to ``shift`` (r, 3)."""
        if len(self.offsets) == 0:
            return self
        return replace(self, offsets=self.offsets - shift)

    def of_offsets(self, mean: Array, centre: Array | None = None) -> tuple[Array, Array]:
        """Information (m, m) on all offsets but the first, 1/m^2, and the offsets (m,) it wants.

        Parameters
        ----------
        mean : (r - 1, 3) array
            Mean recorded positions of the receivers minus that of the first, metres.
        centre : (m,) array, optional
            Offsets that put the antennas where they may be; 0 by default.

        Notes
        -----
        Along directions that nothing determines the antennas are taken to be within
        `VEHICLE_SIZE` of ``centre``. Left at 0 they would come together in one point, where noise
        passes for rotation.
        """
        m = mean.size
        information = np.eye(m) * VEHICLE_SIZE**-2
        pull = information @ (np.zeros(m) if centre is None else centre)
        if len(self.offsets):
            values, sigmas = self.offsets[1:].ravel(), self.offset_sigmas[1:].ravel()
            stated = np.isfinite(values)
            weight = np.where(stated, 1 / np.where(stated, sigmas, 1.0) ** 2, 0.0)
            information = information + np.diag(weight)
            pull = pull + weight * np.where(stated, values, 0.0)
        if len(self.heights):
            level = np.linalg.inv(self._level_covariance(len(mean)))
            vertical = np.zeros((m, len(mean)))
            vertical[2::3] = np.eye(len(mean))
            wanted = self.heights[1:] - self.heights[0] - mean[:, 2]
            information = information + vertical @ level @ vertical.T
            pull = pull + vertical @ level @ wanted
        return information, np.asarray(np.linalg.solve(information, pull), dtype=float)

    def _level_covariance(self, others: int) -> Array:
        """(others, others) covariance of the heights above the first antenna of a leaning vehicle.

        Leaning by `LEAN` about both axes lifts two antennas by amounts whose covariance is
        LEAN^2 times the product of their arms.
        """
        arms = self.arms(others)
        shared = np.minimum.outer(arms, arms) ** 2 / 2  # of arms 60 degrees apart
        shared[np.diag_indices(others)] = arms**2
        for row, (i, j) in enumerate(receiver_pairs(others + 1)):
            if i and len(self.distances) and np.isfinite(self.distances[row]):
                product = (arms[i - 1] ** 2 + arms[j - 1] ** 2 - self.distances[row] ** 2) / 2
                most = 0.95 * arms[i - 1] * arms[j - 1]
                shared[i - 1, j - 1] = shared[j - 1, i - 1] = np.clip(product, -most, most)
        return np.asarray(LEAN**2 * shared + HEIGHT_SIGMA**2 * np.eye(others))

    def arms(self, others: int) -> Array:
        """(others,) distances of the antennas from the first, as stated or `USUAL_ARM`."""
        stated = self.distances[:others] if len(self.distances) else np.full(others, np.nan)
        return np.where(np.isfinite(stated), stated, USUAL_ARM)


def posterior(
    drive: tuple[Array, Array, Array],
    kappa_of: Callable[[Array], Array],
    signs: Array,
    prior: OffsetPrior,
    belief: tuple[Array, Array],
    start: Array | None = None,
) -> tuple[Array, Array, Array, float]:
    """Offsets from drive and prior, the curvature there, the prior's share of it and its cost.

    Parameters
    ----------
    drive : ((m,) array, (m, m) array, (m,) array)
        Its information along the directions, 1/m^2, 0 where it has none; the directions, one a
        column; the right-hand side along them.
    kappa_of : callable
        (p,) constants (d^2 - |c|^2) / 2 that belong to given offsets.
    signs : (p, r - 1) array
        Which offset enters which pair.
    prior : OffsetPrior
        About the offsets counted from where the drive's are.
    belief : ((m, m) array, (m,) array)
        What `OffsetPrior.of_offsets` makes of it.
    start : (m,) array, optional
        Where to begin; without it at the solution without measured distances.

    Returns
    -------
    offsets : (m,) array
        At the minimum.
    curvature, prior_part : (m, m) array
        Of the cost there, and the prior's share of it, 1/m^2.
    against : float
        Cost of what is known beforehand: squared normalised differences.

    Notes
    -----
    Gauss-Newton: the measured distances are not linear in the offsets. From ``start`` it finds the
    nearest of several minima.
    """
    signal, directions, right = drive
    information, wanted = belief
    data = (directions * signal) @ directions.T
    pull = directions @ right + information @ wanted
    base = data + information
    offsets: Array = np.asarray(np.linalg.solve(base, pull), dtype=float)
    measured = np.flatnonzero(np.isfinite(prior.distances))
    if len(measured) == 0:
        off = offsets - wanted
        return offsets, base, information, float(off @ information @ off)
    if start is not None:
        offsets = start
    return _with_distances(offsets, base, pull, (information, wanted), (kappa_of, signs), prior)


def _with_distances(
    offsets: Array,
    base: Array,
    pull: Array,
    belief: tuple[Array, Array],
    geometry: tuple[Callable[[Array], Array], Array],
    prior: OffsetPrior,
) -> tuple[Array, Array, Array, float]:
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
    information, believed = belief
    off = distances(offsets)[0] - wanted
    away = offsets - believed
    against = float(away @ information @ away + weight @ off**2)
    return offsets, curvature, information + share, against
