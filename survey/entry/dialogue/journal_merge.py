"""The journals of two writers made one, and the readings file with them."""

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from survey.entry.dialogue.entry_session import EntrySession
from survey.entry.dialogue.file_changes import adopt_changes
from survey.entry.record.journal import Journal
from survey.entry.record.lock import CampaignLock
from survey.entry.record.merging import Merged, merge_journals
from survey.entry.record.readings_csv import HandChanges
from survey.entry.room.double import agreement
from survey.settings import SurveySettings
from validation.campaign.folder import Campaign
from validation.errors import InputError, Problem
from validation.text_files.writing import write_files


def merge(campaign: Campaign, others: Sequence[Path]) -> tuple[Merged, Path]:
    """What is in the journal of a campaign after a merge, and the file that keeps the old one.

    Rows of the readings file that no journal has are taken over; no reading is taken back.

    Raises
    ------
    GtvalError
        If an entry session is open, or a file cannot be read or written.
    InputError
        Naming a damaged line.
    """
    settings = campaign.section("survey", SurveySettings)
    path = campaign.folder / settings.entry.journal
    missing = [one for one in (path, *others) if not one.exists()]
    if missing:
        raise InputError([Problem(one, "there is no such journal") for one in missing])
    lock = CampaignLock.take(path.with_suffix(".lock"), "merge")
    try:
        agree = agreement(campaign.settings.instrument, settings)
        measures = settings.entry.second != "type"
        merged = merge_journals([path, *others], agree, second_measures=measures)
        now = datetime.now().astimezone().strftime("%Y%m%d-%H%M%S-%f")
        kept = path.with_name(f"{path.stem}.before-merge-{now}{path.suffix}")
        write_files(path.parent, {kept.name: path.read_bytes(), path.name: merged.as_bytes()})
    finally:
        lock.release()
    entry_session = EntrySession(campaign, Journal.open(path, "merge"))
    try:
        seen = entry_session.readings_file.held()
        changes = entry_session.readings_file.changes_by_hand(entry_session.state)
        if changes:
            adopt_changes(entry_session, HandChanges(changes.added, (), changes.remarks))
        entry_session.readings_file.write(entry_session.state, seen)
    finally:
        entry_session.close()
    return merged, kept
