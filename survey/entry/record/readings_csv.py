"""survey/readings.csv, derived from the journal, and what was changed in it by hand."""

import csv
import io
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from survey.entry.record.entries import FROM_FILE, FROM_FILE_UNUSED, Entry
from survey.entry.record.numbers import plain
from survey.entry.record.state import Agree, EntryState, replayed
from validation.text_files.csv_tables import Column, read_csv

HEADING = ("time", "from", "to", "distance", "observer", "use", "note", "entry")
HEADING_LINE = ",".join(HEADING) + "\n"
_FORMULA = ("=", "+", "-", "@", "\t")


def csv_text(state: EntryState) -> str:
    """The readings that count, one a row, in the order entered."""
    rows = [csv_line(entry, state) for entry in state.rows_of_file()]
    return "".join([HEADING_LINE, *rows])


def csv_line(entry: Entry, state: EntryState) -> str:
    """One reading as a line of the file."""
    row = csv_row(entry, state)
    line = ",".join(row)
    if line.count(",") == len(HEADING) - 1 and '"' not in line and line.isprintable():
        return f"{line}\n"  # nothing to quote, as nearly always; thousands are written at once
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerow(row)
    return stream.getvalue()


def csv_row(entry: Entry, state: EntryState) -> tuple[str, ...]:
    """The cells of a reading."""
    note = "; ".join(state.notes[entry.number]) if entry.number in state.notes else ""
    return (
        entry.when,
        entry.start,
        entry.end,
        plain(entry.metres or 0.0),
        _harmless(entry.by),
        "no" if entry.device == FROM_FILE_UNUSED else "",
        _harmless(note),
        str(entry.number),
    )


def _harmless(text: str) -> str:
    """The text, with a mark before what a spreadsheet would take for a formula."""
    return f"'{text}" if text.startswith(_FORMULA) else text


@dataclass(frozen=True)
class HandChanges:
    """How a readings file differs from the journal.

    Parameters
    ----------
    added : tuple of (Entry, str)
        Rows that the journal does not have, as readings to take over, with their notes.
    missing : tuple of int
        Readings of the journal that are no longer in the file.
    """

    added: tuple[tuple[Entry, str], ...]
    missing: tuple[int, ...]


def hand_changes(path: Path, state: EntryState, agree: Agree) -> HandChanges | None:
    """What a person changed in the readings file; None where it is as derived, or was once.

    A file that an earlier state of the journal gives is only late: a reading was safe in the
    journal when the power went, before the file had it.

    Raises
    ------
    InputError
        If the file cannot be read as a table of readings.
    """
    if not path.exists():
        return None
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    if text == csv_text(state) or _was_derived(text, state, agree):
        return None
    rows = _rows(path)
    there = {csv_row(entry, state): entry.number for entry in state.rows_of_file()}
    count = Counter(row[:-1] for row in rows)
    missing = [number for row, number in there.items() if not _take(count, row[:-1])]
    added = [(_as_entry(row), row[6]) for row in rows if _take(count, row[:-1])]
    return HandChanges(tuple(added), tuple(missing))


def _take(count: Counter[tuple[str, ...]], row: tuple[str, ...]) -> bool:
    """Whether a row is there, and one less from now on."""
    if count[row] <= 0:
        return False
    count[row] -= 1
    return True


def _was_derived(text: str, state: EntryState, agree: Agree) -> bool:
    """Whether the file is what some earlier state of the journal gave."""
    last = text.rstrip("\n").rpartition("\n")[2].rpartition(",")[2]
    first = int(last) if last.isdigit() and int(last) in state.entries else 0
    entries: Sequence[Entry] = list(state.entries.values())
    earlier = replayed(entries[:first], agree, second_measures=state.second_measures)
    for entry in entries[first:]:
        if csv_text(earlier) == text:
            return True
        earlier.apply(entry)
    return False


def _rows(path: Path) -> list[tuple[str, ...]]:
    """The cells of the file in the order of `HEADING`."""
    optional = ("time", "observer", "use", "note", "entry")
    table = read_csv(
        path,
        [
            Column("from"),
            Column("to"),
            Column("distance", "number", low=0.0, high=1e4, unit="m"),
            *(Column(name, required=False, blank=True) for name in optional),
        ],
    )
    table.raise_problems()
    shown = [plain(metres) for metres in table.numbers["distance"]]
    columns = [shown if name == "distance" else table.text[name] for name in HEADING]
    return list(zip(*columns, strict=True))


def _as_entry(row: tuple[str, ...]) -> Entry:
    """A row as a reading to take over."""
    time, start, end, distance, observer, use, _note, _number = row
    return Entry(
        "reading",
        by=observer,
        device=FROM_FILE_UNUSED if use.lower() == "no" else FROM_FILE,
        start=start,
        end=end,
        text=distance,
        metres=float(distance),
        measured=time,
    )
