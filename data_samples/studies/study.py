"""A study: all its trials, and what they say of intervals, covariances and findings."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy import special

from data_samples.studies.plan import Plan
from data_samples.studies.trial import KeptTrials, SystemErrors, Trial, TrialJob, run_trial
from validation.pieces.processors import processors
from validation.pieces.store import FOLDER
from validation.pieces.work import done_once
from validation.poses.angles import Array
from validation.shown import Shown
from validation.systems import Progress, no_progress


class Ranged(NamedTuple):
    """A number with its interval; NaN where it cannot be told."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, repr=False)
class Honesty(Shown):
    """What a system's poses were against the truth, in all rooms of one setting.

    Parameters
    ----------
    setting, system : str
        Which.
    trials : int
        Rooms with poses of the system.
    poses, stops : int
        Poses that it gave, and stops of these rooms.
    rms : (3,) array
        Of the errors in x, y (metres), theta (radians).
    inside : Ranged
        Share of the errors inside the interval of the study's confidence that the poses state.
    nees : Ranged
        Mean NEES over its expectation, the number of components.
    """

    setting: str
    system: str
    trials: int
    poses: int
    stops: int
    rms: Array
    inside: Ranged
    nees: Ranged

    def verdict(self, confidence: float) -> str:
        """'as stated', 'too sure' or 'too careful', by the interval of the share inside."""
        if not np.isfinite(self.inside.low):
            return "not told"
        if self.inside.high < confidence:
            return "too sure"
        return "too careful" if self.inside.low > confidence else "as stated"


@dataclass(frozen=True, repr=False)
class Power(Shown):
    """How often something was found in the rooms of one setting.

    Parameters
    ----------
    setting, severity, code : str
        What, and where.
    found, trials : int
        Rooms in which it was found, of all that gave a result.
    times : float
        In how many places of such a room, on average.
    share : Ranged
        Of them, with the interval of Clopper and Pearson.
    """

    setting: str
    severity: str
    code: str
    found: int
    trials: int
    times: float
    share: Ranged


@dataclass(frozen=True, repr=False)
class Study(Shown):
    """What a study found.

    Parameters
    ----------
    plan : Plan
        What was asked.
    trials : mapping of str to sequence of Trial
        By setting, in the order of the seeds.
    honesty : tuple of Honesty
        By setting and system.
    power : tuple of Power
        By setting, the most frequent first.
    """

    plan: Plan
    trials: Mapping[str, Sequence[Trial]]
    honesty: tuple[Honesty, ...]
    power: tuple[Power, ...]

    def refused(self, setting: str) -> int:
        """Rooms of a setting that gave no result."""
        return sum(bool(one.refused) for one in self.trials[setting])


def run_study(
    plan: Plan, folder: Path, progress: Progress = no_progress, workers: int | None = None
) -> Study:
    """All trials of a plan, those that are kept and new ones.

    Parameters
    ----------
    plan : Plan
        What is asked.
    folder : Path
        Where trials are kept.
    progress : callable
        Told what is being done and the share done.
    workers : int, optional
        Processes; by default one for each processor.
    """
    jobs = [TrialJob(one, seed) for one in plan.settings.values() for seed in plan.seeds]
    kept = KeptTrials(folder / FOLDER / "trials.jsonl")
    many = min(processors(workers), len(jobs))
    tell = partial(progress, f"{len(jobs):,} rooms")
    done = done_once(run_trial, jobs, lambda job: job.key, kept, kept, many, tell)
    count = len(plan.seeds)
    trials = {label: done[at * count : (at + 1) * count] for at, label in enumerate(plan.settings)}
    honesty = [one for label, some in trials.items() for one in _honesty(plan, label, some)]
    power = [one for label, some in trials.items() for one in _power(plan, label, some)]
    return Study(plan, trials, tuple(honesty), tuple(power))


def _honesty(plan: Plan, label: str, trials: Sequence[Trial]) -> Iterator[Honesty]:
    """Every system of one setting."""
    reach = float(special.ndtri((1 + plan.confidence) / 2))
    for system in dict.fromkeys(name for one in trials for name in one.systems):
        rooms = [one for one in trials if system in one.systems]
        own = [one.systems[system] for one in rooms]
        errors = np.concatenate([one.errors for one in own])
        yield Honesty(
            setting=label,
            system=system,
            trials=len(own),
            poses=len(errors),
            stops=sum(one.stops for one in rooms),
            rms=np.sqrt((errors**2).mean(0)),
            inside=_share_inside([_inside(one, reach) for one in own], plan.confidence),
            nees=_of_rooms([one.nees / 3 for one in own], plan.confidence, 0.0, np.inf),
        )


def _share_inside(values: Sequence[Array], confidence: float) -> Ranged:
    """Share of all rooms; where no room has an error outside, as if each were one number.

    Student's interval has no width then, which would be a claim that few rooms cannot make.
    """
    found = _of_rooms(values, confidence, 0.0, 1.0)
    if found.value < 1 or np.isnan(found.low):
        return found
    rooms = sum(len(one) > 0 for one in values)
    return Ranged(found.value, proportion(rooms, rooms, confidence).low, 1.0)


def _inside(one: SystemErrors, reach: float) -> Array:
    """(k,) 1 where an error is inside its interval, 0 outside; those without a sigma left out."""
    known = np.isfinite(one.sigmas)
    return (np.abs(one.errors[known]) <= reach * one.sigmas[known]).astype(float)


def _of_rooms(values: Sequence[Array], confidence: float, least: float, most: float) -> Ranged:
    """Mean over all rooms, with Student's interval; errors of one room are not independent.

    Notes
    -----
    A ratio of sums over rooms, its variance by the residuals of the rooms (Cochran 1977, "Sampling
    techniques", section 6.4).
    """
    known = [one[np.isfinite(one)] for one in values]
    sums, counts = np.array([(one.sum(), len(one)) for one in known], dtype=float).T
    rooms = int((counts > 0).sum())
    if not rooms:
        return Ranged(np.nan, np.nan, np.nan)
    mean = float(sums.sum() / counts.sum())
    if rooms < 2:
        return Ranged(mean, np.nan, np.nan)
    left = sums - mean * counts
    sigma = float(np.sqrt((left**2).sum() * rooms / (rooms - 1)) / counts.sum())
    half = float(special.stdtrit(rooms - 1, (1 + confidence) / 2)) * sigma
    return Ranged(mean, max(mean - half, least), min(mean + half, most))


def _power(plan: Plan, label: str, trials: Sequence[Trial]) -> Iterator[Power]:
    """Every finding of one setting that is no praise."""
    rooms = [one for one in trials if not one.refused]
    places = [Counter((severity, code) for severity, code, _ in one.findings) for one in rooms]
    found = Counter(kind for one in places for kind in one if kind[0] != "good")
    order = {"error": 0, "warning": 1, "note": 2}
    for kind in sorted(found, key=lambda kind: (order[kind[0]], -found[kind], kind)):
        share = proportion(found[kind], len(rooms), plan.confidence)
        times = sum(one[kind] for one in places) / found[kind]
        yield Power(label, *kind, found[kind], len(rooms), times, share)


def proportion(found: int, of: int, confidence: float) -> Ranged:
    """A share with the interval of Clopper and Pearson (1934)."""
    if of == 0:
        return Ranged(np.nan, np.nan, np.nan)
    tail = (1 - confidence) / 2
    low = float(special.betaincinv(found, of - found + 1, tail)) if found else 0.0
    high = float(special.betaincinv(found + 1, of - found, 1 - tail)) if found < of else 1.0
    return Ranged(found / of, low, high)
