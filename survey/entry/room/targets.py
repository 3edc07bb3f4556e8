"""What is to be measured, in the order in which it is quickest, and why some of it is not."""

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

from survey.entry.record.entries import pair_of
from survey.readings.hardware import missing_hardware
from survey.readings.hidden_pairs import load_hidden_pairs
from survey.readings.point_names import robot_point
from survey.settings import EntrySettings, PlanSettings, SurveySettings
from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError, Problem
from validation.text_files.csv_tables import Column, read_csv

Pair = frozenset[str]
SPREAD = 3
"""So many world points of a mark lie far apart at first: two leave two places, the third tells
them apart, and each further reading is checked."""


class Target(NamedTuple):
    """One reading to take: the laser stands over ``start`` and points at ``end``."""

    start: str
    end: str

    @property
    def pair(self) -> Pair:
        """The two points, without order."""
        return pair_of(self.start, self.end)


def stop_of(target: Target) -> str:
    """The stop whose mark is an end of a target; '' for one between Vframe and wall."""
    return next((name.partition("/")[0] for name in target if "/" in name), "")


@dataclass(frozen=True)
class Station:
    """A place of the laser with all that is read from there.

    Parameters
    ----------
    name : str
        The point that the laser stands over.
    targets : tuple of Target
        In their order.
    """

    name: str
    targets: tuple[Target, ...]


@dataclass(frozen=True)
class Names:
    """The points of a campaign, by kind, and the stops."""

    vframe: tuple[str, ...]
    rig: tuple[str, ...]
    world: tuple[str, ...]
    stops: tuple[str, ...]

    @property
    def marks(self) -> list[str]:
        """Names of the marks of all stops: '7/O'."""
        return [f"{stop}/{point}" for stop in self.stops for point in self.rig]

    @property
    def points(self) -> list[str]:
        """All points."""
        return [*self.vframe, *self.world, *self.marks]

    @cached_property
    def _kinds(self) -> tuple[Pair, Pair, Pair]:
        return frozenset(self.vframe), frozenset(self.world), frozenset(self.marks)

    def may_be_measured(self, pair: Pair) -> bool:
        """Whether the survey has a use for the distance of two points."""
        if len(pair) != 2:
            return False
        inside, on_wall, on_mark = (len(pair & kind) for kind in self._kinds)
        return inside == 2 or (on_wall == 1 and inside + on_mark == 1)

    def why_not(self, pair: Pair) -> str:
        """What is wrong with a pair, in words; '' where it may be measured."""
        if self.may_be_measured(pair):
            return ""
        unknown = sorted(name for name in pair if not any(name in kind for kind in self._kinds))
        if unknown:
            return (
                f"no point of this campaign: {', '.join(unknown)}; check the names, [survey] "
                "world_points and [survey.entry] poses"
            )
        return (
            "this pair is not entered here: expected two Vframe points, or a world point with a "
            "Vframe point or a mark; keep such rows in another file"
        )

    def with_stops_of(self, pairs: Iterable[Pair]) -> "Names":
        """These names, and the stops whose marks are ends of the pairs."""
        ends = (robot_point(name) for pair in pairs for name in sorted(pair))
        found = (end[0] for end in ends if end is not None and end[0] and end[1] in self.rig)
        return replace(self, stops=tuple(dict.fromkeys([*self.stops, *found])))


def load_names(campaign: Campaign, more_stops: Iterable[str] = ()) -> Names:
    """The points of a campaign.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    more_stops : iterable of str
        Stops that were begun in the room.

    Raises
    ------
    InputError
        If no world points are listed, campaign.toml does not state the hardware, or the file of
        initial guesses is bad.
    """
    settings = campaign.section("survey", SurveySettings)
    problems = missing_hardware(campaign, tolerance=settings.reading_sigma is None)
    if not settings.world_points:
        listed = 'list the world points, as in world_points = ["1", "2", "3"]'
        problems.append(Problem(campaign.toml, listed, field="survey.world_points"))
    stops = settings.entry.poses or _guessed_stops(campaign.folder / settings.initial_guesses)
    if problems and not stops:
        listed = (
            'list the stops, as in [survey.entry] poses = ["1", "2", "3"], or give rough poses of '
            f"them in {settings.initial_guesses}"
        )
        problems.append(Problem(campaign.toml, listed, field="survey.entry.poses"))
    if problems:
        raise InputError(problems)
    written_as = {meaning: label for label, meaning in settings.labels.items()}
    return Names(
        vframe=tuple(written_as.get(name, name) for name in campaign.settings.vframe.points),
        rig=tuple(campaign.settings.robot_frame.points),
        world=tuple(settings.world_points),
        stops=tuple(dict.fromkeys([*stops, *more_stops])),
    )


