"""The journal: an append-only file that no accident takes a reading from.

One line an entry, a JSON object that ends in a checksum over itself and the line before. A line
counts when it is on the disk (fsync); only then is anybody told. A torn last line was never
acknowledged and is cut off; any other damage is an error, never a silent loss.
"""

import contextlib
import hashlib
import json
import os
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Self

from survey.entry.record.entries import Entry, entry_from_json
from survey.entry.record.lock import CampaignLock, locked_for_a_line
from validation.errors import GtvalError, InputError, Problem

_PATIENCE, _PAUSE = 50, 0.01
"""So often, and so many seconds apart, a line is looked at that another process is writing."""
MAX_JOURNAL_BYTES = 200_000_000
"""A million entries: no campaign has as many."""
_CHECK, _END = b',"check":"', b'"}'
_CHECK_LENGTH = 16
"""Hexadecimal digits: chance lets a damaged line pass once in 1.8e19."""
_START = b"0" * _CHECK_LENGTH
TWO_WRITERS = (
    "two entry sessions wrote to this journal without seeing one another: end both, then run "
    "`gtval journal-merge`, which keeps what both wrote"
)


class NotRecordedError(GtvalError):
    """Something could not be written to the journal; it may be tried again."""


class BehindError(Exception):
    """Another process has written to the journal; what it wrote must be read first."""


@dataclass(frozen=True)
class JournalText:
    """What a journal file holds.

    Parameters
    ----------
    entries : tuple of Entry
        In the order written.
    size : int
        Bytes up to the end of the last good line.
    torn : int
        Bytes after it, of a line that was never finished.
    check : bytes
        Checksum of the last good line.
    """

    entries: tuple[Entry, ...]
    size: int
    torn: int
    check: bytes


def read_journal(path: Path) -> JournalText:
    """The entries of a journal; none where there is no file.

    Raises
    ------
    InputError
        Naming the line that was damaged, and what to do.
    """
    try:
        if path.exists() and path.stat().st_size > MAX_JOURNAL_BYTES:
            raise InputError([Problem(path, "larger than 200 MB; this is no journal")])
        data = path.read_bytes()
    except FileNotFoundError:
        data = b""
    except OSError as error:
        raise GtvalError(f"cannot read {path}: {error.strerror or error}") from error
    *lines, unfinished = data.split(b"\n")
    check, good = _checked(lines)
    # Blocks of the last line that a power cut kept from the disk are zeros.
    lost = good == len(lines) - 1 and not unfinished and b"\0" in lines[good]
    if good < len(lines) and not lost:
        if lines[good] not in lines[:good] and _parent(lines, good) is not None:
            raise InputError([Problem(path, TWO_WRITERS, good + 1)])
        raise _damaged(path, good + 1, "the checksum does not fit")
    entries = _entries(path, lines[:good])
    size = sum(map(len, lines[:good])) + good
    return JournalText(entries, size, len(data) - size, check)


def _parent(lines: Sequence[bytes], number: int) -> int | None:
    """Which earlier line a line was written after, by its checksum; -1: none; None: it fits none.

    The nearest is looked at first: two writers are seldom far apart.
    """
    body, _, rest = lines[number].rpartition(_CHECK)
    for before in range(number - 1, -2, -1):
        check = _START if before < 0 else check_of(lines[before])
        if rest == _checksum(check, body) + _END:
            return before
    return None


def check_of(line: bytes) -> bytes:
    """The checksum that a line ends in."""
    return line.rpartition(_CHECK)[2].removesuffix(_END)


def _damaged(path: Path, line: int, why: str) -> InputError:
    return InputError(
        [
            Problem(
                path,
                f"the journal was damaged here ({why}); put a copy of it back, or rename it: the "
                "readings file is then taken over as it is",
                line,
            )
        ]
    )


def _checked(lines: Sequence[bytes], before: bytes = _START) -> tuple[bytes, int]:
    """The last checksum that is right, and how many lines there are up to it."""
    for number, line in enumerate(lines):
        body, _, rest = line.rpartition(_CHECK)
        check = _checksum(before, body)
        if rest != check + _END:
            return before, number
        before = check
    return before, len(lines)


