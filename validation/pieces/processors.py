"""How many processors this process may count on."""

import os

_inside = False
"""Whether this process is one of those that others hand jobs to."""


def processors(wanted: int | None = None) -> int:
    """How many processes to work with: as many as were wanted, else one for each processor.

    One in a process that does a job for another, which has the other processors at work already.
    """
    return wanted or (1 if _inside else os.cpu_count() or 1)


def at_work_for_another() -> None:
    """Say that this process does jobs for another: see `processors`."""
    global _inside  # noqa: PLW0603  (a fact about the process)
    _inside = True
