"""Work spread over processes that end quietly when a person interrupts it, and their memory."""

import ctypes
import os
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from multiprocessing import connection, get_context, parent_process
from threading import Thread
from typing import TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")

_CHUNK = 4
"""Jobs that a process takes at once: few, so that progress is smooth and an interruption short."""

_AHEAD = 3
"""Jobs for each process that are handed out before one has ended, so that none waits."""


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
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _begin, (prepare,))
    try:
        with _interrupts_held():
            results = pool.map(function, jobs, chunksize=_CHUNK)
        yield from _counted(results, len(jobs), progress)
    finally:
        pool.shutdown(cancel_futures=True)


def as_they_end(
    function: Callable[[Job], Result],
    jobs: Sequence[Job],
    workers: int,
    progress: Callable[[float], None] | None = None,
    prepare: Callable[[], None] | None = None,
) -> Iterator[tuple[int, Result]]:
    """The results of a function as they come, each with the number of its job.

    So each can be kept at once: who is interrupted loses what is being worked on, a job for each
    process. No more jobs are handed out than keep the processes busy, so any number of them takes
    no more memory.

    Parameters
    ----------
    function, jobs, workers, progress, prepare
        As for `in_processes`.
    """
    if workers == 1:
        yield from enumerate(_counted(map(function, jobs), len(jobs), progress))
        return
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _begin, (prepare,))
    waiting: dict[Future[Result], int] = {}
    try:
        ended = 0
        for number, job in enumerate(jobs):
            with _interrupts_held():
                waiting[pool.submit(function, job)] = number
            if len(waiting) < _AHEAD * workers:
                continue
            for result in _ended(waiting):
                ended += 1
                _tell(progress, ended / len(jobs))
                yield result
        while waiting:
            for result in _ended(waiting):
                ended += 1
                _tell(progress, ended / len(jobs))
                yield result
    finally:
        pool.shutdown(cancel_futures=True)


def _begin(prepare: Callable[[], None] | None) -> None:
    """What each new process does first."""
    Thread(target=_end_with_parent, daemon=True).start()
    if prepare is not None:
        prepare()


def _end_with_parent() -> None:
    """End this process when the one that started it is gone: killed, it cannot end its workers."""
    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


def _ended(waiting: "dict[Future[Result], int]") -> Iterator[tuple[int, Result]]:
    """Those that have ended, once there are some; they wait no more."""
    done, _ = wait(waiting, return_when=FIRST_COMPLETED)
    yield from sorted(((waiting.pop(one), one.result()) for one in done), key=lambda pair: pair[0])


def _tell(progress: Callable[[float], None] | None, share: float) -> None:
    if progress is not None:
        progress(share)


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
