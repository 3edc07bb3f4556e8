"""What a set of poses can show of an explanation, and what it cannot."""

from dataclasses import dataclass

import numpy as np

from validation.explain.fitting.fit import Fit
from validation.poses.angles import Array
from validation.statistics.hypotheses import LOST, TAKES_PART

ONLY_HEADINGS = frozenset({"mount_theta", "drift_theta", "growth_theta"})
"""Turns that move no position."""


@dataclass(frozen=True)
class Observability:
    """What the data determine.

    Parameters
    ----------
    undetermined : tuple of str
        Parameters that take part in a combination which the data do not show.
    directions : (m, k) array
        These combinations, in metres and radians, each with its largest part equal to 1.
    heading_spread : float
        Circular standard deviation of the headings, in radians.
    """

    undetermined: tuple[str, ...]
    directions: Array
    heading_spread: float

    @property
    def complete(self) -> bool:
        """Whether all parameters are determined."""
        return not self.undetermined


def observability(found: Fit) -> Observability:
    """What a single fit (B = 1) shows of its parameters.

    Notes
    -----
    Eigenvectors of the information matrix in units of a single pose's noise: metres for shifts,
    radians for turns, the path's size for scale. The slip is left out: it has its own row.
    """
    k = len(found.model.parameters)
    headings = found.corrected.poses.reshape(-1, 3)[:, 2]
    length = min(abs(np.exp(1j * headings).mean()), 1.0)
    spread = float(np.sqrt(-2 * np.log(max(length, 1e-12))))
    if not k:
        return Observability((), np.zeros((0, 0)), spread)
    unit = single_pose_sizes(found)
    scaled = found.information[0] * unit[:, None] * unit[None, :]
    if len(unit) > k:  # what is left for the systematic part once the slip is fitted
        rest = np.linalg.pinv(scaled[k:, k:], hermitian=True)
        scaled = scaled[:k, :k] - scaled[:k, k:] @ rest @ scaled[k:, :k]
    values, vectors = np.linalg.eigh(scaled)
    lost = vectors[:, values < 1 / LOST**2].T
    sizes = lost * unit[:k]
    sizes = sizes / np.maximum(np.abs(sizes).max(axis=1, keepdims=True), 1e-300)
    takes_part = ((np.abs(lost) > TAKES_PART) | (np.abs(sizes) > TAKES_PART)).any(0)
    names = tuple(
        name for name, part in zip(found.model.parameters, takes_part, strict=True) if part
    )
    return Observability(names, sizes, spread)


def single_pose_sizes(found: Fit) -> Array:
    """(k,) size of each fitted parameter that changes a pose by about its noise."""
    diagonal = np.sqrt(np.median(np.diagonal(found.covariances[0], axis1=-2, axis2=-1), axis=0))
    length, angle = float(np.hypot(*diagonal[:2]) / np.sqrt(2)), float(diagonal[2])
    positions = found.corrected.poses.reshape(-1, 3)[:, :2]
    extent = float(np.sqrt(positions.var(0).sum())) or 1.0
    sizes = []
    for name in found.model.fitted:
        if name in ONLY_HEADINGS and not found.model.through_reference:
            sizes.append(angle)
        elif name.endswith("theta"):
            sizes.append(min(angle, length / extent))
        elif name == "scale":
            sizes.append(length / extent)
        elif name == "time":
            slopes = found.corrected.by_parameters.reshape(-1, 3, len(found.model.fitted))
            rate = np.abs(slopes[:, :2, found.model.fitted.index("time")])
            sizes.append(length / max(float(np.sqrt((rate**2).mean())), 1e-9))
        else:
            sizes.append(length)
    return np.array(sizes)
