"""The command ``gtval compare``: tables of stops, or poses in time."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from validation.commands.options import AS_JSON, EVERYTHING, NORMAL, PATH, STRICT
from validation.commands.run import method_of, print_evaluations
from validation.commands.trajectory_files import moves, refuse_tables

if TYPE_CHECKING:
    from validation.poses.trajectory import Trajectory
    from validation.results import Finding
    from validation.statistics.error_statistics import IntervalMethod
    from validation.statistics.evaluation import Evaluation
    from validation.trajectories.comparison import TimeComparison

LIMIT_M = 0.05
"""The limit that is answered where none is asked for: the accuracy that AD2.3 set out to show."""


@click.command()
@click.argument("validation", type=PATH, metavar="CAMPAIGN | REFERENCE")
@click.argument("gt", type=PATH, nargs=-1, metavar="[SOURCE]...")
@click.option(
    "--align",
    metavar="none|frame|frame+time|...",
    help="Of trajectories: what is fitted first, of frame, scale, mount, time. By default nothing.",
)
@click.option(
    "--stops",
    type=PATH,
    help="When the robot stood where (pose, from, to), to compare a trajectory with a table; "
    "without it the standstills are found.",
)
@click.option(
    "--at",
    type=click.Choice(["sparser", "reference", "source"]),
    help="Of trajectories: at whose times; by default at those of the one with fewer poses a "
    "second.",
)
@click.option(
    "--limit",
    type=click.FloatRange(min=0, min_open=True),
    help=f"Of trajectories: metres for which a source is good enough or not; {LIMIT_M} by default.",
)
@AS_JSON
@NORMAL
@STRICT
@EVERYTHING
def compare(
    validation: Path,
    gt: tuple[Path, ...],
    align: str | None,
    stops: Path | None,
    at: Literal["sparser", "reference", "source"] | None,
    limit: float | None,
    as_json: bool,
    normal: bool,
    strict: bool,
    everything: bool,
) -> None:
    """Compare poses: REFERENCE with one or more SOURCE files, or a campaign's results.

    Tables of stops are compared stop by stop: they have the columns pose, x, y, theta (metres,
    radians) and, if known, the covariance xx, xy, xt, yy, yt, tt; poses in space have x, y, z,
    yaw, pitch, roll. Trajectories are compared at common times; their intervals allow for errors
    that neighbours share. A table as REFERENCE and a trajectory as SOURCE are compared at the
    stops. With a campaign folder as the only argument the tables under its
    results/ are compared. Nothing is written.
    """
    from validation.commands.output import end_of_command, print_first_findings
    from validation.report.terminal import print_json

    findings: Sequence[Finding]
    if gt and moves(validation):
        if normal or stops:
            raise click.UsageError("--normal-interval and --stops are for tables of stops")
        found = _compared_in_time(validation, gt, align or "none", at or "sparser")
        findings = _told_in_time(found, limit or LIMIT_M, as_json=as_json, everything=everything)
    else:
        if at or limit or align not in {None, "none", "frame"}:
            raise click.UsageError("--at, --limit and more than --align frame are for trajectories")
        own_frame = align == "frame"
        evaluations, findings = _compared(validation, gt, method_of(normal), stops, own_frame)
        if as_json:
            from validation.report.evaluation_json import evaluation_json, position_json
            from validation.statistics.by_source import source_differences, source_json
            from validation.statistics.standards.summary import standards_json, standards_of

            said = {one.system: standards_json(standards_of(one)) for one in evaluations}
            print_json(
                {
                    "comparisons": [
                        {
                            **evaluation_json(one),
                            "standards": said[one.system],
                            "by_source": source_json(source_differences(one)),
                        }
                        for one in evaluations
                    ],
                    "systems": {one.system: position_json(one) for one in evaluations},
                    "findings": findings,
                }
            )
        else:
            print_evaluations(evaluations, everything=everything)
    if not as_json:
        print_first_findings(findings, everything=everything)
    end_of_command(findings, failed=False, strict=strict)


def _compared_in_time(
    reference: Path,
    sources: Sequence[Path],
    align: str,
    at: Literal["sparser", "reference", "source"],
) -> "list[TimeComparison]":
    """The sources, each against the reference."""
    from validation.errors import GtvalError
    from validation.trajectories.alignment import parts_of
    from validation.trajectories.comparison import compare_in_time
    from validation.trajectories.formats import read_trajectory
    from validation.trajectories.formats.source import system_name

    parts = parts_of(align)
    names = [system_name(path) for path in sources]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise GtvalError(f"two sources are named {', '.join(twice)}; rename a file")
    refuse_tables(sources)
    truth = read_trajectory(reference)
    return [compare_in_time(truth, read_trajectory(path), parts, at, _delay_of) for path in sources]


def _delay_of(reference: "Trajectory", source: "Trajectory") -> "tuple[float, float | None]":
    """The delay and its sigma, as `gtval sync` has them; by positions where there is no heading.

    Raises
    ------
    GtvalError
        If the motion does not tell it.
    """
    from validation.errors import GtvalError
    from validation.statistics.error_statistics import two_sided_quantile
    from validation.trajectories.alignment import delay_by_positions
    from validation.trajectories.clock.estimate import estimate_clock

    if not (reference.has_orientation and source.has_orientation):
        return delay_by_positions(reference, source)
    found = estimate_clock(reference, source)
    if found.verdict != "determined":
        what = "is ambiguous" if found.verdict == "ambiguous" else "cannot be told"
        raise GtvalError(
            f"the delay of '{source.system}' {what}: {found.reason}; leave 'time' out of --align, "
            "and see `gtval sync`"
        )
    # That of the middle of the common time, which a drift changes to both sides of it.
    half = (found.high_s - found.low_s) / 2
    return found.delay_s, half / two_sided_quantile(found.confidence)


def _told_in_time(
    comparisons: "Sequence[TimeComparison]", limit: float, *, as_json: bool, everything: bool
) -> "list[Finding]":
    """Print comparisons in time, without their findings unless as JSON; the findings."""
    from validation.report.terminal import print_json, print_table
    from validation.trajectories.findings import findings_in_time
    from validation.trajectories.telling import comparison_json, overview_in_time, tables_in_time

    findings = [finding for one in comparisons for finding in findings_in_time(one, limit)]
    if as_json:
        systems = {one.system: comparison_json(one, limit) for one in comparisons}
        print_json({"comparisons": [], "systems": systems, "findings": findings})
        return findings
    print_table(overview_in_time(comparisons, limit))
    for one in comparisons if everything else ():
        for table in tables_in_time(one, limit):
            print_table(table)
    return findings


def _compared(
    validation: Path,
    gt: tuple[Path, ...],
    method: "IntervalMethod",
    stops: Path | None,
    own_frame: bool,
) -> "tuple[list[Evaluation], list[Finding]]":
    """The comparisons asked for, and what follows in words."""
    from validation.campaign.folder import load_campaign
    from validation.campaign.stored import read_tables, stored_tables
    from validation.errors import InputError, Problem
    from validation.poses.pose_table import refuse_twice
    from validation.published.moving import at_stops
    from validation.results import VALIDATION_SYSTEM
    from validation.solving import late_finding
    from validation.statistics.by_source import source_differences, source_findings
    from validation.statistics.conclusions import conclusions
    from validation.statistics.evaluation import evaluate

    settings = None
    if validation.is_dir() or validation.name == "campaign.toml":
        if gt:
            raise click.UsageError("give either a campaign folder alone, or pose tables")
        campaign = load_campaign(validation)
        found, settings = stored_tables(campaign), campaign.settings.comparison
        by_name = {table.system: table for table in found.tables}
        truth = by_name.pop(VALIDATION_SYSTEM, None)
        if truth is None or not by_name:
            what = "poses_survey.csv" if truth is None else "poses of another system"
            text = f"there are no {what} yet; `gtval run` makes them"
            raise InputError([Problem(campaign.results, text)])
        systems = list(by_name.values())
    elif gt:
        found = read_tables([validation, *(path for path in gt if not moves(path))])
        truth, *systems = found.tables
        moving = [at_stops(path, truth, stops, own_frame=own_frame) for path in gt if moves(path)]
        systems += [table for one in moving for table in one.tables]
        moved = [finding for one in moving for finding in one.findings]
        found = replace(found, findings=(*found.findings, *moved))
        refuse_twice([table.system for table in systems])
    else:
        raise click.UsageError("give at least one GT table to compare with the validation table")
    evaluations = [evaluate(truth, table, settings, method) for table in systems]
    concluded = [finding for one in evaluations for finding in conclusions(one)]
    concluded += [
        finding for one in evaluations for finding in source_findings(source_differences(one))
    ]
    late = late_finding("results", found.others)
    return evaluations, [*found.findings, *late, *concluded]
