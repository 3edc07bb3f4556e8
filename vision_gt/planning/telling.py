"""A plan of cameras in tables, findings and numbers."""

from collections.abc import Iterator

import numpy as np

from validation.poses.angles import Array
from validation.results import Finding, Size, Table, TableColumn
from vision_gt.planning.floor import area_of
from vision_gt.planning.plan import CameraPlan, over_headings, place_sigma, rows_of

MM, MRAD = 1e3, 1e3
SUBJECT = "vision plan"
_SMALL_HOLE = 0.05
"""Square metres of a hole that is not named: less than a foot's print."""
_TILTED_ENOUGH = np.deg2rad(1.0)
"""By which a vertical field may be short of what the depth needs: a judgement, a pole leans more.
"""


def plan_tables(plan: CameraPlan) -> list[Table]:
    """All tables, those of the floor first."""
    tables = [floor_table(plan), camera_table(plan), accuracy_table(plan)]
    if plan.given.stops:
        tables.append(stop_table(plan))
    return [*tables, *(rule_table(plan, names) for names in plan.rule)]


def floor_table(plan: CameraPlan) -> Table:
    """Shares of floor and stops that one and two cameras see, and have a pose of."""
    poses = plan.at_stops.cameras_with_pose
    stops = plan.stops_seen.sum(0)
    rows: list[list[str | int | float | None]] = []
    for count, name in ((1, "one camera and more"), (2, "two cameras and more")):
        rows.append([
            name,
            100 * plan.share(count),
            100 * plan.share_with_pose(count),
            100 * float((stops >= count).mean()) if len(stops) else None,
            100 * float((poses >= count).mean()) if len(poses) else None,
        ])  # fmt: skip
    return Table(
        "Floor and stops that cameras see",
        ("seen by", "floor [%]", "with a pose [%]", "stops [%]", "stops with a pose [%]"),
        rows,
        ("", ".1f", ".1f", ".0f", ".0f"),
        f"Of {area_of(plan.given.outline):.1f} square metres. With a pose: a marker can be read "
        "there, over all headings of the robot. Nothing is in the way in a plan.",
    )


def camera_table(plan: CameraPlan) -> Table:
    """Each camera's tilt, fields of view, footprint, and the width of a marker in its image."""
    mounts = plan.given.mounts
    needed = [one.needed_field for one in mounts]
    across = [2 * np.arctan(0.5 * one.camera.size[0] / one.camera.parameters[0]) for one in mounts]
    widths = [_quantiles(one.sides) for one in plan.over_floor.views]
    columns: list[TableColumn] = [
        ("camera", "", plan.names),
        ("tilt [deg]", ".1f", [np.rad2deg(one.tilt) for one in mounts]),
        ("across [deg]", ".1f", np.rad2deg(across)),
        ("down [deg]", ".1f", [np.rad2deg(one.vertical_field) for one in mounts]),
        ("needed [deg]", ".1f", [None if v is None else np.rad2deg(v) for v in needed]),
        ("floor [m2]", ".1f", [plan.footprint(i) for i in range(len(mounts))]),
        ("marker from [px]", ".0f", [w[0] for w in widths]),
        ("median [px]", ".0f", [w[1] for w in widths]),
        ("to [px]", ".0f", [w[2] for w in widths]),
    ]
    note = (
        "Across, down: fields of view. Needed: the field down that the wanted depth asks for. "
        "The last three: width of a marker that can be read."
    )
    return Table.of_columns("Cameras", columns, note)


