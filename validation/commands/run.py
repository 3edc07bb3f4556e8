"""The commands ``gtval run``, ``gtval compare`` and ``gtval report``."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import (
    AS_JSON,
    CAMPAIGN,
    EVERYTHING,
    NORMAL,
    PATH,
    STRICT,
    progress_bar,
)

if TYPE_CHECKING:
    from validation.results import Finding
    from validation.run import RunResult
    from validation.statistics.error_statistics import IntervalMethod
    from validation.statistics.evaluation import Evaluation

RUN_BEFORE_REPORT = 0.7
"""Share of the progress bar that a run has before its report is written. A judgement: the report of
the AD2.3 campaign takes longer than its run, that of a room with images a tenth of it."""


@click.command()
@CAMPAIGN
@AS_JSON
@NORMAL
@STRICT
@EVERYTHING
@click.option("--no-report", is_flag=True, help="Write results only, no report.")
def run(
    campaign: Path, as_json: bool, normal: bool, strict: bool, everything: bool, no_report: bool
) -> None:
    """Do all that a campaign has data for: solve, compare, report.

    Poses, errors and statistics go to CAMPAIGN/results, the report to CAMPAIGN/report. If input
    is bad, nothing is written. A part that fails unexpectedly does not take the others along.
    """
    from validation.commands.output import end_of_command

    done = _run_and_write(campaign, _method(normal), report=not no_report)
    page = None if no_report else done.campaign.report / "report.html"
    if as_json:
        _print_run_json(done, page)
    else:
        _print_run(done, everything=everything)
        click.echo(f"Results: {done.campaign.results}")
        if page:
            click.echo(f"Report: {page}")
    end_of_command(done.findings, failed=done.failed, strict=strict)


def _print_run_json(done: "RunResult", page: Path | None) -> None:
    """A run for scripts."""
    from validation.report.evaluation_json import evaluation_json
    from validation.report.terminal import print_json

    print_json(
        {
            "campaign": done.campaign.settings.name,
            "validation_is_faulty": done.validation_is_faulty,
            "results": done.campaign.results,
            "report": page,
            "systems": {system.name: system.result.facts for system in done.systems},
            "comparisons": [evaluation_json(one) for one in done.evaluations],
            "findings": done.findings,
        }
    )


def _print_run(done: "RunResult", *, everything: bool) -> None:
    """One row a system, and what asks for action."""
    from validation.commands.output import print_first_findings
    from validation.report.evaluation_tables import poses_table

    if done.evaluations:
        print_evaluations(done.evaluations, everything=everything)
    else:
        from validation.report.terminal import print_table

        print_table(poses_table(done.tables))
    print_first_findings(done.findings, everything=everything)
    if done.validation_is_faulty:
        from validation.report.document import FAULTY

        click.echo(f"\nDo not use these numbers yet. {FAULTY}")
    click.echo()


@click.command()
@CAMPAIGN
@AS_JSON
@NORMAL
@STRICT
@EVERYTHING
@click.option("--pdf", is_flag=True, help="Also as PDF; needs the extra 'pdf'. Takes a while.")
def report(
    campaign: Path, as_json: bool, normal: bool, strict: bool, everything: bool, pdf: bool
) -> None:
    """Run a campaign and write its report: HTML, and tables as Markdown and LaTeX.

    The report is always made from a fresh run, so that it cannot disagree with the data.
    """
    from validation.commands.output import end_of_command

    done = _run_and_write(campaign, _method(normal), report=True, pdf=pdf)
    folder = done.campaign.report
    names = ["report.html", "tables.md", "tables.tex", *(["report.pdf"] if pdf else [])]
    if as_json:
        from validation.report.terminal import print_json

        print_json({"report": [folder / name for name in names], "findings": done.findings})
    else:
        _print_run(done, everything=everything)
        for name in names:
            click.echo(f"Report: {folder / name}")
    end_of_command(done.findings, failed=done.failed, strict=strict)


@click.command()
@click.argument("validation", type=PATH, metavar="CAMPAIGN | VALIDATION.csv")
@click.argument("gt", type=PATH, nargs=-1, metavar="[GT.csv]...")
@AS_JSON
@NORMAL
@STRICT
@EVERYTHING
def compare(
    validation: Path,
    gt: tuple[Path, ...],
    as_json: bool,
    normal: bool,
    strict: bool,
    everything: bool,
) -> None:
    """Compare pose tables: VALIDATION.csv with one or more GT.csv, or a campaign's results.

    A pose table has the columns pose, x, y, theta (metres, radians) and, if known, the
    covariance xx, xy, xt, yy, yt, tt; poses in space have x, y, z, yaw, pitch, roll.
    With a campaign folder as the only argument the tables under its results/ are compared.
    Nothing is written.
    """
    from validation.commands.output import end_of_command, print_first_findings

    evaluations, findings = _compared(validation, gt, _method(normal))
    if as_json:
        from validation.report.evaluation_json import evaluation_json
        from validation.report.terminal import print_json

        print_json(
            {
                "comparisons": [evaluation_json(one) for one in evaluations],
                "findings": findings,
            }
        )
    else:
        print_evaluations(evaluations, everything=everything)
        print_first_findings(findings, everything=everything)
    end_of_command(findings, failed=False, strict=strict)


def print_evaluations(evaluations: "Sequence[Evaluation]", *, everything: bool = False) -> None:
    """Print one row a system; with everything, each system's tables too."""
    from validation.report.evaluation_tables import (
        magnitude_table,
        overview_table,
        pose_table,
        statistics_table,
    )
    from validation.report.terminal import print_table

    print_table(overview_table(evaluations))
    for evaluation in evaluations if everything else ():
        for table in (
            statistics_table(evaluation),
            pose_table(evaluation.comparison),
            magnitude_table(evaluation.comparison),
        ):
            print_table(table)


