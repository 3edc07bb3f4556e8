"""The command ``gtval plan``."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import AS_JSON, CAMPAIGN, FIGURE, STRICT, progress_bar

if TYPE_CHECKING:
    from survey.chapters.planned import Prediction
    from validation.campaign.folder import Campaign


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
    from survey.chapters.planned import (
        extra_table,
        plan_facts,
        plan_findings,
        points_table,
        predict,
        stops_table,
    )
    from survey.settings import PlanSettings
    from validation.campaign.folder import load_campaign
    from validation.commands.output import tell_check

    loaded = load_campaign(campaign)
    settings = loaded.section("plan", PlanSettings)
    with progress_bar("plan") as report:
        prediction = predict(loaded, settings, extra, report, planned=planned)
    if figure is not None:
        _write_map(figure, loaded, prediction)
    findings = plan_findings(prediction)
    tables = [points_table(prediction)]
    if prediction.motions:
        tables.append(stops_table(prediction, settings))
    if prediction.extra:
        tables.append(extra_table(prediction))
    facts = plan_facts(prediction, settings)
    tell_check(facts, tables, findings, as_json=as_json, strict=strict)


def _write_map(path: Path, campaign: "Campaign", prediction: "Prediction") -> None:
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