def _entries(path: Path, lines: Sequence[bytes], before: int = 0) -> tuple[Entry, ...]:
    """The entries of lines whose checksums are right, so many lines being before them."""
    try:
        said = json.loads(b"[%s]" % b",".join(lines))  # half the time of one after the other
    except ValueError:
        said = []
    if len(said) != len(lines):
        said = [None] * len(lines)
    entries = []
    for number, line in enumerate(lines, 1):
        try:
            entry = entry_from_json(said[number - 1] or json.loads(line))
        except ValueError as error:
            raise _damaged(path, before + number, str(error)) from None
        if entry.number != before + number:
            raise _damaged(path, before + number, f"entry {entry.number} stands here")
        entries.append(entry)
    return tuple(entries)


def _checksum(before: bytes, body: bytes) -> bytes:
    """Of a line without its end, and of the checksum of the line before it."""
    return hashlib.sha256(before + body).hexdigest()[:_CHECK_LENGTH].encode()


@dataclass(frozen=True)
class Line:
    """An entry, with the checksum of the line that its writer knew before it."""

    entry: Entry
    before: bytes


def line_of(entry: Entry, before: bytes | None = None) -> tuple[bytes, bytes]:
    """The line of an entry after one with a checksum, and its own checksum."""
    body = entry.as_json()[:-1].encode()
    check = _checksum(before or _START, body)
    return body + _CHECK + check + _END + b"\n", check


def lines_of(path: Path, known: Collection[bytes] = ()) -> dict[bytes, Line]:
    """The lines of a journal that perhaps two writers wrote to, by their checksums.

    Parameters
    ----------
    path : Path
        The file; a torn last line is left out.
    known : collection of bytes
        Checksums of lines of other files, which lines may follow on.

    Raises
    ------
    InputError
        Naming a line that follows on none.
    """
    lines = path.read_bytes().split(b"\n")[:-1]
    found: dict[bytes, Line] = {}
    checks = [_START, *known]
    for number, line in enumerate(lines, 1):
        body, _, rest = line.rpartition(_CHECK)
        before = next((c for c in reversed(checks) if rest == _checksum(c, body) + _END), None)
        if before is None:
            raise _damaged(path, number, "it follows on no other line")
        try:
            entry = entry_from_json(json.loads(line))
        except ValueError as error:
            raise _damaged(path, number, str(error)) from None
        found.setdefault(check_of(line), Line(entry, before))
        checks.append(check_of(line))
    return found


