"""Which figures of the survey go into which section of the report."""

from typing import TYPE_CHECKING

import numpy as np

from survey.campaign.outcome import SurveyOutcome
from survey.campaign.result_files import adjusted_points
from survey.estimation.solve import SurveySolution
from survey.readings.levels import CRITICAL
from validation.results import Figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

    from survey.figures.maps import Places, Room


def solution_figures(outcome: SurveyOutcome) -> dict[str, list[Figure]]:
    """Figures by section: 'world points', 'robot frames', 'readings'."""
    solution = outcome.solution
    if solution is None:
        return {"world points": [], "robot frames": [], "readings": []}
    return {
        "world points": [_world_map(outcome, solution)],
        "robot frames": [_pose_map(outcome, solution)] if solution.poses else [],
        "readings": [_residuals(solution)],
    }


def hand_pose_figure(outcome: SurveyOutcome) -> list[Figure]:
    """Hand-measured against validation poses."""
    poses, guesses = outcome.poses, outcome.inputs.evidence.guesses
    if poses is None:
        return []
    shared = [name for name in poses.ids if name in guesses]
    if not shared:
        return []

    def draw() -> "MatplotlibFigure":
        from survey.figures.maps import Places, hand_against_validation  # noqa: PLC0415

        table = poses.select(shared)
        unknown = np.full((len(shared), 3, 3), np.nan)
        hand = Places(tuple(shared), np.array([guesses[name] for name in shared]), unknown)
        return hand_against_validation(
            hand, Places(table.ids, table.poses, table.covariances), _room(outcome)
        )

    return [
        Figure(
            "hand-against-validation",
            "Robot frames measured roughly by hand against the validation poses.",
            f"Map of {len(shared)} stops with an arrow from each validation pose towards its "
            "rough measurement; the numbers are in the table above.",
            draw,
        )
    ]


def _room(outcome: SurveyOutcome) -> "Room":
    """Vframe, rig and walls for the maps."""
    from survey.figures.maps import Room  # noqa: PLC0415

    settings = outcome.campaign.settings
    return Room(
        vframe=tuple(settings.vframe.points.items()),
        rig=np.array(list(settings.robot_frame.points.values())),
        walls=tuple(tuple(wall) for wall in settings.room.walls),
    )


def _world_places(solution: SurveySolution) -> "Places":
    from survey.figures.maps import Places  # noqa: PLC0415

    names = solution.joint_names
    positions, covariances = adjusted_points(solution, names)
    return Places(names, positions, covariances)


def _world_map(outcome: SurveyOutcome, solution: SurveySolution) -> Figure:
    def draw() -> "MatplotlibFigure":
        from survey.figures.maps import survey_map  # noqa: PLC0415

        return survey_map(_room(outcome), world=_world_places(solution))

    return Figure(
        "world-points",
        "World points with their 3-sigma ellipses after the joint adjustment; the factor by which "
        "the ellipses are enlarged is stated in the figure.",
        f"Map of the Vframe square and {len(solution.joint_names)} world points around it, each "
        "with an uncertainty ellipse; coordinates and standard deviations are in the table.",
        draw,
    )


def _pose_map(outcome: SurveyOutcome, solution: SurveySolution) -> Figure:
    def draw() -> "MatplotlibFigure":
        from survey.figures.maps import Places, survey_map  # noqa: PLC0415

        table = solution.pose_table()
        frames = None if table is None else Places(table.ids, table.poses, table.covariances)
        return survey_map(_room(outcome), world=_world_places(solution), frames=frames)

    return Figure(
        "robot-frames",
        "Validation poses: robot frames in true size with enlarged 3-sigma ellipses of their "
        "origins.",
        f"Map of {len(solution.poses)} robot frames along the path among the world points; "
        "coordinates and standard deviations are in the table.",
        draw,
    )


def _residuals(solution: SurveySolution) -> Figure:
    def draw() -> "MatplotlibFigure":
        from survey.figures.residuals import residual_figure  # noqa: PLC0415

        labels = [
            f"{a} to {b}" for a, b in zip(solution.used.start, solution.used.end, strict=True)
        ]
        return residual_figure(solution.used.distance, solution.reliability.w, labels)

    return Figure(
        "reading-residuals",
        "Standardised residuals of all readings over their distance, and their distribution; "
        f"beyond {CRITICAL} a reading is suspect.",
        f"{len(solution.used)} standardised residuals, largest "
        f"{np.nanmax(np.abs(solution.reliability.w), initial=0.0):.1f}.",
        draw,
    )
