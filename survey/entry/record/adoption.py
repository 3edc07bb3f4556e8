"""Readings that came from elsewhere: a readings file from before, or changed by hand."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

from survey.entry.record.entries import FROM_FILE, MAX_NOTE, Entry
from survey.entry.record.readings_csv import HandChanges
from validation.errors import GtvalError, InputError, Problem

WhyNot = Callable[[frozenset[str]], str]


def refuse_hand_changes(path: Path, changes: HandChanges) -> GtvalError:
    """The error for a readings file that no longer follows from the journal."""
    return GtvalError(
        f"{path} was changed by hand: it has {len(changes.added)} row(s) that the journal does "
        f"not have, and lacks {len(changes.missing)} reading(s). Take that over with --adopt, or "
        "move the file away: it is then written anew from the journal"
    )


def as_entries(
    path: Path, changes: HandChanges, stops: Iterable[str], why_not: WhyNot
) -> list[tuple[Entry, str]]:
    """The journal entries that take changes over, each with the remark to note at it.

    Parameters
    ----------
    path : Path
        The readings file, for messages.
    changes : HandChanges
        What was changed.
    stops : iterable of str
        Stops of the file that nobody has begun yet.
    why_not : callable
        What is wrong with a pair of points; '' where it may be measured.

    Raises
    ------
    InputError
        Naming what is wrong with the points of the rows, each thing once.
    """
    problems: dict[str, Problem] = {}
    for reading, _ in changes.added:
        fault = why_not(reading.pair)
        if fault:
            value = f"{reading.start},{reading.end}"
            problems.setdefault(fault, Problem(path, fault, field="from", value=value))
    if problems:
        raise InputError(problems.values())
    begun = [(Entry("stop", device=FROM_FILE, text=stop), "") for stop in stops]
    noted = [
        (Entry("note", device=FROM_FILE, of=n, text=text[:MAX_NOTE]), "")
        for n, text in changes.remarks
    ]
    # What is added comes first: a power cut between loses nothing.
    added = [(reading, remark[:MAX_NOTE]) for reading, remark in changes.added]
    undone = [(Entry("undo", device=FROM_FILE, of=number), "") for number in changes.missing]
    return [*begun, *added, *noted, *undone]


def remark_on(reading: Entry, remark: str) -> Entry:
    """The entry that keeps a row's note."""
    return replace(
        Entry("note", device=FROM_FILE),
        start=reading.start,
        end=reading.end,
        of=reading.number,
        text=remark,
    )