class Journal:
    """A journal that is open for writing, by one process at a time.

    Parameters
    ----------
    path : Path
        The file; made, with its folder, when the first entry is written.
    entries : sequence of Entry
        What it holds.
    """

    def __init__(self, path: Path, text: JournalText, lock: CampaignLock) -> None:
        self.path = path
        self.recovered_bytes = text.torn
        self._entries = list(text.entries)
        self._check = text.check
        self._size = text.size
        self._lock = lock
        self._file = -1

    @classmethod
    def open(cls, path: Path, who: str = "") -> Self:
        """The journal of a campaign, locked against other processes.

        Raises
        ------
        GtvalError
            If another process has it open, saying who; or the folder cannot be written.
        InputError
            If the file was damaged.
        """
        lock = CampaignLock.take(path.with_suffix(".lock"), who)
        try:
            journal = cls(path, read_journal(path), lock)
            journal._make_ready()
        except BaseException:
            lock.release()
            raise
        return journal

    @classmethod
    def look(cls, path: Path) -> Self:
        """The journal as it is on the disk, for looking only.

        Raises
        ------
        InputError
            If the file was damaged.
        """
        return cls(path, read_journal(path), CampaignLock.none())

    @property
    def is_open(self) -> bool:
        """Whether it can be written to."""
        return self._file >= 0

    @property
    def entries(self) -> Sequence[Entry]:
        """All entries."""
        return self._entries

    def catch_up(self) -> list[Entry]:
        """What another process wrote since this one looked; none as long as it is alone.

        The lock keeps others out. Where it does not, because its file was deleted or the disk is
        shared by a network that knows no locks, their entries are taken in before the next.

        Raises
        ------
        NotRecordedError
            If what they wrote does not follow on what this process knows.
        """
        if not self.is_open or self._is_as_left():
            return []
        for _ in range(_PATIENCE):
            data = os.pread(self._file, MAX_JOURNAL_BYTES, self._size)
            if data.endswith(b"\n"):
                break
            time.sleep(_PAUSE)  # the other one is in the middle of a line
        lines = data.split(b"\n")[:-1]
        check, good = _checked(lines, self._check)
        if good < len(lines) or not lines:
            raise NotRecordedError(f"NOT recorded: {self.path}: {TWO_WRITERS}")
        found = _entries(self.path, lines, len(self._entries))
        self._check = check
        self._size += len(data)
        self._entries += found
        return list(found)

    def append(self, entry: Entry, now: datetime | None = None) -> Entry:
        """The entry with its number and time, once it is safely on the disk.

        Raises
        ------
        NotRecordedError
            If it could not be written; nothing of it is left in the file then.
        BehindError
            If another process has written; `catch_up` reads that.
        """
        if not self.is_open:
            raise NotRecordedError(f"NOT recorded: {self.path} is not open for writing")
        with locked_for_a_line(self._file):
            if not self._is_as_left():
                raise BehindError
            return self._append(entry, now)

    def _append(self, entry: Entry, now: datetime | None) -> Entry:
        when = (now or datetime.now().astimezone()).isoformat(timespec="milliseconds")
        numbered = replace(entry, number=len(self._entries) + 1, time=when)
        line, check = line_of(numbered, self._check)
        try:
            self._write(line)
        except OSError as error:
            self._cut_off()
            reason = error.strerror or error
            raise NotRecordedError(
                f"NOT recorded: cannot write to {self.path}: {reason}"
            ) from error
        self._size += len(line)
        self._check = check
        self._entries.append(numbered)
        return numbered

    def close(self) -> None:
        """Let other processes have it."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1
        self._lock.release()

    def _make_ready(self) -> None:
        """Open for appending, with any torn last line cut off."""
        try:
            new = not self.path.exists()
            flags = os.O_RDWR | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0)
            self._file = os.open(self.path, flags, 0o666)
            if self.recovered_bytes:
                os.ftruncate(self._file, self._size)
                os.fsync(self._file)
            if new:
                flush_folder(self.path.parent)
        except OSError as error:
            self.close()
            raise GtvalError(
                f"cannot write to {self.path}: {error.strerror or error}; no reading would be safe"
            ) from error

    def _is_as_left(self) -> bool:
        """Whether the file is the one that was opened, and as long as after the last line.

        Raises
        ------
        NotRecordedError
            If it was deleted, replaced or cut short.
        """
        own = os.fstat(self._file)
        try:
            there = self.path.stat()
        except OSError:
            there = None
        if there is None or (there.st_dev, there.st_ino) != (own.st_dev, own.st_ino):
            said = "was deleted or replaced while the entry runs; put it back, then start again"
            raise NotRecordedError(f"NOT recorded: {self.path} {said}")
        if own.st_size < self._size:
            said = "was cut short while the entry runs; put a copy of it back, then start again"
            raise NotRecordedError(f"NOT recorded: {self.path} {said}")
        return own.st_size == self._size

    def _write(self, line: bytes) -> None:
        rest = memoryview(line)
        while rest:
            rest = rest[os.write(self._file, rest) :]
        os.fsync(self._file)

    def _cut_off(self) -> None:
        """Remove what a failed write left; if even that fails, write nothing more."""
        try:
            os.ftruncate(self._file, self._size)
        except OSError:
            with contextlib.suppress(OSError):
                os.close(self._file)
            self._file = -1


def flush_folder(folder: Path) -> None:
    """Make new names in a folder survive a power cut, where the system can."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
