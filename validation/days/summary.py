"""The summary of many campaigns: read, put in order, charted and told."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from validation.days.charted import Summary, all_series
from validation.days.order import campaign_folders, in_order
from validation.days.reading import Day, NoResultsError, read_day
from validation.days.telling import findings_of
from validation.errors import GtvalError, InputError, Problem
from validation.results import Finding
from validation.statistics.control.charts import FALSE_ALARM_DAYS
from validation.systems import Progress, no_progress


def summarise(
    days: Iterable[Day],
    findings: Iterable[Finding] = (),
    false_alarm_days: float = FALSE_ALARM_DAYS,
) -> Summary:
    """The systems of several days, with a control chart of each bias and of each spread.

    Parameters
    ----------
    days : iterable of Day
        In any order.
    findings : iterable of Finding
        What is known of campaigns that could not be read.
    false_alarm_days : float
        Days without change between two false alarms, on average, all charts together.
    """
    given = list(days)
    moments = [one.moment for one in given]
    order = in_order([one.folder.name for one in given], moments)
    placed = tuple(given[place] for place in order)
    dated = all(one is not None for one in moments)
    series = all_series(placed, false_alarm_days, dated=dated)
    told = Summary(placed, series, tuple(findings), dated, false_alarm_days)
    return replace(told, findings=(*told.findings, *findings_of(told)))


def summarise_campaigns(
    paths: Sequence[Path],
    progress: Progress = no_progress,
    false_alarm_days: float = FALSE_ALARM_DAYS,
) -> Summary:
    """The summary of campaign folders; those that cannot be read are findings.

    Parameters
    ----------
    paths : sequence of Path
        Campaign folders, or folders that hold such.
    progress : callable
        Called with what is being done and the share done.
    false_alarm_days : float
        As for `summarise`.

    Raises
    ------
    InputError
        If not one of them can be read, with the problems of all.
    """
    folders = campaign_folders(paths)
    days: list[Day] = []
    findings: list[Finding] = []
    problems: list[Problem] = []
    for number, folder in enumerate(folders):
        progress(folder.name, number / len(folders))
        try:
            days.append(read_day(folder))
        except GtvalError as error:
            code = "day_without_results" if isinstance(error, NoResultsError) else "day_unreadable"
            findings.append(_left_out(folder, error, code))
            own = error.problems if isinstance(error, InputError) else ()
            problems += own or [Problem(folder, str(error))]
        except Exception as error:  # noqa: BLE001  (one campaign must not take the others)
            said = f"unexpected: {type(error).__name__}: {error}. Please report it"
            findings.append(_left_out(folder, said, "day_unreadable"))
            problems.append(Problem(folder, said))
    if not days:
        raise InputError(problems)
    progress("charts", 1.0)
    return summarise(days, findings, false_alarm_days)


def _left_out(folder: Path, said: object, code: str) -> Finding:
    return Finding("error", f"This campaign is left out: {said}", str(folder), code)
