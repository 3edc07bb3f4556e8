"""Laser GT as a system of gtval: campaign folder to robot poses."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from laser_gt.settings import LaserSettings

if TYPE_CHECKING:
    from laser_gt.campaign.outcome import LaserOutcome
    from validation.campaign.folder import Campaign
    from validation.results import SystemResult
    from validation.systems import Progress


class LaserSystem:
    """Robot poses from scans."""

    name = "laser"
    starts_from_survey = True

    def has_data(self, campaign: "Campaign") -> bool:
        """Whether there are scans."""
        settings = campaign.section("laser", LaserSettings)
        return any((campaign.folder / file).exists() for file in settings.scan_files)

    def inputs(self, campaign: "Campaign") -> list[Path]:
        """Scans, times of the stops, odometry and decisions."""
        settings = campaign.section("laser", LaserSettings)
        files = [*settings.scan_files, settings.stops, settings.odometry, settings.decisions]
        return [campaign.folder / file for file in files]

    def optional_inputs(self, campaign: "Campaign") -> list[Path]:
        """Those of them that need not be there: decisions, and what is not stated.

        Without odometry scans find their way alone, or by what a log holds itself; scans of a table
        say themselves which stop they are of.
        """
        settings = campaign.section("laser", LaserSettings)
        files = [settings.decisions]
        if "odometry" not in settings.model_fields_set:
            files.append(settings.odometry)
        if settings.format == "csv":
            files.append(settings.stops)
        return [campaign.folder / file for file in files]

    def solve(self, campaign: "Campaign", progress: "Progress", **choices: Any) -> "SystemResult":
        """Poses by scan matching and by the genetic aligner, findings and report sections.

        Where no stop can be placed, the matches with their verdicts are a result all the same, with
        an error among the findings. The choices are those of
        `laser_gt.campaign.solve.solve_campaign`.
        """
        from laser_gt.campaign.solve import solve_campaign

        return result_of(solve_campaign(campaign, progress, need_poses=False, **choices))


def result_of(outcome: "LaserOutcome") -> "SystemResult":
    """An outcome in the form that all systems share."""
    from laser_gt.campaign.facts import laser_facts
    from laser_gt.campaign.findings import laser_findings
    from laser_gt.campaign.pose_tables import pose_tables
    from laser_gt.campaign.result_files import result_files
    from laser_gt.campaign.sections import laser_sections, pose_table, verdict_table
    from validation.results import SystemResult

    return SystemResult(
        tables=pose_tables(outcome),
        findings=laser_findings(outcome),
        sections=laser_sections(outcome),
        files=result_files(outcome),
        facts=laser_facts(outcome),
        overview=[
            *map(verdict_table, outcome.matchings.values()),
            *map(pose_table, outcome.solutions.values()),
        ],
    )


SYSTEM = LaserSystem()
