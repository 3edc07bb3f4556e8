"""The drive of a robot as a system of gtval: a log of scans to a trajectory."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from laser_gt.settings import DriveSettings

if TYPE_CHECKING:
    from validation.campaign.folder import Campaign
    from validation.results import SystemResult
    from validation.systems import Progress


class LaserDriveSystem:
    """A trajectory from a log of scans."""

    name = "laser_drive"
    starts_from_survey = True

    def has_data(self, campaign: "Campaign") -> bool:
        """Whether there is a log."""
        settings = campaign.section("laser_drive", DriveSettings)
        return (campaign.folder / settings.scans).exists()

    def inputs(self, campaign: "Campaign") -> list[Path]:
        """Log, odometry and stops."""
        settings = campaign.section("laser_drive", DriveSettings)
        files = [settings.scans, settings.odometry, settings.stops]
        return [campaign.folder / file for file in files if file is not None]

    def optional_inputs(self, campaign: "Campaign") -> list[Path]:
        """The stops: without them the drive is in a frame of its own."""
        settings = campaign.section("laser_drive", DriveSettings)
        return [campaign.folder / settings.stops]

    def solve(self, campaign: "Campaign", progress: "Progress", **choices: Any) -> "SystemResult":
        """The trajectory, its poses at stops, findings and the report's section.

        The choices are those of `laser_gt.drive_campaign.solve.solve_drive_campaign`.
        """
        from laser_gt.drive_campaign.solve import solve_drive_campaign

        return solve_drive_campaign(campaign, progress, **choices)


SYSTEM = LaserDriveSystem()
