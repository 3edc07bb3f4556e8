"""The plan of a survey as a campaign folder holds it."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from survey.planning import Pair
from survey.planning_settings import PlanSettings
from survey.readings import robot_point
from validation.angles import Array
from validation.campaign import Campaign
from validation.csv_tables import Column, read_csv
from validation.errors import GtvalError
from validation.poses import from_csv

_METRES = {"low": -1e4, "high": 1e4, "unit": "m"}


@dataclass(frozen=True)
class PlannedPlaces:
    """Where world points and stops are to be.

    Parameters
    ----------
    world : mapping of str to (2,) array
        World points, metres, Vframe.
    poses : mapping of str to (3,) array
        Stops: x, y in metres, theta in radians.
    """

    world: Mapping[str, Array]
    poses: Mapping[str, Array]


def load_planned_places(campaign: Campaign, settings: PlanSettings) -> PlannedPlaces:
    """The planned world points and stops.

    Raises
    ------
    GtvalError
        If there are no planned world points.
    InputError
        Naming file, line, field and value of every bad place.
    """
    path = campaign.folder / settings.world_points
    if not path.exists():
        raise GtvalError(
            f"{campaign.folder} has neither readings nor a plan: write the planned world points "
            f"to {settings.world_points} (columns world_point, x, y) and the stops to "
            f"{settings.poses} (pose, x, y, theta)"
        )
    table = read_csv(
        path,
        [
            Column("world_point"),
            Column("x", "number", **_METRES),  # type: ignore[arg-type]
            Column("y", "number", **_METRES),  # type: ignore[arg-type]
        ],
    )
    table.flag_duplicates(["world_point"])
    for row, name in enumerate(table.text["world_point"]):
        if name in campaign.settings.vframe.points:
            table.flag(row, "world_point", "also a Vframe point; world points need other names")
        elif robot_point(name) is not None:
            table.flag(row, "world_point", "names with a '/' are marks of stops")
    if len(table) == 0 and not table.problems:
        raise GtvalError(f"{path}: the file has a header but no world point")
    table.raise_problems()
    places = np.column_stack([table.numbers["x"], table.numbers["y"]])
    world = dict(zip(table.text["world_point"], places, strict=True))
    stops = campaign.folder / settings.poses
    if not stops.exists():
        return PlannedPlaces(world, {})
    poses = from_csv(stops, "planned")
    return PlannedPlaces(world, dict(zip(poses.ids, poses.poses, strict=True)))


def load_hidden_pairs(
    campaign: Campaign, settings: PlanSettings, names: Collection[str]
) -> set[Pair]:
    """Pairs of points that do not see one another; none where there is no file.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    settings : PlanSettings
        Names the file.
    names : collection of str
        All points. '7/*' in the file stands for all marks of stop 7.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.
    """
    path: Path = campaign.folder / settings.not_visible
    if not path.exists():
        return set()
    table = read_csv(path, [Column("from"), Column("to")])
    hidden: set[Pair] = set()
    for row in range(len(table)):
        ends = []
        for column in ("from", "to"):
            meant = _meant(table.text[column][row], names)
            if not meant and table.text[column][row]:
                table.flag(row, column, "no such point in the plan")
            ends.append(meant)
        hidden |= {frozenset((a, b)) for a in ends[0] for b in ends[1]}
    table.raise_problems()
    return hidden


def _meant(name: str, names: Collection[str]) -> list[str]:
    """The points that a name of the file stands for."""
    if name.endswith("/*"):
        return [point for point in names if point.startswith(name[:-1])]
    return [name] if name in names else []
