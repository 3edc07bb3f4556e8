"""The part of the survey's report that tells how the readings were taken."""

from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from itertools import pairwise
from statistics import median

import numpy as np

from survey.entry.dialogue.entry_session import EntrySession
from survey.entry.dialogue.words import readings_text
from survey.entry.record.entries import FROM_FILE, FROM_FILE_UNUSED, Entry
from survey.entry.record.numbers import plain
from survey.entry.record.readings_csv import csv_text
from survey.settings import SurveySettings
from validation.campaign.folder import Campaign
from validation.results import Finding, Section, Size, SystemResult, Table

PAUSE = 300.0
"""Seconds without a reading that are a break. A judgement: readings follow within a minute, and
moving to the next stop takes two or three."""
MOST_PLACES = 8
"""So many places of a person are named in the table. A judgement: one line of a report."""
SUBJECT = "field entry"


def entry_report(campaign: Campaign) -> SystemResult:
    """Findings and sections on how the readings were taken; none where there is no journal.

    Raises
    ------
    InputError
        If the journal was damaged.
    """
    settings = campaign.section("survey", SurveySettings)
    if not (campaign.folder / settings.entry.journal).exists():
        return SystemResult()
    entry_session = EntrySession.look(campaign)
    readings = [e for e in entry_session.journal.entries if e.kind == "reading"]
    if not readings:
        return SystemResult()
    tables = [
        _people(entry_session, readings),
        _places(readings),
        _fates(entry_session, readings),
    ]
    findings = [*_behind(entry_session), *_doubtful(entry_session), *_left(entry_session)]
    double = _double_entries(entry_session)
    if double:
        tables.append(_agreement_table(entry_session, double))
        findings.append(_agreement(entry_session, double))
    skipped = _skipped(entry_session)
    if skipped:
        tables.append(
            Table("Pairs not measured", ("reason", "pairs"), sorted(skipped.items()), ("", ""))
        )
    remarks = _remarks(entry_session)
    if remarks:
        heading = ("reading", "value [m]", "measured by", "remark")
        tables.append(Table("Remarks", heading, remarks, ("", "", "", "")))
    section = Section("How the readings were taken", tables)
    return SystemResult(findings=findings, sections=[section])


def _people(entry_session: EntrySession, readings: Sequence[Entry]) -> Table:
    """Who measured how much, when, and how quickly."""
    rows = []
    for person in dict.fromkeys(e.by for e in readings):
        own = [e for e in readings if e.by == person]
        times = _times(own)
        gaps = [b - a for a, b in pairwise(times) if b - a <= PAUSE]
        counting = sum(e.number in entry_session.state.counting(e.pair) for e in own)
        rows.append(
            (
                person or "not named",
                len(own),
                counting,
                _day(times[0]) if times else "",
                _day(times[-1]) if times else "",
                sum(gaps) / 60 if times else None,
                median(gaps) if gaps else None,
            )
        )
    return Table(
        "Who measured",
        (
            "person",
            "numbers entered",
            "readings that count",
            "first",
            "last",
            "at work [min]",
            "median between readings [s]",
        ),
        rows,
        ("", "", "", "", "", ".0f", ".0f"),
        note="At work: without breaks of more than 5 minutes.",
    )


def _places(readings: Sequence[Entry]) -> Table:
    """Where the laser stood for whom: the first few points and stops, and the last."""
    rows = []
    for person in dict.fromkeys(e.by for e in readings):
        starts = [e.start for e in readings if e.by == person]
        names = [f"stop {s.partition('/')[0]}" if "/" in s else s for s in starts]
        said = list(dict.fromkeys(names))
        if len(said) > MOST_PLACES:
            said = [*said[: MOST_PLACES - 1], "…", f"{said[-1]} ({len(said)} in all)"]
        rows.append((person or "not named", ", ".join(said)))
    return Table("What they measured", ("person", "laser on"), rows, ("", ""))


def _remarks(entry_session: EntrySession) -> list[tuple[str, str, str, str]]:
    """What people remarked on readings, in the order of these."""
    state = entry_session.state
    return [
        (f"{e.start}–{e.end}", plain(e.metres or 0.0), e.by, remark)
        for e in (state.entries[number] for number in sorted(state.notes))
        for remark in state.notes[e.number]
    ]


def _fates(entry_session: EntrySession, readings: Sequence[Entry]) -> Table:
    """What became of the numbers that were entered."""
    state = entry_session.state
    counts = (
        ("numbers entered", len(readings)),
        ("readings that count", sum(e.number in state.counting(e.pair) for e in readings)),
        ("replaced by a new reading", sum(e.number in state.replaced for e in readings)),
        ("taken back", sum(e.number in state.undone for e in readings)),
        ("set aside: the pair had a reading", sum(e.number in state.set_aside for e in readings)),
        ("kept although doubtful", len(state.kept)),
        ("refused: no possible distance", _count(entry_session, "refused")),
        (
            "taken over from a file",
            sum(e.device in (FROM_FILE, FROM_FILE_UNUSED) for e in readings),
        ),
    )
    return Table("Corrections", ("what", "number"), counts)


def _count(entry_session: EntrySession, kind: str) -> int:
    return sum(e.kind == kind for e in entry_session.journal.entries)


