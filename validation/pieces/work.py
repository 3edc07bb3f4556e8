"""Pieces of work done: what is kept is taken over, the rest is done and kept as it ends."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypeVar

from validation.pieces.processes import as_they_end, in_processes
from validation.pieces.store import KeptPieces

Job = TypeVar("Job")
Result = TypeVar("Result")
Job_contra = TypeVar("Job_contra", contravariant=True)

READING = 0.05
"""Of the work, that it takes to see which pieces are known: a millisecond beside twenty and
more."""


class Form(Protocol[Job_contra, Result]):
    """How the result of a job is written as JSON and read again."""

    def written(self, result: Result, job: Job_contra, /) -> dict[str, Any] | None:
        """The result as values that JSON has; None where it should not be kept."""

    def read(self, told: dict[str, Any], job: Job_contra, /) -> Result:
        """The result, from what `written` gave; ValueError, KeyError or the like if it is none."""


def done_once(
    function: Callable[[Job], Result],
    jobs: Sequence[Job],
    key: Callable[[Job], str],
    kept: KeptPieces | None,
    form: Form[Job, Result],
    workers: int = 1,
    progress: Callable[[float], None] = lambda _share: None,
    prepare: Callable[[], None] | None = None,
) -> list[Result]:
    """The results of a function, in the order of its jobs; what is kept is not done again.

    Parameters
    ----------
    function : callable
        Of a module, so that other processes find it.
    jobs : sequence
        Its arguments, one for each piece.
    key : callable
        Of a job: hash of all that its result depends on (`key_of`).
    kept : KeptPieces or None
        What earlier runs made; what is new is added as it ends.
    form : Form
        How a result is kept.
    workers, progress, prepare
        As for `validation.pieces.processes.as_they_end`.
    """
    if kept is None:
        return list(in_processes(function, jobs, workers, progress, prepare))
    keys: list[str] = []
    found: list[Result | None] = []
    for number, job in enumerate(jobs):
        keys.append(key(job))
        found.append(taken_over(keys[-1], job, kept, form))
        progress(READING * number / len(jobs))
    new = [number for number, one in enumerate(found) if one is None]
    kept.count(taken=len(jobs) - len(new))

    def told(share: float) -> None:
        progress(READING + (1 - READING) * share)

    for at, result in as_they_end(function, [jobs[i] for i in new], workers, told, prepare):
        found[new[at]] = result
        line = form.written(result, jobs[new[at]])
        if line is not None:  # what failed by chance is tried again by the next run
            kept.add(keys[new[at]], line)
        kept.count(done=1)
    return [one for one in found if one is not None]


def taken_over(key: str, job: Job, kept: KeptPieces, form: Form[Job, Result]) -> Result | None:
    """What is kept of a job; None where nothing is, or where it cannot be read."""
    told = kept.get(key)
    try:
        return None if told is None else form.read(told, job)
    except (ValueError, KeyError, TypeError, IndexError, AttributeError):
        return None
