"""The command ``gtval convergence``."""

from math import degrees, isfinite, pi
from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import AS_JSON, CAMPAIGN, PATH, SEED, STRICT, progress_bar

if TYPE_CHECKING:
    from survey.studies.convergence import Convergence, Region
    from survey.studies.convergence_problems import Unknown
    from validation.results import Finding, Table
    from validation.systems import Progress

    Explored = tuple[Unknown, Convergence]


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
        found = _explore(unknowns, starts, radius, passes, seed, report)
    for folder in filter(None, (maps, maps_too)):
        _write_maps(folder, found)
    findings = convergence_findings(found)
    kinds = {
        kind: [one for one in found if one[0].kind == kind] for kind in ("world point", "pose")
    }
    facts = {"unknowns": [_facts(*one) for one in found]}
    tables = [_table(kind, chosen) for kind, chosen in kinds.items() if chosen]
    tell_check(facts, tables, findings, as_json=as_json, strict=strict)


def _explore(
    unknowns: "list[Unknown]",
    starts: int,
    radius: float,
    passes: int,
    seed: int,
    report: "Progress",
) -> "list[Explored]":
    """Every unknown with where its starts lead; each draws from a stream of its own."""
    import numpy as np

    from survey.studies.convergence import explore_convergence
    from validation.errors import GtvalError

    streams = np.random.SeedSequence(seed).spawn(len(unknowns))
    found = []
    for number, (unknown, stream) in enumerate(zip(unknowns, streams, strict=True)):
        report(f"{unknown.kind} {unknown.name}", number / len(unknowns))
        rng = np.random.default_rng(stream)
        try:
            result = explore_convergence(
                unknown.problem, unknown.solution, rng, starts=starts, radius=radius, passes=passes
            )
        except ValueError as error:
            said = f"{unknown.kind} {unknown.name}: {error}; give it more --passes than {passes}"
            raise GtvalError(said) from error
        found.append((unknown, result))
    return found


def convergence_findings(found: "list[Explored]") -> "list[Finding]":
    """What a person should know of where the starts lead."""
    from survey.studies.convergence import smallest_region
    from validation.results import Finding, Severity

    findings = []
    for kind in ("world point", "pose"):
        results = [result for unknown, result in found if unknown.kind == kind]
        if not results:
            continue
        any_heading = smallest_region(results)
        text = f"Every start {_region_words(any_heading)} led to the solution, for every {kind}"
        if kind == "pose":
            limited = smallest_region(results, pi / 3)
            text += f"; with the heading within ±60°, every start {_region_words(limited)}"
        severity: Severity = "good" if any_heading.radius > 0 else "warning"
        findings.append(Finding(severity, f"{text}.", f"{kind}s", "convergence"))
    for unknown, result in found:
        other = result.better_elsewhere
        if other is not None:
            place = ", ".join(f"{value:.3f}" for value in other.state)
            findings.append(
                Finding(
                    "error",
                    f"{other.starts} starts lead to another place ({place}) that fits better "
                    f"(cost {other.cost:.1f} instead of {result.cost:.1f}); check its readings.",
                    f"{unknown.kind} {unknown.name}",
                    "better_elsewhere",
                )
            )
    return findings


def _region_words(region: "Region") -> str:
    if region.radius == 0:
        return "within 0 m (a start failed already inside the smallest radius tested)"
    more = ", the largest tested," if region.limited_by_test else ""
    return (
        f"within {region.radius:.2g} m{more} (at worst {region.starts} starts: below "
        f"{region.failures_below:.2g} of such starts fail, at 95 % confidence)"
    )


def _table(kind: str, found: "list[Explored]") -> "Table":
    """One row for each unknown."""
    from validation.results import Table

    limits = [region.heading_limit for region in found[0][1].regions]
    headings = [
        "radius [m]" if limit == pi else f"within ±{degrees(limit):.0f}° [m]" for limit in limits
    ]
    rows: list[list[str | int | float | None]] = []
    for unknown, result in found:
        nearest = result.others[0].cost if result.others else None
        radii = [region.radius for region in result.regions]
        share = result.regions[0].failures_below
        rows.append([unknown.name, *result.counts, *radii, share, result.cost, nearest])
    first = found[0][1]
    return Table(
        f"Where {len(first.starts)} starts up to {first.radius:g} m away lead, {kind} by {kind}",
        [
            *(kind, "to the solution", "elsewhere", "nowhere", *headings),
            *("share below", "cost", "cost elsewhere"),
        ],
        rows,
        ["", "", "", "", *(".2f" for _ in limits), ".2g", ".1f", ".1f"],
        "Radius: every start within it led to the solution, headings being any unless limited. "
        "Share below: at 95 % confidence, a smaller share of such starts within it fails. "
        f"Nowhere: no convergence in {first.passes} passes.",
    )


def _facts(unknown: "Unknown", result: "Convergence") -> dict[str, object]:
    """Numbers for scripts; the starts themselves are left out."""
    return {
        "kind": unknown.kind,
        "name": unknown.name,
        "solution": result.solution,
        "cost": result.cost,
        "readings": len(unknown.problem.distance),
        "starts": len(result.starts),
        "starts_within": result.radius,
        "passes": result.passes,
        **dict(zip(("to_solution", "elsewhere", "nowhere"), result.counts, strict=True)),
        "regions": result.regions,
        "others": result.others,
    }


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
