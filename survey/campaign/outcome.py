"""All that the survey makes of a campaign folder, before it is told to anyone."""

from dataclasses import dataclass

from survey.campaign.inputs import SurveyInputs
from survey.causes.diagnosis import Diagnosis
from survey.estimation.solve import SurveySolution
from survey.published.as_published import AsPublished
from survey.published.check import PublishedComparison
from validation.campaign.folder import Campaign
from validation.poses.pose_table import PoseTable


@dataclass(frozen=True)
class SurveyOutcome:
    """Readings, solution and poses of a campaign.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    inputs : SurveyInputs
        What its files hold.
    solution : SurveySolution or None
        What the readings give.
    published : PublishedComparison or None
        Published world points against computed ones.
    as_published : AsPublished or None
        What the document's filters make of the same readings, where that was asked for.
    diagnosis : Diagnosis or None
        Common causes of what is wrong with the readings.
    """

    campaign: Campaign
    inputs: SurveyInputs
    solution: SurveySolution | None = None
    published: PublishedComparison | None = None
    as_published: AsPublished | None = None
    diagnosis: Diagnosis | None = None

    @property
    def poses(self) -> PoseTable | None:
        """The validation poses: from readings where there are any of stops, else published."""
        own = None if self.solution is None else self.solution.pose_table()
        return own or self.inputs.published_poses
