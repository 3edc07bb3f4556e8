"""Campaign folders: loaded, run, written, many of them summed up; and how a notebook shows them."""

from collections.abc import Iterable
from os import PathLike
from pathlib import Path

import numpy.typing as npt

from gtval.arguments import said_plainly
from gtval.judging import findings_table
from validation.campaign.folder import Campaign
from validation.campaign.folder import load_campaign as load
from validation.days.charted import Summary
from validation.days.summary import summarise_campaigns
from validation.days.tables import systems_table
from validation.report.evaluation_tables import overview_table
from validation.report.files import report_files
from validation.report.html import html_blocks
from validation.report.terminal import most_severe_first
from validation.results import Table
from validation.run import RunResult
from validation.run import run_campaign as run
from validation.run_files import write_results
from validation.shown import html_of
from validation.statistics.control.charts import FALSE_ALARM_DAYS, ControlChart
from validation.statistics.control.charts import control_chart as chart_of
from validation.systems import Progress, no_progress

__all__ = ["Campaign", "RunResult", "load_campaign", "run_campaign", "write_run"]
__all__ += ["ControlChart", "Summary", "control_chart", "summarise"]


@said_plainly
def load_campaign(folder: str | PathLike[str]) -> Campaign:
    """The campaign in a folder.

    Parameters
    ----------
    folder : path
        The folder, or its campaign.toml.

    Raises
    ------
    InputError
        Naming file, line, key and value of every bad place of campaign.toml.

    Examples
    --------
    >>> room = gtval.testing.make_room(folder, seed=1)
    >>> gtval.load_campaign(folder).settings.name
    'Synthetic room'
    """
    return load(Path(folder))


@said_plainly
def run_campaign(
    campaign: Campaign | str | PathLike[str], progress: Progress = no_progress
) -> RunResult:
    """What all installed systems make of a campaign, compared with its survey and explained.

    Nothing is written; `write_run` does that.

    Parameters
    ----------
    campaign : Campaign or path
        The campaign, or its folder.
    progress : callable
        Called with what is being done and the share done, 0 to 1.

    Raises
    ------
    GtvalError
        If any data are bad, with the faults of all systems at once.

    Examples
    --------
    >>> room = gtval.testing.make_room(folder, seed=1)
    >>> done = gtval.run_campaign(folder)
    >>> [table.system for table in done.tables]
    ['survey', 'example_gt']
    """
    return run(campaign if isinstance(campaign, Campaign) else load_campaign(campaign), progress)


@said_plainly
def write_run(done: RunResult) -> list[Path]:
    """Write results/ and report/ of a run into its campaign folder, all files or none.

    Parameters
    ----------
    done : RunResult
        Of `run_campaign`.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    GtvalError
        If they cannot be written; the old files are then untouched.

    Examples
    --------
    >>> room = gtval.testing.make_room(folder, seed=1, stops=6)
    >>> files = gtval.write_run(gtval.run_campaign(folder))
    >>> (folder / "report" / "report.html") in files
    True
    """
    return write_results(*report_files(done)).files


@html_of.register
def _(done: RunResult) -> str:
    """Errors of all systems, then what asks for action."""
    tables: list[Table] = [overview_table(done.evaluations)] if done.evaluations else []
    urgent = [one for one in done.findings if one.severity in {"error", "warning"}]
    tables += [findings_table(most_severe_first(urgent))] if urgent else []
    return html_blocks(tables, "run")


@said_plainly
def summarise(
    campaigns: Iterable[str | PathLike[str]], *, false_alarm_days: float = FALSE_ALARM_DAYS
) -> Summary:
    """Bias and spread of every system over campaigns that were run, with control charts.

    Parameters
    ----------
    campaigns : iterable of path
        Campaign folders, in any order, or folders that hold such.
    false_alarm_days : float
        Days without change between two false alarms, on average, all charts together.

    Raises
    ------
    InputError
        If none of them has results; a single one that has none is a finding.

    Examples
    --------
    >>> room = gtval.testing.make_room(folder, seed=1, stops=6)
    >>> files = gtval.write_run(gtval.run_campaign(folder))
    >>> gtval.summarise([folder]).systems
    ('example_gt',)
    """
    return summarise_campaigns([Path(one) for one in campaigns], false_alarm_days=false_alarm_days)


@said_plainly
def control_chart(
    values: npt.ArrayLike,
    sigmas: npt.ArrayLike | None = None,
    *,
    false_alarm_days: float = FALSE_ALARM_DAYS,
    charts: int = 1,
) -> ControlChart:
    """Steps and drifts of a number a day, each noticed by the days up to then alone.

    Parameters
    ----------
    values : (n,) array_like
        One number a day, in the order of the days.
    sigmas : (n,) array_like, optional
        Standard deviation of each by the day alone; that from day to day is estimated.
    false_alarm_days : float
        Days without change between two false alarms, on average, all charts together.
    charts : int
        How many charts there are.

    Raises
    ------
    GtvalError
        If a number is not finite, or there are not as many sigmas.

    Examples
    --------
    >>> days = [0.1, 0.0, 0.2, 0.1, -0.1, 0.0, 0.1, 2.1, 1.9, 2.0]
    >>> chart = gtval.control_chart(days)
    >>> [(change.began, change.noticed, change.kind) for change in chart.changes]
    [(7, 7, 'step')]
    """
    return chart_of(values, sigmas, false_alarm_days=false_alarm_days, charts=charts)


@html_of.register
def _(told: Summary) -> str:
    """How each system is over the days."""
    return html_blocks([systems_table(told)], "days")
