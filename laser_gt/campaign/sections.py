"""Report sections and tables of laser GT."""

import re
from collections import Counter
from collections.abc import Sequence
from types import ModuleType

import numpy as np

from laser_gt.campaign.outcome import LaserOutcome
from laser_gt.campaign.overlays import chosen_pairs, overlay_figure, overlay_table, overlays
from laser_gt.matching.verdicts import VERDICTS, Match
from laser_gt.placing.engines import Matching
from laser_gt.placing.mounts import MountCheck
from laser_gt.placing.solution import LaserSolution
from laser_gt.scans.planar import compose
from validation.results import Figure, Section, Table, Text

COMPONENTS = ("x [m]", "y [m]", "theta [rad]")

SHOWN = 16
"""Matches on the sheet of the report: the doubtful ones first. The gallery shows all."""


def laser_sections(outcome: LaserOutcome) -> list[Section]:
    """One section for each engine, and one for the mount."""
    sections = [_engine_section(outcome, matching) for matching in outcome.matchings.values()]
    check = outcome.mount_check
    blocks: list[Table | Figure | Text] = [] if check is None else [mount_table(check)]
    pairs = chosen_pairs(outcome)
    if pairs and (check is not None or outcome.settings.overlay_pairs):
        shown = overlays(outcome, pairs)
        blocks += [overlay_table(shown), overlay_figure(outcome, shown)]
    if blocks:
        sections.append(Section("Laser GT: mount", blocks))
    return sections


def _engine_section(outcome: LaserOutcome, matching: Matching) -> Section:
    """Map, pair graph, matches and poses of one engine."""
    engine = matching.engine
    title = {"scanmatch": "scan matching", "genetic": "genetic aligner"}[engine]
    blocks: list[Table | Figure | Text] = [
        Text(
            f"Initial guess: {outcome.trajectory.source}. Every accepted match is an edge of one "
            "pose graph. Not to be used as ground truth for methods that use the same laser."
        ),
        verdict_table(matching),
        fitness_table(matching),
    ]
    solution = outcome.solutions.get(engine)
    if solution is not None:
        blocks += _solution_blocks(outcome, solution)
    shown = worst_first(matching.matches)[:SHOWN]
    blocks += [
        Figure(
            f"laser_{engine}_quality",
            "What each match was judged by.",
            "Scatter of explained share against free-space violations, and of standard deviation "
            "against relative residuals, by verdict.",
            lambda: _figures().quality_figure(matching),
        ),
        Figure(
            f"laser_{engine}_matches",
            f"Matches, the doubtful first ({len(shown)} of {len(matching.matches)}).",
            "Pairs of scans in two colours after alignment, each with its verdict.",
            lambda: _figures().match_sheet(shown, outcome.inputs.by_stop),
        ),
    ]
    if matching.convergence:
        blocks.append(
            Figure(
                "laser_genetic_convergence",
                "Best fitness of each generation, all pairs.",
                "Curves that fall and level out.",
                lambda: _figures().convergence_figure(matching.convergence),
            )
        )
    return Section(f"Laser GT: {title}", blocks)


def _figures() -> ModuleType:
    """The drawing module, loaded when something is drawn."""
    from laser_gt.campaign import figures  # noqa: PLC0415  (matplotlib is slow to load)

    return figures


def _solution_blocks(outcome: LaserOutcome, solution: LaserSolution) -> list[Table | Figure | Text]:
    """What needs poses."""
    engine, mount = solution.matching.engine, outcome.inputs.mount
    where = dict(zip(solution.stops, solution.placement.poses, strict=True))
    start = solution.placement.frames[0]
    laser = compose(compose(start, mount), outcome.trajectory.poses)
    poses = np.array(
        [where.get(stop, laser[number]) for number, stop in enumerate(outcome.inputs.stops)]
    )
    return [
        Figure(
            f"laser_{engine}_map",
            "All scans, aligned, in the GTV frame; stops that placed the laser frame are bold.",
            "Map of the room drawn by the scans, with the stops and their headings.",
            lambda: _figures().room_map(solution, outcome.inputs.by_stop, mount),
        ),
        Figure(
            f"laser_{engine}_pairs",
            "Pairs of stops that were matched, by verdict.",
            "Graph of the stops with a line for each pair.",
            lambda: _figures().pair_graph(outcome.inputs.stops, poses, solution.matching),
        ),
        pose_table(solution),
    ]


