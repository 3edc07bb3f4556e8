"""The [survey] table of campaign.toml."""

from typing import Literal

from pydantic import Field

from survey.entry.settings import EntrySettings
from validation.campaign import Finite, Name, Positive, Settings


class Motion(Settings):
    """A known motion between two surveyed stops (the accuracy experiment).

    ``dx``, ``dy`` in metres and ``dtheta`` in radians, along the axes of the first stop's robot
    frame or of the GTV frame; ``sigmas`` are their standard deviations, exact where not given.
    """

    start: Name
    end: Name
    dx: Finite
    dy: Finite
    dtheta: Finite
    frame: Literal["robot", "gtv"] = "gtv"
    sigmas: tuple[Positive, Positive, Positive] | None = None


class SurveySettings(Settings):
    """Files and choices of the survey; paths are relative to the campaign folder.

    ``labels`` maps a Vframe point's name as written in the readings to the point that it
    stands for, where the two differ. ``reading_sigma`` replaces the instrument's standard
    deviation. ``robust`` weighs large residuals down (Huber). ``entry`` is about typing readings
    in the room.
    """

    readings: str = "survey/readings.csv"
    initial_guesses: str = "survey/initial_guesses.csv"
    hand_points: str = "survey/hand_points.csv"
    published_world_points: str = "survey/published_world_points.csv"
    published_poses: str = "survey/published_poses.csv"
    published_sigmas: tuple[Positive, Positive, Positive] | None = None
    world_points: list[Name] = Field(default_factory=list)
    labels: dict[Name, Name] = Field(default_factory=dict)
    reading_sigma: Positive | None = None
    robust: bool = False
    motions: list[Motion] = Field(default_factory=list)
    entry: EntrySettings = EntrySettings()
