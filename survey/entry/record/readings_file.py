"""The readings file beside the journal, kept up to date while readings come in."""

import contextlib
import os
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path

from survey.entry.record.entries import Entry
from survey.entry.record.late_rows import LateRows
from survey.entry.record.readings_csv import (
    HandChanges,
    csv_line,
    csv_text,
    hand_changes,
    heading_line,
)
from survey.entry.record.state import EntryState, Pair
from validation.errors import GtvalError
from validation.text_files.writing import write_files

_CHANGES = ("reading", "undo", "keep", "note")
"""Kinds of entries that change the file."""
_TRIES = 5
"""So often a file that somebody saves at this very moment is read again."""


class _ChangedError(Exception):
    """Somebody saved the file while it was written."""


class ReadingsFile:
    """survey/readings.csv as derived from the journal.

    A reading is safe once it is in the journal. If this file cannot be written, that is said in
    ``problem``, and made good with the next entry or the next start. A file that somebody else
    changed meanwhile keeps the changes: from then on only the lines of the readings entered here
    are added and taken away, until a person says what is to become of it.

    Parameters
    ----------
    path : Path
        The file.
    units : {"m", "cm", "mm", "ft", "in"}
        Of its distances, where the heading states none.
    """

    def __init__(self, path: Path, units: str = "m") -> None:
        self.path = path
        self.problem = ""
        self.edited = False
        """Whether somebody else changed it, and nobody has said what is to become of that."""
        self._units = units
        self._before_edit: bytes | None = None
        self._left: bytes | None = None
        """What it held after the last write; None where that is not known."""
        self._owed: list[str] = []
        self._due: list[str] = []
        """Lines to add and to take away that a file in another form could not be given yet."""
        self._shared = False
        """Whether another process writes to journal and file as well."""
        self._late = LateRows(path.with_suffix(".late"))
        self._rows: dict[Pair, list[tuple[int, str]]] | None = None
        """Entries and lines by pair, so that a change of one need not format all anew."""

    def is_current(self, state: EntryState) -> bool:
        """Whether it is there and as the journal says."""
        text = csv_text(state).encode()
        if self._read() != text:
            return False
        self._left = text
        self._complete()
        return True

    def cut_torn(self, state: EntryState) -> None:
        """Take away a last line that was never finished: the journal has that reading.

        Power went, or the process was killed, while the line was written. A line that somebody
        else left unfinished is not touched.
        """
        held = self._read()
        if not held or held.endswith(b"\n"):
            return
        whole, _, torn = held.rstrip(b"\0").rpartition(b"\n")
        rows = chain.from_iterable(self.prepare(state).values())
        lines = [heading_line(state).encode(), *(line.encode() for _, line in rows)]
        if any(line.startswith(torn) and line != torn + b"\n" for line in lines):
            os.truncate(self.path, len(whole) + 1 if whole else 0)

    def _complete(self) -> None:
        """All readings are in it."""
        if not self._shared:
            self._late.clear()

    def changes_by_hand(self, state: EntryState) -> HandChanges | None:
        """How a person changed the file; None where nobody did."""
        found = hand_changes(self.path, state, self._units)
        if found and found.missing:
            found = replace(found, missing=self._late.not_among(found.missing))
        return found

    def held(self) -> bytes | None:
        """What it holds now, for `write`."""
        return self._read()

    def write(self, state: EntryState, seen: bytes | None) -> bool:
        """Write it anew, whole or not at all; not where it no longer holds what was seen of it.

        Returns
        -------
        bool
            False where somebody saved it meanwhile: it must be looked at once more.
        """
        self.edited, self._left = False, seen
        if self._read() != seen:
            self.edited = True
            return False
        self._try(lambda: self._replace(self._derived(state)))
        if not (self.edited or self.problem):
            self._complete()
        return not self.edited

    def prepare(self, state: EntryState) -> dict[Pair, list[tuple[int, str]]]:
        """The lines of all pairs, which take a while when first made."""
        if self._rows is None:
            self._rows = {pair: _rows_of(pair, state) for pair in state.pairs}
        return self._rows

    def take_in(self, entry: Entry, state: EntryState) -> tuple[list[str], list[str]]:
        """Take one more entry into account; the lines that it takes away, and those it adds."""
        gone: list[str] = []
        new: list[str] = []
        if self._rows is None or entry.kind not in _CHANGES:
            return gone, new
        for pair in {entry.pair, state.entries.get(entry.of, entry).pair}:
            before = [line for _, line in self._rows.get(pair, [])]
            self._rows[pair] = _rows_of(pair, state)
            after = [line for _, line in self._rows[pair]]
            gone += (Counter(before) - Counter(after)).elements()
            new += (Counter(after) - Counter(before)).elements()
        return gone, new

    def follow(self, entry: Entry, state: EntryState) -> None:
        """Take one more entry into account, and write it.

        `prepare` was called before the entry was applied to the state.
        """
        gone, new = self.take_in(entry, state)
        if entry.kind not in _CHANGES:
            return
        held = self._read()
        known = self._shared and not self.edited and held not in (None, self._left)
        if known and self._is_ours(held or b"", gone, state):
            self._left = held
            gone = [*gone, ""]  # lines of the other one may be missing: write all
        self.edited = self.edited or self._is_changed(held, state)
        if self.edited:
            self._before_edit = self._left
            for line in gone:
                (self._owed.remove if line in self._owed else self._due.append)(line)
            self._owed += new
            self._late.add(entry.number)  # until the lines are in it
            self._try(lambda: self._merge(state))
        elif held is not None and self._left is not None and not gone:
            self._try(lambda: self._append("".join(new)))
        else:
            self._try(lambda: self._replace(self._derived(state)))

    def expect(self, entry: Entry, state: EntryState) -> None:
        """Take in an entry of another process, which writes it to the file by itself."""
        if not self._shared:
            self._late.add(entry.number, and_after=True)
        self._shared = True
        self.take_in(entry, state)

    def _is_ours(self, held: bytes, gone: Sequence[str], state: EntryState) -> bool:
        """Whether all lines of a file that others write to are the journal's."""
        if not held:  # an editor has emptied it and is about to write
            return False
        known = {heading_line(state), *gone}
        known.update(line for rows in self.prepare(state).values() for _, line in rows)
        return set(held.decode(errors="replace").splitlines(keepends=True)) <= known

    def _is_changed(self, held: bytes | None, state: EntryState) -> bool:
        """Whether somebody else changed the file since the last write."""
        if held is None or self._left is not None:
            return held != self._left and held is not None
        try:  # after a write that failed
            return bool(self.changes_by_hand(state))
        except GtvalError:
            return True

    @property
    def question(self) -> str:
        """What a person is asked about a file that somebody else changed; '' if nothing."""
        if not self.edited:
            return ""
        return (
            f"{self.path.name} was changed by hand while the entry runs. The changes and the "
            "readings entered here are both in it. Take the changes into the journal (f take), or "
            "put that file aside and write the journal's (f aside)?"
        )

    def put_aside(self, state: EntryState, name: str) -> Path:
        """Keep what was changed by hand under another name, and write the journal's readings."""
        aside = self.path.with_name(name)
        for _ in range(_TRIES):
            seen = self._read()
            if seen is not None:
                write_files(aside.parent, {aside.name: seen})
            if self.write(state, seen):
                break
        return aside

    def _derived(self, state: EntryState) -> bytes:
        rows = sorted(chain.from_iterable(self.prepare(state).values()))
        return "".join([heading_line(state), *(line for _, line in rows)]).encode()

    def _read(self) -> bytes | None:
        """What the file holds now; None where it is not there."""
        try:
            return self.path.read_bytes()
        except OSError:
            return None

    def _try(self, action: Callable[[], None]) -> None:
        try:
            action()
        except (OSError, GtvalError) as error:
            self._left = None if not self.edited else self._left
            self.problem = f"{self.path.name} is behind the journal: {error}"
        else:
            self.problem = ""

    def _replace(self, text: bytes) -> None:
        """Write the file anew, unless somebody saves it meanwhile."""
        seen = self._left

        def check() -> None:
            held = self._read()
            if held is not None and seen is not None and held != seen:
                raise _ChangedError

        try:
            saved = self._put(text, check)
        except _ChangedError:
            saved = True
        if saved:
            self.edited = not self._shared
            raise OSError("somebody saves it at this moment")
        self._left = text
        self._owed, self._due = [], []

    def _put(self, text: bytes, check: Callable[[], None]) -> bool:
        """Put the text in its place; whether the file was saved between the last look and that.

        What was saved then is in its place again.
        """
        old = self.path.with_name(f".{self.path.name}.{os.getpid()}.seen.tmp")
        old.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # no file yet, or a file system without hard links
            old.hardlink_to(self.path)
        try:
            write_files(self.path.parent, {self.path.name: text}, before=check)
            late = old.read_bytes() if old.exists() and self._left is not None else self._left
            if late != self._left:
                old.replace(self.path)  # the file itself: an editor may still be writing to it
                return True
        finally:
            old.unlink(missing_ok=True)
        return False

    def _merge(self, state: EntryState) -> None:
        """Take away and add lines in a file that somebody else changed."""
        for _ in range(_TRIES):
            held = self._read()
            if held is None:
                self.edited = False
                self._left = None
                self._replace(self._derived(state))
                return
            lines = held.decode("utf-8", "surrogateescape").splitlines(keepends=True)
            if not lines or lines[0] != heading_line(state):
                said = "it was saved in another form; f takes it over"
                raise OSError(said)
            if not lines[-1].endswith("\n"):
                lines[-1] += "\n"
            for line in self._due:
                if line in lines:
                    lines.remove(line)
            there = set(lines)
            stale = self._stale(lines, self._due)
            lines += [line for line in (*stale, *self._owed) if line not in there]
            self._before_edit = self._left = held
            try:
                self._replace("".join(lines).encode("utf-8", "surrogateescape"))
            except OSError:
                if self._read() == held:
                    raise
            else:
                return
        raise OSError("somebody saves it again and again")

    def _stale(self, held: Sequence[str], gone: Sequence[str]) -> list[str]:
        """The last lines that were written, where an editor has saved what it read before them.

        Whoever means to take back the last readings undoes them: here they are kept.
        """
        left = (self._before_edit or b"").decode("utf-8", "surrogateescape")
        there = set(held)
        numbers = {line.rpartition(",")[2] for line in held}
        found: list[str] = []
        for line in reversed(left.splitlines(keepends=True)[1:]):
            if line in there:
                break
            if line not in gone and line.rpartition(",")[2] not in numbers:
                found.insert(0, line)
        return found

    def _append(self, line: str) -> None:
        data = line.encode()
        size = len(self._left or b"")
        handle = os.open(self.path, os.O_WRONLY | os.O_APPEND | getattr(os, "O_BINARY", 0))
        try:
            if os.write(handle, data) != len(data):
                os.ftruncate(handle, size)
                raise OSError("the disk is full")
        finally:
            os.close(handle)
        self._left = (self._left or b"") + data


def _rows_of(pair: Pair, state: EntryState) -> list[tuple[int, str]]:
    """The lines of one pair, each with its entry."""
    return [(entry.number, csv_line(entry, state)) for entry in state.rows_of_pair(pair)]
