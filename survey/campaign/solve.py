"""From the files of a campaign to what its survey gives."""

from survey.campaign.cause_words import cause_of_failure
from survey.campaign.inputs import load_inputs
from survey.campaign.outcome import SurveyOutcome
from survey.causes.diagnosis import diagnose, diagnose_unsolved, without_cause
from survey.estimation.adjustment import UnsettledError
from survey.estimation.solve import solve_survey
from survey.published.as_published import as_published_estimates
from survey.published.check import compare_published
from validation.campaign.folder import Campaign
from validation.errors import GtvalError
from validation.systems import Progress, no_progress


def solve_campaign(
    campaign: Campaign,
    progress: Progress = no_progress,
    *,
    robust: bool | None = None,
    as_published: bool | None = None,
) -> SurveyOutcome:
    """The survey of a campaign folder.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    progress : callable
        Told what is being done.
    robust : bool, optional
        Whether to weigh large residuals down; as the settings say by default.
    as_published : bool, optional
        Whether to run the document's two filters, too; as the settings say by default.

    Raises
    ------
    GtvalError
        If files are bad, labels are contradicted, or nothing is determined.
    """
    inputs = load_inputs(campaign)
    if inputs.file is None:
        return SurveyOutcome(campaign, inputs)
    vframe, rig = campaign.settings.vframe, campaign.settings.robot_frame
    readings, evidence = inputs.file.used, inputs.evidence
    world_points = inputs.settings.world_points
    weighed = inputs.settings.robust if robust is None else robust
    diagnosis = None
    try:
        solution = solve_survey(
            vframe, rig, readings, world_points, evidence, robust=weighed, progress=progress
        )
    except UnsettledError as error:
        diagnosis = diagnose_unsolved(vframe, rig, readings, world_points)
        try:  # what the cause leaves whole
            solution = solve_survey(
                vframe, rig, without_cause(diagnosis, readings), world_points, evidence
            )
        except GtvalError:
            raise GtvalError(cause_of_failure(diagnosis, readings) or str(error)) from None
    published = None
    if evidence.published:
        published = compare_published(evidence.published, solution.world, readings, solution.vframe)
    literal = None
    if inputs.settings.as_published if as_published is None else as_published:
        literal = as_published_estimates(solution, readings, vframe, rig)
    diagnosis = diagnosis or diagnose(solution, vframe, rig, readings)
    return SurveyOutcome(campaign, inputs, solution, published, literal, diagnosis)
