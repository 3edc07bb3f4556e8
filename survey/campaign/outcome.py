"""All that the survey makes of a campaign folder, before it is told to anyone."""

from dataclasses import dataclass

from survey.campaign.inputs import load_evidence, load_published_poses, need_survey_data
from survey.estimation.solve import Evidence, SurveySolution, solve_survey
from survey.published.check import PublishedComparison, compare_published
from survey.readings.readings import ReadingsFile, load_readings
from survey.settings import SurveySettings
from validation.campaign.folder import Campaign
from validation.errors import InputError, Problem
from validation.poses.pose_table import PoseTable
from validation.systems import Progress, no_progress


@dataclass(frozen=True)
class SurveyOutcome:
    """Readings, solution and poses of a campaign.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    settings : SurveySettings
        Its [survey] table.
    file : ReadingsFile or None
        The readings, if there are any.
    evidence : Evidence
        Coordinates from elsewhere.
    solution : SurveySolution or None
        What the readings give.
    published : PublishedComparison or None
        Published world points against computed ones.
    poses : PoseTable or None
        The validation poses: from readings where there are any of robot frames, else published.
    published_poses : PoseTable or None
        Poses taken over from elsewhere.
    """

    campaign: Campaign
    settings: SurveySettings
    file: ReadingsFile | None
    evidence: Evidence
    solution: SurveySolution | None
    published: PublishedComparison | None
    poses: PoseTable | None
    published_poses: PoseTable | None


def solve_campaign(
    campaign: Campaign, progress: Progress = no_progress, *, robust: bool = False
) -> SurveyOutcome:
    """The survey of a campaign folder.

    Raises
    ------
    GtvalError
        If files are bad, labels are contradicted, or nothing is determined.
    """
    settings = campaign.section("survey", SurveySettings)
    need_survey_data(campaign, settings)
    _check_settings(campaign, settings)
    file = load_readings(campaign, settings)
    evidence = load_evidence(campaign, settings)
    published_poses = load_published_poses(campaign, settings)
    if file is None:
        return SurveyOutcome(
            campaign, settings, None, evidence, None, None, published_poses, published_poses
        )
    solution = solve_survey(
        campaign.settings.vframe,
        campaign.settings.robot_frame,
        file.used,
        settings.world_points,
        evidence,
        robust=robust or settings.robust,
        progress=progress,
    )
    published = None
    if evidence.published:
        published = compare_published(
            evidence.published, solution.world, file.used, solution.vframe
        )
    return SurveyOutcome(
        campaign,
        settings,
        file,
        evidence,
        solution,
        published,
        solution.pose_table() or published_poses,
        published_poses,
    )


def _check_settings(campaign: Campaign, settings: SurveySettings) -> None:
    """Raise for names in [survey] that mean nothing or two things."""
    vframe = set(campaign.settings.vframe.points)
    problems = []
    for name, meaning in settings.labels.items():
        if meaning not in vframe:
            problems.append(("labels", f"{name} = {meaning}: no such Vframe point"))
    meanings = list(settings.labels.values())
    if len(set(meanings)) < len(meanings):
        problems.append(("labels", "two labels stand for the same Vframe point"))
    unmapped = {name for name in vframe - set(settings.labels) if name in meanings}
    problems += [
        ("labels", f"both '{n}' and another label stand for {n}") for n in sorted(unmapped)
    ]
    twice = {name for name in settings.world_points if settings.world_points.count(name) > 1}
    problems += [("world_points", f"'{name}' is listed twice") for name in sorted(twice)]
    both = vframe & set(settings.world_points)
    problems += [
        ("world_points", f"'{name}' is also a Vframe point; world points need other names")
        for name in sorted(both)
    ]
    if problems:
        raise InputError(
            [Problem(campaign.toml, text, field=f"survey.{key}") for key, text in problems]
        )