def _quantiles(values: Array) -> list[float | None]:
    """Least, median and most of what is finite."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return [None] * 3
    return [float(finite.min()), float(np.median(finite)), float(finite.max())]


def sigmas_over_floor(plan: CameraPlan) -> dict[str, Array]:
    """Covariances (p, 3, 3) over the floor by what gives the pose: each camera, best, all."""
    found = plan.over_floor
    by_camera = {f"camera {name}": found.single[i] for i, name in enumerate(plan.names)}
    return {**by_camera, "the best camera": found.best, "all cameras together": found.merged}


def accuracy_table(plan: CameraPlan) -> Table:
    """Predicted standard deviations of the robot's pose over the floor."""
    rows: list[list[str | int | float | None]] = []
    for name, covariances in sigmas_over_floor(plan).items():
        place = place_sigma(covariances)
        known = np.isfinite(place)
        if not known.any():
            rows.append([name, 0.0, *[None] * 6])
            continue
        variances = np.diagonal(covariances[known], axis1=1, axis2=2)
        x, y, theta = np.sqrt(variances.mean(0))
        rows.append([
            name,
            100 * float(known.mean()),
            MM * x,
            MM * y,
            MRAD * theta,
            MM * float(np.median(place[known])),
            MM * float(np.quantile(place[known], 0.95)),
            100 * float((place[known] <= plan.given.wanted).mean()),
        ])  # fmt: skip
    return Table(
        "Predicted accuracy of the robot's pose over the floor",
        (
            "from", "poses [%]", "x [mm]", "y [mm]", "theta [mrad]", "place [mm]",
            "95 % below [mm]", f"within {MM * plan.given.wanted:g} mm [%]",
        ),
        rows,
        ("", ".1f", ".2f", ".2f", ".2f", ".2f", ".2f", ".0f"),
        f"Root mean squares over all places and headings, for corners good to "
        f"{plan.given.corner_sigma:g} px; place: median of the root of both variances. How well "
        "cameras and markers are placed themselves comes on top.",
    )  # fmt: skip


def stop_table(plan: CameraPlan) -> Table:
    """Each stop: who sees it, and how well its pose will be known."""
    found = plan.at_stops
    rows: list[list[str | int | float | None]] = []
    for p, name in enumerate(plan.given.stops):
        seen = [n for n, s in zip(plan.names, plan.stops_seen[:, p], strict=True) if s]
        posed = [n for n, v in zip(plan.names, found.views, strict=True) if v.gives_pose[p]]
        markers = max((int(v.readable[p].sum()) for v in found.views), default=0)
        sides = np.array([v.sides[p] for v in found.views])
        widest = float(np.nanmax(sides)) if np.isfinite(sides).any() else np.nan
        sigmas = np.sqrt(np.diagonal(found.best[p])) * [MM, MM, MRAD]
        merged = MM * place_sigma(found.merged[p])
        rows.append([
            name, " ".join(seen), " ".join(posed), markers,
            *rows_of([widest, *sigmas, float(merged)]),
        ])  # fmt: skip
    return Table(
        "Stops",
        (
            "stop", "floor seen by", "pose from", "markers", "widest [px]", "x [mm]", "y [mm]",
            "theta [mrad]", "all together [mm]",
        ),
        rows,
        ("", "", "", "", ".0f", ".2f", ".2f", ".2f", ".2f"),
        "Standard deviations from the camera that knows the pose best, and of the place from all.",
    )  # fmt: skip


def rule_table(plan: CameraPlan, names: str) -> Table:
    """How large a marker has to be at a distance."""
    rule = plan.rule[names]
    columns: list[TableColumn] = [
        ("distance [m]", ".1f", [one.distance for one in rule]),
        ("marker [px]", ".1f", rows_of([one.side_pixels for one in rule])),
        ("place [mm]", ".2f", rows_of([MM * one.sigma for one in rule])),
        ("heading [mrad]", ".2f", rows_of([MRAD * one.sigma_heading for one in rule])),
        ("side to be read [mm]", ".0f", rows_of([MM * one.readable_side for one in rule])),
        (
            f"side for {MM * plan.given.wanted:g} mm [mm]",
            ".0f",
            rows_of([MM * one.wanted_side for one in rule]),
        ),
    ]
    note = (
        f"One marker of {MM * float(plan.given.layout.sides[0]):g} mm on a robot that faces a "
        "camera which looks straight at it; blank: two poses look alike."
    )
    return Table.of_columns(f"Side of a marker by its distance, camera {names}", columns, note)


def plan_findings(plan: CameraPlan) -> list[Finding]:
    """What to change before the cameras are hung."""
    found = [*_coverage(plan), *_fields(plan), *_accuracy(plan)]
    if not any(one.severity == "warning" for one in found):
        text = "Every place of the floor and every stop is seen and has a pose as good as wanted."
        seen = Size("part of the floor that is seen", plan.share(1))
        found.append(Finding("good", text, SUBJECT, "plan_good", (seen,)))
    return found


