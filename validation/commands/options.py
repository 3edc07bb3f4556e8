"""What the commands of all packages share: their options, and how long work shows its progress."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from validation.systems import Progress

PATH = click.Path(path_type=Path)
CAMPAIGN = click.argument("campaign", type=PATH)
AS_JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON for scripts.")
NORMAL = click.option(
    "--normal-interval",
    "normal",
    is_flag=True,
    help="Interval of the mean as mean +- 1.96 s / sqrt(n) instead of Student's t.",
)
STRICT = click.option(
    "--strict", is_flag=True, help="Exit with status 3 if a finding is an error; for scripts."
)
EVERYTHING = click.option(
    "--all", "everything", is_flag=True, help="Print all tables and findings, not only the first."
)
DRY_RUN = click.option("--dry-run", is_flag=True, help="Print only; write nothing.")
WORKERS = click.option(
    "--workers", type=click.IntRange(1), help="Processes; one for each processor by default."
)
SCHEDULER = click.option(
    "--scheduler",
    metavar="tcp://HOST:PORT",
    help="Of a Dask cluster whose workers do what processes of this machine would; needs the extra "
    "'cluster'.",
)
SEED = click.option(
    "--seed",
    type=click.IntRange(0),
    default=1,
    show_default=True,
    help="Of all that is drawn at random.",
)
FIGURE = click.option("--figure", type=PATH, help="Write a figure to this .png or .svg file.")
AS_PUBLISHED = click.option(
    "--as-published/--not-as-published",
    default=None,
    help="Also the document's way, for comparison.",
)


@contextmanager
def progress_bar(what: str, before: str = "") -> "Iterator[Progress]":
    """A progress bar on stderr, shown on a terminal only; gives the function to report to.

    Parameters
    ----------
    what : str
        What is done first.
    before : str
        What stands before all that is being done: '2 of 5, '.
    """
    from rich.progress import (
        BarColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    from validation.report.terminal import console

    shown = console(stderr=True)
    left = (TimeRemainingColumn(), TextColumn("left"))
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), *left)
    with Progress(*columns, console=shown, transient=True, disable=not shown.is_terminal) as bar:
        task = bar.add_task(before + what, total=1.0)

        def report(what: str, share: float) -> None:
            bar.update(task, description=before + what, completed=share)

        yield report


CLOCK_WINDOW = click.option(
    "--window",
    type=click.FloatRange(min=0.1),
    default=60.0,
    show_default=True,
    help="Seconds to both sides in which the delay is looked for.",
)
STAMP_METRES, STAMP_RADIANS = 0.05, 0.05
"""Errors that stamps may cause where nothing else is asked for: as for the limits of a bias."""
