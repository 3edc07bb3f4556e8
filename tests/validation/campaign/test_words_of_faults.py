"""No fault of campaign.toml is told in pydantic's words, whatever is written for any key."""

import re
from datetime import date
from typing import Annotated, Literal

import pytest
from pydantic import BaseModel, Field, ValidationError

from laser_gt.settings import LaserSettings
from rtk_gt.settings import RtkSettings
from survey.settings import PlanSettings, SurveySettings
from validation.campaign.faults import in_words
from validation.campaign.folder import CampaignSettings, Finite, Name, Published, Settings
from validation.explain.settings import ExplainSettings
from vision_gt.settings import VisionSettings

MODELS = (
    *(CampaignSettings, LaserSettings, RtkSettings, SurveySettings),
    *(PlanSettings, ExplainSettings, VisionSettings),
)
PYDANTIC = re.compile(r"Input should|Field required|should (have|match)|valid (\w+)|Extra inputs")


class Inner(Settings):
    key: float = 0.0


class Kinds(Settings):
    """A key of each kind that our settings have."""

    needed: float
    text: str = ""
    name: Name = "a"
    number: Finite = 0.0
    above: Annotated[float, Field(gt=0, lt=1)] = 0.5
    between: Annotated[float, Field(ge=0, le=1)] = 0.5
    whole: Annotated[int, Field(ge=1)] = 1
    yes: bool = True
    day: date | None = None
    choice: Literal["csv", "bag"] = "csv"
    three: tuple[float, float, float] = (0.0, 0.0, 0.0)
    some: list[str] = Field(default_factory=list)
    table: dict[Name, float] = Field(default_factory=dict)
    inner: Inner = Inner()


def faults(model: type[BaseModel], data: object) -> list[str]:
    try:
        model.model_validate(data)
    except ValidationError as error:
        return [in_words(one) for one in error.errors()]
    return []


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        (None, None, "the key is missing; add it"),
        ("text", [1], "write a text in quotes"),
        ("name", "", "write a text that is not empty"),
        ("name", "a b", "write a name without spaces, '/', ',', ';' and quotes"),
        ("number", "far", "write a number, without quotes and without a unit"),
        ("number", [1], "write a number, without quotes and without a unit"),
        ("number", float("nan"), "write a finite number"),
        ("above", 0, "write a number greater than 0"),
        ("above", 1, "write a number less than 1"),
        ("between", -1, "write a number of at least 0"),
        ("between", 2, "write a number of at most 1"),
        ("whole", 1.5, "write a whole number, without quotes"),
        ("whole", "x", "write a whole number, without quotes"),
        ("yes", "maybe", "write true or false, without quotes"),
        ("yes", [], "write true or false, without quotes"),
        ("day", "yesterday", "write a date as YYYY-MM-DD, without a time"),
        ("day", [], "write a date as YYYY-MM-DD, without a time"),
        ("choice", "xml", "write one of 'csv' or 'bag'"),
        ("three", [1, 2], "the list is too short; add value number 3"),
        ("three", [1, 2, 3, 4], "write 3 values, not 4"),
        ("three", 1, "write a list, in square brackets"),
        ("some", "a", "write a list, in square brackets"),
        ("table", [1], "write a table: keys and values under a heading in square brackets"),
        ("table", {"a b": 1}, "write a name without spaces, '/', ',', ';' and quotes"),
        ("inner", 1, "write a table: keys and values under a heading in square brackets"),
    ],
)
def test_every_kind_of_fault_says_what_to_write(key, value, expected):
    data = {} if key is None else {"needed": 1, key: value}
    assert faults(Kinds, data) == [expected]


def test_sigmas_of_published_poses_are_three_or_six():
    given = {"system": "rig", "file": "a.csv"}
    assert faults(Published, {**given, "sigmas": [0.1] * 4}) == ["sigmas are 3 or 6 numbers, not 4"]
    for right in ([0.1] * 3, [0.1] * 6):
        assert faults(Published, {**given, "sigmas": right}) == []
    assert faults(Published, {**given, "system": "My rig"}) == [
        "write a name of small letters, digits and '_' that begins with a letter"
    ]


WRONG = (
    *(True, "x y", "", -1, 1e9, 0.5, float("nan"), float("inf"), [], {}, [1] * 20, ["a"] * 2),
    *({"a": "x"}, {"a b": 1}, {"a": [1, 2, 3, 4, 5]}, [{"a": 1}], date(2026, 1, 1)),
)


def nested(model: type[BaseModel], seen: set[type[BaseModel]]) -> set[type[BaseModel]]:
    """The model and all that stand in it."""
    seen.add(model)
    for one in model.model_fields.values():
        for found in find_models(one.annotation):
            if found not in seen:
                nested(found, seen)
    return seen


def find_models(annotation: object) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    inner = getattr(annotation, "__args__", ())
    return [model for one in inner for model in find_models(one)]


def test_no_key_of_any_table_is_told_in_pydantics_words():
    models = set().union(*(nested(model, set()) for model in MODELS))
    assert len(models) > 20
    said = {
        (model.__name__, key, text)
        for model in models
        for key in model.model_fields
        for value in WRONG
        for text in faults(model, {key: value})
        if text and "Extra inputs" not in text
    }
    assert len(said) > 300
    assert [one for one in said if PYDANTIC.search(one[2])] == []
