"""Coordinates from elsewhere: published, hand-measured, first guesses."""

from pathlib import Path

import numpy as np

from survey.estimation.solve import Evidence
from survey.settings import SurveySettings
from validation.campaign.folder import Campaign
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.pose_table import PoseTable, from_csv
from validation.text_files.csv_tables import Column, read_csv

HAND_SIGMA = 0.2
"""Standard deviation, in metres, of hand-measured points that state none."""


def load_evidence(campaign: Campaign, settings: SurveySettings) -> Evidence:
    """Everything in the campaign that was not measured with the hand laser.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.
    """
    folder = campaign.folder
    hand, sigmas = _world_points(folder / settings.hand_points, settings)
    published, _ = _world_points(folder / settings.published_world_points, settings)
    guesses = folder / settings.initial_guesses
    table = from_csv(guesses, "hand") if guesses.exists() else None
    return Evidence(
        published=published,
        hand=hand,
        hand_sigma=float(np.nanmax(sigmas)) if np.isfinite(sigmas).any() else HAND_SIGMA,
        guesses={} if table is None else dict(zip(table.ids, table.poses, strict=True)),
    )


def _world_points(path: Path, settings: SurveySettings) -> tuple[dict[str, Array], Array]:
    """Coordinates and stated sigmas of named world points; nothing where there is no file."""
    if not path.exists():
        return {}, np.empty(0)
    columns = [
        Column("world_point"),
        Column("x", "number", low=-1e4, high=1e4, unit="m"),
        Column("y", "number", low=-1e4, high=1e4, unit="m"),
        Column("sigma", "number", required=False, blank=True, low=1e-6, high=100, unit="m"),
    ]
    table = read_csv(path, columns)
    table.flag_duplicates(["world_point"])
    for row, name in enumerate(table.text["world_point"]):
        if name and name not in settings.world_points:
            table.flag(row, "world_point", "not listed in campaign.toml, [survey] world_points")
    table.raise_problems()
    places = np.column_stack([table.numbers["x"], table.numbers["y"]])
    return dict(zip(table.text["world_point"], places, strict=True)), np.array(
        table.numbers["sigma"]
    )


def load_published_poses(campaign: Campaign, settings: SurveySettings) -> PoseTable | None:
    """Validation poses taken over from elsewhere; None where there are none."""
    path = campaign.folder / settings.published_poses
    if not path.exists():
        return None
    table = from_csv(path, "survey", sigmas=settings.published_sigmas)
    return PoseTable(
        "survey",
        table.ids,
        table.poses,
        table.covariances,
        sources=tuple(source or "published" for source in table.sources),
        provenance={"file": settings.published_poses},
    )


def need_survey_data(campaign: Campaign, settings: SurveySettings) -> None:
    """Raise if the campaign has neither readings nor published poses."""
    wanted = [campaign.folder / settings.readings, campaign.folder / settings.published_poses]
    if not any(path.exists() for path in wanted):
        raise GtvalError(
            f"{campaign.folder} holds no survey: neither {settings.readings} nor "
            f"{settings.published_poses} is there"
        )
