"""Readings that came from elsewhere: a readings file from before, or changed by hand."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from survey.entry.record.entries import FROM_FILE, MAX_NOTE, Entry
from survey.entry.record.readings_csv import HandChanges
from validation.errors import GtvalError, InputError, Problem

MayBeMeasured = Callable[[frozenset[str]], bool]


def refuse_hand_changes(path: Path, changes: HandChanges) -> GtvalError:
    """The error for a readings file that no longer follows from the journal."""
    return GtvalError(
        f"{path} was changed by hand: it has {len(changes.added)} row(s) that the journal does "
        f"not have, and lacks {len(changes.missing)} reading(s). Take that over with --adopt, or "
        "delete the file: it is then written anew from the journal"
    )


def as_entries(
    path: Path, changes: HandChanges, may_be_measured: MayBeMeasured
) -> list[tuple[Entry, str]]:
    """The journal entries that take changes over, each with the remark to note at it.

    Parameters
    ----------
    path : Path
        The readings file, for messages.
    changes : HandChanges
        What was changed.
    may_be_measured : callable
        Whether a pair is among the points of the campaign.

    Raises
    ------
    InputError
        Naming every row whose points are not those of the campaign.
    """
    problems = [
        Problem(
            path,
            "no pair of points of this campaign; check the names, [survey] world_points and "
            "[survey.entry] poses",
            field="from",
            value=f"{reading.start},{reading.end}",
        )
        for reading, _ in changes.added
        if not may_be_measured(reading.pair)
    ]
    if problems:
        raise InputError(problems)
    undone = [(Entry("undo", device=FROM_FILE, of=number), "") for number in changes.missing]
    return [*undone, *((reading, remark[:MAX_NOTE]) for reading, remark in changes.added)]


def remark_on(reading: Entry, remark: str) -> Entry:
    """The entry that keeps a row's note."""
    return replace(
        Entry("note", device=FROM_FILE),
        start=reading.start,
        end=reading.end,
        of=reading.number,
        text=remark,
    )
