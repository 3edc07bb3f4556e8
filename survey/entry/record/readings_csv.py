"""survey/readings.csv, derived from the journal, and what was changed in it by hand."""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from survey.entry.record.entries import FROM_FILE, FROM_FILE_UNUSED, Entry
from survey.entry.record.numbers import plain
from survey.entry.record.state import EntryState, replayed
from validation.text_files.csv_tables import Column, read_csv
from validation.text_files.csv_text import harmless

HEADING = ("time", "from", "to", "distance", "observer", "use", "note", "entry")
_SAME = 6
"""Cells that make a row the reading that it is; its note and number may change."""


def heading_line(state: EntryState) -> str:
    """The first line of the file."""
    return ",".join(HEADING).replace("distance", state.heading) + "\n"


def csv_text(state: EntryState) -> str:
    """The readings that count, one a row, in the order entered."""
    rows = [csv_line(entry, state) for entry in state.rows_of_file()]
    return "".join([heading_line(state), *rows])


def csv_line(entry: Entry, state: EntryState) -> str:
    """One reading as a line of the file."""
    row = tuple(map(harmless, csv_row(entry, state)))
    line = ",".join(row)
    if line.count(",") == len(HEADING) - 1 and '"' not in line and line.isprintable():
        return f"{line}\n"  # nothing to quote, as nearly always; thousands are written at once
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerow(row)
    return stream.getvalue()


def csv_row(entry: Entry, state: EntryState) -> tuple[str, ...]:
    """The cells of a reading, as they are meant."""
    note = "; ".join(state.notes[entry.number]) if entry.number in state.notes else ""
    return (
        entry.when,
        entry.start,
        entry.end,
        plain(entry.metres or 0.0),
        entry.by,
        "no" if entry.device == FROM_FILE_UNUSED else "",
        note,
        str(entry.number),
    )


@dataclass(frozen=True)
class HandChanges:
    """How a readings file differs from the journal.

    Parameters
    ----------
    added : tuple of (Entry, str)
        Rows that the journal does not have, as readings to take over, with their notes.
    missing : tuple of int
        Readings of the journal that were taken out of the file.
    remarks : tuple of (int, str)
        Readings with a note that the journal does not have.
    """

    added: tuple[tuple[Entry, str], ...]
    missing: tuple[int, ...]
    remarks: tuple[tuple[int, str], ...] = ()

    def __bool__(self) -> bool:
        return bool(self.added or self.missing or self.remarks)


def hand_changes(path: Path, state: EntryState, units: str = "m") -> HandChanges | None:
    """What a person changed in the readings file; None where it is as derived, or was once.

    A file that an earlier state of the journal gives is only late: a reading was safe in the
    journal when the power went, before the file had it. So are readings later than all that the
    file has, and rows that were taken back.

    Parameters
    ----------
    path : Path
        The file.
    state : EntryState
        What the journal says.
    units : {"m", "cm", "mm", "ft", "in"}
        Of the distances, where their heading says nothing.

    Raises
    ------
    InputError
        If the file cannot be read as a table of readings.
    """
    if not path.exists():
        return None
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    if not text.strip("\0 \r\n") or text == csv_text(state) or _was_derived(text, state):
        return None
    rows = _rows(path, units)
    last = max((int(row[-1]) for row in rows if row[-1].isdecimal()), default=0)
    waiting: dict[tuple[str, ...], list[int]] = {}
    for entry in state.rows_of_file():
        waiting.setdefault(csv_row(entry, state)[:_SAME], []).append(entry.number)
    added, remarks = [], []
    for row in rows:
        numbers = waiting.get(row[:_SAME], [])
        if not numbers:
            if not _is_late(row, state):
                added.append((_as_entry(row), row[6]))
            continue
        own = int(row[-1]) if row[-1].isdecimal() else 0
        number = numbers.pop(numbers.index(own) if own in numbers else 0)
        known = "; ".join(state.notes.get(number, []))
        more = row[6].removeprefix(known).removeprefix("; ")
        if more and row[6] != known:
            remarks.append((number, more))
    missing = sorted(n for numbers in waiting.values() for n in numbers if n <= last)
    return HandChanges(tuple(added), tuple(missing), tuple(remarks))


def _is_late(row: tuple[str, ...], state: EntryState) -> bool:
    """Whether a row is a reading of the journal that was taken back, replaced or set aside."""
    entry = state.entries.get(int(row[-1])) if row[-1].isdecimal() else None
    return entry is not None and csv_row(entry, state)[:_SAME] == row[:_SAME]


def _was_derived(text: str, state: EntryState) -> bool:
    """Whether the file is what some earlier state of the journal gave."""
    last = text.rstrip("\n").rpartition("\n")[2].rpartition(",")[2]
    first = int(last) if last.isdecimal() and int(last) in state.entries else 0
    entries: Sequence[Entry] = list(state.entries.values())
    earlier = replayed(
        entries[:first],
        state.agree,
        second_measures=state.second_measures,
        heading=state.heading,
    )
    for entry in entries[first:]:
        if csv_text(earlier) == text:
            return True
        earlier.apply(entry)
    return False


def _rows(path: Path, units: str) -> list[tuple[str, ...]]:
    """The cells of the file in the order of `HEADING`."""
    optional = ("time", "observer", "use", "note", "entry")
    table = read_csv(
        path,
        [
            Column("from"),
            Column("to"),
            Column("distance", "number", low=0.0, high=1e4, unit="m", written_in=units),
            *(Column(name, required=False, blank=True) for name in optional),
        ],
    )
    table.raise_problems()
    used = ["no" if use.lower() == "no" else "" for use in table.text["use"]]
    shown = [plain(metres) for metres in table.numbers["distance"]]
    columns = {**table.text, "distance": shown, "use": used}
    return list(zip(*(columns[name] for name in HEADING), strict=True))


def _as_entry(row: tuple[str, ...]) -> Entry:
    """A row as a reading to take over."""
    time, start, end, distance, observer, use, _note, _number = row
    return Entry(
        "reading",
        by=observer,
        device=FROM_FILE_UNUSED if use == "no" else FROM_FILE,
        start=start,
        end=end,
        text=distance,
        metres=float(distance),
        measured=time,
    )
