"""The [survey.entry] table of campaign.toml."""

from typing import Annotated, Literal

from pydantic import Field

from validation.campaign import Name, Positive, Settings


class EntrySettings(Settings):
    """How readings are entered in the room; paths are relative to the campaign folder.

    ``poses`` are the stops to measure; where none are listed, those of the initial guesses, and
    any stop can be begun by its name. ``order`` is 'spread' where the first three world points
    of each mark are to lie far apart, so that the following readings can be checked sharply, or
    'listed'. ``second`` says what the other person's blind entry is: a new measurement from the
    other end ('measure'), the same display typed again ('type'), or not wanted ('none').
    A stop is good enough when the standard deviations of x and y are below ``pose_sigma``
    (metres) and that of theta below ``heading_sigma`` (radians), each mark having readings to
    ``least_world_points`` or more.
    """

    journal: str = "survey/journal.jsonl"
    poses: list[Name] = Field(default_factory=list)
    order: Literal["spread", "listed"] = "spread"
    second: Literal["none", "type", "measure"] = "measure"
    pose_sigma: Positive = 0.003
    heading_sigma: Positive = 0.005
    least_world_points: Annotated[int, Field(ge=1, le=1000)] = 4
