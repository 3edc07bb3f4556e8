"""The command ``gtval convergence``."""

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import AS_JSON, CAMPAIGN, PATH, SEED, STRICT, progress_bar

if TYPE_CHECKING:
    from survey.chapters.regions import Explored


@click.command()
@CAMPAIGN
@AS_JSON
@STRICT
@click.option(
    "--starts", default=10_000, show_default=True, type=click.IntRange(1), help="For each unknown."
)
@click.option("--radius", default=5.0, show_default=True, help="Largest distance of a start, m.")
@click.option(
    "--passes", default=20, show_default=True, type=click.IntRange(1), help="Passes of the filter."
)
@SEED
@click.option("--maps", type=PATH, help="Write a map for each unknown to this folder.")
@click.option("--figures", "maps_too", type=PATH, hidden=True)  # the name before --maps
def convergence(
    *,
    campaign: Path,
    as_json: bool,
    strict: bool,
    starts: int,
    radius: float,
    passes: int,
    seed: int,
    maps: Path | None,
    maps_too: Path | None,
) -> None:
    """How far off a first guess may be: where thousands of random ones lead.

    For every world point and pose the filter is started at random places up to --radius metres
    from the solution, with any heading. The table states the largest tested radius within which
    every start led to the solution.
    """
    from survey.campaign.solve import solve_campaign
    from survey.chapters.regions import (
        convergence_findings,
        explore,
        region_facts,
        regions_tables,
    )
    from validation.campaign.folder import load_campaign
    from validation.commands.output import tell_check
    from validation.errors import GtvalError

    if not (isfinite(radius) and radius > 0):
        raise click.BadParameter("the radius must be a positive number of metres")
    loaded = load_campaign(campaign)
    with progress_bar("survey") as report:
        outcome = solve_campaign(loaded)
        if outcome.solution is None or outcome.inputs.file is None:
            raise GtvalError(
                f"{campaign}: poses were taken over as published; without readings there is no "
                "filter to start"
            )
        from survey.studies.convergence_problems import unknowns_of

        unknowns = unknowns_of(
            outcome.solution, outcome.inputs.file.used, loaded.settings.robot_frame
        )
        found = explore(unknowns, starts, radius, passes, seed, report)
    for folder in filter(None, (maps, maps_too)):
        _write_maps(folder, found)
    findings = convergence_findings(found)
    facts = {"unknowns": [region_facts(*one) for one in found]}
    tables = regions_tables(found)
    tell_check(facts, tables, findings, as_json=as_json, strict=strict)


def _write_maps(folder: Path, found: "list[Explored]") -> None:
    """One PNG for each unknown."""
    from survey.figures.studies import convergence_map
    from validation.figures.writing import figure_bytes
    from validation.text_files.writing import write_files

    contents: dict[str, str | bytes] = {}
    for unknown, result in found:
        name = f"convergence_{unknown.kind.replace(' ', '_')}_{unknown.name}.png"
        figure = convergence_map(result, f"{unknown.kind} {unknown.name}")
        contents[name] = figure_bytes(figure, ".png", name)
    write_files(folder, contents)