def worst_first(matches: Sequence[Match]) -> list[Match]:
    """Matches that may be wrong first, then refuted, imprecise, accepted, by falling doubt."""
    order = {"may be wrong": 0, "refuted": 1, "imprecise": 2, "accepted": 3}
    return sorted(matches, key=lambda m: (order[m.verdict], m.agreement))


def verdict_table(matching: Matching) -> Table:
    """How many matches got which verdict, and why not better."""
    rows: list[list[str | int | float | None]] = []
    for verdict in VERDICTS:
        chosen = matching.of(verdict)
        common = Counter(kind_of(reason) for one in chosen for reason in one.reasons).most_common(3)
        rows.append([verdict, len(chosen), "; ".join(f"{kind} ({n})" for kind, n in common)])
    title = f"Verdicts on the matches by {matching.engine}"
    return Table(title, ["verdict", "matches", "most common reasons"], rows)


def fitness_table(matching: Matching) -> Table:
    """The document's fitness of the matches by verdict, and of wrong poses of the same pairs."""
    accepted = matching.accepted
    kinds: dict[str, list[float]] = {
        verdict: [one.fitness for one in matching.of(verdict)] for verdict in VERDICTS
    }
    kinds["best wrong pose of the accepted pairs"] = [one.rival_fitness for one in accepted]
    usual = float(np.median(kinds["accepted"])) if accepted else np.nan
    rows: list[list[str | int | float | None]] = []
    for kind, found in kinds.items():
        values = np.array([one for one in found if np.isfinite(one)])
        if len(values):
            low, middle, high = np.quantile(values, [0.0, 0.5, 1.0]).tolist()
            times = None if np.isnan(usual) else middle / max(usual, 1e-9)
            rows.append([kind, len(values), low, middle, high, times])
    return Table(
        "Fitness of right and wrong matches [m²]",
        ["", "matches", "least", "median", "most", "median over accepted"],
        rows,
        ["", "d", ".3f", ".3f", ".3f", ".1f"],
        "Squared distances to the closest points, summed, less the worst five, as in AD2.3: the "
        "smaller the better. It says that a wrong match has about 40 times the usual (1.933). "
        "Where a wrong pose has less than an accepted match, fitness cannot tell them apart.",
    )


def kind_of(reason: str) -> str:
    """A reason with dots for its numbers."""
    return re.sub(r"-?\d[\d.]*", "..", reason)


def pose_table(solution: LaserSolution) -> Table:
    """Poses with standard deviations."""
    sigma = solution.placement.sigmas
    values = np.hstack([solution.placement.poses, sigma]).tolist()
    return Table(
        f"Poses by {solution.matching.engine}",
        ["pose", *COMPONENTS, *(f"sigma {name}" for name in COMPONENTS)],
        [[stop, *row] for stop, row in zip(solution.stops, values, strict=True)],
        ["", ".4f", ".4f", ".4f", ".4f", ".4f", ".4f"],
        f"Placed by the surveyed stops {', '.join(solution.anchors)}.",
    )


def mount_table(check: MountCheck) -> Table:
    """Stated and found mount."""
    found = check.found
    columns = [check.stated, check.stated_sigmas, found.mount, found.sigmas, check.difference]
    values = np.column_stack(columns).tolist()
    return Table(
        "Mount of the laser on the robot",
        ["", "stated", "sigma", "found", "sigma found", "stated - found"],
        [[name, *row] for name, row in zip(COMPONENTS, values, strict=True)],
        ["", ".4f", ".4f", ".4f", ".4f", "+.4f"],
        f"From {found.pairs} pairs with turns of {np.rad2deg(found.turn):.0f} degrees "
        f"(root mean square); {check.says}.",
    )
