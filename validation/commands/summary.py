"""The command ``gtval summary``."""

from pathlib import Path

import click

from validation.commands.options import AS_JSON, EVERYTHING, PATH, STRICT, progress_bar

PAGE = Path("summary.html")
MOST_ROWS = 40
"""Rows of the table of the days that are printed without --all: as many as one screen has lines."""


@click.command()
@click.argument("campaigns", type=PATH, nargs=-1, required=True, metavar="CAMPAIGN...")
@click.option(
    "--page",
    type=PATH,
    default=PAGE,
    show_default=True,
    help="The file of the page that is written.",
)
@click.option("--no-page", is_flag=True, help="Write nothing.")
@click.option(
    "--false-alarms",
    type=click.FloatRange(min=30),
    help="Days without any change between two false alarms, on average, all charts together; 730 "
    "by default.",
)
@AS_JSON
@STRICT
@EVERYTHING
def summary(
    campaigns: tuple[Path, ...],
    page: Path,
    no_page: bool,
    false_alarms: float | None,
    as_json: bool,
    strict: bool,
    everything: bool,
) -> None:
    """Tell how the ground truth of several days was, and whether it got worse.

    Each CAMPAIGN is a day that was run; a folder that holds campaigns stands for all of them. They
    are put in the order of the dates they state, else of their names. Bias and spread of every
    system have control charts: a step or a drift is noticed on the first day that shows it beyond
    chance. Campaigns that cannot be read, or have no results, are named.
    """
    from validation.commands.output import end_of_command, print_first_findings
    from validation.days.page import summary_page
    from validation.days.summary import summarise_campaigns
    from validation.days.tables import days_table, summary_json, systems_table
    from validation.report.terminal import print_json, print_table
    from validation.statistics.control.charts import FALSE_ALARM_DAYS
    from validation.text_files.writing import write_files

    with progress_bar("reading") as progress:
        told = summarise_campaigns(campaigns, progress, false_alarms or FALSE_ALARM_DAYS)
        if not no_page:
            progress("writing the page", 1.0)
            write_files(page.parent, {page.name: summary_page(told)})
    written = None if no_page else page
    if as_json:
        print_json({**summary_json(told), "page": written, "findings": told.findings})
    else:
        days = days_table(told)
        if everything or len(days.rows) <= MOST_ROWS:
            print_table(days)
        print_table(systems_table(told))
        print_first_findings(told.findings, everything=everything)
        if written:
            click.echo(f"\nPage: {written}")
    end_of_command(told.findings, strict=strict)
