"""Work spread over processes that end quietly when a person interrupts it, and their memory."""

import ctypes
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")

_CHUNK = 4
"""Jobs that a process takes at once: few, so that progress is smooth and an interruption short."""


def in_processes(
    function: Callable[[Job], Result],
    jobs: Sequence[Job],
    workers: int,
    progress: Callable[[float], None] | None = None,
    prepare: Callable[[], None] | None = None,
) -> Iterator[Result]:
    """The results of a function, in the order of its jobs.

    Parameters
    ----------
    function : callable
        Of a module, so that other processes find it.
    jobs : sequence
        Its arguments.
    workers : int
        Processes; with 1 all is done in this one.
    progress : callable, optional
        Told the share done.
    prepare : callable, optional
        Called once in each new process.
    """
    if workers == 1:
        yield from _counted(map(function, jobs), len(jobs), progress)
        return
    # Spawned, not forked: a process with threads must not be copied.
    pool = ProcessPoolExecutor(workers, get_context("spawn"), prepare)
    try:
        with _interrupts_held():
            results = pool.map(function, jobs, chunksize=_CHUNK)
        yield from _counted(results, len(jobs), progress)
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Let Ctrl-C wait. Processes that are started meanwhile never hear it: this one ends them.

    A terminal sends it to all of them at once, and each would print a traceback. Systems
    without signal masks go without.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _counted(
    results: Iterable[Result], total: int, progress: Callable[[float], None] | None
) -> Iterator[Result]:
    """The results as they come, each told as progress."""
    for number, result in enumerate(results, 1):
        if progress is not None:
            progress(number / total)
        yield result


def give_back_memory() -> None:
    """Memory that was freed goes back to the system, where its allocator can be asked to.

    The GNU allocator keeps freed arrays of megabytes for later, in pieces that later ones do not
    fit: of an hour at 20 Hz it kept 150 MB. It takes some milliseconds.
    """
    try:
        trim = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):  # another system, another allocator
        return
    trim(0)
