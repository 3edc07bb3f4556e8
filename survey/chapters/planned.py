"""What a survey will be worth, or is worth: prediction, tables, findings, and plan against fact."""

from dataclasses import dataclass
from math import degrees, sqrt

import numpy as np

from survey.campaign.outcome import SurveyOutcome
from survey.campaign.solve import solve_campaign
from survey.estimation.adjustment import Adjustment
from survey.estimation.geometry import ELLIPSE_SIGMAS, ellipse_axes
from survey.readings.hidden_pairs import load_hidden_pairs
from survey.readings.readings import Readings, readings_path
from survey.settings import PlanSettings, SurveySettings
from survey.studies.accuracy import detectable_motion
from survey.studies.planning import (
    ExtraReading,
    best_extra_readings,
    diagonal_blocks,
    planned_adjustment,
    planned_places,
    planned_readings,
    repeated_stop_covariance,
    typical_uncertainty,
    weak_points,
    world_names,
)
from survey.studies.planning_files import load_planned_places
from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError
from validation.poses.angles import Array
from validation.results import Finding, Section, Size, SystemResult, Table, TableColumn
from validation.systems import Progress, no_progress
from validation.text_files.csv_text import csv_text

MM = 1e3


@dataclass(frozen=True)
class Prediction:
    """What a survey will be worth.

    Parameters
    ----------
    measured : bool
        Whether it rests on the readings that exist, rather than on a plan.
    adjustment : Adjustment
        Places and their covariance.
    readings : int
        Readings in it.
    motions : mapping of str to (3, 3) array
        For each stop the covariance of a small motion of it.
    extra : sequence of ExtraReading
        What would help most.
    weak : mapping of str to int
        World points with fewer than three Vframe points in view.
    """

    measured: bool
    adjustment: Adjustment
    readings: int
    motions: dict[str, Array]
    extra: list[ExtraReading]
    weak: dict[str, int]


def predict(
    campaign: Campaign,
    settings: PlanSettings,
    extra: int,
    report: Progress = no_progress,
    *,
    planned: bool = False,
) -> Prediction:
    """The prediction for a campaign folder.

    Raises
    ------
    GtvalError
        If there is neither a plan nor a survey, or something is left undetermined.
    """
    base = campaign.settings
    survey = campaign.section("survey", SurveySettings)
    measured = not planned and readings_path(campaign, survey).exists()
    if measured:
        readings, adjustment = _existing(campaign)
        hidden = load_hidden_pairs(campaign, settings, adjustment.network.points)
    else:
        places = load_planned_places(campaign, settings)
        plan = (base.vframe, base.robot_frame, places.world, places.poses)
        hidden = load_hidden_pairs(campaign, settings, planned_places(*plan))
        readings = planned_readings(*plan, base.instrument, hidden, repeat=settings.repeat)
        adjustment = planned_adjustment(*plan, readings)
    report("motions", 0.4)
    poses = adjustment.network.poses
    motions = {pose: repeated_stop_covariance(adjustment, pose) for pose in poses}
    report("further readings", 0.6)
    suggested = best_extra_readings(adjustment, base.instrument, hidden, extra)
    weak = weak_points(readings, base.vframe, world_names(adjustment))
    return Prediction(measured, adjustment, len(readings), motions, suggested, weak)


def plan_chapter(outcome: SurveyOutcome) -> tuple[SystemResult, dict[str, Array]]:
    """The plan beside what was reached, and what motion of each stop the plan would see.

    The second is the predicted covariance of a small motion, by stop. Nothing where nothing is
    planned.

    Raises
    ------
    InputError
        Naming every bad place of the plan.
    """
    campaign = outcome.campaign
    settings = campaign.section("plan", PlanSettings)
    if not (campaign.folder / settings.world_points).exists():
        return SystemResult(), {}
    try:
        plan = predict(campaign, settings, 0, planned=True)
    except InputError:
        raise
    except GtvalError as error:
        text = f"The plan cannot be set beside the survey: {error}."
        return SystemResult(findings=[Finding("warning", text, "survey", "plan")]), {}
    tables, rows = [], _beside(outcome, plan)
    for kind in ("world point", "stop"):
        chosen = [row[1:] for row in rows if row[0] == kind]
        if chosen:
            tables.append(_beside_table(kind, chosen))
    section = Section("Plan against what was reached", tables)
    result = SystemResult(
        findings=list(_beside_findings(outcome, plan)),
        sections=[section],
        files={"plan_reached.csv": csv_text(("kind", "name", *_BESIDE), rows)},
    )
    return result, plan.motions