def _coverage(plan: CameraPlan) -> Iterator[Finding]:
    """Holes in the floor, stops that nobody sees, neighbours without common view."""
    named = [one for one in plan.holes if one.area > _SMALL_HOLE]
    if named:
        listed = "; ".join(
            f"{one.area:.1f} square metres about ({one.middle[0]:.1f}, {one.middle[1]:.1f})"
            for one in named
        )
        text = f"{100 * (1 - plan.share(1)):.1f} % of the floor is seen by no camera: {listed}."
        size = Size("part of the floor that no camera sees", 1 - plan.share(1))
        yield Finding("warning", text, SUBJECT, "plan_holes", (size,))
    poses = plan.at_stops.cameras_with_pose
    blind = [name for name, count in zip(plan.given.stops, poses, strict=True) if not count]
    if blind:
        text = f"No camera will have a sure pose of the robot at stop {', '.join(blind)}."
        count = Size("stops without a pose", len(blind), "stops")
        yield Finding("warning", text, SUBJECT, "plan_stops", (count,))


def _fields(plan: CameraPlan) -> Iterator[Finding]:
    """Lenses too narrow for the wanted depth."""
    for one in plan.given.mounts:
        if one.needed_field is not None and one.needed_field > one.vertical_field + _TILTED_ENOUGH:
            text = (
                f"Camera {one.camera.name}: the wanted depth needs a field of view of "
                f"{np.rad2deg(one.needed_field):.0f} degrees down the image; its lens has "
                f"{np.rad2deg(one.vertical_field):.0f}. Hang it lower, or take a shorter lens."
            )
            size = Size("field of view that is needed", one.needed_field, "rad")
            yield Finding("warning", text, f"camera {one.camera.name}", "plan_field", (size,))


def _accuracy(plan: CameraPlan) -> Iterator[Finding]:
    """Places with a pose that is not as good as wanted, and poses that look like others."""
    place = over_headings(place_sigma(plan.over_floor.best))
    known = np.isfinite(place)
    poor = float((place[known] > plan.given.wanted).mean()) if known.any() else 1.0
    if poor > 0:
        text = (
            f"Over {100 * poor:.0f} % of the floor with a pose its standard deviation is above the "
            f"wanted {MM * plan.given.wanted:g} mm. Larger or more markers, a longer lens or a "
            "nearer camera help; vision.on_floor = true does most for far markers."
        )
        size = Size("part of the floor above what is wanted", poor)
        yield Finding("warning", text, SUBJECT, "plan_accuracy", (size,))
    views = plan.over_floor.views
    alike = np.mean([one.ambiguous.mean() for one in views])
    if alike > 0:
        text = (
            f"At {100 * alike:.0f} % of places and cameras a single marker looks alike in two "
            "poses, and gives none. Two markers in view, or vision.on_floor = true, decide."
        )
        yield Finding("note", text, SUBJECT, "plan_ambiguous")


def plan_facts(plan: CameraPlan) -> dict[str, object]:
    """The plan for scripts: lengths in metres, angles in radians, shares from 0 to 1."""
    over = {}
    for name, covariances in sigmas_over_floor(plan).items():
        known = np.isfinite(covariances[:, 0, 0])
        if known.any():
            mean = np.diagonal(covariances[known], axis1=1, axis2=2).mean(0)
            over[name] = {"share": float(known.mean()), "sigmas": np.sqrt(mean).tolist()}
    found = plan.at_stops
    return {
        "floor_area": area_of(plan.given.outline),
        "floor_seen": {"one": plan.share(1), "two": plan.share(2)},
        "floor_with_pose": {"one": plan.share_with_pose(1), "two": plan.share_with_pose(2)},
        "footprints": {name: plan.footprint(i) for i, name in enumerate(plan.names)},
        "tilts": {one.camera.name: one.tilt for one in plan.given.mounts},
        "accuracy": over,
        "stops": {
            name: {
                "seen_by": [n for n, s in zip(plan.names, plan.stops_seen[:, p], strict=True) if s],
                "cameras_with_pose": int(found.cameras_with_pose[p]),
                "sigmas": rows_of(np.sqrt(np.diagonal(found.best[p])).tolist()),
                "sigmas_merged": rows_of(np.sqrt(np.diagonal(found.merged[p])).tolist()),
            }
            for p, name in enumerate(plan.given.stops)
        },
        "rule": {names: [_rule_fact(one) for one in rows] for names, rows in plan.rule.items()},
        "holes": [{"middle": one.middle.tolist(), "area": one.area} for one in plan.holes],
    }


def _rule_fact(row: object) -> dict[str, float | None]:
    """A row of the rule with None where there is no number."""
    return {name: rows_of([value])[0] for name, value in vars(row).items()}
