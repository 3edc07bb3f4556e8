"""Work on a Dask cluster: processes of other machines do what those of this one do."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar

from validation.errors import GtvalError
from validation.pieces.processors import worked

Job = TypeVar("Job")
Result = TypeVar("Result")

PATIENCE = 30
"""Seconds in which a scheduler must answer, and have a worker. A judgement: a cluster that runs
answers in a second."""
AHEAD = 3
"""Jobs for each thread of the workers that are handed out before one has ended, so that none
waits and any number of jobs takes no more memory."""
WITHOUT_CLUSTER = (
    "work on a cluster needs the extra 'cluster', of which {} is missing: pip install "
    "'gtval[cluster]'"
)

_client: ContextVar[Any] = ContextVar("client", default=None)


@contextmanager
def on_cluster(scheduler: str | None) -> Iterator[None]:
    """Whatever is spread over processes meanwhile goes to the workers of a Dask scheduler.

    The workers are started elsewhere, with gtval in the same version and, where jobs are files,
    with the campaign at the same path.

    Parameters
    ----------
    scheduler : str, optional
        Its address, 'tcp://HOST:8786'; without one nothing changes.

    Raises
    ------
    GtvalError
        If the extra is missing, or nobody answers there.
    """
    if not scheduler:
        yield
        return
    try:
        from distributed import Client  # noqa: PLC0415  (an extra)
    except ImportError as error:
        raise GtvalError(WITHOUT_CLUSTER.format(error.name)) from None
    try:
        client = Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise GtvalError(f"no Dask scheduler answers at {scheduler}: {error}") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            raise GtvalError(f"the Dask scheduler at {scheduler} has no worker") from None
        token = _client.set(client)
        try:
            yield
        finally:
            _client.reset(token)


def cluster_in_use() -> bool:
    """Whether `on_cluster` is in force."""
    return _client.get() is not None


def on_workers(
    function: Callable[[Job], Result],
    jobs: Sequence[Job],
    progress: Callable[[float], None] | None = None,
    prepare: Callable[[], None] | None = None,
) -> Iterator[tuple[int, Result]]:
    """The results of a function as they come from the cluster, each with the number of its job.

    Jobs of a worker that dies are done again by another; what had come back is kept.

    Parameters
    ----------
    function, jobs, progress, prepare
        As for `validation.pieces.processes.as_they_end`.

    Raises
    ------
    GtvalError
        If a job ends one worker after the other.
    """
    from distributed import KilledWorker, as_completed  # noqa: PLC0415  (an extra)

    client = _client.get()
    threads = sum(client.nthreads().values())
    numbers = iter(range(len(jobs)))
    waiting: dict[Any, int] = {}
    done = as_completed(loop=client.loop)

    def hand_out() -> None:
        for number in numbers:
            future = client.submit(worked, function, prepare, jobs[number], pure=False)
            waiting[future] = number
            done.add(future)
            if len(waiting) >= AHEAD * max(threads, 1):
                return

    try:
        hand_out()
        for ended, future in enumerate(done, 1):
            result = future.result()
            number = waiting.pop(future)
            future.release()
            hand_out()
            if progress is not None:
                progress(ended / len(jobs))
            yield number, result
    except KilledWorker as error:
        raise GtvalError(f"a piece of the work ended one worker after the other: {error}") from None
    finally:
        client.cancel(list(waiting))
