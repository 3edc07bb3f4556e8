"""All that the survey makes of a campaign folder, before it is told to anyone."""

from dataclasses import dataclass, replace
from functools import cached_property

from survey.campaign.inputs import SurveyInputs
from survey.causes.diagnosis import Diagnosis
from survey.estimation.solve import SurveySolution
from survey.published.as_published import AsPublished
from survey.published.check import PublishedComparison
from survey.readings.point_names import robot_point
from survey.readings.readings import Readings
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

    @cached_property
    def poses(self) -> PoseTable | None:
        """The validation poses: from readings where there are any of stops, else published."""
        own = None if self.solution is None else self.solution.pose_table()
        if own is None:
            return self.inputs.published_poses
        file = self.inputs.file
        return own if file is None else with_makers(own, file.used)


def with_makers(table: PoseTable, readings: Readings) -> PoseTable:
    """The poses, each with its observer and its day in its source, where there is one of them."""
    told: dict[str, tuple[set[str], set[str]]] = {}
    marks = {name: robot_point(name) for name in {*readings.start, *readings.end}}
    rows = zip(readings.start, readings.end, readings.observer, readings.time, strict=True)
    for start, end, observer, time in rows:
        stop = marks[start] or marks[end]
        if stop:
            observers, days = told.setdefault(stop[0], (set(), set()))
            observers.add(observer)
            days.add(time.replace(" ", "T").split("T")[0])
    sources = []
    for name, source in zip(table.ids, table.sources, strict=True):
        observers, days = told.get(name, (set(), set()))
        kinds = (("observer", observers), ("day", days))
        parts = [
            f"{kind} {one}" for kind, names in kinds if len(names) == 1 for one in names if one
        ]
        sources.append(", ".join([source, *parts]))
    return replace(table, sources=tuple(sources))
