"""Whether the offsets that were stated beforehand agree with what the drive says of them."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from rtk_gt.offsets.estimate import estimate_offsets
from rtk_gt.offsets.prior import OffsetPrior
from rtk_gt.receivers.steps import Steps
from validation.errors import GtvalError
from validation.poses.angles import Array

CONTRADICTION = 10.0
"""Beyond so many standard deviations of a component the two cannot be put together: no chance does
that, also where a stated sigma is too small by half; between, a finding says it."""
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class PriorCheck:
    """Stated offsets against those of the drive alone.

    Parameters
    ----------
    difference : (r - 1, 3) array
        Stated minus found, metres; NaN where nothing was stated.
    sigmas : (r - 1, 3) array
        Standard deviations of the differences; metres where the drive leaves an offset open.
    probability : float
        Of differences at least as large by chance.
    """

    difference: Array
    sigmas: Array
    probability: float


def check_prior(steps: Steps, prior: OffsetPrior, *, eta: float, robust: bool) -> PriorCheck | None:
    """The stated offsets beside those that the drive gives without them; None if none are stated.

    Parameters
    ----------
    steps, eta, robust
        As in `estimate_offsets`.
    prior : OffsetPrior
        What was stated. Stated distances are used for both.

    Raises
    ------
    GtvalError
        If they contradict each other: a mean of the two would be a wrong path that looks good.
    """
    if len(prior.offsets) == 0:
        return None
    without = replace(prior, offsets=np.empty((0, 3)), offset_sigmas=np.empty((0, 3)))
    alone = estimate_offsets(steps, eta=eta, robust=robust, prior=without)
    difference = (prior.offsets - alone.offsets.values)[1:]
    own = np.square(prior.offset_sigmas[1:])
    sigmas = np.sqrt(np.square(alone.offset_sigmas[1:]) + own)
    stated = np.isfinite(difference).ravel()
    spread = (alone.offset_covariance + np.diag(own.ravel()))[np.ix_(stated, stated)]
    off = difference.ravel()[stated]
    square = float(off @ np.linalg.solve(spread, off))
    found = PriorCheck(difference, sigmas, float(special.chdtrc(stated.sum(), square)))
    if (np.abs(difference) > CONTRADICTION * sigmas).any():
        raise GtvalError(_contradiction(found, steps.receivers[1:], prior.offsets[1:]))
    return found


def differences_said(found: PriorCheck, receivers: tuple[str, ...], least: float) -> str:
    """Components that differ by more than ``least`` standard deviations, in words."""
    sizes = np.nan_to_num(np.abs(found.difference) / found.sigmas)
    return "; ".join(
        f"{name} {AXES[k]} by {100 * found.difference[row, k]:+.1f} cm ({sizes[row, k]:.0f} sigma)"
        for row, name in enumerate(receivers)
        for k in range(3)
        if sizes[row, k] > least
    )


def _contradiction(found: PriorCheck, receivers: tuple[str, ...], stated: Array) -> str:
    text = (
        "the offsets stated in [rtk.known_offsets] contradict the drive: "
        f"{differences_said(found, receivers, CONTRADICTION)}. "
    )
    alone = stated - found.difference
    for i in range(len(receivers)):
        for j in range(i):
            exchanged = stated.copy()
            exchanged[[i, j]] = stated[[j, i]]
            if (np.abs(exchanged - alone) <= CONTRADICTION * found.sigmas).all():
                text += f"Exchanged, those of {receivers[j]} and {receivers[i]} fit. "
    return text + "Correct them, or leave out those that are not sure"
