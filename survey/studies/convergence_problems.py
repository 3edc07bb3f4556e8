"""The unknowns of a solved survey as problems whose convergence can be explored."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from survey.estimation import robot_frames, world_points
from survey.estimation.solve import SurveySolution
from survey.readings.readings import Readings
from survey.studies.convergence import DistanceProblem
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
    problem : DistanceProblem
        Its readings.
    solution : (2,) or (3,) array
        Where it was found.
    """

    kind: Literal["world point", "pose"]
    name: str
    problem: DistanceProblem
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
        *_points(solution, readings),
        *(_pose(solution, fit, readings, rig) for fit in solution.frames),
    ]


def _points(solution: SurveySolution, readings: Readings) -> list[Unknown]:
    """World points, known by their distances to the Vframe."""
    frame = solution.vframe
    variance = np.diagonal(frame.covariance).reshape(-1, 2).mean(1)
    found = []
    for point in solution.world.points:
        own = readings.touching([point.name], frame.names)
        index = np.array([frame.names.index(end) for end in own.end], dtype=int)
        problem = DistanceProblem(
            known=frame.points[index],
            body=None,
            distance=own.distance,
            sigma=own.sigma,
            known_sigma=np.sqrt(variance[index]),
            body_sigma=0.0,
            prior_sigma=world_points.PRIOR_SIGMA,
        )
        found.append(Unknown("world point", point.name, problem, point.position))
    return found


def _pose(
    solution: SurveySolution,
    fit: robot_frames.RobotFrameFit,
    readings: Readings,
    rig: RobotFrame,
) -> Unknown:
    """A pose, known by the distances of its marks to the world points."""
    own = robot_frames.pose_readings(fit.pose, readings, solution.world, rig)
    problem = DistanceProblem(
        known=own.known,
        body=own.body,
        distance=own.distance,
        sigma=own.sigma,
        known_sigma=own.known_sigma,
        body_sigma=own.body_sigma,
        prior_sigma=robot_frames.PRIOR_SIGMA,
    )
    return Unknown("pose", fit.pose, problem, fit.state)
