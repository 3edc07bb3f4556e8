"""Work spread over processes that end quietly when a person interrupts it, and their memory."""

import ctypes
import os
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import partial
from multiprocessing import connection, get_context, parent_process
from threading import Lock, Thread, Timer
from typing import ParamSpec, TypeVar

from validation.errors import GtvalError
from validation.pieces.cluster import cluster_in_use, on_workers
from validation.pieces.processors import worked

Given = ParamSpec("Given")
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
    """The results of a function, in the order of its jobs; by the cluster where one is in use.

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
    if cluster_in_use() and len(jobs) > 1:
        yield from _in_order(on_workers(function, jobs, progress, prepare))
        return
    if workers == 1:
        yield from _counted(map(function, jobs), len(jobs), progress)
        return
    with _pool_of(workers) as pool:
        with _interrupts_held():
            results = pool.map(partial(worked, function, prepare), jobs, chunksize=_CHUNK)
        yield from _counted(results, len(jobs), progress)


def as_they_end(
    function: Callable[[Job], Result],
    jobs: Sequence[Job],
    workers: int,
    progress: Callable[[float], None] | None = None,
    prepare: Callable[[], None] | None = None,
) -> Iterator[tuple[int, Result]]:
    """The results of a function as they come, each with the number of its job.

    By the cluster where one is in use (`validation.pieces.cluster.on_cluster`). So each can be kept
    at once: who is interrupted loses what is being worked on, a job for each process. No more jobs
    are handed out than keep the processes busy, so any number of them takes no more memory.

    Parameters
    ----------
    function, jobs, workers, progress, prepare
        As for `in_processes`.
    """
    if cluster_in_use() and len(jobs) > 1:
        yield from on_workers(function, jobs, progress, prepare)
        return
    if workers == 1:
        yield from enumerate(_counted(map(function, jobs), len(jobs), progress))
        return
    waiting: dict[Future[Result], int] = {}
    with _pool_of(workers) as pool:
        ended = 0
        for number, job in enumerate(jobs):
            with _interrupts_held():
                waiting[pool.submit(worked, function, prepare, job)] = number
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


_shared: ContextVar[dict[int, ProcessPoolExecutor] | None] = ContextVar("shared", default=None)


@contextmanager
def shared_processes() -> Iterator[None]:
    """Keep the processes that are started in a block for all its work; they end with it.

    A process takes a second of its processor to start, as it imports all modules.
    """
    if _shared.get() is not None:
        yield
        return
    pools: dict[int, ProcessPoolExecutor] = {}
    token = _shared.set(pools)
    try:
        yield
    finally:
        _shared.reset(token)
        for pool in pools.values():
            pool.shutdown(cancel_futures=True)


@contextmanager
def _pool_of(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Processes for one piece of work: those of `shared_processes`, or some that end with it."""
    pools = _shared.get()
    known = None if pools is None else pools.get(workers)
    # Spawned, not forked: a process with threads must not be copied.
    pool = known or ProcessPoolExecutor(workers, get_context("spawn"), _begin)
    try:
        yield pool
    except BaseException:  # what was handed out is of no use any more
        if pools is not None:
            pools.pop(workers, None)
        pool.shutdown(cancel_futures=True)
        raise
    if pools is None:
        pool.shutdown()
    else:
        pools[workers] = pool


@dataclass(frozen=True)
class _Problem:
    """What went wrong in another process, in words: not every error can be sent."""

    text: str


def _answered(function: Callable[[], Result]) -> Result | _Problem:
    """What a function returns, or what went wrong."""
    try:
        return function()
    except GtvalError as error:
        return _Problem(str(error))
    except Exception as error:  # noqa: BLE001  (told, and the process goes on)
        return _Problem(f"unexpected: {type(error).__name__}: {error}. Please report it")


class Beside:
    """A few processes beside a server, for what needs much memory or may take long.

    They are started when something is asked, and end when nothing was for a while, and their
    memory with them. One that dies or hangs takes nothing along but what was asked of it.

    Parameters
    ----------
    most : int
        Processes at once.
    idle : float
        Seconds without work after which they end.
    """

    def __init__(self, most: int = 2, idle: float = 30.0) -> None:
        self._most, self._idle = most, idle
        self._lock = Lock()
        self._pool: ProcessPoolExecutor | None = None
        self._ending: Timer | None = None
        self._asked = 0

    def call(
        self,
        seconds: float,
        function: Callable[Given, Result],
        *args: Given.args,
        **more: Given.kwargs,
    ) -> Result:
        """What a function of a module returns, called in one of the processes.

        Raises
        ------
        GtvalError
            If it takes longer than some seconds, its process dies, or the function raises.
        """
        with self._lock:
            self._asked += 1
            if self._ending is not None:
                self._ending.cancel()
            if self._pool is None:
                self._pool = ProcessPoolExecutor(self._most, get_context("spawn"), _begin)
            pool = self._pool
            with _interrupts_held():
                future = pool.submit(_answered, partial(function, *args, **more))
        try:
            result = future.result(seconds)
        except TimeoutError:
            self._drop(pool)
            raise GtvalError(f"it was not done after {seconds:g} seconds; try again") from None
        except BrokenProcessPool:
            self._drop(pool)
            raise GtvalError("the process that works it out has died; try again") from None
        finally:
            self._rest()
        if isinstance(result, _Problem):
            raise GtvalError(result.text)
        return result

    def _rest(self) -> None:
        """End the processes in a while, unless something is asked before."""
        with self._lock:
            self._asked -= 1
            if self._asked == 0 and self._pool is not None:
                self._ending = Timer(self._idle, self._end_idle, (self._pool,))
                self._ending.daemon = True
                self._ending.start()

    def _end_idle(self, pool: ProcessPoolExecutor) -> None:
        """End processes of which nothing was asked meanwhile."""
        with self._lock:
            if self._asked:
                return
        self._drop(pool)

    def _drop(self, pool: ProcessPoolExecutor) -> None:
        """End processes, also such as hang."""
        with self._lock:
            if self._pool is not pool:
                return
            self._pool = None
        for process in list((pool._processes or {}).values()):  # noqa: SLF001  (3.14 has kill_workers)
            process.kill()
        pool.shutdown(wait=False, cancel_futures=True)

    def close(self) -> None:
        """End all of them."""
        if self._ending is not None:
            self._ending.cancel()
        if self._pool is not None:
            self._drop(self._pool)


def _begin() -> None:
    """What each new process does first."""
    Thread(target=_end_with_parent, daemon=True).start()


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


def _in_order(found: Iterable[tuple[int, Result]]) -> Iterator[Result]:
    """Results in the order of their jobs, each as soon as those before it are there."""
    early: dict[int, Result] = {}
    following = 0
    for number, result in found:
        early[number] = result
        while following in early:
            yield early.pop(following)
            following += 1


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
