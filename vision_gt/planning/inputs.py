"""The plan of cameras as campaign.toml states it: [vision.plan]."""

from collections.abc import Iterator

import numpy as np

from validation.campaign.folder import Campaign
from validation.campaign.toml_files import line_of
from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array
from validation.poses.pose_table import from_csv
from vision_gt.example_settings import EXAMPLES, PLAN_EXAMPLE
from vision_gt.optics.camera import Camera
from vision_gt.optics.camera_files import read_cameras
from vision_gt.planning.floor import area_of, sides_that_cross
from vision_gt.planning.mounting import (
    MountedCamera,
    mounted,
    pinhole,
    planned_layout,
    tilt_for_depth,
)
from vision_gt.planning.plan import PlanInput
from vision_gt.settings import (
    CameraPlanSettings,
    PlannedCamera,
    VisionSettings,
    stated,
)

_AROUND = 0.5
"""Metres around the stops that make the floor where none is stated: half the length of a robot. A
judgement."""


def load_plan(campaign: Campaign, settings: VisionSettings) -> PlanInput:
    """What is planned.

    Raises
    ------
    InputError
        Naming every key of campaign.toml that a plan needs and that is missing or bad.
    GtvalError
        If neither a floor nor stops say what has to be seen.
    """
    plan = settings.plan
    if problems := list(_missing(campaign, plan)):
        raise InputError(problems)
    mounts = tuple(_mounted(campaign, plan, one) for one in plan.cameras)
    stops = _stops(campaign, plan)
    floor = None
    if settings.on_floor:
        h, t = settings.floor.height**-2, settings.floor.tilt**-2
        floor = np.diag([0.0, 0.0, h, t, t, 0.0])
    layout = planned_layout(
        plan.markers,
        stated(plan.marker_side),
        stated(plan.marker_height),
        np.deg2rad(plan.marker_lean_deg),
        plan.marker_radius,
    )
    return PlanInput(
        mounts,
        layout,
        _outline(campaign, plan, stops),
        stops,
        plan.corner_sigma,
        plan.marker_cells,
        floor,
        plan.wanted,
    )


def _missing(campaign: Campaign, plan: CameraPlanSettings) -> Iterator[Problem]:
    """Keys that are needed and not there, and names that come twice."""
    if not plan.cameras:
        said = f"a plan needs cameras; write in campaign.toml, for example:\n\n{PLAN_EXAMPLE}"
        yield Problem(campaign.toml, said, field="vision.plan.cameras")
        return
    names = [one.name for one in plan.cameras]
    for at, name in enumerate(names):
        if name in names[:at]:
            said = f"camera {names.index(name) + 1} of the plan has this name already"
            yield _at(campaign, said, name, "cameras", str(at), "name")
    files: dict[tuple[str, ...], str] = {("file",): plan.file}
    files |= {("cameras", str(at), "file"): one.file for at, one in enumerate(plan.cameras)}
    for keys, file in files.items():
        if file and not (campaign.folder / file).exists():
            yield _at(campaign, "there is no such file in the campaign folder", file, *keys)
    needed = ["marker_side", "marker_height"]
    if any(not (one.file or plan.file or (one.resolution and one.field_of_view_deg))
           for one in plan.cameras):  # fmt: skip
        needed = ["resolution", "field_of_view_deg", *needed]
    for key in needed:
        if getattr(plan, key) is None:
            example = f"{key} = {EXAMPLES['vision.plan'][key]}"
            said = f"needed for a plan; write in [vision.plan] a line such as: {example}"
            yield Problem(campaign.toml, said, field=f"vision.plan.{key}")


def _at(campaign: Campaign, said: str, value: object, *keys: str) -> Problem:
    """A bad value of [vision.plan], with its line."""
    whole = ("vision", "plan", *keys)
    line = line_of(campaign.toml, whole)
    return Problem(campaign.toml, said, line, ".".join(whole), str(value))


def _mounted(campaign: Campaign, plan: CameraPlanSettings, one: PlannedCamera) -> MountedCamera:
    """A camera where it will hang."""
    camera = _lens(campaign, plan, one)
    needed = None
    if one.depth is not None:
        tilt, needed = tilt_for_depth(one.height, one.depth)
    else:
        tilt = float(np.deg2rad(stated(one.tilt_deg)))
    T = mounted(camera, one.position, one.height, float(np.deg2rad(one.pan_deg)), tilt)
    return MountedCamera(camera, T, tilt, needed)


def _lens(campaign: Campaign, plan: CameraPlanSettings, one: PlannedCamera) -> Camera:
    """A camera's own lens before the plan's, and a stated field of view before a file of the plan.

    Raises
    ------
    InputError
        If its file is bad.
    """
    file = one.file or ("" if one.field_of_view_deg else plan.file)
    if file:
        found = read_cameras(campaign.folder / file)
        chosen = next((c for c in found if c.name == one.name), found[0])
        return Camera(one.name, chosen.size, chosen.parameters)
    size = stated(one.resolution or plan.resolution)
    field = stated(one.field_of_view_deg or plan.field_of_view_deg)
    return pinhole(one.name, size, float(np.deg2rad(field)))


def _stops(campaign: Campaign, plan: CameraPlanSettings) -> dict[str, Array]:
    """Planned stops by name; none where the file is not there."""
    path = campaign.folder / plan.stops
    if not path.exists():
        if "stops" in plan.model_fields_set:
            said = "there is no such file in the campaign folder"
            raise InputError([_at(campaign, said, plan.stops, "stops")])
        return {}
    table = from_csv(path, system="plan")
    return dict(zip(table.ids, table.poses, strict=True))


def _outline(campaign: Campaign, plan: CameraPlanSettings, stops: dict[str, Array]) -> Array:
    """Corners of the floor that has to be seen."""
    if plan.floor:
        outline = np.array(plan.floor)
        said = ""
        if crossing := sides_that_cross(outline):
            one, other = (f"that from corner {a} to {b}" for a, b in crossing)
            said = f"its sides cross, {one} and {other}; name the corners in their order around it"
        elif len(outline) < 3 or area_of(outline) <= 0:
            said = "the floor needs three corners and more that do not lie on one line"
        if said:
            value = [list(corner) for corner in plan.floor]
            raise InputError([_at(campaign, said, value, "floor")])
        return outline
    if not stops:
        raise GtvalError(
            "nothing says what has to be seen: write floor = [[0, 0], [4, 0], [4, 6], [0, 6]] in "
            f"[vision.plan], or the stops in {plan.stops} (pose, x, y, theta)"
        )
    places = np.array([pose[:2] for pose in stops.values()])
    (x0, y0), (x1, y1) = places.min(0) - _AROUND, places.max(0) + _AROUND
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
