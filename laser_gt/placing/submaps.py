"""Neighbours merged into submaps, where scans that see half a turn leave stops apart.

Two scans of half a turn that look different ways have little in common. What joins each with its
neighbours is known already: these scans are laid together, and the two maps are matched as one.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laser_gt.matching.judgement import MatchSettings, match
from laser_gt.matching.verdicts import Match
from laser_gt.placing.switches import Part
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.planar import compose
from laser_gt.scans.scan import Sweep, View
from validation.poses.angles import Array

HALF_VIEW = np.pi + 0.1
"""Radians that the views of a sweep see together, up to which it is merged. A judgement: half a
turn and a little, as small scanners of 240 degrees overlap whatever their heading."""
NEIGHBOURS = 3
"""Scans that are merged with one. A judgement: they look to both sides and behind."""
KNOWN = 0.01
"""Standard deviation in metres (and half of it in radians) up to which a neighbour is merged: the
range noise of the scanners that need it, so that walls stay thin."""


def sees_half(sweep: Sweep) -> bool:
    """Whether a sweep sees half a turn or less."""
    seen = sum(float(np.ptp(view.scan.angles)) + view.scan.step for view in sweep.views)
    return seen <= HALF_VIEW


def matched_as_submaps(
    sweeps: Sequence[Prepared],
    part: Part,
    pair: tuple[int, int],
    guess: Array,
    settings: MatchSettings,
) -> Match | None:
    """The match of two stops with their neighbours; None where neither has any.

    Parameters
    ----------
    sweeps : sequence of Prepared
        Of all stops.
    part : Part
        The graph of the matches that are used.
    pair : (int, int)
        Two stops in different parts of it.
    guess : (3,) array
        The second seen from the first.
    settings : MatchSettings
        How well that is known, and the limits of the verdict.

    Notes
    -----
    The covariance is that of the match and of the worst neighbour on either side: all of a
    submap may lie off by as much.
    """
    (first, one_spread, one_count), (second, other_spread, other_count) = (
        _submap(sweeps, part, stop) for stop in pair
    )
    if one_count == other_count == 1:
        return None
    found = match(first, second, guess, settings)
    text = f"matched as submaps of {one_count} and {other_count} scans"
    spread = one_spread + other_spread
    seen = None if found.seen_covariance is None else found.seen_covariance + spread
    return replace(
        found,
        covariance=found.covariance + spread,
        seen_covariance=seen,
        reasons=(*found.reasons, text),
    )


def _submap(sweeps: Sequence[Prepared], part: Part, stop: int) -> tuple[Prepared, Array, int]:
    """A stop's sweep with those of its neighbours, the covariance of the worst, and how many."""
    poses = part.solution.poses
    others = np.flatnonzero(part.parts == part.parts[stop])
    others = others[others != stop]
    far = np.hypot(*(poses[others, :2] - poses[stop, :2]).T)
    chosen: list[tuple[int, Array, Array]] = []
    for other in others[np.argsort(far, kind="stable")].tolist():
        pose, covariance = part.step(stop, other)
        sigmas = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
        if (sigmas < [KNOWN, KNOWN, KNOWN / 2]).all():
            chosen.append((other, pose, covariance))
        if len(chosen) == NEIGHBOURS:
            break
    if not chosen:
        return sweeps[stop], np.zeros((3, 3)), 1
    views = list(sweeps[stop].sweep.views)
    for other, pose, _ in chosen:
        views += [View(one.scan, compose(pose, one.mount)) for one in sweeps[other].sweep.views]
    worst = max((covariance for *_, covariance in chosen), key=lambda one: float(np.trace(one)))
    return Prepared(Sweep(tuple(views), sweeps[stop].name)), worst, len(chosen) + 1
