"""The commands ``gtval run`` and ``gtval report``."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import (
    AS_JSON,
    CAMPAIGN,
    EVERYTHING,
    NORMAL,
    STRICT,
    progress_bar,
)

if TYPE_CHECKING:
    from validation.run import RunResult
    from validation.statistics.error_statistics import IntervalMethod
    from validation.statistics.evaluation import Evaluation

PAPER = ("tables_paper.md", "tables_paper.tex")


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

    done = _run_and_write(campaign, method_of(normal), report=not no_report)
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
    from validation.statistics.by_source import source_json
    from validation.statistics.standards.summary import standards_json

    said = {one.system: standards_json(one) for one in done.statements.standards}
    print_json(
        {
            "campaign": done.campaign.settings.name,
            "validation_is_faulty": done.validation_is_faulty,
            "results": done.campaign.results,
            "report": page,
            "systems": {system.name: system.result.facts for system in done.systems},
            "time": done.in_time.facts if done.in_time else {},
            "comparisons": [
                {
                    **evaluation_json(one),
                    "standards": said.get(one.system),
                    "by_source": source_json(
                        [each for each in done.statements.by_source if each.system == one.system]
                    ),
                }
                for one in done.evaluations
            ],
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

    done = _run_and_write(campaign, method_of(normal), report=True, pdf=pdf)
    folder = done.campaign.report
    wanted = ["report.html", "tables.md", "tables.tex", *PAPER, *(["report.pdf"] if pdf else [])]
    names = [name for name in wanted if (folder / name).is_file()]
    if as_json:
        from validation.report.terminal import print_json

        print_json({"report": [folder / name for name in names], "findings": done.findings})
    else:
        _print_run(done, everything=everything)
        for name in names:
            click.echo(f"Report: {folder / name}")
    end_of_command(done.findings, failed=done.failed, strict=strict)


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


def method_of(normal: bool) -> "IntervalMethod":
    """How the interval of the mean is found."""
    return "normal" if normal else "student"


def _run_and_write(
    campaign: Path, method: "IntervalMethod", *, report: bool, pdf: bool = False
) -> "RunResult":
    """Run the campaign and write its results, with the report if wanted."""
    from validation.whole_run import run_and_write

    with progress_bar("reading") as progress:
        return run_and_write(campaign, progress, method, report=report, pdf=pdf)
