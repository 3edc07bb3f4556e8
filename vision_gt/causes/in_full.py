"""A hypothesis solved in full: its numbers, how well it explains the images, what they cost."""

from dataclasses import dataclass

import numpy as np

from validation.errors import GtvalError
from validation.pieces.results import kept_result
from validation.poses.angles import Array
from validation.statistics.hypotheses import Tried
from vision_gt.causes.effects import Effect, Moved, Released, Scaled
from vision_gt.causes.evidence import Evidence
from vision_gt.causes.linear import Linear
from vision_gt.causes.trial import Solved, solved
from vision_gt.network.solution import REFERENCE

_PASSES = 5


@dataclass(frozen=True)
class Cause:
    """A hypothesis with its numbers.

    Parameters
    ----------
    effect : Effect
        What.
    size, sigma : (k,) arrays
        Its numbers: a share; or metres and radians.
    solution : Solved
        Everything, with it taken into account.
    moments : tuple of str
        Stops since which it may have been, of a move: nothing tells which.
    survey : float
        -2 log of the likelihood of the surveyed stops, but for a constant (`surveyed`).
    """

    effect: Effect
    size: Array
    sigma: Array
    solution: Solved
    moments: tuple[str, ...] = ()
    survey: float = 0.0


@kept_result()
def tried_in_full(effect: Effect, null: Solved) -> Tried[Cause]:
    """A hypothesis solved in full."""
    if isinstance(effect, Scaled):
        cause, cost, penalty = _scaled(effect, null)
    elif isinstance(effect, Moved):
        cause, cost, penalty = _moved(effect, null)
    elif isinstance(effect, Released):
        cause, cost, penalty = _released(effect, null)
    else:
        raise GtvalError(f"no way to try {effect.kind}")
    at = cause.solution
    return Tried(
        cause,
        at.score + penalty,
        at.freedom - len(effect.prior),
        places=float(effect.places),
        cost=cost,
    )


def _scaled(effect: Scaled, null: Solved) -> tuple[Cause, float, float]:
    """Gauss-Newton in the scale, everything else adjusted along.

    A step that does not make things better is shortened.
    """
    prior = float(effect.prior[0])
    at, s, cost = null, 0.0, null.adjustment.cost
    step = float(effect.gain(Linear(null)).sizes(effect.prior)[0])
    for _ in range(_PASSES):
        trial = float(np.clip(s + step, -3 * prior, 3 * prior))
        there = solved(effect.applied(null.evidence, trial), begin=at.setup)
        found = there.adjustment.cost + 0.5 * (trial / prior) ** 2
        if found > cost:
            step /= 4
            continue
        at, s, cost = there, trial, found
        gain = effect.gain(Linear(at, bounded=False))
        information = gain.information[0, 0] / (1 + s) ** 2 + prior**-2
        step = float((gain.slope[0] / (1 + s) - s / prior**2) / information)
        if abs(step) < 0.1 / np.sqrt(information):
            break
    gain = effect.gain(Linear(at, bounded=False))
    information = gain.information[0, 0] / (1 + s) ** 2 + prior**-2
    cause = Cause(effect, np.array([s]), np.array([information**-0.5]), at)
    return cause, gain.occam(effect.prior), (s / prior) ** 2


def _moved(effect: Moved, null: Solved) -> tuple[Cause, float, float]:
    """One camera or part more."""
    evidence, new, old = effect.applied(null.evidence)
    at = solved(evidence)
    shared, _ = at.setup.change_from(evidence.setup)
    size = shared[new] - shared[old]
    covariance = at.adjustment.covariance
    spread = (
        covariance[np.ix_(new, new)]
        + covariance[np.ix_(old, old)]
        - covariance[np.ix_(new, old)]
        - covariance[np.ix_(old, new)]
    )
    cost = 2 * float(np.log(effect.prior).sum()) - float(np.linalg.slogdet(spread)[1])
    return Cause(effect, size, np.sqrt(np.diagonal(spread)), at), cost, 0.0


def _released(effect: Released, null: Solved) -> tuple[Cause, float, float]:
    """A thing known less well."""
    before, evidence = null.evidence, effect.applied(null.evidence)
    at = solved(evidence, begin=null.setup)
    shared, bodies = at.setup.change_from(evidence.setup)

    def known(one: Evidence, solution: Solved) -> tuple[Array, Array]:
        """Information before, and covariance afterwards."""
        if effect.of_reference:
            i = one.bodies.index(REFERENCE)
            return one.knowledge.bodies[i], solution.adjustment.body_covariances[i]
        slots = effect.slots(one)
        return one.knowledge.shared[slots, slots], solution.adjustment.covariance[slots, slots]

    def occam(one: Evidence, solution: Solved) -> float:
        information, covariance = known(one, solution)
        if not information.any():  # it was taken as exact
            return 0.0
        return -float(np.linalg.slogdet(information)[1] + np.linalg.slogdet(covariance)[1])

    if effect.of_reference:
        size = bodies[evidence.bodies.index(REFERENCE)]
    else:
        size = shared[effect.slots(evidence)]
    sigma = np.sqrt(np.diagonal(known(evidence, at)[1]))
    return Cause(effect, size, sigma, at), occam(evidence, at) - occam(before, null), 0.0
