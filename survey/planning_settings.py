"""The [plan] table of campaign.toml."""

from typing import Annotated

from pydantic import Field

from validation.campaign import Settings


class PlanSettings(Settings):
    """What is planned before anybody goes to the room; paths are relative to the campaign folder.

    ``world_points`` has the columns world_point, x, y; ``poses`` pose, x, y, theta;
    ``not_visible`` from, to: pairs that cannot be read, '7/*' standing for all marks of stop 7.
    ``repeat`` is how often every visible pair is read. ``confidence`` and ``power`` say what
    'detectable' means.
    """

    world_points: str = "survey/planned_points.csv"
    poses: str = "survey/initial_guesses.csv"
    not_visible: str = "survey/not_visible.csv"
    repeat: Annotated[int, Field(ge=1, le=100)] = 1
    confidence: Annotated[float, Field(gt=0.5, lt=1)] = 0.95
    power: Annotated[float, Field(gt=0.5, lt=1)] = 0.8
