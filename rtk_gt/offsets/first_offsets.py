"""Offsets to look for errors with, of drives in which errors hide the offsets.

A jump of a decimetre that nobody knows of passes for noise of some centimetres, and under such
noise a drive tells no offsets. A part of the drive without the jump tells them.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rtk_gt.offsets.estimate import Offsets
from rtk_gt.offsets.robust import redescending_weights
from rtk_gt.receivers.assumptions import FEWEST_STEPS
from rtk_gt.receivers.steps import Steps, pair_differences

PARTS = (2, 4)
"""Parts of equal numbers of steps: of one jump a half is free, of three a quarter."""
QUIETER = 0.5
"""Noise of a part against that of the whole drive at most: a straight road is as quiet in all."""


def first_offsets(steps: Steps, quick: Callable[[Steps], Offsets]) -> Offsets:
    """Offsets of the whole drive; where these are open, those of its part that tells them best.

    Parameters
    ----------
    steps : Steps
        As recorded.
    quick : callable
        Offsets of some steps.

    Returns
    -------
    Offsets
        With weights and residuals of all steps. Those of the whole drive, open, where no part that
        is quieter tells more.
    """
    whole = quick(steps)
    if whole.known:
        return whole
    every = np.flatnonzero(steps.complete)
    for count in PARTS:
        if len(every) < count * FEWEST_STEPS:
            break
        parts = [quick(steps.select(rows)) for rows in np.array_split(every, count)]
        known = [one for one in parts if one.known and one.sigma < QUIETER * whole.sigma]
        if known:
            best = min(known, key=lambda one: float(one.distance_sigmas.max()))
            return _of_all(steps.select(steps.complete), best)
    return whole


def _of_all(steps: Steps, part: Offsets) -> Offsets:
    """The offsets of a part with weights and residuals of all steps."""
    rods = pair_differences(steps.positions + part.offsets.values)
    residuals = np.linalg.norm(rods, axis=-1) - part.distances
    good = part.residuals[part.weights > 0]
    spread = np.atleast_2d(good.T @ good / len(good)) + 1e-12 * np.eye(good.shape[1])
    squares = np.einsum("tp,pq,tq->t", residuals, np.linalg.inv(spread), residuals)
    weights = redescending_weights(squares, good.shape[1])
    return replace(part, weights=weights, residuals=residuals, squares=squares)
