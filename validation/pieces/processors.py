"""How many processors this process may count on, and what it does for another."""

import os
from collections.abc import Callable
from typing import TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")

_inside = False
"""Whether this process is one of those that others hand jobs to."""


def processors(wanted: int | None = None) -> int:
    """How many processes to work with: as many as were wanted, else one for each processor.

    One in a process that does a job for another, which has the other processors at work already.
    """
    return wanted or (1 if _inside else os.cpu_count() or 1)


_prepared: set[str] = set()
"""What this process has been prepared with."""


def worked(
    function: Callable[[Job], Result], prepare: Callable[[], None] | None, job: Job
) -> Result:
    """A job done for another process, by one that is prepared for it once."""
    global _inside  # noqa: PLW0603  (a fact about the process)
    _inside = True
    if prepare is not None and (name := f"{prepare.__module__}.{prepare.__qualname__}"):
        if name not in _prepared:
            prepare()
        _prepared.add(name)
    return function(job)
