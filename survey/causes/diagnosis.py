"""What is wrong with a survey: one cause, and what else is wrong once that is allowed for."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from survey.causes.lead import Lead, log_of
from survey.causes.search import SINGLE, Causes, continued, searched
from survey.causes.start import located_trial, whole_trial
from survey.causes.trial import Fit, Trial
from survey.estimation.solve import SurveySolution
from survey.estimation.vframe import estimate_vframe
from survey.estimation.world_points import locate_world_points
from survey.readings.readings import Mask, Readings
from validation.campaign.folder import RobotFrame, Vframe
from validation.statistics.hypotheses import RIVAL, Ranking, Tried

MOST_CAUSES = 3
"""Causes looked for one after the other. A judgement: a survey with more is measured anew."""


@dataclass(frozen=True)
class Diagnosis:
    """Common causes, and what remains.

    Parameters
    ----------
    found : tuple of Causes
        Each with a common cause as its best hypothesis, the largest first.
    rest : Causes
        The search after them: its best hypothesis is none, or independent blunders.
    """

    found: tuple[Causes, ...]
    rest: Causes

    @property
    def fit(self) -> Fit:
        """The survey with all that was found allowed for."""
        return self.rest.best_fit

    @property
    def plain(self) -> Fit:
        """All readings as they are."""
        return (*self.found, self.rest)[0].plain


def diagnose(
    solution: SurveySolution, vframe: Vframe, rig: RobotFrame, readings: Readings
) -> Diagnosis:
    """Common causes of what is wrong with a survey, each allowed for in the search of the next.

    Parameters
    ----------
    solution : SurveySolution
        What the chain of single solutions gave.
    vframe, rig : Vframe, RobotFrame
        Nominal frames.
    readings : Readings
        All readings, in the order of the file.
    """
    return _diagnosed(whole_trial(solution, vframe, rig, readings), vframe, readings)


def diagnose_unsolved(
    vframe: Vframe, rig: RobotFrame, readings: Readings, world_points: Sequence[str]
) -> Diagnosis:
    """The same where the chain of single solutions ends in a contradiction."""
    world = locate_world_points(world_points, readings, estimate_vframe(vframe, readings))
    located = dict(zip(world.names, world.positions, strict=True))
    missing = [point.name for point in world.missing]
    return _diagnosed(located_trial(vframe, rig, readings, located, missing, {}), vframe, readings)


def without_cause(diagnosis: Diagnosis, readings: Readings) -> Readings:
    """The readings that the common causes do not speak about."""
    kept = np.ones(len(readings), dtype=bool)
    for causes in diagnosis.found:
        kept[causes.rows[causes.ranking.best.what.rows]] = False
    return readings.select(kept)


def _diagnosed(started: tuple[Trial, Mask], vframe: Vframe, readings: Readings) -> Diagnosis:
    trial, inside = started
    log = log_of(readings.select(inside), list(vframe.points))
    rows = np.flatnonzero(inside)
    found: list[Causes] = []
    causes = searched(trial, log, rows)
    while claimed(causes.ranking) and len(found) < MOST_CAUSES:
        found.append(causes)
        causes = searched(continued(causes.best_fit), log, rows)
    if claimed(causes.ranking):
        causes = replace(causes, ranking=Ranking((nothing(causes.ranking),)))
    return Diagnosis(tuple(found), causes)


def claimed(ranking: Ranking[Lead]) -> bool:
    """Whether a common cause is likelier than none by more than the odds that rule out."""
    best = ranking.best
    gap = nothing(ranking).criterion - best.criterion
    return best.what.kind not in SINGLE and gap > RIVAL


def nothing(ranking: Ranking[Lead]) -> Tried[Lead]:
    """The hypothesis that nothing is wrong."""
    return next(one for one in ranking.tried if one.what.kind == "none")


def blunders(ranking: Ranking[Lead]) -> Tried[Lead] | None:
    """The best hypothesis of independent blunders, if any was worth solving."""
    return next((one for one in ranking.tried if one.what.kind == "blunders"), None)
