"""Commands that somebody stops, by Ctrl-C or by SIGTERM as schedulers and containers do."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, current_thread, main_thread
from types import FrameType

STOPS = (signal.SIGINT, signal.SIGTERM)
_asked = Event()


@contextmanager
def ended_as_interrupted() -> Iterator[None]:
    """Let SIGTERM end a command as Ctrl-C does, by a KeyboardInterrupt.

    So temporary folders go, and what is being written is whole or not there.
    """
    if current_thread() is not main_thread():
        yield
        return
    before = {one: signal.signal(one, _stop) for one in STOPS}
    try:
        yield
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)
        _asked.clear()


def _stop(_signal: int, _frame: FrameType | None) -> None:
    _asked.set()
    raise KeyboardInterrupt


def go_on_after(error: BaseException) -> None:
    """Raise a KeyboardInterrupt where the command is to end, whatever a library made of the first.

    Code in C that is interrupted may end in an error of its own, which is no failure of a part.
    """
    if _asked.is_set():
        raise KeyboardInterrupt from error
