"""A campaign run and written, with its report: what the command and the page do alike."""

from dataclasses import replace
from pathlib import Path

from validation.campaign.folder import load_campaign
from validation.run import RunResult, run_campaign
from validation.run_files import write_results
from validation.solving import late_finding
from validation.statistics.error_statistics import IntervalMethod
from validation.systems import Progress
from validation.text_files.writing import Content

RUN_BEFORE_REPORT = 0.7
"""Share of the progress bar that a run has before its report is written. A judgement: the report of
the AD2.3 campaign takes longer than its run, that of a room with images a tenth of it."""


def run_and_write(
    folder: Path,
    progress: Progress,
    method: IntervalMethod = "student",
    *,
    report: bool = True,
    pdf: bool = False,
) -> RunResult:
    """The run of a campaign, whose results are written, with the report if wanted.

    Parameters
    ----------
    folder : Path
        The campaign folder, or its campaign.toml.
    progress : callable
        Called with what is being done and the share done.
    method : {"student", "normal"}
        Of the intervals of the mean.
    report, pdf : bool
        Whether to write the report, and whether as PDF, too.

    Raises
    ------
    GtvalError
        If input is bad, or nothing can be written; the old files are then untouched.
    """
    loaded = load_campaign(folder)
    share_of_run = RUN_BEFORE_REPORT if report else 1.0
    done = run_campaign(loaded, lambda what, share: progress(what, share_of_run * share), method)
    files: dict[str, Content] = {}
    if report:
        from validation.report.files import report_files  # noqa: PLC0415  (figures)

        progress("writing the report", RUN_BEFORE_REPORT)
        done, files = report_files(done, pdf=pdf)
    old = write_results(done, files).old
    return replace(done, findings=(*done.findings, *late_finding("results", old)))
