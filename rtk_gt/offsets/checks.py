"""Whether the offsets that were stated beforehand agree with what the drive says of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from rtk_gt.offsets.costs import settled_cost
from rtk_gt.offsets.estimate import Offsets
from rtk_gt.offsets.minima import Minima
from rtk_gt.offsets.prior import OffsetPrior
from rtk_gt.receivers.steps import Steps
from validation.errors import GtvalError
from validation.poses.angles import Array

CONTRADICTION = 10.0
"""Beyond so many standard deviations of a component the two cannot be put together: no chance does
that, also where a stated sigma is too small by half; between, a finding says it."""
FAR = 12.0
"""The same of all components together: of the six of two receivers chance adds some 2.4."""
AXES = ("x", "y", "z")


UNITS = {"feet": 3.28084, "inches": 39.3701, "centimetres": 100.0, "millimetres": 1000.0}
"""How many of each make a metre."""
LIKE = 0.05
"""Share by which stated and seen distance may differ from such a factor: a judgement. The phase
centres of antennas stand some centimetres off what a tape measure reaches."""


def check_units(prior: OffsetPrior, seen: Offsets, names: Sequence[str]) -> None:
    """Raise for stated distances that are those of the drive in another unit.

    Parameters
    ----------
    prior : OffsetPrior
        With distances, metres; NaN where nothing is stated.
    seen : Offsets
        Of the drive without them.
    names : sequence of str
        Of the pairs.

    Raises
    ------
    GtvalError
        Naming pair, both distances and the unit.
    """
    for k, stated in enumerate(prior.distances):
        found, sigma = float(seen.distances[k]), float(seen.distance_sigmas[k])
        if np.isnan(stated) or not sigma < LIKE * found:
            continue
        for unit, factor in UNITS.items():
            if abs(stated / found / factor - 1) < LIKE:
                raise GtvalError(
                    f"the distance {names[k]} is stated as {stated:g} m in [rtk.known_distances], "
                    f"but this drive says {found:.3f} m: {factor:g} times less. It seems to be in "
                    f"{unit}; write metres ({stated / factor:.3f})"
                )


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
    away : float
        All differences together, in standard deviations.
    """

    difference: Array
    sigmas: Array
    probability: float
    away: float

    @property
    def sizes(self) -> Array:
        """(r - 1, 3) differences in standard deviations; 0 where nothing was stated."""
        return np.nan_to_num(np.abs(self.difference) / self.sigmas)


def check_prior(
    find: Callable[..., Minima], prior: OffsetPrior, together: Offsets, steps: Steps
) -> PriorCheck | None:
    """The stated offsets beside those that the drive gives without them; None if none are stated.

    Parameters
    ----------
    find : callable
        `all_minima` of the steps, called with ``prior`` and ``near``.
    prior : OffsetPrior
        What was stated. Stated distances are used for both.
    together : Offsets
        From the drive and what is stated.
    steps : Steps
        Those of ``find``.

    Raises
    ------
    GtvalError
        If they contradict each other: a mean of the two would be a wrong path that looks good.
    """
    if len(prior.offsets) == 0:
        return None
    without = replace(prior, offsets=np.empty((0, 3)), offset_sigmas=np.empty((0, 3)))
    minima = find(prior=without, near=together.offsets.values)
    # A drive with several solutions contradicts what is stated only where all of them do.
    solutions = (minima.best, *minima.others) if minima.near is None else (minima.near,)
    checks = [(_against(prior, alone), alone) for alone in solutions]
    found, alone = min(checks, key=lambda one: one[0].away)
    used, quiet = steps.select(steps.complete), min(alone, together, key=lambda one: one.sigma)
    own = settled_cost(used, alone, quiet, without)
    both = settled_cost(used, together, quiet, prior)
    # Sigmas of a weak drive are no measure far away; the likelihood is one everywhere.
    worse = both - own > CONTRADICTION**2
    if worse and ((found.sizes > CONTRADICTION).any() or found.away > FAR):
        raise GtvalError(_contradiction(found, together.receivers[1:], prior.offsets[1:]))
    return found


def _against(prior: OffsetPrior, alone: Offsets) -> PriorCheck:
    """What is stated against one solution of the drive."""
    difference = (prior.offsets - alone.offsets.values)[1:]
    own = np.square(prior.offset_sigmas[1:])
    sigmas = np.sqrt(np.square(alone.offset_sigmas[1:]) + own)
    stated = np.isfinite(difference).ravel()
    spread = (alone.offset_covariance + np.diag(own.ravel()))[np.ix_(stated, stated)]
    off = difference.ravel()[stated]
    square = float(off @ np.linalg.solve(spread, off))
    probability = float(special.chdtrc(stated.sum(), square))
    return PriorCheck(difference, sigmas, probability, float(np.sqrt(square)))


def differences_said(found: PriorCheck, receivers: tuple[str, ...], least: float) -> str:
    """Components that differ by more than ``least`` standard deviations, in words."""
    sizes = found.sizes
    return "; ".join(
        f"{name} {AXES[k]} by {100 * found.difference[row, k]:+.1f} cm ({sizes[row, k]:.0f} sigma)"
        for row, name in enumerate(receivers)
        for k in range(3)
        if sizes[row, k] > least
    )


def _contradiction(found: PriorCheck, receivers: tuple[str, ...], stated: Array) -> str:
    in_all = f"all together by {found.away:.0f} sigma, with the distances that are stated"
    text = (
        "the offsets stated in [rtk.known_offsets] contradict the drive: "
        f"{differences_said(found, receivers, CONTRADICTION) or in_all}. "
    )
    alone = stated - found.difference
    for i in range(len(receivers)):
        for j in range(i):
            exchanged = stated.copy()
            exchanged[[i, j]] = stated[[j, i]]
            if (np.abs(exchanged - alone) <= CONTRADICTION * found.sigmas).all():
                text += f"Exchanged, those of {receivers[j]} and {receivers[i]} fit. "
    return text + "Correct them, or leave out those that are not sure"
