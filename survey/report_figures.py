"""Which figures of the survey go into which section of the report."""

from survey.outcome import SurveyOutcome
from validation.results import Figure


def solution_figures(outcome: SurveyOutcome) -> dict[str, list[Figure]]:
    """Figures by section: 'world points', 'robot frames', 'readings'."""
    del outcome
    return {"world points": [], "robot frames": [], "readings": []}


def hand_pose_figure(outcome: SurveyOutcome) -> list[Figure]:
    """Hand-measured against validation poses."""
    del outcome
    return []
