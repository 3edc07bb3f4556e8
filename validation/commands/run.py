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
    PATH,
    SCHEDULER,
    STRICT,
    progress_bar,
)

if TYPE_CHECKING:
    from validation.results import Finding
    from validation.run import RunResult
    from validation.statistics.error_statistics import IntervalMethod
    from validation.statistics.evaluation import Evaluation

PAPER = ("tables_paper.md", "tables_paper.tex")


@click.command()
@click.argument("campaigns", type=PATH, nargs=-1, required=True, metavar="CAMPAIGN...")
@AS_JSON
@NORMAL
@STRICT
@EVERYTHING
@click.option("--no-report", is_flag=True, help="Write results only, no report.")
@SCHEDULER
def run(
    campaigns: tuple[Path, ...],
    as_json: bool,
    normal: bool,
    strict: bool,
    everything: bool,
    no_report: bool,
    scheduler: str | None = None,
) -> None:
    """Do all that a campaign has data for: solve, compare, report.

    Poses, errors and statistics go to CAMPAIGN/results, the report to CAMPAIGN/report. If input
    is bad, nothing is written. A part that fails unexpectedly does not take the others along.

    Of several campaigns a broken one does not stop the others; a folder that holds campaigns stands
    for all of them.
    """
    from validation.commands.output import end_of_command
    from validation.days.order import campaign_folders
    from validation.pieces.cluster import on_cluster
    from validation.pieces.store import counted

    folders = campaign_folders(campaigns)
    if len(folders) > 1:
        with on_cluster(scheduler):
            _run_several(
                *(folders, method_of(normal), as_json, strict),
                everything=everything,
                report=not no_report,
            )
        return
    with on_cluster(scheduler), counted() as pieces:
        done = _run_and_write(folders[0], method_of(normal), report=not no_report)
    if as_json:
        from validation.report.terminal import print_json

        told = _run_json(done, _page_of(done, report=not no_report))
        print_json({**told, "pieces": pieces.kinds})
    else:
        _tell_run(done, everything=everything, report=not no_report)
        click.echo(pieces.text(), nl=False)
    end_of_command(done.findings, failed=done.failed, strict=strict)


def _run_several(
    folders: "Sequence[Path]",
    method: "IntervalMethod",
    as_json: bool,
    strict: bool,
    *,
    everything: bool,
    report: bool,
) -> None:
    """Run campaigns in turn, tell each when it is done, and end as the worst of them calls for."""
    from validation.commands.output import BAD_INPUT, end_of_command
    from validation.days.running import run_one
    from validation.report.terminal import print_json

    told: list[dict[str, object]] = []
    findings: list[Finding] = []
    bad = failed = 0
    for number, folder in enumerate(folders, 1):
        # A bar of its own for each: what is printed while one is shown goes to the bar's stream.
        with progress_bar("reading", f"{number} of {len(folders)}, {folder.name}: ") as progress:
            one = run_one(folder, progress, method, report=report)
        failed += one.failed
        if one.done is not None:
            findings += one.done.findings
            told.append({"folder": folder})
            if as_json:
                told[-1] |= _run_json(one.done, _page_of(one.done, report=report))
            else:
                click.echo(f"Campaign {folder}\n")
                _tell_run(one.done, everything=everything, report=report)
                click.echo()
            continue
        bad += not one.trace
        told.append({"folder": folder, "error": {"message": one.error, "problems": one.problems}})
        click.echo(f"{one.trace}Error: {folder}: {one.error}", err=True)
    if as_json:
        print_json({"campaigns": told})
    else:
        broken = [str(one["folder"]) for one in told if "error" in one]
        said = f"; without results: {', '.join(broken)}" if broken else ""
        click.echo(f"{len(told) - len(broken)} of {len(told)} campaigns are done{said}")
    if bad and not failed:
        click.get_current_context().exit(BAD_INPUT)
    end_of_command(findings, failed=bool(failed), strict=strict)


def _page_of(done: "RunResult", *, report: bool) -> Path | None:
    return done.campaign.report / "report.html" if report else None


def _tell_run(done: "RunResult", *, everything: bool, report: bool) -> None:
    """A run for people, and where its files are."""
    _print_run(done, everything=everything)
    click.echo(f"Results: {done.campaign.results}")
    if report:
        click.echo(f"Report: {_page_of(done, report=report)}")


def _run_json(done: "RunResult", page: Path | None) -> dict[str, object]:
    """A run for scripts."""
    from validation.report.evaluation_json import evaluation_json
    from validation.statistics.by_source import source_json
    from validation.statistics.standards.summary import standards_json

    said = {one.system: standards_json(one) for one in done.statements.standards}
    return {
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
