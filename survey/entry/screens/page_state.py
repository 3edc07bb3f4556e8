"""Everything that the page shows, as plain data."""

from collections.abc import Mapping
from typing import Any

from survey.entry.dialogue.answers import Answer
from survey.entry.dialogue.entry_session import EntrySession
from survey.entry.dialogue.file_changes import warnings
from survey.entry.dialogue.words import (
    answer_lines,
    doubts_text,
    enough_text,
    progress_of,
    unchecked_text,
    value_text,
)
from survey.entry.record.entries import Entry
from survey.entry.record.numbers import plain
from survey.entry.record.state import Pair
from survey.entry.room.rough_places import RoughPlaces
from survey.entry.room.slips import shown_decimals
from survey.entry.room.targets import Target, stop_of
from validation.page.desk import campaign_key
from validation.page.people import Person

FOLLOWING = 200
"""Targets sent ahead, for a page that loses the link: an hour's work or more."""
RECENT = 6
"""Readings shown back. A judgement: what fits on the screen of a phone."""


def page_state(entry_session: EntrySession, person: Person, rough: RoughPlaces) -> dict[str, Any]:
    """What a device shows, values that its person must not see left out.

    Parameters
    ----------
    entry_session : EntrySession
        What was done.
    person : Person
        At the device.
    rough : RoughPlaces
        Where points are drawn that have no measured place yet.
    """
    guide = entry_session.guide
    following = guide.following(person, FOLLOWING)
    target = following[0] if following else None
    shown_at = target or guide.plan[0].targets[0]
    return {
        "version": entry_session.version,
        "key": campaign_key(entry_session.campaign.folder),
        "campaign": entry_session.campaign.settings.name,
        "by": person.name,
        "second": person.second,
        "second_wanted": entry_session.settings.second != "none",
        "progress": progress_of(entry_session, person),
        "targets": [_target(entry_session, one, person) for one in following],
        "station": _station(entry_session, shown_at, person),
        "recent": _recent(entry_session, person),
        "last": _last(entry_session, person),
        "doubtful": _doubtful(entry_session, person),
        "disagreeing": _disagreeing(entry_session),
        "unexamined": entry_session.unexamined(),
        "status": _status(entry_session, shown_at, person),
        "map": _map(entry_session, shown_at, rough),
        "behind": entry_session.readings_file.problem,
        "warnings": warnings(entry_session),
        "edited": entry_session.readings_file.edited,
        "unchecked": "" if person.second else unchecked_text(entry_session),
        "decimals": shown_decimals(entry_session.campaign.settings.instrument),
    }


def answer_state(entry_session: EntrySession, answer: Answer) -> dict[str, Any]:
    """An answer as the page says it."""
    found = answer.verdict
    return {
        "outcome": answer.outcome,
        "look": answer.needs_a_look,
        "lines": answer_lines(entry_session, answer),
        "number": answer.entry.number,
        "hypotheses": [plain(h.metres) for h in found.hypotheses] if found else [],
    }


def _target(entry_session: EntrySession, target: Target, person: Person) -> dict[str, Any]:
    again = not person.second and bool(entry_session.state.counting(target.pair))
    return {"from": target.start, "to": target.end, "again": again}


def _station(entry_session: EntrySession, target: Target, person: Person) -> dict[str, Any]:
    station = entry_session.guide.station_of(target, person)
    doubtful = set() if person.second else set(entry_session.doubtful_at(station))
    rows = []
    for one in station.targets:
        value = value_text(entry_session, one.pair, blind=person.second)
        state = _state_of(entry_session, one.pair, person)
        if doubtful & set(entry_session.state.counting(one.pair)):
            state = "doubtful"
        rows.append({"from": one.start, "to": one.end, "value": value, "state": state})
    progress = progress_of(entry_session, person, station.targets)
    return {"name": station.name, "rows": rows, "progress": progress}


