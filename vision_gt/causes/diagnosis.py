"""Which hypothesis explains best what does not fit, and whether that is enough to be told."""

import contextlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy import special

from validation.pieces.results import kept_result
from validation.poses.angles import Array, wrap
from validation.statistics.hypotheses import RIVAL, Ranking, Tried, ranked
from vision_gt.causes.effects import Effect, Moved, Scaled, all_effects
from vision_gt.causes.evidence import Evidence, Seen, evidence_of
from vision_gt.causes.exchanges import Exchanged, bar_exchanged, exchanges, lenses_exchanged
from vision_gt.causes.in_full import Cause, tried_in_full
from vision_gt.causes.linear import Linear
from vision_gt.causes.trial import Noise, Solved, solved, with_noise, with_own_noise
from vision_gt.least_squares.adjustment import MAX_STEPS, NotDeterminedError
from vision_gt.optics.transforms import planar_pose

LEAST_GAIN = 2 * float(np.log(1e3))
"""Of the criterion: odds of a thousand to one against 'nothing is wrong', as nearly all campaigns
have nothing of the kind."""
_MOST_TRIED = 10
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
_NONE = Scaled("nothing")


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
        # The survey tells hypotheses apart, but is no reason to have one: that is images that do
        # not fit.
        seen = _by_images(self.nothing) - _by_images(best)
        gained = seen if self.against else min(seen, self.nothing.criterion - best.criterion)
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
    def against(self) -> bool:
        """Whether the surveyed stops fit the poses as they are far better than the best hypothesis.

        By odds of a thousand to one, as much as it takes to tell a cause.
        """
        return self.ranking.best.what.survey - self.nothing.what.survey > LEAST_GAIN

    @property
    def others(self) -> tuple[Cause, ...]:
        """Hypotheses that nothing rules out beside the best one, but for those of its kind."""
        own = {self.nothing.what.effect, *self.alike}
        return tuple(o.what for o in self.ranking.rivals() if o.what.effect not in own)

    @property
    def excluded(self) -> tuple[Effect, ...]:
        """What the images alone do not rule out beside the best hypothesis, and the survey does."""
        best = self.ranking.best
        left = {best.what.effect, *(o.what.effect for o in self.ranking.rivals())}
        limit = _by_images(best) + RIVAL
        out = [o.what.effect for o in self.ranking.tried if _by_images(o) < limit]
        same = [e for e in out if isinstance(e, Moved) and e.like(best.what.effect)]
        return tuple(e for e in out if e not in {*left, *same, self.nothing.what.effect})

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

        Of several that nothing tells apart (`alike`, `others`) the largest.
        """
        tried = {one.what.effect: one.what.solution for one in self.ranking.tried}
        named = (*self.alike, *(one.effect for one in self.others))
        every = np.array([self._off(tried[effect]) for effect in named])
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
    cause = Cause(_NONE, np.zeros(1), np.zeros(1), null)
    nothing = _surveyed(Tried(cause, null.score, null.freedom), seen)
    promising = _promising(Linear(null))
    tried = [nothing, *_climbed(promising, seen, null)]
    best = min(tried, key=lambda one: one.criterion)
    if best.chi_squared > _BAD * best.freedom or _strangers(seen):
        tried += _exchanged(exchanges(seen), seen, null, noise)
    elif best.what.effect.kind in {"lens", "focal_length"} or _noisy(noise):
        # One of many cameras with the lens of another one: the rest fits.
        tried += _exchanged(lenses_exchanged(seen), seen, null, noise)
    if best.what.effect.kind == "bar":
        tried += _exchanged(bar_exchanged(seen), seen, null, noise)
    return Diagnosis(ranked(tried), nothing, noise, seen)


def _surveyed(tried: Tried[Cause], seen: Seen) -> Tried[Cause]:
    """A hypothesis with what the surveyed stops say of it (`surveyed`)."""
    if not seen.surveyed.ids:
        return tried
    at = tried.what.solution
    said = seen.surveyed.misfit(at.evidence.stops, *Linear(at, bounded=False).stop_poses())
    return replace(tried, what=replace(tried.what, survey=said), cost=tried.cost + said)


def _by_images(tried: Tried[Cause]) -> float:
    """The criterion of a hypothesis without what the survey says of it."""
    return tried.criterion - tried.what.survey


def _noisy(noise: Sequence[Noise]) -> bool:
    """Whether corners scatter as about another camera's lens."""
    return any(one.factor > _BAD for one in noise)


def _strangers(seen: Seen) -> bool:
    """Whether two cameras see the robot in two places at one stop."""
    return any(effect.kind == "images_exchanged" for effect in exchanges(seen))


def _climbed(effects: Sequence[Effect], seen: Seen, null: Solved) -> list[Tried[Cause]]:
    """Hypotheses solved in full; of those as good as the best also the moments beside theirs."""
    tried: list[Tried[Cause]] = []
    left, known = list(effects), set[Effect]()
    while left:
        effect = left.pop(0)
        known.add(effect)
        try:
            one = _surveyed(tried_in_full(effect, null), seen)
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
            found[effect] = _surveyed(_reread(effect, seen, null, noise), seen)
    if not found:
        return []
    best = min(found, key=lambda effect: found[effect].criterion)
    same = [effect for effect in found if best.like(effect)]
    for effect in same:
        found[effect] = _surveyed(_reread(effect, seen, null, noise, MAX_STEPS), seen)
    return list(found.values())


@kept_result()
def _reread(
    effect: Exchanged, seen: Seen, null: Solved, noise: Sequence[Noise], steps: int = _GLANCE
) -> Tried[Cause]:
    """What was seen read another way."""
    evidence = evidence_of(effect.reread(seen))
    if effect.lenses:  # with the noise that shows by the right lens
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