_BESIDE = ("planned_position", "planned_heading", "reached_position", "reached_heading")


def _sigmas(adjustment: Adjustment, kind: str, name: str) -> tuple[float, float]:
    """Standard deviation in the plane, metres, and of the heading, radians; NaN for points."""
    rows = adjustment.pose_rows([name]) if kind == "stop" else adjustment.point_rows([name])
    variances = adjustment.cofactors.variances[rows]
    heading = float(np.sqrt(variances[2])) if kind == "stop" else np.nan
    return float(np.sqrt(variances[:2].sum())), heading


def _beside(outcome: SurveyOutcome, plan: Prediction) -> list[list[object]]:
    """Kind, name, and the standard deviations planned and reached; NaN where not surveyed."""
    reached = None if outcome.solution is None else outcome.solution.adjustment
    names = [("world point", name) for name in world_names(plan.adjustment)]
    names += [("stop", name) for name in plan.adjustment.network.poses]
    there: set[tuple[str, str]] = set()
    if reached is not None:
        there = {("world point", name) for name in world_names(reached)}
        there |= {("stop", name) for name in reached.network.poses}
    rows: list[list[object]] = []
    for kind, name in names:
        found = (np.nan, np.nan)
        if reached is not None and (kind, name) in there:
            found = _sigmas(reached, kind, name)
        rows.append([kind, name, *_sigmas(plan.adjustment, kind, name), *found])
    return rows


def _beside_table(kind: str, rows: list[list[object]]) -> Table:
    """Planned and reached standard deviations of one kind, and their ratio."""
    values = np.array([row[1:] for row in rows], dtype=float)
    cells = [[None if np.isnan(v) else float(v) for v in column] for column in (MM * values).T]
    ratio = values[:, 2] / values[:, 0]
    columns: list[TableColumn] = [
        (kind, "", [str(row[0]) for row in rows]),
        ("planned sigma [mm]", ".1f", cells[0]),
        ("reached sigma [mm]", ".1f", cells[2]),
        ("reached/planned", ".2f", [None if np.isnan(v) else float(v) for v in ratio]),
    ]
    if kind == "stop":
        columns += [("planned heading [mrad]", ".2f", cells[1])]
        columns += [("reached heading [mrad]", ".2f", cells[3])]
    note = (
        "Sigma in the plane, sqrt(var x + var y), under the stated sigmas. Planned: every pair "
        "that is in range and not listed as hidden is read. No value: not surveyed."
    )
    return Table.of_columns(f"Planned and reached: {kind}s", columns, note)


MUCH_WORSE = 1.5
"""Times the planned uncertainty from which it is a warning. A judgement: half as large again is
what is left when more than half of the readings are not taken."""


def _beside_findings(outcome: SurveyOutcome, plan: Prediction) -> list[Finding]:
    """How good the survey was to be, and is."""
    now, solution = typical_uncertainty(plan.adjustment), outcome.solution
    stops = bool(plan.adjustment.network.poses)
    of = "A rig point" if stops else "A world point"
    text = f"{of} was planned to {MM * now:.1f} mm (1 sigma in the plane, mean square)"
    if solution is None or (stops and not solution.frames):
        text += "; what was reached is not known: there are no readings of stops."
        return [Finding("note", text, "survey", "plan")]
    reached = typical_uncertainty(solution.adjustment)
    text += (
        f" and is known to {MM * reached:.1f} mm: {len(solution.used)} readings were taken, "
        f"{plan.readings} planned."
    )
    if reached > MUCH_WORSE * now:
        text += " `gtval plan` says which further readings help most."
        return [Finding("warning", text, "survey", "plan")]
    return [Finding("note", text, "survey", "plan")]


def _existing(campaign: Campaign) -> tuple[Readings, Adjustment]:
    """Readings and joint adjustment of a campaign that has been measured."""
    outcome = solve_campaign(campaign)
    if outcome.solution is None:
        raise GtvalError(f"{campaign.folder}: there are no readings")
    return outcome.solution.used, outcome.solution.adjustment


