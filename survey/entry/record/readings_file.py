"""The readings file beside the journal, kept up to date while readings come in."""

import os
from collections.abc import Callable
from itertools import chain
from pathlib import Path

from survey.entry.record.entries import Entry
from survey.entry.record.readings_csv import (
    HEADING_LINE,
    HandChanges,
    csv_line,
    csv_text,
    hand_changes,
)
from survey.entry.record.state import EntryState, Pair
from validation.errors import GtvalError
from validation.text_files.writing import write_files

_CHANGES = ("reading", "undo", "keep", "note")
"""Kinds of entries that change the file."""


class ReadingsFile:
    """survey/readings.csv as derived from the journal.

    A reading is safe once it is in the journal. If this file cannot be written, that is said in
    ``problem``, and made good with the next entry or the next start.

    Parameters
    ----------
    path : Path
        The file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.problem = ""
        self._size = -1
        self._rows: dict[Pair, list[tuple[int, str]]] | None = None
        """Entries and lines by pair, so that a change of one need not format all anew."""

    def is_current(self, state: EntryState) -> bool:
        """Whether it is there and as the journal says."""
        text = csv_text(state).encode()
        if not self.path.exists() or self.path.read_bytes() != text:
            return False
        self._size = len(text)
        return True

    def changes_by_hand(self, state: EntryState) -> HandChanges | None:
        """How a person changed the file; None where nobody did."""
        return hand_changes(self.path, state, state.agree)

    def write(self, state: EntryState) -> None:
        """Write it anew, whole or not at all."""
        rows = sorted(chain.from_iterable(self.prepare(state).values()))
        text = "".join([HEADING_LINE, *(line for _, line in rows)])
        self._try(lambda: self._replace(text.encode()))

    def prepare(self, state: EntryState) -> dict[Pair, list[tuple[int, str]]]:
        """The lines of all pairs, which take a while when first made."""
        if self._rows is None:
            self._rows = {pair: _rows_of(pair, state) for pair in state.pairs}
        return self._rows

    def take_in(self, entry: Entry, state: EntryState) -> None:
        """Take one more entry into account, to be written with the next."""
        if self._rows is not None and entry.kind in _CHANGES:
            for pair in {entry.pair, state.entries.get(entry.of, entry).pair}:
                self._rows[pair] = _rows_of(pair, state)

    def follow(self, entry: Entry, state: EntryState) -> None:
        """Take one more entry into account, and write it."""
        self.take_in(entry, state)
        if entry.kind not in _CHANGES:
            return
        if entry.kind == "reading" and state.counting(entry.pair) == [entry.number]:
            new = not (entry.of or entry.second)
            if new and self._is_as_left():
                self._try(lambda: self._append(csv_line(entry, state)))
                return
        self.write(state)

    def _is_as_left(self) -> bool:
        """Whether the file has the size that it had after the last write."""
        try:
            return self._size >= 0 and self.path.stat().st_size == self._size
        except OSError:
            return False

    def _try(self, action: Callable[[], None]) -> None:
        try:
            action()
        except (OSError, GtvalError) as error:
            self._size = -1
            self.problem = f"{self.path.name} is behind the journal: {error}"
        else:
            self.problem = ""

    def _replace(self, text: bytes) -> None:
        write_files(self.path.parent, {self.path.name: text})
        self._size = len(text)

    def _append(self, line: str) -> None:
        data = line.encode()
        handle = os.open(self.path, os.O_WRONLY | os.O_APPEND | getattr(os, "O_BINARY", 0))
        try:
            if os.write(handle, data) != len(data):
                os.ftruncate(handle, self._size)
                raise OSError("the disk is full")
        finally:
            os.close(handle)
        self._size += len(data)


def _rows_of(pair: Pair, state: EntryState) -> list[tuple[int, str]]:
    """The lines of one pair, each with its entry."""
    return [(entry.number, csv_line(entry, state)) for entry in state.rows_of_pair(pair)]
