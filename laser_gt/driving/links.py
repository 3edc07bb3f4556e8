"""Relative poses of two sweeps, as edges of the graph; matched in parallel processes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from laser_gt.matching.both_ways import both_ways
from laser_gt.matching.judgement import MatchSettings, match
from laser_gt.matching.local import MOSTLY_FAKE, align
from laser_gt.matching.search import SearchSettings
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.planar import wrapped
from laser_gt.scans.scan import Sweep, digest_of
from validation.pieces.store import code_of, kept_here, key_of
from validation.pieces.work import done_once
from validation.poses.angles import Array

REACH = 0.15
"""Metres within which points are paired at first, from a guess by the submaps or by a judged match.
A judgement: many times what such a guess is off, and less than from one wall to the next."""
MOVED = (0.1, 0.05)
"""Metres and radians that a link may be away from such a guess: two thirds of the reach."""
WORST = 3.0
"""Largest ratio of the residuals to what noise explains: beyond it, a match may be wrong."""
WIDEST = 8.0
"""Half width in metres of the largest search. A judgement: the length of a room, and what a drive
of ten minutes is off by where its scans show little."""
SEEN_TWICE = 0.7
"""Share of the points that both could see and that agree, from which on a match that may be
wrong enters the graph with a switchable weight. A judgement: half-way from refuted to accepted."""
IN_FREE_SPACE = 0.15
"""Largest share of points in free space of such a match; the same."""
IN_COMMON = 0.2
"""Least share of all points that lie on the other sweep, of a match that is searched for. A
judgement: less than a fifth of two views is a corner, and buildings have many."""
CODE = ("laser_gt.scans", "laser_gt.matching", "laser_gt.driving.links")
"""What links are made by."""
PART = 24
"""Pairs that a process takes at once: few enough to share the work evenly, enough to prepare each
sweep for several of them."""


@dataclass(frozen=True)
class Link:
    """A measured motion from one sweep to another.

    Parameters
    ----------
    start, end : int
        Sweeps.
    pose : (3,) array
        Frame of the end in that of the start.
    information : (3, 3) array
        Inverse covariance; zero along what the scans do not determine.
    sure : bool
        Whether it is not to be doubted.
    """

    start: int
    end: int
    pose: Array
    information: Array
    sure: bool = False


@dataclass(frozen=True)
class Asked:
    """A pair to be matched.

    Parameters
    ----------
    start, end : int
        Sweeps.
    guess : (3,) array
        Frame of the end in that of the start.
    sigmas : (float, float)
        How well the guess is known, metres and radians; used where a match is to be judged.
    """

    start: int
    end: int
    guess: Array
    sigmas: tuple[float, float] = (0.0, 0.0)


Job = tuple[Mapping[int, Sweep], Sequence[Asked]]


def matched_links(
    sweeps: Sequence[Sweep],
    asked: Sequence[Asked],
    workers: int,
    report: Callable[[float], None],
    *,
    judged: bool,
) -> list[Link]:
    """A link for each pair whose match holds.

    Parameters
    ----------
    sweeps : sequence of Sweep
        All of the drive.
    asked : sequence of Asked
        Pairs.
    workers : int
        Processes.
    report : callable
        Told the share done.
    judged : bool
        Whether each match is searched for and judged; else it is polished from its guess.
    """
    parts = [asked[first : first + PART] for first in range(0, len(asked), PART)]
    jobs: list[Job] = [
        ({number: sweeps[number] for one in part for number in (one.start, one.end)}, part)
        for part in parts
    ]
    work, form = partial(_links_of, judged=judged), _Form()
    few = workers if len(jobs) > workers else 1
    kept = kept_here("laser_links.jsonl", "groups of links")
    done = done_once(work, jobs, partial(_key, judged=judged), kept, form, few, report)
    return [link for found in done for link in found]


class _Form:
    """Links of a part of the pairs, as they are kept."""

    @staticmethod
    def written(result: Sequence[Link], job: Job) -> dict[str, Any]:
        """As values that JSON has, sweeps by their place in the job."""
        place = {number: at for at, number in enumerate(job[0])}
        rows = [
            [
                place[one.start],
                place[one.end],
                one.pose.tolist(),
                one.information.tolist(),
                one.sure,
            ]
            for one in result
        ]
        return {"links": rows}

    @staticmethod
    def read(told: dict[str, Any], job: Job) -> list[Link]:
        """The links, their sweeps being those of the job."""
        numbers = list(job[0])
        return [
            Link(numbers[start], numbers[end], np.array(pose), np.array(information), bool(sure))
            for start, end, pose, information, sure in told["links"]
        ]


def _key(job: Job, *, judged: bool) -> str:
    """Hash of all that the links of a part depend on."""
    sweeps, asked = job
    place = {number: at for at, number in enumerate(sweeps)}
    pairs = [(place[one.start], place[one.end], one.guess.tolist(), one.sigmas) for one in asked]
    digests = (digest_of(one).encode() for one in sweeps.values())
    return key_of(code_of(*CODE), repr((judged, pairs)).encode(), *digests)


def _links_of(job: Job, *, judged: bool) -> list[Link]:
    """The links of a part of the pairs."""
    sweeps, asked = job
    prepared = {number: Prepared(replace(sweep)) for number, sweep in sweeps.items()}
    found = [_link(prepared[one.start], prepared[one.end], one, judged=judged) for one in asked]
    return [link for link in found if link is not None]


def _link(reference: Prepared, moving: Prepared, asked: Asked, *, judged: bool) -> Link | None:
    """The link of a pair, if its match holds."""
    guess, sure = asked.guess, False
    if judged:
        length, angle = asked.sigmas
        form = MatchSettings(length, angle, search=SearchSettings(window=WIDEST))
        seen = match(reference, moving, guess, form)
        agrees = seen.agreement >= SEEN_TWICE and seen.violating <= IN_FREE_SPACE
        alone = seen.rival <= -form.judgement.rival_margin
        much = seen.explained >= IN_COMMON and seen.scale <= WORST
        refused = seen.verdict == "refuted" or not much
        if refused or not (seen.verdict == "accepted" or (agrees and alone)):
            return None
        guess, sure = seen.pose, False
    found = polished(reference, moving, guess)
    return None if found is None else Link(asked.start, asked.end, *found, sure)


def polished(reference: Prepared, moving: Prepared, guess: Array) -> tuple[Array, Array] | None:
    """Pose and information of a match from a good guess, both ways; None where it does not hold.

    Notes
    -----
    Directions of which most of the information is fake (`laser_gt.matching.local`) have none: along
    a corridor a link says nothing.
    """
    found = align(reference.surface, moving.surface, guess, reach=REACH)
    if not np.isfinite(found.covariance[0]).all() or found.scale[0] > WORST:
        return None
    pose, covariance = both_ways(reference.surface, moving.surface, found)
    off = wrapped(pose - guess)
    if np.hypot(off[0], off[1]) > MOVED[0] or abs(off[2]) > MOVED[1]:
        return None
    information = np.linalg.inv(covariance)
    total = found.information[0] + found.fake[0]
    whitener = np.linalg.inv(np.linalg.cholesky(total + 1e-9 * np.trace(total) * np.eye(3)))
    share, axes = np.linalg.eigh(whitener @ found.fake[0] @ whitener.T)
    for axis in (whitener.T @ axes).T[share >= MOSTLY_FAKE]:
        along = information @ axis
        information = information - np.outer(along, along) / max(float(axis @ along), 1e-12)
    return pose, (information + information.T) / 2