def _behind(entry_session: EntrySession) -> Iterable[Finding]:
    """The readings file must be what the journal says."""
    path = entry_session.readings_file.path
    text = path.read_text(encoding="utf-8-sig", errors="replace") if path.exists() else ""
    told = csv_text(entry_session.state)
    if text != told:
        yield Finding(
            "error",
            f"{path.name} is not what the journal says: it is behind, or was changed by hand. "
            "Start `gtval enter` once: it brings the file up to date, or says what was changed.",
            SUBJECT,
            "entry-file-differs",
            (Size("lines of the file less those of the journal", _lines(text) - _lines(told)),),
        )


def _lines(text: str) -> int:
    return len(text.splitlines())


def _doubtful(entry_session: EntrySession) -> Iterable[Finding]:
    """Readings that were doubtful in the room and were left so."""
    numbers = entry_session.doubtful()
    kept = [n for n in entry_session.state.kept if _counts(entry_session, n)]
    if numbers:
        yield Finding(
            "warning",
            f"{len(numbers)} reading(s) were doubtful in the room and neither kept nor measured "
            f"again: {readings_text(entry_session, numbers)}.",
            SUBJECT,
            "entry-doubtful",
            (Size("doubtful readings", len(numbers), "readings"),),
        )
    if kept:
        yield Finding(
            "note",
            f"{len(kept)} doubtful reading(s) were kept by the people in the room: "
            f"{readings_text(entry_session, kept)}.",
            SUBJECT,
            "entry-kept",
            (Size("readings kept", len(kept), "readings"),),
        )


def _counts(entry_session: EntrySession, number: int) -> bool:
    return number in entry_session.state.counting(entry_session.state.entries[number].pair)


def _left(entry_session: EntrySession) -> Iterable[Finding]:
    """How much of the plan was measured."""
    progress = entry_session.guide.progress()
    if progress.left:
        yield Finding(
            "note",
            f"{progress.left} planned pair(s) have no reading yet, {progress.done} have.",
            SUBJECT,
            "entry-plan",
            (Size("planned pairs without a reading", progress.left, "pairs"),),
        )


@dataclass(frozen=True)
class _Double:
    """A pair that two people entered: the values in their order, and how it ended."""

    pair: str
    first: float
    second: float
    agreed_at_once: bool
    settled: bool


def _double_entries(entry_session: EntrySession) -> list[_Double]:
    """All double entries."""
    state = entry_session.state
    found = []
    for pair, own in state.pairs.items():
        entries = [state.entries[n] for n in own.numbers]
        seconds = [e for e in entries if e.second]
        if not seconds:
            continue
        firsts = [e for e in entries if e.number < seconds[0].number]
        if not firsts:
            continue
        a, b = firsts[-1].metres or 0.0, seconds[0].metres or 0.0
        found.append(
            _Double(
                f"{firsts[-1].start}–{firsts[-1].end}",
                a,
                b,
                state.agree(a, b),
                not state.disagrees(pair),
            )
        )
    return found


def _agreement_table(entry_session: EntrySession, double: Sequence[_Double]) -> Table:
    """Rates of agreement, and the spread of two measurements from the two ends."""
    agreed = [d for d in double if d.agreed_at_once]
    differences = np.array([d.second - d.first for d in agreed])
    rows: list[tuple[str, str]] = [
        ("pairs entered by two people", str(len(double))),
        ("agreed at once", f"{len(agreed)} ({100 * len(agreed) / len(double):.1f} %)"),
        (
            "settled by a further reading",
            str(sum(d.settled and not d.agreed_at_once for d in double)),
        ),
        ("still open", str(sum(not d.settled for d in double))),
    ]
    if entry_session.settings.second == "measure" and len(agreed) > 1:
        spread = float(np.sqrt(np.mean(differences**2)) * 1000)
        rows.append(("rms difference of those that agreed [mm]", f"{spread:.1f}"))
    return Table(
        "Blind second entries",
        ("what", "value"),
        rows,
        note="The second person did not see the first value.",
    )


def _agreement(entry_session: EntrySession, double: Sequence[_Double]) -> Finding:
    """Whether double entries agree."""
    open_pairs = [d for d in double if not d.settled]
    if open_pairs:
        shown = ", ".join(f"{d.pair} {plain(d.first)} / {plain(d.second)}" for d in open_pairs[:6])
        return Finding(
            "warning",
            f"{len(open_pairs)} pair(s) have two entries that disagree and count as not "
            f"measured: {shown}.",
            SUBJECT,
            "entry-disagrees",
            (Size("pairs whose entries disagree", len(open_pairs), "pairs"),),
        )
    agreed = sum(d.agreed_at_once for d in double)
    total = len(double)
    done = entry_session.guide.progress().done
    return Finding(
        "good",
        f"{total} of {done} pairs were entered by two people without seeing one another's value; "
        f"{agreed} agreed at once, all others after a further reading.",
        SUBJECT,
        "entry-agrees",
        (Size("pairs that agreed at once", agreed, "pairs"),),
    )


def _skipped(entry_session: EntrySession) -> Counter[str]:
    """Why pairs were not measured, with their number."""
    guide = entry_session.guide
    reasons = (
        guide.skipped(target.pair)
        for station in guide.plan
        for target in station.targets
        if not entry_session.state.counting(target.pair)
    )
    return Counter(reason for reason in reasons if reason is not None)


def _times(entries: Iterable[Entry]) -> list[float]:
    """When readings were measured, seconds, in order; of those whose time is known."""
    found = []
    for entry in entries:
        with suppress(ValueError):
            found.append(datetime.fromisoformat(entry.when).timestamp())
    return sorted(found)


def _day(seconds: float) -> str:
    """Local day and time to the minute."""
    return datetime.fromtimestamp(seconds).astimezone().strftime("%Y-%m-%d %H:%M")
