"""Walls, as a campaign's file of distances between them shows them."""

from math import degrees
from pathlib import Path

import numpy as np

from survey.chapters.lengths import flag_empty
from survey.readings.instrument import reading_sigma
from survey.settings import SurveySettings
from survey.studies.walls import WallPair, compare_walls, wall_findings
from validation.campaign.folder import Campaign, Instrument
from validation.results import Section, SystemResult, Table
from validation.text_files.csv_tables import Column, read_csv
from validation.text_files.csv_text import csv_text


def walls_chapter(campaign: Campaign) -> SystemResult:
    """Whether the walls of a campaign are parallel; nothing where none were measured.

    Raises
    ------
    InputError
        Naming every bad place.
    """
    path = campaign.folder / campaign.section("survey", SurveySettings).walls
    if not path.exists():
        return SystemResult()
    pairs = read_walls(path, campaign.settings.instrument)
    rows = [[p.wall_a, p.wall_b, p.readings, p.span, p.angle, p.sigma, p.p_value] for p in pairs]
    header = ["wall_a", "wall_b", "readings", "span", "angle", "sigma", "p_value"]
    return SystemResult(
        findings=[finding for pair in pairs for finding in wall_findings(pair)],
        sections=[Section("Are the walls parallel?", [walls_table(pairs)])],
        files={"walls.csv": csv_text(header, rows)},
    )


def read_walls(path: Path, instrument: Instrument) -> list[WallPair]:
    """Every pair of walls of a file, compared.

    Raises
    ------
    InputError
        Naming every bad place.
    """
    table = read_csv(
        path,
        [
            Column("wall_a"),
            Column("wall_b"),
            Column("position", "number", low=-1000.0, high=1000.0, unit="m"),
            Column(
                "distance", "number", low=instrument.range_min, high=instrument.range_max, unit="m"
            ),
        ],
    )
    names = list(zip(table.text["wall_a"], table.text["wall_b"], strict=True))
    for row, (a, b) in enumerate(names):
        if a and a == b:
            table.flag(row, "wall_b", "the two walls are the same")
        elif (b, a) in names[:row]:
            table.flag(
                row,
                "wall_a",
                f"line {table.lines[names.index((b, a))]} has these walls the other way round; "
                "give positions along one and the same wall",
            )
    flag_empty(table, "distance")
    table.raise_problems()
    position = np.array(table.numbers["position"])
    distance = np.array(table.numbers["distance"])
    pairs = []
    for a, b in dict.fromkeys(names):
        rows = np.array([name == (a, b) for name in names])
        sigma = reading_sigma(instrument, distance[rows])
        pairs.append(compare_walls(a, b, position[rows], distance[rows], sigma))
    return pairs


def walls_table(pairs: list[WallPair]) -> Table:
    """One row for each pair of walls."""
    return Table(
        "Angles between walls",
        ["wall a", "wall b", "readings", "span [m]", "angle [°]", "sigma [°]", "p-value"],
        [
            [
                *(pair.wall_a, pair.wall_b, pair.readings, pair.span),
                *(degrees(pair.angle), degrees(pair.sigma), pair.p_value),
            ]
            for pair in pairs
        ],
        ["", "", "", ".2f", "+.3f", ".3f", ".2g"],
        "Positive where the walls move apart as the position grows.",
    )
