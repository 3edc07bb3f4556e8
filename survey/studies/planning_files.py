"""The plan of a survey as a campaign folder holds it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from survey.readings.hardware import missing_hardware
from survey.readings.point_names import robot_point
from survey.settings import PlanSettings
from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError
from validation.poses.angles import Array
from validation.poses.pose_table import from_csv
from validation.text_files.csv_tables import Column, read_csv

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
        Naming file, line, field and value of every bad place, and every key of campaign.toml that
        does not state the hardware.
    """
    path = campaign.folder / settings.world_points
    if not path.exists():
        raise GtvalError(
            f"{campaign.folder} has neither readings nor a plan: write the planned world points "
            f"to {settings.world_points} (columns world_point, x, y) and the stops to "
            f"{settings.poses} (pose, x, y, theta)"
        )
    missing = missing_hardware(campaign)
    if missing:
        raise InputError(missing)
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
