"""Where points roughly are before they are measured: for the map alone."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from survey.settings import PlanSettings, SurveySettings
from validation.campaign.folder import Campaign
from validation.text_files.csv_tables import Column, read_csv

Place = tuple[float, float]


@dataclass(frozen=True)
class RoughPlaces:
    """Places in metres, in the Vframe, and the walls as polylines."""

    places: Mapping[str, Place]
    walls: list[list[Place]]


def load_rough_places(campaign: Campaign) -> RoughPlaces:
    """Planned, published and hand-measured places, and the marks of guessed stops.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.
    """
    survey = campaign.section("survey", SurveySettings)
    plan = campaign.section("plan", PlanSettings)
    places: dict[str, Place] = {}
    for name in (plan.world_points, survey.published_world_points, survey.hand_points):
        for point, x, y, _ in _rows(campaign.folder / name, "world_point"):
            places[point] = (x, y)
    rig = campaign.settings.robot_frame.points
    for name in (plan.poses, survey.initial_guesses):
        for stop, x, y, theta in _rows(campaign.folder / name, "pose"):
            c, s = math.cos(theta), math.sin(theta)
            for point, (a, b) in rig.items():
                places[f"{stop}/{point}"] = (x + c * a - s * b, y + s * a + c * b)
    return RoughPlaces(places, [list(wall) for wall in campaign.settings.room.walls])


def _rows(path: Path, key: str) -> list[tuple[str, float, float, float]]:
    """Name, x, y and theta (0 where there is none) of each row; none where there is no file."""
    if not path.exists():
        return []
    table = read_csv(
        path,
        [
            Column(key),
            Column("x", "number", low=-1e4, high=1e4, unit="m"),
            Column("y", "number", low=-1e4, high=1e4, unit="m"),
            Column("theta", "number", required=key == "pose", blank=key != "pose"),
        ],
    )
    table.raise_problems()
    theta = [0.0 if math.isnan(value) else value for value in table.numbers["theta"]]
    numbers = table.numbers
    return list(zip(table.text[key], numbers["x"], numbers["y"], theta, strict=True))
