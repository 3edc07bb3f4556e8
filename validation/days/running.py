"""A campaign run among others: a broken one does not stop them."""

import traceback
from dataclasses import dataclass
from pathlib import Path

from validation.errors import GtvalError, InputError, Problem
from validation.run import RunResult
from validation.statistics.error_statistics import IntervalMethod
from validation.systems import Progress, no_progress
from validation.whole_run import run_and_write


@dataclass(frozen=True)
class Ran:
    """What became of one campaign.

    Parameters
    ----------
    folder : Path
        The campaign folder.
    done : RunResult, optional
        What the run found; None where there is none.
    error : str
        Why there is none; empty where there is one.
    problems : tuple of Problem
        The bad places of its input.
    trace : str
        Of an exception that nobody expected.
    """

    folder: Path
    done: RunResult | None = None
    error: str = ""
    problems: tuple[Problem, ...] = ()
    trace: str = ""

    @property
    def failed(self) -> bool:
        """Whether something failed that nobody expected."""
        return bool(self.trace) or (self.done is not None and self.done.failed)


def run_one(
    folder: Path,
    progress: Progress = no_progress,
    method: IntervalMethod = "student",
    *,
    report: bool = True,
) -> Ran:
    """What becomes of a campaign that is run and written.

    Parameters
    ----------
    folder : Path
        The campaign folder.
    progress : callable
        Called with what is being done and the share done.
    method : {"student", "normal"}
        Of the intervals of the mean.
    report : bool
        Whether to write its report.
    """
    try:
        return Ran(folder, run_and_write(folder, progress, method, report=report))
    except GtvalError as error:
        problems = error.problems if isinstance(error, InputError) else ()
        return Ran(folder, error=str(error), problems=tuple(problems))
    except Exception as error:  # noqa: BLE001  (one campaign must not take the others)
        said = f"unexpected: {type(error).__name__}: {error}. Please report it"
        return Ran(folder, error=said, trace="".join(traceback.format_exception(error)))
