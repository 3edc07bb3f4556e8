"""Which explanation: by a test of every part, an information criterion, and prediction."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import special

from validation.explain.fitting.fit import LEAST_P, MOST_SCALE, Fit
from validation.explain.fitting.leave_one_out import LeaveOneOut, leave_one_out
from validation.explain.fitting.level import contradicts
from validation.explain.fitting.models import (
    DRIFTS,
    FRAME_TURN,
    SHIFT_MOUNT,
    ErrorModel,
    candidates,
)
from validation.explain.fitting.observability import Observability, observability
from validation.explain.fitting.pairs import Pairs
from validation.explain.fitting.serial import (
    Kinds,
    Serial,
    joint_of,
    memory_of,
    says_dependent,
    serial,
)
from validation.explain.fitting.shared import dropped_p_value, shared_covariance
from validation.explain.fitting.starts import fit_all
from validation.statistics.hypotheses import RIVAL
from validation.statistics.neighbours import FEWEST, is_said

FALSE_ALARM = 0.02
"""Chance that any systematic error at all is claimed in a clean campaign: a lab that believes one
takes its robot apart. `benchmarks/explain_rates.py --only clean` counts it."""


LASTING = 0.6
"""Over the number of poses: the chance that lasting errors do as much as a part must be below it if
errors are as likely to last as not, and below less by the odds that they last. 200 tables a kind
with it: a frame of eight standard deviations of its own estimate is found in 97, 96 and 96 % of 12,
20 and 60 independent poses (without the odds in favour of independent ones in 96, 92 and 93 %); a
cause is invented in 4 % of the tables of 12 poses with a correlation of 0.5, in 1 % of 20, in none
of 60, in none of 20 and 60 with 0.8 and in 1 and 0 % with 0.95 (100 tables of 20 without it: in 6,
18 and 33 %)."""
MOST_LASTING = 0.5
"""Of that level: a part whose like lasting errors bring about in every other table is none, however
sure it is that they do not last."""


@dataclass(frozen=True)
class Candidate:
    """One explanation with all by which it is judged.

    Parameters
    ----------
    fit : Fit
        Robust, to all pairs.
    loo : LeaveOneOut
        Its predictions.
    criterion : float
        BIC: -2 log likelihood + (number of systematic parameters) log(number of observations).
    p_values : dict of str to float
        For each simpler explanation contained in this one: the chance of so large a gain if the
        simpler one were true.
    observability : Observability
        What the data determine.
    needed : bool
        Whether every part passes its test and prediction gains.
    serial : Serial, optional
        What its parameters are worth where errors depend on their neighbours.
    alone : bool
        Whether it would be needed if errors were independent.
    """

    fit: Fit
    loo: LeaveOneOut
    criterion: float
    p_values: dict[str, float]
    observability: Observability
    needed: bool
    serial: Serial | None = None
    alone: bool = False

    @property
    def model(self) -> ErrorModel:
        """What was fitted."""
        return self.fit.model

    @property
    def name(self) -> str:
        """Of the model."""
        return self.model.name


@dataclass(frozen=True)
class Selection:
    """The explanations of one system's errors, and the one chosen.

    Parameters
    ----------
    pairs : Pairs
        What they were fitted to.
    candidates : tuple of Candidate
        All of them, the simplest first.
    chosen : Candidate
        The best of those whose every part is needed.
    rivals : tuple of Candidate
        Others that cannot be ruled out.
    threshold : float
        p-value below which a part counts as needed.
    memory : float
        Log of the odds that errors depend on their neighbours, whatever the cause; `dependent`
        says whether they count as such.
    dependent : bool
        Whether intervals and tests allow for that.
    """

    pairs: Pairs
    candidates: tuple[Candidate, ...]
    chosen: Candidate
    rivals: tuple[Candidate, ...]
    threshold: float
    memory: float = -np.inf
    dependent: bool = False

    def candidate(self, name: str) -> Candidate:
        """The one with that name."""
        return next(one for one in self.candidates if one.name == name)

    @property
    def taken_out(self) -> Candidate:
        """What is taken out before sources are compared with each other.

        The chosen one; where errors depend on their neighbours, what would be chosen if they did
        not: whether it is a cause or lasts by chance, it is no fault of single poses. A drift is
        such a lasting one itself.
        """
        if not self.dependent or self.chosen.model.drifts:
            return self.chosen
        constant = [one for one in self.candidates if one.alone and not one.model.drifts]
        return min(constant, key=lambda one: _criterion(one.fit))

    @property
    def weights(self) -> dict[str, float]:
        """Share of belief in each explanation by the criterion alone (Schwarz weights)."""
        values = np.array([one.criterion for one in self.candidates])
        shares = np.exp(-(values - values.min()) / 2)
        shares /= shares.sum()
        return {one.name: float(share) for one, share in zip(self.candidates, shares, strict=True)}


def select(pairs: Pairs, false_alarm: float = FALSE_ALARM) -> Selection:
    """The explanation of one system's errors, among all candidates.

    An explanation counts only if each of its parts is needed: against every simpler explanation
    contained in it the likelihood must gain more than chance would (at ``false_alarm`` shared
    equally among the candidates), and left-out poses must be predicted better. Among those the
    one with the least BIC is chosen. Headings that are the direction of motion tell no mount.

    Parameters
    ----------
    pairs : Pairs
        At least three.
    false_alarm : float
        Chance that a clean system gets any explanation but 'none'.
    """
    models = candidates(reference=pairs.reference_pose is not None, moving=pairs.motion is not None)
    lost = pairs.convention.headings_lost
    if lost:
        models = tuple(one for one in models if not {"mount", "turn"} & set(one.parts))
    fits = fit_all(pairs, models)
    if contradicts(fits, pairs):
        pairs = replace(pairs, contradicted=True)
        fits = fit_all(pairs, models)
    both = next((one for one in fits if one.model.name == "frame_mount"), None)
    if both is not None and not observability(both).complete:
        fits += fit_all(pairs, [FRAME_TURN, SHIFT_MOUNT], fits)
    known: Memories = {}
    odds = _odds(pairs, fits, known)
    dependent = is_said(odds, len(pairs))
    if dependent and not lost:  # perhaps by a drift
        fits += fit_all(pairs, DRIFTS, fits)
        odds = _odds(pairs, fits, known)
        dependent = is_said(odds, len(pairs))
    threshold = false_alarm / (len(fits) - 1)
    asked = _Asked(pairs, threshold, odds, dependent, known)
    made = _all_judged(fits, [], asked)
    chosen = _best(made, dependent)
    unlike = any(one.alone and one.model.parts for one in made)
    tried = lost or any(one.model.drifts for one in made)
    if unlike and not tried and _lasting(known, len(pairs)):
        # A drift along a smooth path looks like many a cause.
        made = _all_judged(fit_all(pairs, DRIFTS, fits), made, asked)
        chosen = _best(made, dependent)
    rivals = _rivals(made, chosen, threshold)
    return Selection(pairs, tuple(made), chosen, rivals, threshold, odds, dependent)


def _all_judged(
    fits: Sequence[Fit], before: Sequence[Candidate], asked: "_Asked"
) -> list[Candidate]:
    """Candidates, each judged against those before it."""
    made = list(before)
    for one in fits:
        made.append(_judged(one, made, asked))
    return made


Memories = dict[str, Kinds | None]
"""Memories of what the explanations leave, by their names."""


class _Asked(NamedTuple):
    """By what candidates are judged: the level of their parts, and what is known of memories."""

    pairs: Pairs
    threshold: float
    odds: float
    dependent: bool
    known: Memories

    @property
    def lasting(self) -> float:
        """Level of a part where errors last: lower, the likelier it is that they do."""
        even = LASTING / len(self.pairs)
        return max(min(even * float(np.exp(-self.odds)), MOST_LASTING), self.threshold)

    @property
    def looks(self) -> bool:
        """Whether what lasting errors do is looked at."""
        few = len(self.pairs) < MANY and self.pairs.between is None
        return self.dependent or few


def _lasting(known: Memories, n: int) -> bool:
    """Whether errors as they came may depend on their neighbours, as those of a drift do.

    More likely than not is enough to try one. Of a large drift most poses count as gross, and too
    few are left to tell.
    """
    plain = known.get("none")
    return n >= FEWEST and (plain is None or joint_of(plain) > 0)


def _best(made: Sequence[Candidate], dependent: bool = False) -> Candidate:
    """The one with the least criterion of those whose every part is needed.

    Where neighbours depend on each other, one that fits far worse than another is no explanation,
    only because the better one might be chance: then it is 'none'. Where nothing says that they do,
    a drift gives way to a constant cause that fits better.
    """
    most = min(one.criterion for one in made) + (_FAR if dependent else np.inf)
    near = [one for one in made if one.criterion < most or not one.model.parts]
    best = min((one for one in near if one.needed), key=lambda one: one.criterion)
    if not dependent and best.model.drifts:
        constant = [one for one in near if one.alone and one.model.parts and not one.model.drifts]
        return min([best, *constant], key=lambda one: one.criterion)
    return best


def _odds(pairs: Pairs, fits: Sequence[Fit], known: Memories) -> float:
    """Log of the odds that errors depend on their neighbours, over all explanations.

    What all poses share by their survey looks like memory, too, but not in what a frame and a
    mount leave.
    """
    if pairs.between is not None:
        fits = [one for one in fits if one.model.name == "frame_mount"] or list(fits)
    criteria = np.array([_criterion(one) for one in fits])
    least = criteria.min()
    far = _FAR if len(pairs) < MANY else 0.0
    for one, value in zip(fits, criteria, strict=True):
        name = one.model.name
        if name not in known and (value <= least + far or not one.model.parts):
            known[name] = memory_of(pairs, one)
    return says_dependent(criteria, [known.get(one.model.name) for one in fits])


_FAR = 10.0
"""Of the criterion: the odds of a model that is worse are below 1 to 148, and only a memory that
the better ones show as well could make up for that; 'none' is always looked at."""


MANY = 1000
"""Poses from which on only the best explanation, and none, are looked at for memories: with so many
the second best has no weight."""


def _criterion(found: Fit) -> float:
    """BIC with the systematic parameters only."""
    k = len(found.model.parameters)
    return -2 * float(found.log_likelihood[0]) + k * float(np.log(max(found.observations, 2)))


def _judged(found: Fit, simpler: Sequence[Candidate], asked: _Asked) -> Candidate:
    """A fit with its tests against the simpler candidates.

    Where poses share errors, or errors depend on their neighbours, what these could do as well
    does not count for it.
    """
    pairs, threshold, dependent = asked.pairs, asked.threshold, asked.dependent
    inside = [one for one in simpler if one.model.nested_in(found.model)]
    p_values = {one.name: gain_p_value(one.fit, found) for one in inside}
    if pairs.between is not None and not found.estimated:
        own = found.covariance[0]
        whole = own + shared_covariance(found, own, pairs.between)
        for one in inside:
            shared = dropped_p_value(found, one.fit, whole)
            p_values[one.name] = max(p_values[one.name], shared)
    loo = leave_one_out(found)
    seen = observability(found)
    criterion = _criterion(found)
    # What independent errors would do as well, lasting ones would all the more.
    passes = all(p < threshold for p in p_values.values())
    sound = seen.complete and not _at_its_bound(found)
    better = all(loo.score > one.loo.score for one in inside)
    alone = passes and better and sound
    looks = passes and sound and (dependent or (better and asked.looks and inside))
    worth = serial(pairs, found, kinds=asked.known.get(found.model.name)) if looks else None
    lasts = True
    if worth is not None:
        lasting = {one.name: _dropped(worth, found, one.fit) for one in inside}
        lasts = all(p < asked.lasting for p in lasting.values())
        if dependent:
            criterion -= 2 * joint_of(worth.kinds)
            p_values = {name: max(p, lasting[name]) for name, p in p_values.items()}
    # A pose is predicted well by whatever its neighbours share with it: no test of a cause.
    needed = passes and sound and lasts and (dependent or better)
    return Candidate(found, loo, criterion, p_values, seen, needed, worth, alone)


def _dropped(worth: Serial, full: Fit, simple: Fit) -> float:
    """Chance of so large values of what a simpler explanation leaves out, with lasting errors.

    A drift is no less of one where it lasts by chance.
    """
    kept = set(simple.model.parameters)
    names = full.model.parameters
    rows = [i for i, name in enumerate(names) if name not in kept]
    if all(names[row].startswith(("drift", "growth")) for row in rows):
        return 0.0
    return worth.p_value(full.parameters[0, rows], rows) if rows else 1.0


def _at_its_bound(found: Fit) -> bool:
    """Whether the scale has run against its bound: then it is none."""
    named = dict(zip(found.model.fitted, found.parameters[0], strict=True))
    return bool(abs(named.get("scale", 0.0)) > 0.999 * MOST_SCALE)


def gain_p_value(simple: Fit, full: Fit) -> float:
    """Chance that a contained explanation would fit so much worse if it were true.

    Notes
    -----
    Likelihood ratio; with estimated noise it is turned into an F statistic, whose denominator
    has the observations minus all fitted parameters as degrees of freedom.
    """
    extra = len(full.model.parameters) - len(simple.model.parameters)
    gain = max(2 * float(full.log_likelihood[0] - simple.log_likelihood[0]), 0.0)
    if not full.estimated:
        return max(float(special.chdtrc(extra, gain)), LEAST_P)
    n = full.observations
    # Two noise levels are estimated besides the parameters.
    left = n - len(full.model.fitted) - 2
    if left < 1:
        return 1.0
    statistic = np.expm1(min(gain / n, 700.0)) * left / extra
    return max(float(special.fdtrc(extra, left, statistic)), LEAST_P)


def smallest_shown(found: Fit, threshold: float) -> tuple[float, float]:
    """Shift and turn that an explanation must have to pass its test in 95 % of campaigns.

    Parameters
    ----------
    found : Fit
        Of 'frame' or 'mount'.
    threshold : float
        p-value that the test asks for.

    Returns
    -------
    shift, turn : float
        In metres and radians, each by itself; to first order.
    """
    k = len(found.model.parameters)
    sigma = np.sqrt(np.diagonal(found.covariance[0])[:k])
    if found.estimated:
        left = max(found.observations - len(found.model.fitted) - 2, 1)
        sigma = sigma * np.sqrt(found.observations / left)
        reach = np.sqrt(k * special.fdtri(k, left, 1 - threshold)) + special.stdtrit(left, 0.95)
    else:
        reach = np.sqrt(special.chdtri(k, threshold)) + special.ndtri(0.95)
    return float(reach * sigma[:2].max()), float(reach * sigma[2])


def _rivals(
    made: Sequence[Candidate], chosen: Candidate, threshold: float
) -> tuple[Candidate, ...]:
    """Explanations that do not contain the chosen one and are not clearly worse."""
    close = []
    for one in made:
        if one.name == chosen.name or chosen.model.nested_in(one.model):
            continue
        if one.model.nested_in(chosen.model):
            continue  # the test of the chosen one's parts has ruled it out
        if not one.observability.complete or _at_its_bound(one.fit):
            continue
        against_none = one.p_values.get("none", 0.0)
        if one.criterion - chosen.criterion < RIVAL and against_none < threshold:
            close.append(one)
    return tuple(sorted(close, key=lambda one: one.criterion))
