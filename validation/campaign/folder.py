"""The campaign folder: its campaign.toml and where things lie in it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations
from math import dist
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from validation.campaign.faults import NAME, SYSTEM
from validation.campaign.toml_files import closest, input_error, line_of, read_toml
from validation.errors import InputError, Problem
from validation.plugins import entry_points
from validation.shown import Shown

if TYPE_CHECKING:
    from validation.results import SystemResult

LONGEST = 300.0
"""Metres that no hand-held laser distance meter measures; a longer pole is in other units."""
ROUNDED = 0.001
"""Metres between a side and the same side from coordinates rounded to the millimetre: 0.0007."""
# Strict: neither true nor "2.5" is a number.
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False, strict=True)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False, strict=True)]
Finite = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Point = tuple[Finite, Finite]
Name = Annotated[str, Field(min_length=1, pattern=NAME)]
M = TypeVar("M", bound=BaseModel)


class Settings(BaseModel):
    """Base of all tables of campaign.toml: unknown keys are errors, values do not change."""

    # Built when first used: a command needs few of the tables that its imports bring along.
    model_config = ConfigDict(
        extra="forbid", frozen=True, coerce_numbers_to_str=True, defer_build=True
    )


class Instrument(Settings):
    """The hand-held laser distance meter.

    ``tolerance`` is the half width that the maker states, taken as 2 sigma; beyond
    ``tolerance_up_to`` metres it grows by ``tolerance_per_metre``. ``setup_sigma`` is what the
    person adds (spot only horizontally aligned, uneven floor, width of the mark) and
    ``resolution`` the last digit shown; both are combined in quadrature. A reading d stands for
    ``offset + scale * d``.
    """

    model: str = "hand-held laser distance meter"
    tolerance: Positive = 0.0015
    tolerance_up_to: NotNegative = 30.0
    tolerance_per_metre: NotNegative = 0.0
    setup_sigma: NotNegative = 0.0
    resolution: NotNegative = 0.001
    offset: Finite = 0.0
    scale: Positive = 1.0
    range_min: NotNegative = 0.05
    range_max: Positive = 50.0


def _in_metres(length: float) -> float:
    """The length, if a hand-held laser can have measured it."""
    if length > LONGEST:
        raise ValueError(f"longer than {LONGEST:g} m, which no hand laser measures; write metres")
    return length


def _check_places(points: Mapping[str, Point], what: str) -> None:
    """Raise where two points are the same place."""
    same = [f"{a} and {b}" for a, b in combinations(points, 2) if points[a] == points[b]]
    if same:
        raise ValueError(f"the {what} points {same[0]} are the same place; correct one")


class Vframe(Settings):
    """The frame on the floor: nominal points, and how well they were marked.

    ``points`` defaults to O, X, Y and XY of a square with sides of one ``pole_length``.
    ``sigma`` is the standard deviation of each coordinate of a marked point.
    """

    pole_length: Annotated[Positive, AfterValidator(_in_metres)] = 2.5
    sigma: Positive = 0.002
    points: dict[Name, Point] = {}

    @model_validator(mode="after")
    def _square(self) -> "Vframe":
        if not self.points:
            a = self.pole_length
            square = {"O": (0.0, 0.0), "X": (a, 0.0), "Y": (0.0, a), "XY": (a, a)}
            object.__setattr__(self, "points", square)
        if len(self.points) < 2:
            raise ValueError("at least two Vframe points are needed")
        _check_places(self.points, "Vframe")
        sides = [dist(a, b) for a, b in combinations(self.points.values(), 2)]
        pole = self.pole_length
        if "pole_length" in self.model_fields_set and min(abs(pole - a) for a in sides) > ROUNDED:
            raise ValueError(
                f"no two points are pole_length = {pole:g} m apart; take out one of both"
            )
        if len(self.points) > 2 and self._on_a_line():
            raise ValueError(
                "the Vframe points lie on one line, and nothing tells on which side of it a place "
                "is; state one that lies off the line"
            )
        return self

    def _on_a_line(self) -> bool:
        """Whether no point is further than sigma off the line of the two furthest apart."""
        places = list(self.points.values())
        a, b = max(combinations(places, 2), key=lambda pair: dist(*pair))
        doubled = [(b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) for c in places]
        return max(map(abs, doubled)) <= self.sigma * dist(a, b)


class RobotFrame(Settings):
    """The rig whose points are marked on the floor at each stop.

    ``points`` are nominal coordinates in the robot frame; ``shape_sigma`` says how well they are
    known (one rig, the same at all stops); ``marking_sigma`` how well each mark on the floor
    stands for its rig point; ``sides`` are measured lengths between rig points with
    ``sides_sigma``.
    """

    points: dict[Name, Point] = {"O": (0.0, 0.0), "X": (0.6, 0.0), "Y": (0.0, 0.4)}
    marking_sigma: NotNegative = 0.001
    shape_sigma: NotNegative = 0.0
    sides: dict[str, Positive] = {}
    sides_sigma: Positive = 0.001

    @property
    def mark_variance(self) -> float:
        """Variance of a coordinate of a mark on the floor in the robot frame, square metres.

        From the marking and from the shape of the rig.
        """
        return self.marking_sigma**2 + self.shape_sigma**2

    @model_validator(mode="after")
    def _heading_is_determined(self) -> "RobotFrame":
        if len(set(self.points.values())) < 2:
            raise ValueError("at least two different rig points are needed to find a heading")
        _check_places(self.points, "rig")
        return self


class Published(Settings):
    """Poses taken over from elsewhere, as a system of its own.

    ``sigmas`` are the standard deviations to assume where the file states none, (x, y, theta) or
    (x, y, z, yaw, pitch, roll); without them errors have no normalised form. A file may hold a
    trajectory instead of a table: ``stops`` is then the file that says when the robot stood where
    (pose, from, to); without it the standstills are found. ``frame`` is 'own' where the
    coordinates are not those of the GTV frame; ``judged = false`` keeps odometry and the like out
    of the comparison at stops; ``format``, ``unit``, ``body`` and ``topic`` say
    what a file does not say itself. ``placed_by`` are the surveyed stops ('all') by which its frame
    was placed, and with ``placed_mount`` its mount too: its errors then follow the survey's there.
    """

    system: Annotated[str, Field(pattern=SYSTEM)]
    file: str
    source: str = ""
    sigmas: tuple[Positive, ...] | None = None
    stops: str = ""
    frame: Literal["gtv", "own"] = "gtv"
    placed_by: list[Name] | Literal["all"] = Field(default_factory=list)
    placed_mount: bool = False
    judged: bool = True
    format: str = ""
    unit: Literal["s", "ms", "us", "ns"] | None = None
    body: str = ""
    topic: str = ""

    @model_validator(mode="after")
    def _planar_or_spatial(self) -> "Published":
        if self.sigmas is not None and len(self.sigmas) not in {3, 6}:
            raise ValueError(f"sigmas are 3 or 6 numbers, not {len(self.sigmas)}")
        return self


class Room(Settings):
    """What is drawn on the room map: walls as polylines in the GTV frame."""

    walls: list[list[Point]] = []


class Comparison(Settings):
    """How errors are judged.

    ``acceptable_bias`` (metres, radians) is the d of the statement 'the bias is below d';
    ``confidence`` the level of all intervals. ``published_statistics`` is a file (system,
    component, mean, std, max_abs, ci95_low, ci95_high) of printed statistics that are set beside
    the computed ones; ``published_errors`` (system, pose, and a column for each component) one of
    printed errors.
    """

    acceptable_bias_length: Positive = 0.05
    acceptable_bias_angle: Positive = 0.05
    confidence: Annotated[float, Field(gt=0.5, lt=1)] = 0.95
    published_statistics: str = ""
    published_errors: str = ""


class Claim(Settings):
    """A conclusion that somebody drew from the campaign, to be set beside its data.

    ``says`` is the conclusion, ``source`` where it stands. Either ``less`` and ``than`` name two
    systems of which the first is said to err less, or ``finding`` (of ``subject``, if one is
    given) is the code of the finding that decides. ``note`` says more, or why nothing can tell.
    """

    says: str
    source: str = ""
    less: str = ""
    than: str = ""
    finding: str = ""
    subject: str = ""
    note: str = ""

    @model_validator(mode="after")
    def _both_or_none(self) -> "Claim":
        if bool(self.less) != bool(self.than):
            raise ValueError("'less' and 'than' belong together: the first is said to err less")
        return self


class CampaignSettings(BaseModel):
    """The shared tables of campaign.toml; tables of single systems are read by them."""

    model_config = ConfigDict(extra="allow", frozen=True, coerce_numbers_to_str=True)

    name: str
    description: str = ""
    place: str = ""
    date: str = ""
    facts: dict[str, str] = {}
    instrument: Instrument = Instrument()
    vframe: Vframe = Vframe()
    robot_frame: RobotFrame = RobotFrame()
    room: Room = Room()
    comparison: Comparison = Comparison()
    published: list[Published] = []
    claims: list[Claim] = []


@dataclass(frozen=True, repr=False)
class Campaign(Shown):
    """A campaign folder.

    Parameters
    ----------
    folder : Path
        Where campaign.toml lies.
    settings : CampaignSettings
        Its contents.
    solved : mapping of str to SystemResult
        In a run: what the systems before this one made of it, so that a system which starts from
        the survey need not solve it again. Empty for a campaign just loaded.
    """

    folder: Path
    settings: CampaignSettings
    solved: "Mapping[str, SystemResult]" = field(default_factory=dict, compare=False, repr=False)

    @property
    def toml(self) -> Path:
        """Path of campaign.toml."""
        return self.folder / "campaign.toml"

    @property
    def results(self) -> Path:
        """Folder of everything computed."""
        return self.folder / "results"

    @property
    def report(self) -> Path:
        """Folder of the report."""
        return self.folder / "report"

    @cached_property
    def extra(self) -> Mapping[str, Any]:
        """Tables that belong to single systems."""
        return self.settings.model_extra or {}

    def section(self, name: str, model: type[M]) -> M:
        """A system's own table, checked against its model; defaults where it is missing.

        Raises
        ------
        InputError
            Naming every bad key.
        """
        try:
            return model.model_validate(self.extra.get(name, {}))
        except ValidationError as error:
            raise input_error(self.toml, model, error, (name,)) from None


def load_campaign(folder: Path, known_tables: frozenset[str] | None = None) -> Campaign:
    """The campaign in a folder.

    Parameters
    ----------
    folder : Path
        The folder, or its campaign.toml.
    known_tables : frozenset of str, optional
        Names that systems use for tables of their own; by default the installed systems'. Any
        other unknown table or key is an error.

    Raises
    ------
    InputError
        Naming the file, line, key and value of every bad place.
    """
    if folder.name == "campaign.toml":
        folder = folder.parent
    path = folder / "campaign.toml"
    said = (
        "there is no such file; a campaign folder needs one. `gtval simulate DIR` writes an example"
    )
    data = read_toml(path, "a campaign.toml", said)
    if known_tables is None:  # an entry point is called as its system and its table
        known_tables = frozenset(entry.name for entry in entry_points(group="gtval.systems"))
    try:
        settings = CampaignSettings.model_validate(data)
    except ValidationError as error:
        raise input_error(path, CampaignSettings, error) from None
    known = known_tables | _OWN_TABLES
    problems = [
        Problem(path, f"unknown table or key{closest(key, known)}", line_of(path, (key,)), key)
        for key in data
        if key not in known
    ]
    if problems:
        raise InputError(problems)
    return Campaign(folder, settings)


_OWN_TABLES = frozenset(CampaignSettings.model_fields) | {"plan", "explain", "time"}