def plan_findings(prediction: Prediction) -> list[Finding]:
    """What to change before going to the room, or before leaving it."""
    now = typical_uncertainty(prediction.adjustment)
    what = "a rig point" if prediction.motions else "a world point"
    text = f"{what.capitalize()} is known to {now * 1e3:.1f} mm (1 sigma in the plane, mean square)"
    source = "from the readings there are" if prediction.measured else "as planned"
    size = Size(f"standard deviation of {what} in the plane", now, "m")
    findings = [Finding("note", f"{text}, {source}.", "survey", "uncertainty", (size,))]
    if prediction.extra:
        last = prediction.extra[-1]
        gain = 1 - last.after / now
        small = "very little: " if gain < 0.01 else ""  # a judgement
        findings.append(
            Finding(
                "note",
                f"{len(prediction.extra)} further readings would gain {small}{gain:.1%} "
                f"({last.after * 1e3:.2f} mm).",
                "survey",
                "extra_readings",
            )
        )
    findings += [
        Finding(
            "error",
            f"only {count} Vframe point(s) in view: two places would fit equally well, which the "
            "ellipse does not show. Move it, or measure it from a third.",
            f"world point {name}",
            "ambiguous",
        )
        for name, count in prediction.weak.items()
    ]
    return findings


def points_table(prediction: Prediction) -> Table:
    """World points with their 3-sigma ellipses."""
    adjustment = prediction.adjustment
    rows: list[list[str | float]] = []
    for name in world_names(adjustment):
        covariance = diagonal_blocks(adjustment, adjustment.point_rows([name]), 2)[0]
        x, y = adjustment.parameters.points[adjustment.network.points.index(name)]
        long, short, direction = ellipse_axes(covariance)
        axes = [1e3 * ELLIPSE_SIGMAS * long, 1e3 * ELLIPSE_SIGMAS * short, degrees(direction) % 180]
        rows.append([name, float(x), float(y), *axes])
    how = "from the readings" if prediction.measured else "planned"
    return Table(
        f"World points, {how}: {ELLIPSE_SIGMAS:g} sigma ellipses ({prediction.readings} readings "
        "in all)",
        ["world point", "x [m]", "y [m]", "long [mm]", "short [mm]", "direction [°]"],
        rows,
        ["", ".3f", ".3f", ".1f", ".1f", ".0f"],
    )


def stops_table(prediction: Prediction, settings: PlanSettings) -> Table:
    """Stops with their uncertainty and the smallest motion that is seen."""
    adjustment = prediction.adjustment
    variances = adjustment.cofactors.variances
    rows: list[list[str | float]] = []
    for pose, covariance in prediction.motions.items():
        at = adjustment.pose_rows([pose])
        x, y, theta = (sqrt(variances[row]) for row in at)
        least = detectable_motion(covariance, settings.confidence, settings.power)
        rows.append(
            [
                pose,
                1e3 * x,
                1e3 * y,
                degrees(theta),
                1e3 * float(least.any_direction),
                degrees(least.components[2]),
            ]
        )
    return Table(
        "Stops: uncertainty, and the smallest motion that is seen",
        ["pose", "σ x [mm]", "σ y [mm]", "σ θ [°]", "shift seen [mm]", "turn seen [°]"],
        rows,
        ["", ".1f", ".1f", ".3f", ".1f", ".3f"],
        f"Seen: a stop moved by this and surveyed again is told from one that did not move, with "
        f"{settings.confidence:.0%} confidence and a chance of {settings.power:.0%}.",
    )


def extra_table(prediction: Prediction) -> Table:
    """Further readings, the best first, each with those above it taken as done."""
    return Table(
        "Further readings that help most, one after the other",
        ["", "from", "to", "", "uncertainty after [mm]", "gain [%]"],
        [
            [
                number,
                extra.start,
                extra.end,
                "repeated" if extra.repeated else "new",
                1e3 * extra.after,
                100 * (1 - extra.after / extra.before),
            ]
            for number, extra in enumerate(prediction.extra, 1)
        ],
        ["", "", "", "", ".3f", ".2f"],
    )


def plan_facts(prediction: Prediction, settings: PlanSettings) -> dict[str, object]:
    """Numbers for scripts."""
    adjustment = prediction.adjustment
    return {
        "source": "readings" if prediction.measured else "plan",
        "readings": prediction.readings,
        "typical_uncertainty": typical_uncertainty(adjustment),
        "world_points": {
            name: {
                "position": adjustment.parameters.points[adjustment.network.points.index(name)],
                "covariance": diagonal_blocks(adjustment, adjustment.point_rows([name]), 2)[0],
            }
            for name in world_names(adjustment)
        },
        "poses": {
            pose: {
                "covariance": diagonal_blocks(adjustment, adjustment.pose_rows([pose]), 3)[0],
                "motion_covariance": covariance,
                "detectable": detectable_motion(covariance, settings.confidence, settings.power),
            }
            for pose, covariance in prediction.motions.items()
        },
        "extra_readings": prediction.extra,
    }
