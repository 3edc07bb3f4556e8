"""One entry session at a time on a campaign."""

import contextlib
import os
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Self

from validation.errors import GtvalError

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]


class CampaignLock:
    """A lock that the system itself releases when its process ends, however it ends."""

    def __init__(self, handle: int) -> None:
        self._handle = handle

    @classmethod
    def take(cls, path: Path, who: str) -> Self:
        """The lock, with a line in its file that says who holds it.

        Raises
        ------
        GtvalError
            If another process holds it, saying which; or the file cannot be made.
        """
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise GtvalError(
                f"cannot write to {path.parent}: {error.strerror or error}; no reading would be "
                "safe there"
            ) from error
        try:
            _lock(handle)
        except OSError:
            holder = os.read(handle, 500).decode(errors="replace").strip()
            os.close(handle)
            raise GtvalError(
                f"another entry session is open on this campaign ({holder or 'unknown'}): end it "
                "first, or join it on its page (`gtval enter --web` serves several people)"
            ) from None
        # Who holds it is only a courtesy: on a full disk the lock alone must do.
        with contextlib.suppress(OSError):
            os.ftruncate(handle, 0)
            since = datetime.now().astimezone().strftime("%H:%M:%S")
            holder = f"{who or 'somebody'}, process {os.getpid()}, since {since}\n"
            os.write(handle, holder.encode(errors="replace"))
        return cls(handle)

    @classmethod
    def none(cls) -> Self:
        """No lock, for those who only look."""
        return cls(-1)

    def release(self) -> None:
        """Let others have it."""
        if self._handle >= 0:
            os.close(self._handle)
            self._handle = -1


@contextlib.contextmanager
def locked_for_a_line(handle: int) -> Iterator[None]:
    """Keep others from writing to an open file meanwhile, where the system can."""
    if fcntl is None:
        yield
        return
    with contextlib.suppress(OSError):  # a network share that knows no locks
        fcntl.flock(handle, fcntl.LOCK_EX)
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_UN)


def _lock(handle: int) -> None:
    """Lock a file without waiting.

    Raises
    ------
    OSError
        If somebody else has it.
    """
    if fcntl is not None:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return
    import msvcrt  # noqa: PLC0415

    # A byte far behind the text, which others may then still read.
    os.lseek(handle, 1 << 20, os.SEEK_SET)
    msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
    os.lseek(handle, 0, os.SEEK_SET)
