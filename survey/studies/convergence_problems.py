"""The unknowns of a solved survey as problems whose convergence can be explored."""

from dataclasses import dataclass
from typing import Literal

from survey.estimation.distance_fit import DistanceFit
from survey.estimation.robot_frames import pose_readings
from survey.estimation.solve import SurveySolution
from survey.estimation.world_points import place_readings
from survey.readings.readings import Readings
from validation.campaign.folder import RobotFrame
from validation.poses.angles import Array


@dataclass(frozen=True)
class Unknown:
    """One thing that was solved for.

    Parameters
    ----------
    kind : {"world point", "pose"}
        What it is.
    name : str
        Its name.
    problem : DistanceFit
        Its readings.
    solution : (2,) or (3,) array
        Where it was found.
    """

    kind: Literal["world point", "pose"]
    name: str
    problem: DistanceFit
    solution: Array


def unknowns_of(solution: SurveySolution, readings: Readings, rig: RobotFrame) -> list[Unknown]:
    """All located world points and solved poses, each with its readings.

    Parameters
    ----------
    solution : SurveySolution
        What was found.
    readings : Readings
        The readings it was found from.
    rig : RobotFrame
        Nominal robot frame.
    """
    return [
        *(
            Unknown(
                "world point",
                point.name,
                place_readings(
                    readings.touching([point.name], solution.vframe.names), solution.vframe
                ),
                point.position,
            )
            for point in solution.world.points
        ),
        *(
            Unknown(
                "pose", fit.pose, pose_readings(fit.pose, readings, solution.world, rig), fit.state
            )
            for fit in solution.frames
        ),
    ]
