"""The command ``gtval plan``."""

from dataclasses import dataclass
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import AS_JSON, CAMPAIGN, FIGURE, STRICT, progress_bar

if TYPE_CHECKING:
    from survey.estimation.adjustment import Adjustment
    from survey.readings.readings import Readings
    from survey.settings import PlanSettings
    from survey.studies.planning import ExtraReading
    from validation.campaign.folder import Campaign
    from validation.poses.angles import Array
    from validation.results import Finding, Table


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
    adjustment: "Adjustment"
    readings: int
    motions: "dict[str, Array]"
    extra: "list[ExtraReading]"
    weak: dict[str, int]


@click.command()
@CAMPAIGN
@AS_JSON
@click.option(
    "--extra",
    default=8,
    show_default=True,
    type=click.IntRange(0, 200),
    help="How many further readings to suggest.",
)
@click.option("--planned", is_flag=True, help="Use the plan even where there are readings.")
@FIGURE
@STRICT
def plan(
    *, campaign: Path, as_json: bool, extra: int, planned: bool, figure: Path | None, strict: bool
) -> None:
    """Predict how good a survey will be, and which further readings help most.

    Before the survey: from planned world points and stops (see [plan] in campaign.toml), every
    visible pair being read. After it: from the readings that exist.
    """
    from survey.settings import PlanSettings
    from validation.campaign.folder import load_campaign
    from validation.commands.output import tell_check

    loaded = load_campaign(campaign)
    settings = loaded.section("plan", PlanSettings)
    prediction = predict(loaded, settings, extra, planned=planned)
    if figure is not None:
        _write_map(figure, loaded, prediction)
    findings = plan_findings(prediction)
    tables = [_points_table(prediction)]
    if prediction.motions:
        tables.append(_poses_table(prediction, settings))
    if prediction.extra:
        tables.append(_extra_table(prediction))
    facts = _facts(prediction, settings)
    tell_check(facts, tables, findings, as_json=as_json, strict=strict)


def predict(
    campaign: "Campaign", settings: "PlanSettings", extra: int, *, planned: bool = False
) -> Prediction:
    """The prediction for a campaign folder.

    Raises
    ------
    GtvalError
        If there is neither a plan nor a survey, or something is left undetermined.
    """
    from survey.readings.hidden_pairs import load_hidden_pairs
    from survey.readings.readings import readings_path
    from survey.settings import SurveySettings
    from survey.studies.planning import (
        best_extra_readings,
        planned_adjustment,
        planned_places,
        planned_readings,
        repeated_stop_covariance,
        weak_points,
        world_names,
    )
    from survey.studies.planning_files import load_planned_places

    base = campaign.settings
    survey = campaign.section("survey", SurveySettings)
    measured = not planned and readings_path(campaign, survey).exists()
    with progress_bar("plan") as report:
        if measured:
            readings, adjustment = _existing(campaign)
            hidden = load_hidden_pairs(campaign, settings, adjustment.network.points)
        else:
            places = load_planned_places(campaign, settings)
            names = planned_places(base.vframe, base.robot_frame, places.world, places.poses)
            hidden = load_hidden_pairs(campaign, settings, names)
            readings = planned_readings(
                base.vframe,
                base.robot_frame,
                places.world,
                places.poses,
                base.instrument,
                hidden,
                repeat=settings.repeat,
            )
            adjustment = planned_adjustment(
                base.vframe, base.robot_frame, places.world, places.poses, readings
            )
        report("motions", 0.4)
        poses = adjustment.network.poses
        motions = {pose: repeated_stop_covariance(adjustment, pose) for pose in poses}
        report("further readings", 0.6)
        suggested = best_extra_readings(adjustment, base.instrument, hidden, extra)
    weak = weak_points(readings, base.vframe, world_names(adjustment))
    return Prediction(measured, adjustment, len(readings), motions, suggested, weak)


def _existing(campaign: "Campaign") -> "tuple[Readings, Adjustment]":
    """Readings and joint adjustment of a campaign that has been measured."""
    from survey.campaign.solve import solve_campaign
    from validation.errors import GtvalError

    outcome = solve_campaign(campaign)
    if outcome.solution is None:
        raise GtvalError(f"{campaign.folder}: there are no readings")
    return outcome.solution.used, outcome.solution.adjustment


def plan_findings(prediction: Prediction) -> "list[Finding]":
    """What to change before going to the room, or before leaving it."""
    from survey.studies.planning import typical_uncertainty
    from validation.results import Finding

    now = typical_uncertainty(prediction.adjustment)
    what = "a rig point" if prediction.motions else "a world point"
    text = f"{what.capitalize()} is known to {now * 1e3:.1f} mm (1 sigma in the plane, mean square)"
    source = "from the readings there are" if prediction.measured else "as planned"
    findings = [Finding("note", f"{text}, {source}.", "survey", "uncertainty")]
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


def _points_table(prediction: Prediction) -> "Table":
    """World points with their 3-sigma ellipses."""
    from survey.estimation.geometry import ELLIPSE_SIGMAS, ellipse_axes
    from survey.studies.planning import diagonal_blocks, world_names
    from validation.results import Table

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


def _poses_table(prediction: Prediction, settings: "PlanSettings") -> "Table":
    """Stops with their uncertainty and the smallest motion that is seen."""
    from math import sqrt

    from survey.studies.accuracy import detectable_motion
    from validation.results import Table

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


def _extra_table(prediction: Prediction) -> "Table":
    """Further readings, the best first, each with those above it taken as done."""
    from validation.results import Table

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


def _facts(prediction: Prediction, settings: "PlanSettings") -> dict[str, object]:
    """Numbers for scripts."""
    from survey.studies.accuracy import detectable_motion
    from survey.studies.planning import diagonal_blocks, typical_uncertainty, world_names

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


def _write_map(path: Path, campaign: "Campaign", prediction: Prediction) -> None:
    """The planning map."""
    import numpy as np

    from survey.figures.maps import Places, Room
    from survey.figures.studies import planning_map
    from survey.studies.planning import diagonal_blocks, world_names
    from validation.figures.writing import write_figure

    adjustment = prediction.adjustment
    network, parameters = adjustment.network, adjustment.parameters

    place = dict(zip(network.points, parameters.points, strict=True))
    names = world_names(adjustment)
    world = Places(
        names,
        np.array([place[name] for name in names]).reshape(-1, 2),
        diagonal_blocks(adjustment, adjustment.point_rows(names), 2),
    )
    of_poses = diagonal_blocks(adjustment, adjustment.pose_rows(network.poses), 3)
    frames = Places(network.poses, parameters.poses, of_poses)
    settings = campaign.settings
    room = Room(
        list(settings.vframe.points.items()),
        np.array(list(settings.robot_frame.points.values()), dtype=float),
        settings.room.walls,
    )
    lines = [
        (str(number), place[extra.start], place[extra.end])
        for number, extra in enumerate(prediction.extra, 1)
    ]
    write_figure(path, planning_map(room, world, frames if network.poses else None, lines))
