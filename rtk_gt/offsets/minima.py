"""All offsets that the steps allow: a straight road has several, and only one is the vehicle's.

Along a straight road antennas move across their arms only. Turned by half a turn the arms do the
same; mirrored they nearly do, and where the vehicle stands any heading will do. Each minimum is
looked for from its own start, and those that are as good as the best are kept.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rtk_gt.offsets.costs import costs_of, settled_cost, stride_of
from rtk_gt.offsets.estimate import Offsets, estimate_offsets
from rtk_gt.offsets.prior import USUAL_ARM, OffsetPrior
from rtk_gt.offsets.slow_errors import ErrorModel
from rtk_gt.receivers.steps import Steps
from validation.errors import GtvalError
from validation.pieces.results import kept_result
from validation.poses.angles import Array

HEADINGS = 6
"""Directions of the vehicle that are tried: a start that is off by half of 60 degrees still sees
most of each turn as one."""
MIRRORED = 2
"""Of them those that are tried with the antennas the other way round: exchanged receivers have one
solution or two, turned by half."""
LEAST_ROD = 0.1
"""Metres that antennas are apart at least: the width of one. Noise alone fits rods of its size."""
AS_GOOD = 30.0
"""A minimum stays possible until its -2 log likelihood is so much larger: noise does that to the
true one once in 20 million (5.5 standard deviations)."""
SIZES, _HELD = (0.7, 1.4), 1e-3
"""Factors of other sizes of the vehicle that are tried, and metres within which they are held."""
_ROUGHLY = 500.0
"""Rough cost above the least from which on nothing is compared; they have been off by a hundred."""
_SAME = 3.0
"""Standard deviations within which two minima are one: a judgement."""
_ROUNDING = 1e-4
"""Metres within which two minima are one in any case."""


@dataclass(frozen=True)
class Minima:
    """Offsets that the steps allow.

    Parameters
    ----------
    best : Offsets
        With the greatest likelihood.
    others : tuple of Offsets
        Elsewhere, and as good within `AS_GOOD`; the better ones first.
    mirrored : Offsets, optional
        A far better one that has the antennas in the opposite order of rotation: then two
        receivers are exchanged.
    near : Offsets, optional
        The one nearest to where it was asked for, if it is as good as the best. Where a vehicle
        stands the solutions are a ring, of which ``best`` and ``others`` are but some points.
    """

    best: Offsets
    others: tuple[Offsets, ...]
    mirrored: Offsets | None = None
    near: Offsets | None = None


MANY, LARGE_MISTAKE = 20.0, 0.3
"""Standard deviations, and metres, within which a solution has the distances that are stated: a
reading that is farther off is a mistake, and every solution then is."""


@kept_result()
def all_minima(
    steps: Steps,
    *,
    eta: float,
    robust: bool,
    prior: OffsetPrior,
    layout: Array | None = None,
    near: Array | None = None,
    model: ErrorModel | None = None,
) -> Minima:
    """Offsets and distances from the steps, with all other solutions that are as good.

    Parameters
    ----------
    steps, eta, robust, prior
        As in `estimate_offsets`.
    layout : (r, 3) array, optional
        Rough antenna positions on the vehicle, x forward, y left, z up; only their directions and
        the order in which they go round count. By default rear, front left, front right.
    near : (r, 3) array, optional
        One more start: offsets that are stated elsewhere.
    model : ErrorModel, optional
        As in `estimate_offsets`.

    Raises
    ------
    GtvalError
        As `estimate_offsets`; or if no solution has antennas that are apart.
    """
    used = steps.select(steps.complete)
    layout = default_layout(prior, len(used.receivers)) if layout is None else layout
    apart = (used.positions - used.positions[:, :1]).mean(0) if len(used) else np.zeros(0)
    begins = [] if near is None else [near]
    begins += [arms - apart for arms in _arms(layout)]
    estimate = partial(estimate_offsets, steps, eta=eta, robust=robust, prior=prior, model=model)
    found = [estimate(bent="never"), *(estimate(start=start, bent="never") for start in begins)]
    beside = found[1] if near is not None else None
    found = [one for one in found if one.distances.min() > LEAST_ROD]
    if not found:
        raise GtvalError(
            "no offsets were found that keep the antennas apart: the vehicle turned and tilted too "
            "little. State [rtk.known_distances] (a tape measure will do) or [rtk.known_offsets] "
            "from a longer drive; `gtval rtk coverage` works without"
        )
    # Where offsets are stated, too, both are held against each other afterwards.
    measured = [one for one in found if _as_measured(one, prior)] if near is None else []
    found = measured or found
    rough = dict(zip(map(id, found), costs_of(found), strict=True))
    found = _distinct(sorted(found, key=lambda one: rough[id(one)]), _alike)
    found = [one for one in found if rough[id(one)] - rough[id(found[0])] < _ROUGHLY]
    quiet = min(found, key=lambda one: one.sigma)
    compared = [*found, beside] if beside is not None and id(beside) in rough else found
    costs = {id(one): settled_cost(used, one, quiet, prior) for one in compared}
    # Of those that are one the best stands for them: from heights that nothing holds, decimetres
    # off, none settles.
    found = _distinct(sorted(found, key=lambda one: costs[id(one)]), _same)
    as_good = AS_GOOD * stride_of(used)
    wanted = _winding(layout)
    upright = [one for one in found if _winding(_mean_arms(used, one)) * wanted >= 0]
    best = upright[0] if upright else found[0]
    wrong = costs[id(best)] - costs[id(found[0])] > as_good or not upright
    others = [one for one in upright if costs[id(one)] - costs[id(best)] < as_good]
    rest = [one for one in others if one is not best]
    if near is None and not wrong and _any_size(used, best, prior):
        raise GtvalError(
            "this drive does not determine the offsets of its receivers, nor how far the antennas "
            "are apart: it turned and tilted too little, and vehicles of other sizes do the same. "
            "State [rtk.known_distances] (a tape measure will do) or [rtk.known_offsets] from a "
            "longer drive; `gtval rtk coverage` works without"
        )
    settled = [estimate(start=one.offsets.values) for one in (best, *rest)]
    if measured and not all(_as_measured(one, prior) for one in settled):
        raise GtvalError(
            "this drive does not determine the offsets of its receivers: what it shows of them "
            "leads away from the distances that are stated. Drive turns, or state "
            "[rtk.known_offsets] from a longer drive; `gtval rtk coverage` works without"
        )
    if beside is not None and id(beside) in costs:
        # In another heading other noise is along the arms: its squares are as many again.
        chance = as_good + 5 * np.sqrt(4 * best.residuals.size / best.correlation_time)
        possible = costs[id(beside)] - costs[id(best)] < chance
        beside = estimate(start=beside.offsets.values, bent="if sure") if possible else None
    return Minima(settled[0], tuple(settled[1:]), found[0] if wrong else None, beside)


def _as_measured(offsets: Offsets, prior: OffsetPrior) -> bool:
    """Whether its distances are those that are stated, within what no tape measure is off by."""
    if len(prior.distances) == 0:
        return True
    off = np.nan_to_num(np.abs(offsets.distances - prior.distances))
    least = np.nan_to_num(MANY * prior.distance_sigmas)
    return bool((off < np.maximum(least, LARGE_MISTAKE)).all())


def _any_size(steps: Steps, offsets: Offsets, prior: OffsetPrior) -> bool:
    """Whether all distances might be others by the same factor, where nothing of them is stated.

    Noise bends the ways of antennas on a straight road, as if their arms were shorter, and where
    that is much of what the road shows the covariance is none. So other sizes are tried.
    """
    stated = prior.offsets[1:]
    if np.isfinite(prior.distances).any() or np.isfinite(stated).any():
        return False
    arms = (steps.positions - steps.positions[:, :1]).mean(0) + offsets.offsets.values

    def cost(factor: float) -> float:
        start = replace(
            offsets,
            offsets=replace(offsets.offsets, values=offsets.offsets.values + (factor - 1) * arms),
            distances=factor * offsets.distances,
        )
        count = len(offsets.distances)
        held = replace(prior, distances=start.distances, distance_sigmas=np.full(count, _HELD))
        return settled_cost(steps, start, offsets, held)

    own = cost(1.0)
    return any(cost(factor) - own < AS_GOOD * stride_of(steps) for factor in SIZES)


def default_layout(prior: OffsetPrior, receivers: int) -> Array:
    """(r, 3) rough antenna positions: the rear one, then the front from left to right.

    Three are placed by their stated distances, `USUAL_ARM` where none is stated.
    """
    if receivers == 2:
        return np.array([[0.0, 0.0, 0.0], [prior.arms(1)[0], 0.0, 0.0]])
    if receivers != 3:
        angle = np.linspace(np.pi / 4, -np.pi / 4, receivers - 1)
        front = USUAL_ARM * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
        return np.vstack([np.zeros(3), front])
    left, right = prior.arms(2)
    across = float(prior.distances[2]) if len(prior.distances) else np.nan
    across = across if np.isfinite(across) else min(left, right)
    cosine = np.clip((left**2 + right**2 - across**2) / (2 * left * right), -0.9, 0.9)
    half = np.arccos(cosine) / 2
    away = np.array([[np.cos(half), np.sin(half), 0.0], [np.cos(half), -np.sin(half), 0.0]])
    return np.vstack([np.zeros(3), away * np.array([[left], [right]])])


def _arms(layout: Array) -> Array:
    """(n, r, 3) the antennas seen from the first, level, in all headings, and mirrored."""
    arms = layout - layout[0]
    angle = 2 * np.pi * np.arange(HEADINGS) / HEADINGS
    zero, one = np.zeros_like(angle), np.ones_like(angle)
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), zero], [np.sin(angle), np.cos(angle), zero],
         [zero, zero, one]]
    ).transpose(2, 0, 1)  # fmt: skip
    mirrored = turn[:: HEADINGS // MIRRORED]
    return np.concatenate(
        [arms @ turn.swapaxes(1, 2), (arms * [1, -1, 1]) @ mirrored.swapaxes(1, 2)]
    )


def _mean_arms(steps: Steps, offsets: Offsets) -> Array:
    """(r, 3) mean corrected positions seen from the first receiver, from one step at a time.

    A drive that turns has no mean arms: the step in the middle stands for it.
    """
    middle = steps.positions[len(steps) // 2] + offsets.offsets.values
    return np.asarray(middle - middle[0])


def _winding(places: Array) -> float:
    """Sign of the order in which the first three antennas go round, seen from above; 0 of two."""
    if len(places) < 3:
        return 0.0
    a, b = places[1] - places[0], places[2] - places[0]
    return float(np.sign(a[0] * b[1] - a[1] * b[0]))


def _distinct(found: list[Offsets], same: Callable[[Offsets, Offsets], bool]) -> list[Offsets]:
    """Without those that are the same as an earlier one."""
    kept: list[Offsets] = []
    for one in found:
        if not any(same(one, other) for other in kept):
            kept.append(one)
    return kept


def _alike(one: Offsets, other: Offsets) -> bool:
    """Whether two are the same to rounding."""
    return bool(np.abs(one.offsets.values - other.offsets.values).max() < _ROUNDING)


def _same(one: Offsets, other: Offsets) -> bool:
    off = (one.offsets.values - other.offsets.values)[1:].ravel()
    spread = one.offset_covariance + other.offset_covariance
    square = off @ np.linalg.solve(spread + _ROUNDING**2 * np.eye(len(off)), off)
    turned = np.abs(off).max() > min(one.distances.min(), other.distances.min())
    return _alike(one, other) or bool(square < _SAME**2 and not turned)
