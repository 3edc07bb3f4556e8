"""The [explain] table of campaign.toml."""

from typing import Annotated

from pydantic import Field

from validation.campaign.folder import Name, Positive, Settings
from validation.explain.fitting.selection import FALSE_ALARM as INVENTED
from validation.explain.sources.arbitration import FALSE_ALARM
from validation.explain.sources.repeatability import REVISIT_RADIUS

Chance = Annotated[float, Field(gt=0, lt=0.5)]


class ExplainSettings(Settings):
    """What is known about the systems beside their poses.

    ``references`` names the stop whose validation pose tied a system to the GTV frame ('?' if one
    did but it is not known which), ``sensors`` the systems that share one, ``witnesses`` files
    with rough poses from elsewhere (relative to the campaign folder) that take part only in
    deciding who is wrong at a stop, ``runs`` systems that are repeated runs of the same one.
    ``independent`` lists systems that are no copies of one another, however alike they look.
    Stops closer than ``revisit_radius`` metres count as the same place.
    """

    references: dict[Name, Name] = Field(default_factory=dict)
    sensors: dict[Name, list[Name]] = Field(default_factory=dict)
    witnesses: dict[Name, str] = Field(default_factory=dict)
    runs: dict[Name, list[Name]] = Field(default_factory=dict)
    independent: list[list[Name]] = Field(default_factory=list)
    revisit_radius: Positive = REVISIT_RADIUS
    invented: Chance = INVENTED
    false_alarm: Chance = FALSE_ALARM
