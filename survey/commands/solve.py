"""The command ``gtval survey`` and the survey's other commands."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import AS_JSON, CAMPAIGN, progress_bar

if TYPE_CHECKING:
    from survey.campaign.outcome import SurveyOutcome


@click.command()
@CAMPAIGN
@AS_JSON
@click.option("--robust", is_flag=True, help="Weigh large residuals down (Huber).")
@click.option("--dry-run", is_flag=True, help="Print only; write nothing.")
@click.option(
    "--as-published",
    is_flag=True,
    help="Also run the document's two filters as printed, and show the differences.",
)
def survey(campaign: Path, as_json: bool, robust: bool, dry_run: bool, as_published: bool) -> None:
    """Turn hand-laser readings into world points and validation poses.

    Writes world_points.csv, vframe_points.csv, poses_survey.csv, survey_single_poses.csv and
    readings_checked.csv to CAMPAIGN/results: all of them, or none if anything fails.
    """
    from survey.campaign.outcome import solve_campaign
    from survey.system import result_of, survey_facts
    from validation.campaign.folder import load_campaign
    from validation.poses.pose_files import pose_files
    from validation.text_files.writing import write_files

    loaded = load_campaign(campaign)
    with progress_bar("survey") as report:
        outcome = solve_campaign(loaded, report, robust=robust)
    result = result_of(outcome)
    if not dry_run:
        tables = pose_files(result.tables)
        write_files(loaded.results, {**result.files, **tables})
    if as_json:
        from validation.report.terminal import print_json

        print_json({**survey_facts(outcome), "findings": result.findings})
        return
    _print(outcome, as_published)
    if not dry_run:
        click.echo(f"\nResults: {loaded.results}")


def _print(outcome: "SurveyOutcome", as_published: bool) -> None:
    """Findings and tables on the terminal."""
    from survey.campaign.findings import survey_findings
    from survey.campaign.sections import pose_table, world_table
    from validation.report.terminal import print_findings, print_table

    solution = outcome.solution
    if solution is not None:
        print_table(world_table(solution))
        if solution.frames:
            print_table(pose_table(solution))
        if as_published:
            from survey.published.published_mode import published_mode_tables

            for table in published_mode_tables(outcome):
                print_table(table)
    print_findings(survey_findings(outcome))


COMMANDS: list[click.Command] = [survey]