def _method(normal: bool) -> "IntervalMethod":
    return "normal" if normal else "student"


def _run_and_write(
    campaign: Path, method: "IntervalMethod", *, report: bool, pdf: bool = False
) -> "RunResult":
    """Run the campaign and write its results, with the report if wanted."""
    from validation.campaign.folder import load_campaign
    from validation.campaign.provenance import REPORT_FILES
    from validation.run import run_campaign
    from validation.run_files import left_over, write_results
    from validation.solving import late_finding

    loaded = load_campaign(campaign)
    with progress_bar("reading") as progress:
        share_of_run = RUN_BEFORE_REPORT if report else 1.0
        done = run_campaign(
            loaded, lambda what, share: progress(what, share_of_run * share), method
        )
        files: dict[str, str | bytes] = {}
        if report:
            from validation.report.files import report_files

            progress("writing the report", RUN_BEFORE_REPORT)
            done, files = report_files(done, pdf=pdf)
    _, old = left_over(done, report=report)
    old = [one for one in old if one.file in REPORT_FILES]  # the others are told as no_data
    write_results(done, files)
    return replace(done, findings=(*done.findings, *late_finding("results", old)))


def _compared(
    validation: Path, gt: tuple[Path, ...], method: "IntervalMethod"
) -> "tuple[list[Evaluation], list[Finding]]":
    """The comparisons asked for, and what follows in words."""
    from validation.campaign.folder import load_campaign
    from validation.campaign.stored import read_tables, stored_tables
    from validation.errors import InputError, Problem
    from validation.poses.pose_table import refuse_twice
    from validation.results import VALIDATION_SYSTEM
    from validation.solving import late_finding
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
        found = read_tables([validation, *gt])
        truth, *systems = found.tables
        refuse_twice([table.system for table in systems])
    else:
        raise click.UsageError("give at least one GT table to compare with the validation table")
    evaluations = [evaluate(truth, table, settings, method) for table in systems]
    concluded = [finding for one in evaluations for finding in conclusions(one)]
    late = late_finding("results", found.others)
    return evaluations, [*found.findings, *late, *concluded]