def _guessed_stops(path: Path) -> list[str]:
    """The stops of the file of initial guesses; none where there is no file."""
    if not path.exists():
        return []
    table = read_csv(path, [Column("pose")])
    table.raise_problems()
    return table.text["pose"]


def load_skipped(campaign: Campaign, names: Names) -> dict[Pair, str]:
    """Pairs that cannot be seen, with the reason; names of points that are not there are errors."""
    hidden = load_hidden_pairs(campaign, campaign.section("plan", PlanSettings), names.points)
    return {pair: reason or "not visible" for pair, reason in hidden.items()}


def stations(names: Names, settings: EntrySettings) -> list[Station]:
    """All places of the laser: the Vframe points, then the marks of each stop.

    From a Vframe point all world points are read, and the later Vframe points.
    """
    of_frame = list(combinations(names.vframe, 2))
    found = [
        Station(
            point,
            tuple(Target(point, other) for first, other in of_frame if first == point)
            + tuple(Target(point, world) for world in names.world),
        )
        for point in names.vframe
    ]
    order = spread(names.world) if settings.order == "spread" else names.world
    found += [Station(mark, tuple(Target(mark, w) for w in order)) for mark in names.marks]
    return found


def from_the_other_end(plan: Sequence[Station]) -> list[Station]:
    """The same targets turned round, those with the laser on one point together.

    Within the frame and within each stop, so that a stop is measured whole before the next.
    """
    places: dict[tuple[str, str], list[Target]] = {}
    for station in plan:
        for target in station.targets:
            turned = Target(target.end, target.start)
            places.setdefault((stop_of(target), target.end), []).append(turned)
    return [Station(name, tuple(targets)) for (_, name), targets in places.items()]


def spread(world: Sequence[str]) -> list[str]:
    """The world points with the first few taken at equal steps, the others as they were.

    World points are numbered along the walls; so the first few lie all around the room.
    """
    n = len(world)
    first = [world[i * n // SPREAD] for i in range(SPREAD)] if n > SPREAD else list(world)
    return [*first, *(name for name in world if name not in first)]


def check_new_name(name: str, what: str, taken: Container[str]) -> str:
    """The name of a further stop or mark.

    Raises
    ------
    GtvalError
        If it cannot be one.
    """
    if not name or any(c in name for c in '/,;"\\') or not name.isprintable() or " " in name:
        raise GtvalError(
            f"'{name}' cannot be the name of a {what}: no blanks, no / \\ , ; or quotes"
        )
    if name in taken:
        raise GtvalError(f"{what} {name} is there already")
    return name


def find_target(where: str, plan: Sequence[Station]) -> Target:
    """The target that a person means: '7/O 3', '7/O-3', '7/O' (its first), '7' (likewise).

    Raises
    ------
    GtvalError
        If there is no such pair in the plan.
    """
    words = where.replace("–", " ").split()
    if len(words) == 1 and not any(words[0] in (s.name, s.name.partition("/")[0]) for s in plan):
        words = where.replace("-", " ").split()
    for station in plan:
        ends: Mapping[str, Target] = {target.end: target for target in station.targets}
        if len(words) == 2 and words[0] == station.name and words[1] in ends:
            return ends[words[1]]
        if len(words) == 2 and words[1] == station.name and words[0] in ends:
            return ends[words[0]]
        if len(words) == 1 and words[0] in (station.name, station.name.partition("/")[0]):
            return station.targets[0]
    raise GtvalError(
        f"'{where}' is not in the plan; say for example: {plan[-1].name} 3. The plan follows from "
        "campaign.toml: [survey] world_points and [survey.entry] poses"
    )
