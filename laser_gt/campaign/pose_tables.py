"""Poses of laser GT as pose tables."""

from collections import Counter

import numpy as np

from laser_gt.campaign.outcome import LaserOutcome
from laser_gt.placing.solution import LaserSolution
from validation.poses.follows import Follows
from validation.poses.pose_table import PoseTable
from validation.results import VALIDATION_SYSTEM


def pose_tables(outcome: LaserOutcome) -> list[PoseTable]:
    """Poses by each engine, and by the document's way where that was asked for."""
    tables = [_table(solution) for solution in outcome.solutions.values()]
    published = outcome.published
    if published is not None:
        tables.append(
            PoseTable(
                system="laser_genetic_as_published",
                ids=published.stops,
                poses=published.poses,
                sources=(f"match with {published.reference}",) * len(published.stops),
                provenance={"reference": [published.reference]},
                follows=Follows(
                    VALIDATION_SYSTEM,
                    (published.reference,),
                    published.by_reference,
                    np.eye(3),
                ),
            )
        )
    return tables


def _table(solution: LaserSolution) -> PoseTable:
    """Poses by one engine; the source of each says how many matches hold its stop."""
    matching = solution.matching
    counts = Counter(stop for one in matching.used for stop in {one.reference, one.moving})
    table = PoseTable(
        system=f"laser_{matching.engine}",
        ids=solution.stops,
        poses=solution.placement.poses,
        sources=tuple(
            f"{counts[stop]} matches{_hanging(solution, stop)}" for stop in solution.stops
        ),
        provenance={
            "reference": list(solution.anchors),
            "accepted": len(matching.accepted),
            "matches": len(matching.matches),
        },
        follows=Follows(
            VALIDATION_SYSTEM,
            solution.anchors,
            solution.placement.by,
            solution.placement.of,
            "frame and mount",
        ),
    )
    return solution.placement.covariance.stated_in(table)


def _hanging(solution: LaserSolution, stop: str) -> str:
    """What is said of a stop that nothing but a match that may be wrong joins with the survey."""
    pairs = [f"{one.reference} - {one.moving}" for one, stops in solution.hanging if stop in stops]
    return f", by {', '.join(pairs)} which may be wrong" if pairs else ""
