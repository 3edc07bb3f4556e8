"""The camera network as a system of gtval: campaign folder to robot poses."""

from typing import TYPE_CHECKING

from validation.results import VALIDATION_SYSTEM
from vision_gt.settings import VisionSettings

if TYPE_CHECKING:
    from validation.campaign.folder import Campaign
    from validation.results import SystemResult
    from validation.systems import Progress
    from vision_gt.campaign.outcome import VisionOutcome


class VisionSystem:
    """Robot poses from cameras and markers."""

    name = "vision"

    def has_data(self, campaign: "Campaign") -> bool:
        """Whether there are images of the robot at its stops."""
        folder = campaign.folder / campaign.section("vision", VisionSettings).images / "poses"
        return folder.is_dir() and any(path.is_dir() for path in folder.iterdir())

    def solve(self, campaign: "Campaign", progress: "Progress") -> "SystemResult":
        """Poses, findings and report sections."""
        from vision_gt.campaign.solve import solve_campaign

        return result_of(solve_campaign(campaign, progress), campaign)


def result_of(outcome: "VisionOutcome", campaign: "Campaign") -> "SystemResult":
    """An outcome in the form that all systems share."""
    from validation.results import SystemResult
    from vision_gt.campaign.findings import vision_findings
    from vision_gt.campaign.result_files import vision_files
    from vision_gt.campaign.sections import vision_sections

    tables = [table for table in (outcome.poses, outcome.published) if table is not None]
    return SystemResult(
        tables=tables,
        findings=vision_findings(outcome, _surveyed(campaign)),
        sections=vision_sections(outcome, campaign),
        files=vision_files(outcome),
        facts=vision_facts(outcome),
    )


def _surveyed(campaign: "Campaign") -> tuple[str, ...]:
    """Stops that the survey of this run has placed; none outside of a run."""
    solved = campaign.solved.get(VALIDATION_SYSTEM)
    return () if solved is None else tuple(name for table in solved.tables for name in table.ids)


def vision_facts(outcome: "VisionOutcome") -> dict[str, object]:
    """Numbers of the vision system for scripts."""
    network = outcome.network.network
    return {
        "stops": len(outcome.stops),
        "stops_with_pose": [stop.pose for stop in outcome.stops if stop.chosen is not None],
        "stops_ambiguous": [
            stop.pose
            for stop in outcome.stops
            if stop.chosen is None and any(p.ambiguous for p in stop.by_camera.values())
        ],
        "cameras": {
            camera.name: {
                "position": [float(v) for v in network.T_gtv_camera[i].translation],
                "position_sigma": [
                    float(network.pose_covariance(camera.name)[k, k] ** 0.5) for k in range(3)
                ],
                "chain": list(outcome.network.chain.path(camera.name)),
            }
            for i, camera in enumerate(network.cameras)
        },
        "corner_sigma": network.sigma,
        "calibration_rms": {name: c.rms for name, c in outcome.calibrations.items()},
        "steadiness": {one.camera: one.verdict for one in outcome.steadiness},
        "as_published": outcome.published is not None,
    }


SYSTEM = VisionSystem()
