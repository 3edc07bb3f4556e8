"""Poses of laser GT as pose tables."""

from laser_gt.campaign.outcome import LaserOutcome
from laser_gt.placing.solution import LaserSolution
from validation.poses.pose_table import PoseTable


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
            )
        )
    return tables


def _table(solution: LaserSolution) -> PoseTable:
    """Poses by one engine; the source of each says how many accepted matches hold its stop."""
    matching, joint = solution.matching, solution.placement.joint
    n = len(solution.stops)
    counts = [
        sum(stop in {one.reference, one.moving} for one in matching.accepted)
        for stop in solution.stops
    ]
    return PoseTable(
        system=f"laser_{matching.engine}",
        ids=solution.stops,
        poses=solution.placement.poses,
        covariances=joint.reshape(n, 3, n, 3)[range(n), :, range(n), :],
        joint=joint,
        sources=tuple(f"{count} matches" for count in counts),
        provenance={
            "reference": list(solution.anchors),
            "accepted": len(matching.accepted),
            "matches": len(matching.matches),
        },
    )
