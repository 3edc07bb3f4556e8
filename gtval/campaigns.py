"""Campaign folders: loaded, run, written, and how a notebook shows a run."""

from os import PathLike
from pathlib import Path

from gtval.arguments import said_plainly
from gtval.judging import findings_table
from validation.campaign.folder import Campaign
from validation.campaign.folder import load_campaign as load
from validation.report.evaluation_tables import overview_table
from validation.report.files import report_files
from validation.report.html import html_blocks
from validation.report.terminal import most_severe_first
from validation.results import Table
from validation.run import RunResult
from validation.run import run_campaign as run
from validation.run_files import write_results
from validation.shown import html_of
from validation.systems import Progress, no_progress

__all__ = ["Campaign", "RunResult", "load_campaign", "run_campaign", "write_run"]


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
    return write_results(*report_files(done))


@html_of.register
def _(done: RunResult) -> str:
    """Errors of all systems, then what asks for action."""
    tables: list[Table] = [overview_table(done.evaluations)] if done.evaluations else []
    urgent = [one for one in done.findings if one.severity in {"error", "warning"}]
    tables += [findings_table(most_severe_first(urgent))] if urgent else []
    return html_blocks(tables, "run")
