"""Convergence of a campaign's filters: which first guesses lead to the solution, and which not.

AD2.3: "the filter never diverged", shown for one world point by a plot of first guesses.
"""

from functools import partial
from math import degrees, pi
from typing import TYPE_CHECKING

import numpy as np

from survey.campaign.outcome import SurveyOutcome
from survey.estimation.iterated_ekf import PASSES
from survey.studies.convergence import Convergence, Region, explore_convergence, smallest_region
from survey.studies.convergence_problems import Unknown, unknowns_of
from validation.errors import GtvalError
from validation.results import Figure, Finding, Section, Severity, Size, SystemResult, Table
from validation.systems import Progress, no_progress
from validation.text_files.csv_text import csv_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

Explored = tuple[Unknown, Convergence]
RADIUS, SEED = 5.0, 1
"""Largest distance of a start, metres, and the seed of all starts."""
MOST_UNKNOWNS = 100
"""Points and stops up to which each is explored: with 500 stops it took a minute, the survey
itself three seconds."""


def regions_chapter(outcome: SurveyOutcome) -> SystemResult:
    """Where random starts lead, for every unknown; nothing without readings or starts."""
    solution, file = outcome.solution, outcome.inputs.file
    starts = outcome.inputs.settings.convergence_starts
    if solution is None or file is None or not starts:
        return SystemResult()
    if len(solution.world.points) + len(solution.frames) > MOST_UNKNOWNS:
        said = (
            f"where starts lead is not tried for more than {MOST_UNKNOWNS} points and stops "
            "together: it would take longer than all else"
        )
        count = Size("points and stops", len(solution.world.points) + len(solution.frames))
        note = Finding("note", f"{said}.", "survey", "convergence", (count,))
        return SystemResult(findings=[note])
    unknowns = unknowns_of(solution, file.used, outcome.campaign.settings.robot_frame)
    try:
        found = explore(unknowns, starts, RADIUS, PASSES, SEED, no_progress)
    except GtvalError as error:
        tried = Size("starts of each", starts)
        warned = Finding("warning", f"{error}.", "survey", "convergence", (tried,))
        return SystemResult(findings=[warned])
    if not found:
        return SystemResult()
    worst = min(found, key=lambda one: (one[1].regions[0].radius, one[1].counts[0]))
    name = f"{worst[0].kind} {worst[0].name}"
    figure = Figure(
        "convergence",
        f"Where first guesses around {name} lead, the one whose region is smallest.",
        "Map of random starts, by where the filter ends; the numbers are in the tables.",
        partial(_draw, worst[1], name),
    )
    return SystemResult(
        findings=convergence_findings(found),
        sections=[Section("Convergence of the filters", [*regions_tables(found), figure])],
        files={"convergence.csv": _regions_csv(found)},
    )


def _draw(result: Convergence, name: str) -> "MatplotlibFigure":
    from survey.figures.studies import convergence_map  # noqa: PLC0415  (matplotlib is slow to load)

    return convergence_map(result, name)


def regions_tables(found: list[Explored]) -> list[Table]:
    """A table for world points, and one for poses."""
    kinds = ("world point", "pose")
    chosen = {kind: [one for one in found if one[0].kind == kind] for kind in kinds}
    return [regions_table(kind, those) for kind, those in chosen.items() if those]


def _regions_csv(found: list[Explored]) -> str:
    """One row an unknown."""
    rows = []
    for unknown, result in found:
        any_heading = result.regions[0]
        share = any_heading.failures_below
        rows.append([unknown.kind, unknown.name, *result.counts, any_heading.radius, share])
    header = ["kind", "name", "to_solution", "elsewhere", "nowhere", "radius", "failures_below"]
    return csv_text(header, rows)


def explore(
    unknowns: list[Unknown],
    starts: int,
    radius: float,
    passes: int,
    seed: int,
    report: Progress,
) -> list[Explored]:
    """Every unknown with where its starts lead; each draws from a stream of its own."""
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


def convergence_findings(found: list[Explored]) -> list[Finding]:
    """What a person should know of where the starts lead."""
    findings = []
    for kind in ("world point", "pose"):
        results = [result for unknown, result in found if unknown.kind == kind]
        if not results:
            continue
        any_heading = smallest_region(results)
        text = f"{_region_words(any_heading)}, for every {kind}"
        if kind == "pose":
            limited = smallest_region(results, pi / 3)
            text += f"; with the heading within ±60°: {_region_words(limited)}"
        severity: Severity = "good" if any_heading.radius > 0 else "warning"
        size = Size("radius from which all starts lead back", any_heading.radius, "m")
        findings.append(Finding(severity, f"{text}.", f"{kind}s", "convergence", (size,)))
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
                    (Size("cost there less cost here", other.cost - result.cost),),
                )
            )
    return findings


def _region_words(region: Region) -> str:
    if region.radius == 0:
        return "A start failed inside the smallest radius tested"
    more = ", the largest tested," if region.limited_by_test else ""
    return (
        f"Every start within {region.radius:.2g} m{more} led to the solution (at worst "
        f"{region.starts} starts: below "
        f"{region.failures_below:.2g} of such starts fail, at 95 % confidence)"
    )


def regions_table(kind: str, found: list[Explored]) -> Table:
    """One row for each unknown."""
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


def region_facts(unknown: Unknown, result: Convergence) -> dict[str, object]:
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
