"""Journal and readings file brought together, at the start and while the entry runs."""

import uuid
from dataclasses import replace
from datetime import datetime
from typing import TYPE_CHECKING, Protocol

from survey.entry.record.adoption import as_entries, refuse_hand_changes, remark_on
from survey.entry.record.readings_csv import HandChanges
from survey.settings import SurveySettings
from validation.campaign.folder import Campaign
from validation.errors import InputError, Problem

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from survey.entry.dialogue.guide import Guide
    from survey.entry.record.entries import Entry
    from survey.entry.record.readings_file import ReadingsFile
    from survey.entry.record.state import EntryState

_TRIES = 5
"""So often a file is looked at that somebody saves while it is taken over."""


class Entering(Protocol):
    """What an entry session is to its files."""

    state: "EntryState"
    guide: "Guide"
    readings_file: "ReadingsFile"
    others: set[int]
    taken_over: int
    version: int

    @property
    def changing(self) -> "AbstractContextManager[bool]":
        """Held by who changes anything."""

    def append_only(self, entry: "Entry") -> "Entry":
        """Write to the journal without writing the readings file anew."""

    def catch_up(self) -> None:
        """Take in what another process has written to the journal."""


def bring_together(entry_session: Entering, *, adopt: bool) -> None:
    """Bring the readings file up to date, or take over what was changed in it.

    Raises
    ------
    GtvalError
        If it was changed by hand and that is not to be taken over.
    """
    file, state = entry_session.readings_file, entry_session.state
    file.cut_torn(state)
    for _ in range(_TRIES):
        if file.is_current(state):
            return
        seen = file.held()
        changes = file.changes_by_hand(state)
        if changes:
            if state.pairs and not adopt:
                raise refuse_hand_changes(file.path, changes)
            adopt_changes(entry_session, changes)
        if (changes is None and not state.pairs) or file.write(state, seen):
            return


def adopt_changes(entry_session: Entering, changes: HandChanges) -> None:
    """Take what was changed in the readings file into the journal."""
    names = entry_session.guide.names
    after = names.with_stops_of(reading.pair for reading, _ in changes.added)
    stops = after.stops[len(names.stops) :]
    path = entry_session.readings_file.path
    for entry, remark in as_entries(path, changes, stops, after.why_not):
        written = entry_session.append_only(replace(entry, id=uuid.uuid4().hex))
        if remark:
            entry_session.append_only(replace(remark_on(written, remark), id=uuid.uuid4().hex))
    entry_session.taken_over += len(changes.added)
    entry_session.guide.make_plan()


def take_edited_file(entry_session: Entering) -> str:
    """What was taken into the journal of a readings file that was changed meanwhile.

    Raises
    ------
    GtvalError
        If the file cannot be read, or names points that are not there.
    """
    file, state = entry_session.readings_file, entry_session.state
    more = less = remarks = 0
    with entry_session.changing:
        entry_session.catch_up()
        for _ in range(_TRIES):
            seen = file.held()
            changes = file.changes_by_hand(state) or HandChanges((), ())
            adopt_changes(entry_session, changes)
            more, less = more + len(changes.added), less + len(changes.missing)
            remarks += len(changes.remarks)
            if file.write(state, seen):
                break
        entry_session.version += 1
    return f"taken into the journal: {more} row(s) more, {less} less, {remarks} remark(s)"


def put_edited_file_aside(entry_session: Entering) -> str:
    """Where the readings file that was changed meanwhile lies now."""
    with entry_session.changing:
        now = datetime.now().astimezone().strftime("%Y%m%d-%H%M%S-%f")
        file = entry_session.readings_file
        name = f"{file.path.stem}.edited-{now}{file.path.suffix}"
        aside = file.put_aside(entry_session.state, name)
        entry_session.version += 1
    return f"the changed file is {aside.name} now; {file.path.name} is the journal's"


def warnings(entry_session: Entering) -> list[str]:
    """What is amiss with the files, for the people in the room."""
    file, others = entry_session.readings_file, len(entry_session.others)
    shared = (
        f"another entry session writes to this journal too ({others} entries so far, all kept): "
        "end one of the two"
    )
    return [text for text in (file.problem, file.question, shared if others else "") if text]


def refuse_sheet(campaign: Campaign, settings: SurveySettings) -> None:
    """Raise where the readings so far are in a sheet, which would be left out from then on."""
    wanted = campaign.folder / settings.readings
    if wanted.exists():
        return
    from survey.readings.readings import readings_path  # noqa: PLC0415  (numpy)

    found = readings_path(campaign, settings)
    if found != wanted and found.exists():
        said = f"save it as {wanted.name} in the same folder first: readings are added to that"
        raise InputError([Problem(found, said)])
