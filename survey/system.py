"""The survey as a system of gtval: campaign folder to validation poses."""

from typing import TYPE_CHECKING

from survey.settings import SurveySettings

if TYPE_CHECKING:
    from pathlib import Path

    from survey.campaign.outcome import SurveyOutcome
    from validation.campaign.folder import Campaign
    from validation.results import SystemResult
    from validation.systems import Progress


class SurveySystem:
    """Validation poses from hand-laser readings."""

    name = "survey"

    def has_data(self, campaign: "Campaign") -> bool:
        """Whether there are readings or published poses."""
        from survey.readings.readings import readings_path

        settings = campaign.section("survey", SurveySettings)
        published = campaign.folder / settings.published_poses
        return readings_path(campaign, settings).exists() or published.exists()

    def inputs(self, campaign: "Campaign") -> "list[Path]":
        """The files of the survey."""
        from survey.campaign.inputs import input_files

        return input_files(campaign)

    optional_inputs = inputs
    """Readings or published poses suffice, and each other file adds something only where it is."""

    def solve(
        self,
        campaign: "Campaign",
        progress: "Progress",
        *,
        robust: bool | None = None,
        as_published: bool | None = None,
    ) -> "SystemResult":
        """Validation poses, findings and report sections."""
        from survey.campaign.solve import solve_campaign

        return result_of(
            solve_campaign(campaign, progress, robust=robust, as_published=as_published)
        )


def result_of(outcome: "SurveyOutcome") -> "SystemResult":
    """An outcome in the form that all systems share."""
    from survey.campaign.facts import landmarks, survey_facts
    from survey.campaign.findings import survey_findings
    from survey.campaign.result_files import survey_files
    from survey.campaign.sections import overview_tables, survey_sections
    from survey.chapters.gathered import survey_chapters
    from survey.entry.dialogue.report import entry_report
    from validation.results import SystemResult

    entered = entry_report(outcome.campaign)
    poses, more = outcome.poses, survey_chapters(outcome)
    return SystemResult(
        tables=[] if poses is None else [poses],
        findings=[*survey_findings(outcome), *more.findings, *entered.findings],
        sections=[*survey_sections(outcome), *more.sections, *entered.sections],
        files={**survey_files(outcome), **more.files},
        facts=survey_facts(outcome),
        landmarks=landmarks(outcome),
        overview=[*overview_tables(outcome), *more.overview],
    )


SYSTEM = SurveySystem()
