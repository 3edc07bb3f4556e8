"""Which hypothesis explains best what does not fit, and whether that is enough to be told."""

import contextlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy import special

from validation.errors import GtvalError
from validation.pieces.results import kept_result
from validation.poses.angles import Array, wrap
from validation.statistics.hypotheses import RIVAL, Ranking, Tried, ranked
from vision_gt.causes.effects import (
    Effect,
    Moved,
    Released,
    Scaled,
    all_effects,
)
from vision_gt.causes.evidence import Evidence, Seen, evidence_of
from vision_gt.causes.exchanges import Exchanged, exchanges, surveyed_rightly
from vision_gt.causes.linear import Linear
from vision_gt.causes.trial import Noise, Solved, solved, with_noise, with_own_noise
from vision_gt.least_squares.adjustment import MAX_STEPS, NotDeterminedError
from vision_gt.network.solution import REFERENCE
from vision_gt.optics.transforms import planar_pose

LEAST_GAIN = 2 * float(np.log(1e3))
"""Of the criterion: odds of a thousand to one against 'nothing is wrong', as nearly all campaigns
have nothing of the kind."""
_MOST_TRIED = 8
"""Hypotheses that are solved in full, the best to first order. A judgement: of 200 simulated
campaigns with a cause it was among the first four in all."""
_LEAST_SHARE = 0.4
"""Of the best one's worth to first order, below which a hypothesis is not solved in full."""
_BAD = 1.5
"""Chi-squared per degree of freedom, under the best hypothesis, from which on things may have been
exchanged. A judgement: it is 1.2 to 1.3 in clean rendered campaigns, as corners of boards have
heavier tails than normal ones, and 2 and more where two cameras or their files are exchanged."""
_LEAST_HARM = 1.0
"""Standard deviations by which a lens or a print has to move some pose to be told. All lenses and
prints differ from what is stated a little, and thousands of corners show it."""
_SURE_GAIN = 100.0
"""Of the criterion, from which on a print of another size is told though it moves nothing: a
judgement, seven times `LEAST_GAIN`."""
_LEAST_PRINT = 0.002
"""Share of a length below which it is no cause. Paper changes by 1 to 2 per mille with the weather,
and in overexposed images, compressed as JPEG, white eats 0.8 to 0.9 per mille of the markers."""
_LEAST_FOCAL = 0.005
"""The same of a focal length that moves no pose: a judgement. Warmth and a lens that is screwed in
anew change it by 1 to 2 per mille, a focus that was touched by per cents."""
_LEAST_LENS = 5.0
"""Pixels of focal length or principal point, likewise."""
_GLANCE = 8
"""Steps of the adjustment after which it is seen whether an exchange explains anything: good starts
need five to ten."""
_PASSES = 5
_NONE = Scaled("nothing")


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
    """

    effect: Effect
    size: Array
    sigma: Array
    solution: Solved
    moments: tuple[str, ...] = ()


@dataclass(frozen=True)
class Diagnosis:
    """What was found to be wrong.

    Parameters
    ----------
    ranking : Ranking of Cause
        The hypotheses that were solved in full, and 'nothing'.
    nothing : Tried of Cause
        That nothing is wrong.
    noise : tuple of Noise
        Of the corners, by camera.
    seen : Seen
        What was looked at.
    """

    ranking: Ranking[Cause]
    nothing: Tried[Cause]
    noise: tuple[Noise, ...]
    seen: Seen = field(repr=False)

    @property
    def cause(self) -> Cause | None:
        """The best hypothesis, where it is much better than none."""
        best = self.ranking.best
        gained = self.nothing.criterion - best.criterion
        effect = best.what.effect
        gradual = isinstance(effect, Scaled) or effect.kind == "lens"
        matters = not gradual or self._moved > _LEAST_HARM
        if isinstance(effect, Scaled):
            # Poses may be right by what else is known: what was stated is wrong all the same.
            share, lens = abs(best.what.size[0]), effect.what == "focal"
            sure = gained > _SURE_GAIN and share > (_LEAST_FOCAL if lens else _LEAST_PRINT)
            matters = sure or (matters and (lens or share > _LEAST_PRINT))
        elif effect.kind == "lens":
            far = float(np.abs(best.what.size[:4]).max()) > _LEAST_LENS
            matters = matters or (gained > _SURE_GAIN and far)
        return best.what if gained > LEAST_GAIN and matters else None

    @property
    def alike(self) -> tuple[Effect, ...]:
        """The best hypothesis and others of its kind, which nothing tells apart from it.

        The images of the same stops of another camera, or another moment of the same move.
        """
        best = self.ranking.best.what.effect
        return (best, *(o.what.effect for o in self.ranking.rivals() if best.like(o.what.effect)))

    @property
    def _moved(self) -> float:
        """Standard deviations by which the best hypothesis moves the robot somewhere."""
        before, after = self.nothing.what.solution, self.ranking.best.what.solution
        rows = before.evidence.stop_bodies()
        if not len(rows):
            return 0.0
        off = (after.setup.t_body[rows] - before.setup.t_body[rows])[:, :2]
        spread = np.diagonal(before.adjustment.body_covariances[rows], axis1=1, axis2=2)
        return float(np.abs(off / np.sqrt(spread[:, :2])).max())

    @cached_property
    def shifts(self) -> Array:
        """(s, 3) best hypothesis minus result: x, y (metres), theta (radians) of each stop.

        Of several that nothing tells apart (`alike`) the largest.
        """
        tried = {one.what.effect: one.what.solution for one in self.ranking.tried}
        every = np.array([self._off(tried[effect]) for effect in self.alike])
        largest = np.linalg.norm(every[:, :, :2], axis=2).argmax(0)
        return np.asarray(np.take_along_axis(every, largest[None, :, None], axis=0)[0])

    def _off(self, after: Solved) -> Array:
        """(s, 3) a solution minus result, of the stops of the best hypothesis."""
        place = {name: i for i, name in enumerate(after.evidence.bodies)}
        bodies, T = set(self.ranking.best.what.solution.evidence.bodies), after.setup.T_world_body
        off = [
            planar_pose(T[place[name]]) - pose if (name := f"stop {stop}") in place else np.zeros(3)
            for stop, (pose, _) in self.seen.results.items()
            if f"stop {stop}" in bodies
        ]
        shifts = np.array(off).reshape(-1, 3)
        shifts[:, 2] = wrap(shifts[:, 2])
        return shifts

    @cached_property
    def harm(self) -> Array:
        """(s,) how many standard deviations of x, y, theta that is, at the most."""
        bodies = set(self.ranking.best.what.solution.evidence.bodies)
        sigmas = [
            np.sqrt(np.diagonal(covariance))
            for stop, (_, covariance) in self.seen.results.items()
            if f"stop {stop}" in bodies
        ]
        return np.asarray(np.abs(self.shifts / np.array(sigmas).reshape(-1, 3)).max(1, initial=0.0))

    def fitting_stops(self, corners: float, floor: float) -> tuple[set[str], set[str]]:
        """Stops whose corners fit, and those on the floor, with the best hypothesis.

        Parameters
        ----------
        corners, floor : float
            Probabilities below which they do not.
        """
        at = self.ranking.best.what.solution
        evidence = at.evidence
        fits = special.chdtrc(np.maximum(at.counts, 1), at.misfits) >= corners
        bad = {g.moment for g, fit in zip(evidence.groups, fits, strict=True) if not fit}
        stands = special.chdtrc(3, at.body_misfits[evidence.stop_bodies()]) >= floor
        standing = {stop for stop, fit in zip(evidence.stops, stands, strict=True) if fit}
        return set(evidence.stops) - bad, standing


@kept_result()
def diagnose(seen: Seen) -> Diagnosis:
    """The hypotheses about what is wrong, the best first.

    Parameters
    ----------
    seen : Seen
        What was seen and stated.

    Raises
    ------
    NotDeterminedError
        If what was seen does not determine where things are.
    """
    evidence, noise = with_own_noise(evidence_of(seen))
    null = solved(evidence)
    nothing = Tried(Cause(_NONE, np.zeros(1), np.zeros(1), null), null.score, null.freedom)
    linear = Linear(null)
    promising = _promising(linear)
    tried = [nothing, *_climbed(promising, null)]
    best = min(tried, key=lambda one: one.criterion)
    if best.chi_squared > _BAD * best.freedom or _strangers(seen):
        tried += _exchanged(exchanges(seen), seen, null, noise)
    elif best.what.effect.kind in {"lens", "focal_length"}:
        # One of many cameras with the file of another one: the rest fits.
        files = (e for e in exchanges(seen) if e.kind == "camera_files_exchanged")
        tried += _exchanged(files, seen, null, noise)
    return Diagnosis(ranked(tried), nothing, noise, seen)


def _strangers(seen: Seen) -> bool:
    """Whether two cameras see the robot in two places at one stop."""
    return any(effect.kind == "images_exchanged" for effect in exchanges(seen))


def _climbed(effects: Sequence[Effect], null: Solved) -> list[Tried[Cause]]:
    """Hypotheses solved in full; of those as good as the best also the moments beside theirs."""
    tried: list[Tried[Cause]] = []
    left, known = list(effects), set[Effect]()
    while left:
        effect = left.pop(0)
        known.add(effect)
        try:
            one = _tried(effect, null)
        except (NotDeterminedError, np.linalg.LinAlgError):
            continue
        if one.criterion < min((other.criterion for other in tried), default=np.inf) + RIVAL:
            left += [e for e in _neighbours(effect, null.evidence) if e not in known]
        tried.append(one)
    return tried


def _exchanged(
    effects: Iterable[Exchanged], seen: Seen, null: Solved, noise: Sequence[Noise]
) -> list[Tried[Cause]]:
    """What may have been exchanged, at a glance; the best of it solved in full.

    Where two cameras see two stops, what is exchanged may be the images of either: images do not
    tell, only the survey does.
    """
    found: dict[Exchanged, Tried[Cause]] = {}
    for effect in effects:
        with contextlib.suppress(NotDeterminedError, np.linalg.LinAlgError):
            found[effect] = _reread(effect, seen, null, noise)
    if not found:
        return []
    best = min(found, key=lambda effect: found[effect].criterion)
    same = [effect for effect in found if best.like(effect)]
    for effect in same:
        found[effect] = _reread(effect, seen, null, noise, MAX_STEPS)
    right = [effect for effect in same if surveyed_rightly(effect, seen)]
    if len(same) > len(right) == 1:
        told = found[right[0]]
        for effect in same:
            del found[effect]
        effect = replace(right[0], by_survey=True)
        found[effect] = replace(told, what=replace(told.what, effect=effect))
    return list(found.values())


@kept_result()
def _reread(
    effect: Exchanged, seen: Seen, null: Solved, noise: Sequence[Noise], steps: int = _GLANCE
) -> Tried[Cause]:
    """What was seen read another way."""
    evidence = evidence_of(effect.reread(seen))
    if effect.kind == "camera_files_exchanged":  # with the noise that shows by the right lens
        evidence, _ = with_own_noise(evidence)
    else:
        evidence = with_noise(evidence, noise)
    at = solved(evidence, steps=steps)
    cause = Cause(effect, np.zeros(0), np.zeros(0), at)
    before, after = (
        float(np.linalg.slogdet(one.views.covariance)[1].sum()) for one in (null.evidence, evidence)
    )
    # What took no part before, or takes none now, would have fitted as well as can be hoped.
    more = 2.0 * (len(null.evidence.views) - len(evidence.views))
    return Tried(
        cause,
        at.score + max(more, 0.0),
        at.freedom,
        places=float(effect.places),
        cost=after - before,
    )


def _promising(linear: Linear) -> list[Effect]:
    """Hypotheses that gain much to first order, the best moment of each kind and subject."""
    best: dict[tuple[str, str], tuple[float, Effect]] = {}
    for effect in all_effects(linear.at.evidence):
        worth = effect.gain(linear).worth(effect.prior) - 2 * float(np.log(effect.places))
        key = effect.kind, effect.subject
        if worth > 0 and (key not in best or worth > best[key][0]):
            best[key] = worth, effect
    ordered = sorted(best.values(), key=lambda one: -one[0])
    return [e for worth, e in ordered[:_MOST_TRIED] if worth > _LEAST_SHARE * ordered[0][0]]


def _neighbours(effect: Effect, evidence: Evidence) -> list[Effect]:
    """The same at the stop before and the stop after."""
    if not isinstance(effect, Moved):
        return []
    stops = effect.moments(evidence)
    at = stops.index(effect.since)
    return [replace(effect, since=stops[i]) for i in (at - 1, at + 1) if 0 <= i < len(stops)]


@kept_result()
def _tried(effect: Effect, null: Solved) -> Tried[Cause]:
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
        at.freedom - len(cause.size),
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
        if effect.kind == "reference":
            i = one.bodies.index(REFERENCE)
            return one.knowledge.bodies[i], solution.adjustment.body_covariances[i]
        slots = effect.slots(one)
        return one.knowledge.shared[slots, slots], solution.adjustment.covariance[slots, slots]

    def occam(one: Evidence, solution: Solved) -> float:
        information, covariance = known(one, solution)
        if not information.any():  # it was taken as exact
            return 0.0
        return -float(np.linalg.slogdet(information)[1] + np.linalg.slogdet(covariance)[1])

    if effect.kind == "reference":
        size = bodies[evidence.bodies.index(REFERENCE)]
    else:
        size = shared[effect.slots(evidence)]
    sigma = np.sqrt(np.diagonal(known(evidence, at)[1]))
    return Cause(effect, size, sigma, at), occam(evidence, at) - occam(before, null), 0.0