def _state_of(entry_session: EntrySession, pair: Pair, person: Person) -> str:
    """Whether a pair is done, open or skipped, for a person."""
    state = entry_session.state
    if person.second:
        skipped = pair in state.without_second
        return "done" if state.has_second(pair) else "skipped" if skipped else "open"
    if state.counting(pair):
        return "done"
    return "open" if entry_session.guide.skipped(pair) is None else "skipped"


def _recent(entry_session: EntrySession, person: Person) -> list[dict[str, Any]]:
    """The last readings, the newest first."""
    found: list[dict[str, Any]] = []
    entries = entry_session.journal.entries
    for entry in reversed(entries[-60:]):
        if entry.kind == "reading" and len(found) < RECENT:
            found.append(_recent_row(entry_session, entry, person))
    return found


def _last(entry_session: EntrySession, person: Person) -> dict[str, Any] | None:
    """The last reading of this device that stands, for its buttons; None if there is none."""
    state = entry_session.state
    for entry in reversed(entry_session.journal.entries[-200:]):
        if entry.kind == "reading" and entry.device == person.device:
            if entry.number in state.undone or entry.number in state.replaced:
                continue
            return {"number": entry.number, "from": entry.start, "to": entry.end}
    return None


def _recent_row(entry_session: EntrySession, entry: Entry, person: Person) -> dict[str, Any]:
    state = entry_session.state
    secret = person.second or state.disagrees(entry.pair)
    fate = ""
    if entry.number in state.undone:
        fate = "undone"
    elif entry.number in state.replaced:
        fate = "replaced"
    elif entry.number in state.set_aside:
        fate = "set aside"
    return {
        "number": entry.number,
        "pair": f"{entry.start}–{entry.end}",
        "value": "entered" if secret else plain(entry.metres or 0.0),
        "by": entry.by,
        "fate": fate,
        "notes": [] if secret else state.notes.get(entry.number, []),
    }


def _doubtful(entry_session: EntrySession, person: Person) -> list[dict[str, Any]]:
    if person.second:
        return []
    return [
        {
            "number": number,
            "from": entry_session.state.entries[number].start,
            "to": entry_session.state.entries[number].end,
            "text": doubts_text(entry_session, [number]),
        }
        for number in entry_session.doubtful_so_far()
    ]


def _disagreeing(entry_session: EntrySession) -> list[dict[str, Any]]:
    """Pairs of which two people's entries disagree; no value."""
    state = entry_session.state
    last = [state.entries[state.pair(pair).numbers[-1]] for pair in entry_session.disagreeing()]
    return [{"from": e.start, "to": e.end, "text": f"{e.start}–{e.end}"} for e in last]


def _status(entry_session: EntrySession, target: Target, person: Person) -> dict[str, Any]:
    """How well the stop or world point is known, and where to go on if that is well enough."""
    found = None if person.second else entry_session.status(target)
    if found is None:
        return {"text": "", "enough": "", "next": ""}
    enough = enough_text(entry_session, target)
    after = entry_session.guide.stop_after(stop_of(target), person) if enough else ""
    return {"text": found.text, "enough": enough, "next": after}


def _map(entry_session: EntrySession, target: Target, rough: RoughPlaces) -> Mapping[str, Any]:
    """Walls and points with their places in metres, measured ones marked as such."""
    names = entry_session.guide.names
    stops = {n.partition("/")[0] for n in (target.start, target.end) if "/" in n}
    known = entry_session.checks.knowledge.places(stops)
    written_as = {meaning: label for label, meaning in entry_session.survey.labels.items()}
    kinds = dict.fromkeys(names.vframe, "frame") | dict.fromkeys(names.world, "world")
    places = {written_as.get(name, name): place for name, place in known.items()}
    wanted = [*names.vframe, *names.world]
    wanted += [f"{stop}/{point}" for stop in sorted(stops) for point in names.rig]
    points = []
    for name in wanted:
        place = places.get(name) or rough.places.get(name)
        if place is not None:
            x, y = place
            points.append(
                {
                    "name": name,
                    "kind": kinds.get(name, "mark"),
                    "x": round(x, 3),
                    "y": round(y, 3),
                    "sure": name in places,
                }
            )
    return {"walls": rough.walls, "points": points}
