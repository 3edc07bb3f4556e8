"""What the files of a survey hold: readings, and coordinates from elsewhere."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from survey.estimation.evidence import Evidence
from survey.readings.hardware import missing_hardware
from survey.readings.readings import ReadingsFile, load_readings, readings_path
from survey.settings import PlanSettings, SurveySettings
from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array
from validation.poses.pose_table import PoseTable, from_csv
from validation.text_files.csv_tables import Column, read_csv
from validation.text_files.table_rows import table_rows

HAND_SIGMA = 0.2
"""Standard deviation, in metres, of hand-measured points that state none. A judgement: a tape laid
by one person; it separates a place from its mirror image, which is metres away."""


@dataclass(frozen=True)
class SurveyInputs:
    """What the files of a campaign say to its survey.

    Parameters
    ----------
    settings : SurveySettings
        The table [survey].
    file : ReadingsFile or None
        The readings, if there are any.
    evidence : Evidence
        Coordinates from elsewhere.
    published_poses : PoseTable or None
        Poses taken over from elsewhere.
    """

    settings: SurveySettings
    file: ReadingsFile | None
    evidence: Evidence
    published_poses: PoseTable | None


def load_inputs(campaign: Campaign) -> SurveyInputs:
    """All that the survey reads.

    Raises
    ------
    GtvalError
        If there are neither readings nor published poses.
    InputError
        Naming file, line, field and value of every bad place.
    """
    settings = campaign.section("survey", SurveySettings)
    readings = readings_path(campaign, settings)
    if not any(path.exists() for path in (readings, campaign.folder / settings.published_poses)):
        raise GtvalError(
            f"{campaign.folder} holds no survey: neither {settings.readings} nor "
            f"{settings.published_poses} is there"
        )
    problems = _settings_problems(campaign, settings)
    if readings.exists():
        # Names of marks hold a '/'; the rest of the file is read when the settings are good.
        marks = any("/" in cell for _, cells in table_rows(readings) for cell in cells)
        tolerance = settings.reading_sigma is None
        problems += missing_hardware(campaign, tolerance=tolerance, rig=marks)
    if problems:
        raise InputError(problems)
    return SurveyInputs(
        settings,
        load_readings(campaign, settings),
        load_evidence(campaign, settings),
        _published_poses(campaign, settings),
    )


def input_files(campaign: Campaign) -> list[Path]:
    """The files that the survey reads, campaign.toml apart, whether they are there or not."""
    settings = campaign.section("survey", SurveySettings)
    plan = campaign.section("plan", PlanSettings)
    names = (
        settings.initial_guesses,
        settings.hand_points,
        settings.published_world_points,
        settings.published_poses,
        settings.entry.journal,
        settings.known_lengths,
        settings.walls,
        settings.published_motions,
        plan.not_visible,
        plan.world_points,
        plan.poses,
    )
    paths = (campaign.folder / name for name in dict.fromkeys(names))
    return [readings_path(campaign, settings), *paths]


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


def _published_poses(campaign: Campaign, settings: SurveySettings) -> PoseTable | None:
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


def _settings_problems(campaign: Campaign, settings: SurveySettings) -> list[Problem]:
    """Names in [survey] that mean nothing or two things."""
    vframe = set(campaign.settings.vframe.points)
    problems = []
    for name, meaning in settings.labels.items():
        if meaning not in vframe:
            problems.append(("labels", f"{name} = {meaning}: no such Vframe point"))
    meanings = list(settings.labels.values())
    if len(set(meanings)) < len(meanings):
        problems.append(("labels", "two labels stand for the same Vframe point"))
    unmapped = {name for name in vframe - set(settings.labels) if name in meanings}
    problems += [
        ("labels", f"both '{n}' and another label stand for {n}") for n in sorted(unmapped)
    ]
    twice = {name for name in settings.world_points if settings.world_points.count(name) > 1}
    problems += [("world_points", f"'{name}' is listed twice") for name in sorted(twice)]
    both = vframe & set(settings.world_points)
    problems += [
        ("world_points", f"'{name}' is also a Vframe point; world points need other names")
        for name in sorted(both)
    ]
    return [Problem(campaign.toml, text, field=f"survey.{key}") for key, text in problems]
