"""The search for one cause: hypotheses found by the linearised survey, solved, and ranked."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import erfc

from survey.causes.blunders import blunder_leads
from survey.causes.common_errors import common_error_leads
from survey.causes.lead import MANY, Lead, Log, look_elsewhere
from survey.causes.linear import UNSEEN, Linear
from survey.causes.names import name_leads
from survey.causes.places import place_leads
from survey.causes.trial import Fit, Rows, Trial, fit
from survey.causes.units import BEFORE_ALL, unit_leads
from survey.estimation.network import Parameters
from validation.statistics.hypotheses import RIVAL, Parameter, Ranking, Tried, ranked

SOLVED_OF_A_KIND = 3
"""Hypotheses of one kind and extent that are solved. A judgement: the first is nearly always the
best of its kind."""
HOPELESS = 10.0
"""A solution that stays so many times above the best chi-squared is not followed to its end."""
EXPLAINED = 1.2
"""The same once a cause explains all of a large survey: no blunders beside another make up for a
fifth of the chi-squared of `MANY` readings."""
LEAST_GAIN = 15.0
"""Decrease of chi-squared below which nothing pays for itself."""


@dataclass(frozen=True)
class Causes:
    """What may be wrong with a survey, ranked.

    Parameters
    ----------
    ranking : Ranking of Lead
        The hypotheses, 'none' among them.
    fits : dict of int to Fit
        Their solutions, by the identity of the lead.
    plain : Fit
        All readings as they are.
    rows : (n,) array of int
        Row of each distance of the trials in the readings.
    log : Log
        What is known of the distances besides.
    """

    ranking: Ranking[Lead]
    fits: dict[int, Fit]
    plain: Fit
    rows: Rows
    log: Log

    @property
    def best_fit(self) -> Fit:
        """The solution under the best hypothesis."""
        return self.fits[id(self.ranking.best.what)]


NOTHING = Lead("none", "all", (), np.empty(0, dtype=np.intp), 0.0, 1.0, lambda trial: trial)


def searched(trial: Trial, log: Log, rows: Rows) -> Causes:
    """The hypotheses about one trial, ranked.

    Where the best needs blunders beside it, points may have started in a wrong place: all is
    searched once more from where they are without those.
    """
    causes, there = _searched_once(trial, log, rows)
    if there is None or there.points.shape != trial.start.points.shape:
        return causes
    again, _ = _searched_once(replace(trial, start=there), log, rows)
    return min(causes, again, key=lambda one: one.ranking.best.criterion)


def _searched_once(trial: Trial, log: Log, rows: Rows) -> tuple[Causes, Parameters | None]:
    """The same from one start, and the solution with blunders where the best needs them."""
    robust, plain = _solved(trial)
    base = replace(trial, start=robust.at)
    linear = Linear(robust)
    tried = [Tried(NOTHING, plain.chi_squared, plain.freedom)]
    fits = {id(NOTHING): plain}
    least, enough = plain.chi_squared, -np.inf
    for lead in sorted(_worth_solving(base, linear, log), key=lambda one: -one.gain):
        if lead.gain < enough and not _is_needed(lead, tried, linear, log, enough):
            continue
        far = HOPELESS if enough == -np.inf else EXPLAINED
        solved = fit(lead.build(base), hopeless=far * least)
        least = min(least, solved.chi_squared)
        if not np.isfinite(solved.chi_squared):
            continue
        tried.append(
            Tried(
                lead, solved.chi_squared, solved.freedom, _as_scattered(lead.sizes(solved), solved),
                max(lead.places, 1.0), lead.cost,
            )
        )  # fmt: skip
        fits[id(lead)] = replace(solved)  # without its matrices
        if len(rows) > MANY and _fits(solved):
            enough = max(enough, BEHIND * lead.gain)
    common = [one for one in tried if one.what.kind not in SINGLE]
    places: dict[int, Parameters] = {}
    for one in sorted(common, key=lambda one: one.chi_squared)[:SOLVED_WITH_BLUNDERS]:
        if len(rows) > MANY and not _may_win(one, fits[id(one.what)], linear, tried):
            continue
        beside, there = _with_blunders(one, fits[id(one.what)])
        if beside.criterion < one.criterion:
            tried = [beside if other is one else other for other in tried]
            places[id(one.what)] = there
    ranking = ranked(tried)
    best = ranking.best.what
    explained = len(rows) > MANY and _fits(fits[id(best)])
    if best.kind == "blunders" and len(best.rows) > MOST_BESIDE and not explained:
        places[id(best)] = fits[id(best)].at
    return Causes(ranking, fits, plain, rows, log), places.get(id(best))


def _solved(trial: Trial) -> tuple[Fit, Fit]:
    """The robust and the plain solution; of a large survey without outliers both are the same."""
    values = np.array([effect.value for effect in trial.effects])
    many = len(trial.network.distance) > MANY
    if many and np.abs(trial.equations(trial.start, values)[0]).max() < 2 * NO_OUTLIER:
        plain = fit(trial)
        if np.abs(plain.residual).max(initial=0.0) < NO_OUTLIER:
            return plain, plain
    robust = fit(trial, robust=True)
    return robust, fit(replace(trial, start=robust.at))


NO_OUTLIER = 5.0
"""Standardised residual that a hundred thousand good readings hardly reach (6 in 10^7 do): up to it
a robust solution of a large survey (`MANY`) lies where the plain one does."""
BEHIND = 0.95
"""Share of the gain of a cause that explains all of a large survey (`MANY`) from which on another
is solved. Gains are exact where the survey is linear: of 500 stops with an offset of 5 mm they
foretold the chi-squared of five other causes to 0.1 % of the gain."""


def _is_needed(
    lead: Lead, tried: Sequence[Tried[Lead]], linear: Linear, log: Log, enough: float
) -> bool:
    """Whether a lead of little gain is solved: one of blunders, and those of names.

    What an exchange gains is seen before the places that it spoils have settled; but it gains no
    more than all that fits badly at its stations.
    """
    if lead.kind in NAMES:
        return _misfit_there(lead, linear, log) > enough
    if sum(one.what.kind not in SINGLE for one in tried) < SOLVED_IN_ALL:
        return True
    return lead.kind == "blunders" and all(one.what.kind != "blunders" for one in tried)


SOLVED_IN_ALL = 3
"""Common causes that are solved whatever they gain, so that the odds against the next are told."""


def _misfit_there(lead: Lead, linear: Linear, log: Log) -> float:
    """Chi-squared of all observations at the stations that a lead of names speaks about."""
    net = linear.fit.trial.network
    stations = {log.station[row] for row in lead.rows} | {*lead.subject}
    squares = linear.at_start**2
    n, first = len(net.distance), len(net.distance) + 2 * len(net.fixed)
    there = np.array([station in stations for station in log.station])
    poses = np.array([pose in stations for pose in net.poses], dtype=bool)
    marks = squares[first : first + 2 * len(net.mark)].reshape(-1, 2)[poses[net.mark_pose]]
    return float(squares[:n][there].sum() + marks.sum())


NAMES = {"exchanged_targets", "exchanged_rig_points", "exchanged_rows", "stop_number"}
"""Kinds whose gain is no score of the linearised survey."""


def _fits(solved: Fit) -> bool:
    """Whether the readings scatter no more than stated."""
    return bool(solved.chi_squared < solved.freedom + WIDE * np.sqrt(2.0 * max(solved.freedom, 1)))


def _may_win(one: Tried[Lead], solved: Fit, linear: Linear, tried: Sequence[Tried[Lead]]) -> bool:
    """Whether blunders beside a cause pay for themselves and may put it first."""
    less = _by_blunders(solved, linear)
    hoped = replace(one, chi_squared=max(one.chi_squared - less, 0.0))
    return less > LEAST_GAIN and hoped.criterion < min(other.criterion for other in tried)


def _by_blunders(solved: Fit, linear: Linear) -> float:
    """Decrease of chi-squared that as many blunders beside a cause as are allowed would bring.

    About twice that of each by itself, where they hide one another.
    """
    q = np.maximum(linear.redundancy, UNSEEN)
    worst = np.sort(solved.residual[: len(q)] ** 2 / q)[-MOST_BESIDE:]
    return float(worst[-1] if worst[-1] < LEAST_GAIN else 2 * worst.sum())


SINGLE = {"none", "blunders"}
"""Kinds that are no common cause."""
SOLVED_WITH_BLUNDERS = 4
"""Common causes beside which independent blunders are allowed for: those that fit best."""
MOST_BESIDE = 5
"""Blunders beside a common cause: more would explain anything."""


BESIDE = RIVAL
"""What it costs to say that readings have a common cause and blunders as well: one kind of mistake
is likelier than two. Without it an offset of 4 of its sigmas beside one blunder was put first."""


def _with_blunders(one: Tried[Lead], solved: Fit) -> tuple[Tried[Lead], Parameters]:
    """The hypothesis with the independent blunders that remain beside it, at their cost."""
    trial = continued(solved)
    leads = blunder_leads(trial, Linear(solved), MOST_BESIDE)
    if not leads:
        return one, solved.at
    lead = leads[0]
    both = fit(lead.build(trial))
    cost = sum(p.cost for p in lead.sizes(both)) + 2 * np.log(lead.places)
    parameters = _as_scattered(one.what.sizes(both), both)
    beside = replace(
        one,
        chi_squared=both.chi_squared,
        freedom=both.freedom,
        parameters=parameters,
        cost=one.cost + float(cost) + BESIDE,
    )
    return beside, both.at


def _as_scattered(sizes: Sequence[Parameter], solved: Fit) -> tuple[Parameter, ...]:
    """Sizes with the intervals that they have where all readings scatter more than is stated."""
    if _fits(solved):
        return tuple(sizes)
    m0 = solved.m0
    return tuple(
        replace(
            one, sigma=m0 * one.sigma,
            low=one.value - m0 * (one.value - one.low),
            high=one.value + m0 * (one.high - one.value),
            p_value=float(erfc(abs(one.value) / max(m0 * one.sigma, 1e-12) / np.sqrt(2.0))),
        )
        for one in sizes
    )  # fmt: skip


WIDE = 3.1
"""Standard deviations of chi-squared from which the readings scatter more than stated: 0.1 %."""


def continued(solved: Fit) -> Trial:
    """A trial that starts where it was solved."""
    effects = tuple(
        replace(effect, value=float(value))
        for effect, value in zip(solved.trial.effects, solved.values, strict=True)
    )
    return replace(solved.trial, start=solved.at, effects=effects)


def _worth_solving(base: Trial, linear: Linear, log: Log) -> list[Lead]:
    """The best few leads of each kind."""
    found: dict[tuple[str, str], list[Lead]] = {}
    for leads in (
        common_error_leads(base, linear, log),
        place_leads(base, linear, log),
        name_leads(base, linear, log),
        unit_leads(base, linear, log),
        blunder_leads(base, linear),
    ):
        for lead in leads:
            if lead.gain > LEAST_GAIN + look_elsewhere(base, lead.places):
                found.setdefault((lead.kind, lead.extent), []).append(lead)
    best: dict[object, Lead] = {}
    for alike in found.values():
        alike.sort(key=lambda one: -one.gain)
        for lead in alike[:SOLVED_OF_A_KIND]:
            _keep(best, lead, base)
    return list(best.values())


def _keep(best: dict[object, Lead], lead: Lead, base: Trial) -> None:
    """Add a lead; of those that say the same of the same readings the one with fewest places."""
    same = object()
    if lead.kind in {"offset", "scale"}:
        same = (lead.kind, lead.rows.tobytes())
    elif lead.kind.startswith("exchanged") and _from_one_point(lead.rows, base):
        same = ("exchanged", np.sort(lead.rows).tobytes())
    other = best.get(same)
    if other is None:
        best[same] = lead
        return
    # Two readings alone: that their rows are exchanged says the same as that their targets are.
    # A scale found as a unit starts where the readings in that unit fit.
    first, second = sorted(
        (other, lead),
        key=lambda one: (one.gain < BEFORE_ALL, one.kind != "exchanged_rows", one.places),
    )
    first = replace(first, places=min(first.places, second.places))
    if second.extent not in BLOCKS:
        named = f"{second.extent} {' '.join(second.subject)}".strip()
        also, equal = (*first.also, *second.also, named), (*first.equal, *second.equal, second)
        first = replace(first, also=also, equal=equal)
    best[same] = first


def _from_one_point(rows: Rows, base: Trial) -> bool:
    """Whether there are two readings, and a point at which both end.

    Then their rows may as well be exchanged as the names of their targets.
    """
    ends = {*base.network.first[rows].tolist()}, {*base.network.second[rows].tolist()}
    return len(rows) == 2 and min(len(ends[0]), len(ends[1])) == 1


BLOCKS = {"from", "until", "block"}
"""Extents that are only a time: a name that means the same readings says more."""
