"""Matches as the scripts and templates of the page take them: plain values."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from laser_gt.logs.decisions import Decision
from laser_gt.matching.verdicts import Match
from laser_gt.panel.bench import ENGINE, Pair, Seen, by_need
from laser_gt.scans.evidence import Prepared, evidence
from laser_gt.scans.planar import transform
from validation.poses.angles import Array

FAR = 0.3
"""Metres beyond which the nearest point of the other scan is no partner, and there is no residual.
A judgement: half of a doorway."""
MOST_ROWS = 2_000
"""Pairs that the list holds. A judgement: a screen holds twenty."""


def rows_told(seen: Seen) -> list[dict[str, Any]]:
    """The list of all pairs, those that need a person first."""
    decisions = seen.outcome.inputs.decisions
    return [
        {
            "reference": one.reference,
            "moving": one.moving,
            "verdict": one.verdict,
            "first": (seen.objections(one) or one.reasons or ("",))[0],
            "decided": _decided(decisions.get((one.reference, one.moving))),
        }
        for one in by_need(seen)[:MOST_ROWS]
    ]


def _decided(decision: Decision | None) -> str:
    """'accept by ann', '' where nothing is decided."""
    if decision is None:
        return ""
    return f"{decision.kind} by {decision.by}" if decision.by else decision.kind


def pair_told(seen: Seen, pair: Pair) -> dict[str, Any]:
    """All that is shown of one pair: both scans, before and after, why, and its loops."""
    one = seen.match(pair)
    sweeps = seen.outcome.inputs.by_stop
    reference, moving = sweeps[one.reference], sweeps[one.moving]
    decision = seen.outcome.inputs.decisions.get((one.reference, one.moving))
    return {
        "scans": {"reference": _scan(reference), "moving": _scan(moving)},
        "guess": one.guess.tolist(),
        "match": match_told(seen, one, reference, moving),
        "decision": None
        if decision is None
        else {"kind": decision.kind, "by": decision.by, "note": decision.note},
        "loops": _loops(seen, one),
    }


def match_told(seen: Seen, one: Match, reference: Prepared, moving: Prepared) -> dict[str, Any]:
    """A match, its verdict and reasons, residuals and what contradicts it."""
    objected = set(seen.objections(one))
    crossing = evidence(reference, moving, one.pose[None]).crossing
    return {
        "reference": one.reference,
        "moving": one.moving,
        "pose": one.pose.tolist(),
        "verdict": one.verdict,
        "reasons": [{"text": text, "objection": text in objected} for text in one.reasons],
        "facts": {
            "sigma_length": one.sigma_length,
            "sigma_angle": one.sigma_angle,
            "explained": one.explained,
            "agreement": one.agreement,
            "violating": one.violating,
            "returned": one.returned,
        },
        "residuals": residuals(reference, moving, one.pose),
        "contradicting": [np.flatnonzero(flags[0]).tolist() for flags in crossing],
    }


def residuals(reference: Prepared, moving: Prepared, pose: Array) -> list[int | None]:
    """Distance of each point of the moving scan from the other's surface, in millimetres.

    Along the normal of the nearest point where it has one, else to that point; None where there
    is none within `FAR`.
    """
    points = transform(pose, moving.sweep.points)
    distance, nearest = reference.tree.query(points, distance_upper_bound=FAR)
    there = np.isfinite(distance)
    at = np.where(there, nearest, 0)
    surface = reference.surface
    across = np.einsum("ij,ij->i", points - surface.centres[at], surface.normals[at])
    values = np.where(surface.flat[at], across, distance)
    return [
        round(1e3 * value) if good else None
        for value, good in zip(values.tolist(), there.tolist(), strict=True)
    ]


def _scan(one: Prepared) -> dict[str, Any]:
    """Points in millimetres, and unit normals in hundredths where there is a line."""
    surface = one.surface
    normals = np.where(surface.flat[:, None], surface.normals, 0)
    return {
        "points": np.round(1e3 * one.sweep.points).astype(int).ravel().tolist(),
        "normals": np.round(100 * normals).astype(int).ravel().tolist(),
    }


def _loops(seen: Seen, one: Match) -> list[dict[str, Any]]:
    """The loops of three scans through a pair, those that do not close first."""
    pair = {one.reference, one.moving}
    mine = [loop for loop in seen.matching.loops if pair <= set(loop.stops)]
    mine.sort(key=lambda loop: -loop.chi_squared)
    return [
        {
            "over": next(stop for stop in loop.stops if stop not in pair),
            "closes": bool(loop.closes),
            "off": round(float(np.sqrt(loop.chi_squared)), 1),
        }
        for loop in mine
    ]


def summary_told(seen: Seen) -> Mapping[str, Any]:
    """How many are of which verdict, and how many stops are placed."""
    placed = seen.placed()
    solution = seen.outcome.solutions.get(ENGINE)
    hanging = {stop for _, some in solution.hanging for stop in some} if solution else set()
    stops = seen.outcome.inputs.stops
    return {
        "counts": {verdict.replace(" ", "_"): n for verdict, n in seen.matching.counts.items()},
        "placed": len(placed),
        "stops": len(stops),
        "hanging": len(hanging),
        "lost": [stop for stop in stops if stop not in set(placed)],
        "kinds": [
            {"kind": kind, "count": len(some)} for kind, some in seen.sole_objections().items()
        ],
    }
