"""The camera network as a system of gtval: campaign folder to robot poses."""

from typing import TYPE_CHECKING

from validation.results import VALIDATION_SYSTEM
from vision_gt.settings import VisionSettings

if TYPE_CHECKING:
    from pathlib import Path

    from validation.campaign.folder import Campaign
    from validation.results import SystemResult
    from validation.systems import Progress
    from vision_gt.campaign.outcome import VisionOutcome


class VisionSystem:
    """Robot poses from cameras and markers."""

    name = "vision"
    starts_from_survey = True
    """For things on a table over surveyed stops, and for a board that checks the survey."""

    def has_data(self, campaign: "Campaign") -> bool:
        """Whether there are images, a printed table of what they show, or a plan."""
        settings = campaign.section("vision", VisionSettings)
        return has_images(campaign.folder, settings) or told_without_images(settings)

    def inputs(self, campaign: "Campaign") -> "list[Path]":
        """Images, what was decided about them, camera files, printed tables, odometry."""
        settings = campaign.section("vision", VisionSettings)
        plan = settings.plan
        files = [*settings.camera_files.values(), *settings.printed.files, plan.file]
        files += [one.file for one in plan.cameras]
        if plan.cameras and (campaign.folder / plan.stops).exists():
            files.append(plan.stops)
        if has_images(campaign.folder, settings) or not told_without_images(settings):
            files.append(settings.images)
        told = [settings.decisions, settings.drive.odometry]
        files += [file for file in told if file and (campaign.folder / file).exists()]
        return [campaign.folder / file for file in files if file]

    def solve(
        self,
        campaign: "Campaign",
        progress: "Progress",
        *,
        workers: int | None = None,
        **choices: bool,
    ) -> "SystemResult":
        """Poses, findings and report sections.

        ``workers`` are processes. ``choices`` are used instead of the settings of their names:
        as_published, merge_cameras, on_floor.
        """
        from dataclasses import replace

        from vision_gt.campaign.planned import with_plan
        from vision_gt.campaign.printed import printed_result
        from vision_gt.campaign.solve import finish
        from vision_gt.drive_campaign.solve import check_frames
        from vision_gt.network.solution import NoFrameError
        from vision_gt.parts.solve import solve_parts
        from vision_gt.parts.told import parts_result
        from vision_gt.stages.decided import left_out_findings
        from vision_gt.stages.lenses import begin
        from vision_gt.stages.places import NoLayoutError

        settings = campaign.section("vision", VisionSettings)
        if not has_images(campaign.folder, settings) and told_without_images(settings):
            return with_plan(printed_result(campaign, settings), campaign, settings)
        check_frames(campaign)
        begun = begin(campaign, progress, workers=workers, **choices)
        left_out = tuple(left_out_findings(campaign, settings))

        def told(result: "SystemResult") -> "SystemResult":
            return replace(result, findings=[*result.findings, *left_out])

        if not begun.given.shows_robot:
            return told(with_plan(parts_result(solve_parts(begun)), campaign, settings))
        try:
            outcome = finish(begun)
        except (NoFrameError, NoLayoutError) as error:
            return told(with_plan(parts_result(solve_parts(begun, error)), campaign, settings))
        result = with_looks(result_of(outcome, campaign), campaign, outcome)
        result = with_plan(result, campaign, settings, outcome)
        return told(with_drive(result, campaign, outcome, progress, workers))


def told_without_images(settings: VisionSettings) -> bool:
    """Whether there is something to tell without images: what was printed, or planned."""
    return bool(settings.printed.files or settings.plan.cameras)


def has_images(folder: "Path", settings: VisionSettings) -> bool:
    """Whether there are images of the robot, or others that give a lens or a network."""
    below = [folder / settings.images / name for name in ("poses", "drive", "calibration")]
    if any(one.is_dir() and any(path.is_dir() for path in one.iterdir()) for one in below):
        return True
    network = folder / settings.images / "network"
    return network.is_dir() and any(network.iterdir())


def with_looks(
    result: "SystemResult", campaign: "Campaign", outcome: "VisionOutcome"
) -> "SystemResult":
    """The result with the images that ask to be looked at."""
    from dataclasses import replace

    from vision_gt.looks.collected import looks_of
    from vision_gt.looks.told import looks_section, picture_files, wanted
    from vision_gt.stages.decided import images_in_use
    from vision_gt.stages.inputs import VisionInputs

    images = images_in_use(campaign, outcome.settings)
    looks = list(looks_of(outcome, VisionInputs(campaign, outcome.settings, images)))
    return replace(
        result,
        sections=[*result.sections, looks_section(looks, campaign.folder)],
        files={**result.files, **picture_files(wanted(looks), campaign.folder)},
    )


def with_drive(
    result: "SystemResult",
    campaign: "Campaign",
    outcome: "VisionOutcome",
    progress: "Progress",
    workers: int | None,
) -> "SystemResult":
    """The result with what the cameras saw of a robot that drives."""
    from dataclasses import replace

    from vision_gt.drive_campaign.solve import solve_campaign_drive
    from vision_gt.drive_campaign.told import (
        drive_facts,
        drive_files,
        drive_findings,
        drive_sections,
        drive_table,
    )

    drive = solve_campaign_drive(campaign, outcome, progress, workers)
    if drive is None:
        return result
    fused = drive.outcome.trajectory
    moving = [] if fused is None else [fused]
    return replace(
        result,
        findings=[*result.findings, *drive_findings(drive)],
        sections=[*result.sections, *drive_sections(drive)],
        files={**result.files, **drive_files(drive)},
        facts={**result.facts, "drive": drive_facts(drive)},
        overview=[*result.overview, drive_table(drive)],
        trajectories=[*result.trajectories, *moving],
    )


def result_of(outcome: "VisionOutcome", campaign: "Campaign") -> "SystemResult":
    """An outcome in the form that all systems share."""
    from validation.results import SystemResult
    from vision_gt.campaign.facts import vision_facts
    from vision_gt.campaign.findings import vision_findings
    from vision_gt.campaign.pose_tables import pose_tables
    from vision_gt.campaign.result_files import vision_files
    from vision_gt.campaign.sections import camera_table, layout_table, pose_table, vision_sections

    solved = campaign.solved.get(VALIDATION_SYSTEM)
    surveyed = [] if solved is None else [name for table in solved.tables for name in table.ids]
    return SystemResult(
        tables=pose_tables(outcome),
        findings=vision_findings(outcome, surveyed),
        sections=vision_sections(outcome, campaign),
        files=vision_files(outcome),
        facts=vision_facts(outcome),
        overview=[
            camera_table(outcome.network),
            layout_table(outcome),
            *([pose_table(outcome)] if outcome.stops else []),
        ],
    )


SYSTEM = VisionSystem()
