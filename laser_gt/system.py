"""Laser GT as a system of gtval: campaign folder to robot poses."""

from typing import TYPE_CHECKING

from laser_gt.settings import LaserSettings

if TYPE_CHECKING:
    from laser_gt.campaign.outcome import LaserOutcome
    from validation.campaign.folder import Campaign
    from validation.poses.pose_table import PoseTable
    from validation.results import SystemResult
    from validation.systems import Progress


class LaserSystem:
    """Robot poses from scans."""

    name = "laser"

    def has_data(self, campaign: "Campaign") -> bool:
        """Whether there are scans."""
        settings = campaign.section("laser", LaserSettings)
        own = [scanner.scans for scanner in settings.scanners.values() if scanner.scans]
        return any((campaign.folder / file).exists() for file in own or [settings.scans])

    def solve(self, campaign: "Campaign", progress: "Progress") -> "SystemResult":
        """Poses by scan matching and by the genetic aligner, findings and report sections."""
        from laser_gt.campaign.outcome import solve_campaign

        return result_of(solve_campaign(campaign, progress))


def result_of(outcome: "LaserOutcome") -> "SystemResult":
    """An outcome in the form that all systems share."""
    from laser_gt.campaign.findings import laser_facts, laser_findings
    from laser_gt.campaign.sections import laser_sections, matches_csv
    from validation.results import SystemResult

    files = {
        f"laser_matches_{engine}.csv": matches_csv(matching)
        for engine, matching in outcome.matchings.items()
    }
    return SystemResult(
        tables=pose_tables(outcome),
        findings=laser_findings(outcome),
        sections=laser_sections(outcome),
        files=dict(files),
        facts=laser_facts(outcome),
    )


def pose_tables(outcome: "LaserOutcome") -> "list[PoseTable]":
    """Poses by each engine, and by the document's way where that was asked for."""
    from validation.poses.pose_table import PoseTable

    tables = []
    for engine, solution in outcome.solutions.items():
        n = len(solution.stops)
        joint = solution.placement.joint
        tables.append(
            PoseTable(
                system=f"laser_{engine}",
                ids=solution.stops,
                poses=solution.placement.poses,
                covariances=joint.reshape(n, 3, n, 3)[range(n), :, range(n), :],
                joint=joint,
                sources=tuple(_source(outcome, engine, stop) for stop in solution.stops),
                provenance={
                    "reference": list(solution.anchors),
                    "accepted": len(solution.matching.accepted),
                    "matches": len(solution.matching.matches),
                },
            )
        )
    if outcome.published is not None:
        tables.append(
            PoseTable(
                system="laser_genetic_as_published",
                ids=outcome.published.stops,
                poses=outcome.published.poses,
                sources=tuple(
                    f"match with {outcome.published.reference}" for _ in outcome.published.stops
                ),
                provenance={"reference": [outcome.published.reference]},
            )
        )
    return tables


def _source(outcome: "LaserOutcome", engine: str, stop: str) -> str:
    """How many accepted matches hold a stop."""
    matching = next(m for name, m in outcome.matchings.items() if name == engine)
    count = sum(stop in (m.reference, m.moving) for m in matching.accepted)
    return f"{count} matches"


SYSTEM = LaserSystem()
