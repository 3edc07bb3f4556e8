"""The offsets and distances by two nested Levenberg-Marquardt optimisations, as published.

A peer for comparison: `rtk_gt.offsets.estimate` finds the same in closed form and says how
sure it is.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from rtk_gt.offsets.noise import pair_incidence
from rtk_gt.receivers.steps import Steps, pair_differences
from validation.poses.angles import Array
from validation.poses.earth_frames import FrameVectors


class NestedSolution(NamedTuple):
    """Offsets (r, 3) and distances (p,) in metres, and the root mean square residual."""

    offsets: FrameVectors
    distances: Array
    rms: float
    inner_runs: int


def nested_offsets(
    steps: Steps, start_distances: Array, start_offsets: Array | None = None
) -> NestedSolution:
    """Offsets and distances from nested optimisations over distances and offsets.

    Parameters
    ----------
    steps : Steps
        Only those at which all receivers are RTK-fixed are used.
    start_distances : (p,) array
        Tape-measured distances, metres.
    start_offsets : (r, 3) array, optional
        Start of the inner optimisation; 0 by default.

    Notes
    -----
    Blanco 2009, Eq. 8 and 9: the outer Levenberg-Marquardt changes the distances, its error
    being what the inner one over the offsets leaves. The outer Jacobian is by forward
    differences, each of which needs an inner run; inner runs start from the best offsets so far.
    """
    used = steps.select(steps.complete)
    differences = pair_differences(used.positions)
    signs = pair_incidence(len(used.receivers))[:, 1:]
    begin = np.zeros(3 * signs.shape[1])
    if start_offsets is not None:
        begin = (start_offsets - start_offsets[0])[1:].ravel()
    best, lowest, runs = begin, np.inf, 0

    def rods(offsets: Array) -> Array:
        return differences + signs @ offsets.reshape(-1, 3)

    def inner(distances: Array) -> Array:
        nonlocal best, lowest, runs
        runs += 1

        def residuals(offsets: Array) -> Array:
            return np.asarray((np.linalg.norm(rods(offsets), axis=-1) - distances).ravel())

        def jacobian(offsets: Array) -> Array:
            rod = rods(offsets)
            along = rod / np.linalg.norm(rod, axis=-1, keepdims=True)
            slope = signs[None, :, :, None] * along[:, :, None, :]
            return np.asarray(slope.reshape(len(rod) * len(signs), -1))

        found = least_squares(residuals, best, jacobian, method="lm", xtol=1e-12, ftol=1e-12)
        if found.cost < lowest:
            best, lowest = np.asarray(found.x), float(found.cost)
        return np.asarray(found.fun)

    outer = least_squares(
        inner, np.asarray(start_distances, dtype=float), method="lm", diff_step=[1e-6] * len(signs)
    )
    inner(outer.x)
    offsets = np.vstack([np.zeros(3), best.reshape(-1, 3)])
    rms = float(np.sqrt(np.mean(outer.fun**2)))
    return NestedSolution(FrameVectors(used.frame, offsets), outer.x, rms, runs)
