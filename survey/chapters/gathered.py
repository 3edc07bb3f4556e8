"""All chapters of a survey beyond its solution, as one result."""

from survey.campaign.outcome import SurveyOutcome
from survey.chapters.lengths import lengths_chapter
from survey.chapters.motions import motions_chapter
from survey.chapters.planned import plan_chapter
from survey.chapters.regions import regions_chapter
from survey.chapters.walls import walls_chapter
from validation.results import SystemResult


def survey_chapters(outcome: SurveyOutcome) -> SystemResult:
    """What instrument, walls, filters, plan and known motions of a campaign show.

    Raises
    ------
    InputError
        Naming every bad place of the first file that has any.
    """
    plan, predicted = plan_chapter(outcome)
    parts = [
        lengths_chapter(outcome.campaign),
        walls_chapter(outcome.campaign),
        regions_chapter(outcome),
        motions_chapter(outcome, predicted),
        plan,
    ]
    return SystemResult(
        findings=[finding for part in parts for finding in part.findings],
        sections=[section for part in parts for section in part.sections],
        files={name: content for part in parts for name, content in part.files.items()},
        overview=[table for part in parts for table in part.overview],
    )
