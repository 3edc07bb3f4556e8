"""Simulated surveys and the AD2.3 one, solved, for the survey's tests."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

import data_samples
from data_samples.rooms.rooms import Room, RoomSettings, make_room
from data_samples.rooms.simulate import SimulatedCampaign, SimulationSettings, simulate_survey
from survey.campaign.outcome import SurveyOutcome
from survey.campaign.solve import solve_campaign
from survey.estimation.solve import SurveySolution, solve_survey
from validation.campaign.folder import load_campaign
from validation.poses.angles import Array, wrap

AD23 = Path(data_samples.__file__).parent / "ad23"


@dataclass(frozen=True)
class Case:
    """A simulated survey, its room and its solution."""

    room: Room
    simulated: SimulatedCampaign
    solution: SurveySolution

    def joint_errors(self) -> tuple[Array, Array, Array]:
        """Errors (n, 3) of the joint poses, their covariances, and the joint covariance."""
        table = self.solution.pose_table()
        assert table is not None
        assert table.joint is not None
        truth = self.simulated.truth.poses.select(table.ids).poses
        return _difference(table.poses, truth), table.covariances, table.joint

    def single_errors(self) -> tuple[Array, Array]:
        """The same for the single-pose filter."""
        frames = self.solution.frames
        truth = self.simulated.truth.poses.select([f.pose for f in frames]).poses
        states = np.array([frame.state for frame in frames])
        return _difference(states, truth), np.array([frame.covariance for frame in frames])

    def world_errors(self) -> tuple[Array, Array]:
        """The same for the world points."""
        truth = dict(zip(self.room.world_names, np.asarray(self.room.world_points), strict=True))
        points = self.solution.world.points
        errors = np.array([point.position - truth[point.name] for point in points])
        return errors, np.array([point.covariance for point in points])


def _difference(a: Array, b: Array) -> Array:
    off = a - b
    off[:, 2] = wrap(off[:, 2])
    return off


def simulated(seed: int, stops: int = 4, **settings: object) -> tuple[Room, SimulatedCampaign]:
    """A room and a survey of it."""
    rng = np.random.default_rng([20080731, seed])
    room = make_room(RoomSettings(stops=stops), rng)
    return room, simulate_survey(room, SimulationSettings(**settings), rng)  # type: ignore[arg-type]


@cache
def case(seed: int, stops: int = 4) -> Case:
    """A clean survey, solved from nothing but its readings."""
    room, survey = simulated(seed, stops)
    solution = solve_survey(room.vframe, survey.robot_frame, survey.readings, room.world_names)
    return Case(room, survey, solution)


@cache
def ad23() -> SurveyOutcome:
    """The published campaign."""
    return solve_campaign(load_campaign(AD23))
