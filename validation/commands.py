"""The commands ``gtval run``, ``gtval compare`` and ``gtval report``."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from validation.evaluation import Evaluation
    from validation.results import Finding
    from validation.run import RunResult
    from validation.statistics import IntervalMethod
    from validation.systems import Progress

CAMPAIGN = click.argument("campaign", type=click.Path(path_type=Path))
AS_JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON for scripts.")
NORMAL = click.option(
    "--normal-interval",
    "normal",
    is_flag=True,
    help="Interval of the mean as mean +- 1.96 s / sqrt(n) instead of Student's t.",
)


@contextmanager
def progress_bar(what: str) -> "Iterator[Progress]":
    """A progress bar on stderr, shown on a terminal only; gives the function to report to."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from validation.report.terminal import console

    shown = console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=shown, transient=True, disable=not shown.is_terminal) as bar:
        task = bar.add_task(what, total=1.0)

        def report(what: str, share: float) -> None:
            bar.update(task, description=what, completed=share)

        yield report


@click.command()
@CAMPAIGN
@AS_JSON
@NORMAL
@click.option("--no-report", is_flag=True, help="Write results only, no report.")
def run(campaign: Path, as_json: bool, normal: bool, no_report: bool) -> None:
    """Do all that a campaign has data for: solve, compare, report.

    Poses, errors and statistics go to CAMPAIGN/results, the report to CAMPAIGN/report. Either
    everything is written or, if anything fails, nothing.
    """
    done = _run_and_write(campaign, _method(normal), report=not no_report)
    page = None if no_report else done.campaign.report / "report.html"
    if as_json:
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
        return
    from validation.report.terminal import print_findings

    if done.evaluations:
        _print_evaluations(done.evaluations)
    print_findings(done.findings)
    if done.validation_is_faulty:
        from validation.report.document import FAULTY

        click.echo(f"\nDo not use these numbers yet. {FAULTY}")
    click.echo(f"\nResults: {done.campaign.results}")
    if page:
        click.echo(f"Report: {page}")


@click.command()
@CAMPAIGN
@AS_JSON
@NORMAL
@click.option("--pdf", is_flag=True, help="Also as PDF; needs the extra 'pdf'. Takes a while.")
def report(campaign: Path, as_json: bool, normal: bool, pdf: bool) -> None:
    """Run a campaign and write its report: HTML, and tables as Markdown and LaTeX.

    The report is always made from a fresh run, so that it cannot disagree with the data.
    """
    done = _run_and_write(campaign, _method(normal), report=True, pdf=pdf)
    folder = done.campaign.report
    names = ["report.html", "tables.md", "tables.tex", *(["report.pdf"] if pdf else [])]
    if as_json:
        from validation.report.terminal import print_json

        print_json({"report": [folder / name for name in names]})
        return
    click.echo(f"Report: {folder / 'report.html'}")
    click.echo(f"Tables: {folder / 'tables.md'}, {folder / 'tables.tex'}")
    if pdf:
        click.echo(f"PDF: {folder / 'report.pdf'}")


@click.command()
@click.argument("validation", type=click.Path(path_type=Path))
@click.argument("gt", type=click.Path(path_type=Path), nargs=-1)
@AS_JSON
@NORMAL
@click.option("--all", "every_pose", is_flag=True, help="Also list every pose.")
def compare(
    validation: Path, gt: tuple[Path, ...], as_json: bool, normal: bool, every_pose: bool
) -> None:
    """Compare pose tables: VALIDATION.csv with one or more GT.csv, or a campaign's results.

    A pose table has the columns pose, x, y, theta (metres, radians) and, if known, the
    covariance xx, xy, xt, yy, yt, tt; poses in space have x, y, z, yaw, pitch, roll.
    With a campaign folder as the only argument the tables under its results/ are compared.
    Nothing is written.
    """
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
        return
    from validation.report.terminal import print_findings

    _print_evaluations(evaluations, every_pose=every_pose)
    print_findings(findings)


def _print_evaluations(evaluations: "Sequence[Evaluation]", *, every_pose: bool = False) -> None:
    """Print the tables of the comparisons."""
    from validation.report.evaluation_tables import (
        magnitude_table,
        overview_table,
        pose_table,
        statistics_table,
    )
    from validation.report.terminal import print_table

    print_table(overview_table(evaluations))
    for evaluation in evaluations:
        print_table(statistics_table(evaluation))
        if every_pose:
            print_table(pose_table(evaluation.comparison))
            print_table(magnitude_table(evaluation.comparison))


def _method(normal: bool) -> "IntervalMethod":
    return "normal" if normal else "student"


def _run_and_write(
    campaign: Path, method: "IntervalMethod", *, report: bool, pdf: bool = False
) -> "RunResult":
    """Run the campaign and write its results, with the report if wanted."""
    from validation.campaign import load_campaign
    from validation.run import run_campaign, write_results

    loaded = load_campaign(campaign)
    with progress_bar("reading") as progress:
        done = run_campaign(loaded, progress, method)
        files: dict[str, str | bytes] = {}
        if report:
            from validation.report.files import report_files

            progress("writing the report", 1.0)
            files = report_files(done, pdf=pdf)
    write_results(done, files)
    return done


def _compared(
    validation: Path, gt: tuple[Path, ...], method: "IntervalMethod"
) -> "tuple[list[Evaluation], list[Finding]]":
    """The comparisons asked for, and what follows in words."""
    from validation.campaign import load_campaign
    from validation.conclusions import conclusions
    from validation.stored import compare_files, compare_results

    if validation.is_dir() or validation.name == "campaign.toml":
        if gt:
            raise click.UsageError("give either a campaign folder alone, or pose tables")
        evaluations = compare_results(load_campaign(validation), method)
    elif gt:
        evaluations = compare_files(validation, gt, method=method)
    else:
        raise click.UsageError("give at least one GT table to compare with the validation table")
    return evaluations, [finding for one in evaluations for finding in conclusions(one)]


COMMANDS: list[click.Command] = [run, compare, report]
