"""What a study varies, as a TOML file states it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from validation.campaign.folder import NotNegative, Positive, Settings
from validation.campaign.toml_files import input_error, line_of, read_toml
from validation.errors import InputError, Problem
from validation.shown import Shown

MOST_SETTINGS = 1000
"""Combinations of a plan. A judgement: more are a slip, and no table that anybody reads."""

Count = Annotated[int, Field(ge=0, le=10_000, strict=True)]
Sigma = Annotated[float, Field(ge=1e-9, le=10, strict=True)]
Offset = Annotated[float, Field(ge=-1000, le=1000, strict=True)]
Sigmas = tuple[Sigma, Sigma, Sigma]
Offsets = tuple[Offset, Offset, Offset]
Flag = Annotated[bool, Field(strict=True)]
Fault = Literal["boxes", "edges", "floor", "glass", "grazing", "lean", "lost", "tilt"]


class RoomTable(Settings):
    """The room and its path, lengths in metres."""

    width: Positive = 7.0
    length: Positive = 10.0
    stops: Annotated[int, Field(ge=1, le=5000, strict=True)] = 8
    world_points: Annotated[int, Field(ge=2, le=500, strict=True)] = 16
    pillars: Annotated[int, Field(ge=0, le=10, strict=True)] = 0


class SurveyTable(Settings):
    """The readings and what goes wrong with them, lengths in metres.

    The sigmas are those that the readings are drawn with, and that the campaign states.
    """

    setup_sigma: NotNegative = 0.002
    tolerance_per_metre: NotNegative = 0.000175
    marking_sigma: NotNegative = 0.0005
    missing: Annotated[float, Field(ge=0, lt=1, strict=True)] = 0.0
    blunders: Count = 0
    blunder_size: Positive = 0.1
    typos: Count = 0
    mirror_trap: Flag = False
    hand_points: Count = 2
    spot_height: NotNegative = 0.0
    tail_freedom: Annotated[float, Field(gt=2, strict=True)] | None = None


class ExampleTable(Settings):
    """A ground truth that is compared with the survey, metres and radians."""

    sigmas: Sigmas = (0.02, 0.02, 0.01)
    bias: Offsets = (0.0, 0.0, 0.0)


class LaserTable(Settings):
    """Two scanners on the robot, and what disturbs them."""

    faults: tuple[Fault, ...] = ()
    mount_error: Offsets = (0.0, 0.0, 0.0)


class VisionTable(Settings):
    """Four cameras, whose images are rendered."""

    cameras: Literal[4] = 4


class TrialSettings(Settings):
    """All that a trial depends on but for its seed."""

    room: RoomTable = RoomTable()
    survey: SurveyTable = SurveyTable()
    example: ExampleTable | None = None
    laser: LaserTable | None = None
    vision: VisionTable | None = None


class PlanFile(TrialSettings):
    """A plan: what all rooms have in common, and what is varied."""

    name: Annotated[str, Field(min_length=1, max_length=200)] = ""
    seeds: Annotated[int, Field(ge=2, le=100_000, strict=True)] = 100
    first_seed: Annotated[int, Field(ge=0, le=2**53, strict=True)] = 1
    confidence: Annotated[float, Field(ge=0.5, lt=1, strict=True)] = 0.95
    vary: dict[str, Annotated[list[Any], Field(min_length=1)]] = Field(default_factory=dict)


@dataclass(frozen=True, repr=False)
class Plan(Shown):
    """A study to be made.

    Parameters
    ----------
    path : Path
        The file.
    name : str
        Of the study.
    seeds : range
        Of the rooms of each setting.
    confidence : float
        Of the intervals that are asked whether they hold the truth, and of those of the tables.
    settings : mapping of str to TrialSettings
        By what is varied in them: 'survey.blunders = 1, room.stops = 26'; '' where nothing is.
    """

    path: Path
    name: str
    seeds: range
    confidence: float
    settings: Mapping[str, TrialSettings]


def read_plan(path: Path) -> Plan:
    """The study that a file states.

    Raises
    ------
    InputError
        Naming file, line, key and value of every bad place.
    """
    missing = "there is no such file. docs/studies.md has a plan to begin with"
    data = read_toml(path, "a plan", missing)
    try:
        plan = PlanFile.model_validate(data)
    except ValidationError as error:
        raise input_error(path, PlanFile, error) from None
    settings = _settings(path, plan, data)
    name = plan.name or path.stem
    seeds = range(plan.first_seed, plan.first_seed + plan.seeds)
    return Plan(path, name, seeds, plan.confidence, settings)


def _settings(path: Path, plan: PlanFile, data: Mapping[str, Any]) -> dict[str, TrialSettings]:
    """Every combination of what is varied."""
    count = 1
    for values in plan.vary.values():
        count *= len(values)
    if count > MOST_SETTINGS:
        said = f"{count:,} combinations; at most {MOST_SETTINGS:,} are worked out"
        raise InputError([Problem(path, said, line_of(path, ("vary",)), "vary")])
    base = {key: data[key] for key in TrialSettings.model_fields if key in data}
    problems = [
        problem
        for key, values in plan.vary.items()
        for value in values
        for problem in _faults(path, base, key, value)
    ]
    problems += [
        Problem(path, "it comes twice", _line_of(path, key), f"vary.{key}", _told(value))
        for key, values in plan.vary.items()
        for at, value in enumerate(values)
        if value in values[:at]
    ]
    if problems:
        raise InputError(problems)
    found = {}
    for chosen in product(*plan.vary.values()):
        own = dict(zip(plan.vary, chosen, strict=True))
        changed = _changed(base, own)
        label = ", ".join(f"{key} = {_told(value)}" for key, value in own.items())
        found[label] = TrialSettings.model_validate(changed)
    return found


def _faults(path: Path, base: Mapping[str, Any], key: str, value: object) -> list[Problem]:
    """What is wrong with one value of what is varied."""
    line = _line_of(path, key)
    table, _, name = key.partition(".")
    if table not in TrialSettings.model_fields or not name:
        known = ", ".join(TrialSettings.model_fields)
        said = f"no such setting: expected a table and its key, as in room.stops, of {known}"
        return [Problem(path, said, line, f"vary.{key}")]
    try:
        TrialSettings.model_validate(_changed(base, {key: value}))
    except ValidationError as error:
        return [
            Problem(path, one.expected, line, f"vary.{key}", _told(value))
            for one in input_error(path, TrialSettings, error).problems
        ]
    return []


def _line_of(path: Path, key: str) -> int | None:
    """Where what is varied is."""
    return line_of(path, ("vary", key)) or line_of(path, ("vary",))


def _changed(base: Mapping[str, Any], values: Mapping[str, object]) -> dict[str, Any]:
    """The tables of a plan with some keys set."""
    tables = {name: dict(table) for name, table in base.items()}
    for key, value in values.items():
        table, _, name = key.partition(".")
        tables.setdefault(table, {})[name] = value
    return tables


def _told(value: object) -> str:
    """A value as a plan has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(map(_told, value))}]"
    return str(value)
