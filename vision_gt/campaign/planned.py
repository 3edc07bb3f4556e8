"""The plan of the cameras as a chapter of the report, beside what was reached."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from validation.campaign.folder import Campaign
from validation.results import Figure, Section, SystemResult, Table
from vision_gt.campaign.outcome import VisionOutcome
from vision_gt.planning.inputs import load_plan
from vision_gt.planning.plan import CameraPlan, place_sigma, rows_of, work_out
from vision_gt.planning.telling import plan_facts, plan_findings, plan_tables
from vision_gt.settings import VisionSettings

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

MM = 1e3


def with_plan(
    result: SystemResult,
    campaign: Campaign,
    settings: VisionSettings,
    outcome: VisionOutcome | None = None,
) -> SystemResult:
    """The result with the plan that [vision.plan] states; as it is where it states no cameras.

    Raises
    ------
    GtvalError
        If the plan is bad.
    """
    if not settings.plan.cameras:
        return result
    plan = work_out(load_plan(campaign, settings))
    tables: list[Table | Figure] = [*plan_tables(plan)]
    if outcome is not None and (reached := reached_table(plan, outcome)) is not None:
        tables.append(reached)
    walls = campaign.settings.room.walls

    def draw() -> "MatplotlibFigure":
        from vision_gt.planning.figures import plan_picture  # noqa: PLC0415

        return plan_picture(plan, walls)

    tables.append(
        Figure(
            "vision_plan",
            "Planned cameras: how many see each place of the floor, and how well the best of them "
            "will know the place of the robot there. Dashed: the floor that has to be seen.",
            "Two maps of the floor, shaded by the number of cameras and by standard deviation.",
            draw,
        )
    )
    return replace(
        result,
        findings=[*result.findings, *plan_findings(plan)],
        sections=[*result.sections, Section("Vision: plan of the cameras", tables)],
        facts={**result.facts, "plan": plan_facts(plan)},
    )


def reached_table(plan: CameraPlan, outcome: VisionOutcome) -> Table | None:
    """Planned against reached standard deviations of the stops' places; None if none is in both."""
    reached = {stop.pose: stop.chosen.planar[1] for stop in outcome.stops if stop.chosen}
    places = place_sigma(plan.at_stops.best).tolist()
    planned = dict(zip(plan.given.stops, places, strict=True))
    names = [name for name in planned if name in reached]
    if not names:
        return None
    sigmas = [float(np.sqrt(np.trace(reached[name][:2, :2]))) for name in names]
    return Table.of_columns(
        "Planned and reached",
        [
            ("stop", "", names),
            ("planned place [mm]", ".2f", rows_of([MM * planned[name] for name in names])),
            ("reached place [mm]", ".2f", [MM * sigma for sigma in sigmas]),
        ],
        "What was reached includes how well cameras and markers are placed, which a plan leaves "
        "out.",
    )
