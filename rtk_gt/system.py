"""RTK-GPS as a system of gtval: campaign folder to spatial poses."""

from pathlib import Path
from typing import TYPE_CHECKING

from rtk_gt.settings import RtkSettings

if TYPE_CHECKING:
    from rtk_gt.campaign.outcome import RtkOutcome
    from validation.campaign.folder import Campaign
    from validation.results import SystemResult
    from validation.systems import Progress


class RtkSystem:
    """The path of a vehicle with three or more RTK-GPS receivers, or what one or two give."""

    name = "rtk"

    def has_data(self, campaign: "Campaign") -> bool:
        """Whether campaign.toml names receivers."""
        return bool(campaign.section("rtk", RtkSettings).receivers)

    def inputs(self, campaign: "Campaign") -> list[Path]:
        """The records of the receivers, and what is drawn beside them."""
        settings = campaign.section("rtk", RtkSettings)
        files = {receiver.file for receiver in settings.receivers}
        files |= {settings.odometry} - {""}
        files |= {settings.aerial.file} if settings.aerial is not None else set()
        return sorted(campaign.folder / file for file in files)

    def solve(self, campaign: "Campaign", progress: "Progress") -> "SystemResult":
        """Path, findings and report sections."""
        if len(campaign.section("rtk", RtkSettings).receivers) < 3:
            from rtk_gt.positions.result import positions_result
            from rtk_gt.positions.solve import solve_positions

            return positions_result(solve_positions(campaign, progress))
        from rtk_gt.campaign.solve import solve_campaign
        from validation.pieces.processes import give_back_memory

        found = result_of(solve_campaign(campaign, progress))
        give_back_memory()
        return found


def result_of(outcome: "RtkOutcome") -> "SystemResult":
    """An outcome in the form that all systems share."""
    from rtk_gt.campaign.facts import rtk_facts
    from rtk_gt.campaign.findings import rtk_findings
    from rtk_gt.campaign.pose_tables import vehicle_table, vehicle_trajectory
    from rtk_gt.campaign.result_files import rtk_files
    from rtk_gt.campaign.sections import rtk_overview, rtk_sections
    from validation.results import SystemResult

    return SystemResult(
        tables=[vehicle_table(outcome.path, outcome.leaps, outcome.corrected)],
        findings=rtk_findings(outcome),
        sections=rtk_sections(outcome),
        files=rtk_files(outcome),
        facts=rtk_facts(outcome),
        overview=rtk_overview(outcome),
        trajectories=(
            [vehicle_trajectory(outcome.path, outcome.settings.max_gap)]
            if len(outcome.path) > 1 and _moves_beside(outcome.campaign)
            else []
        ),
    )


def _moves_beside(campaign: "Campaign") -> bool:
    """Whether there is anything that the path could be compared with in time.

    An hour at 20 Hz is a trajectory of 25 MB.
    """
    return bool(campaign.settings.published) or bool(set(campaign.extra) - {"rtk"})


SYSTEM = RtkSystem()
