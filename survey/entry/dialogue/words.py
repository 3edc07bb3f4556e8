"""What both front ends say, in the same words."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from survey.entry.dialogue.answers import Answer
from survey.entry.dialogue.entry_session import EntrySession
from survey.entry.dialogue.guide import Progress
from survey.entry.record.entries import Entry, Person
from survey.entry.record.numbers import plain, signed_mm
from survey.entry.record.state import Pair
from survey.entry.room.targets import Target, stop_of

if TYPE_CHECKING:
    from survey.entry.room.checks import Verdict

COMMANDS = (
    ("5.378", "the distance, in metres or millimetres; comma or point"),
    ("7/O 3 5.378", "the distance of a pair that is not the next one"),
    ("u", "undo what was done last"),
    ("r 5.378", "the last reading again: this number replaces it"),
    ("r", "measure the last one again; r 7/O 3: that one"),
    ("k", "keep the last reading: it is what the display shows"),
    ("s REASON", "skip: this one cannot be measured"),
    ("j 7/X 3", "go on with 7/X–3; also: j 7/X, j 7"),
    ("p 27", "begin a further stop called 27"),
    ("n TEXT", "a remark about the last reading"),
    ("b BOB", "somebody else is at the laser from now on"),
    ("l", "list the readings of this station"),
    ("d", "list all doubtful readings"),
    ("i", "how far the work is"),
    ("?", "this list"),
    ("q", "end; go on later exactly here"),
)


def pair_text(target: Target) -> str:
    """'7/O → 3': from where to where."""
    return f"{target.start} → {target.end}"


def answer_lines(entry_session: EntrySession, answer: Answer) -> list[str]:
    """What to say of an answer, the most important first."""
    found = answer.verdict
    if found is None:
        return [answer.text]
    if found.status != "doubtful":
        off = "" if found.off is None else f" ({signed_mm(found.off)})"
        lines = [f"{answer.text}, {found.text}{off}"]
    else:
        lines = [f"{answer.text}: DOUBTFUL, {found.text}"]
        hint = advice(found)
        if hint:
            lines.append(f"{hint}; read the display again")
    others = [n for n in found.suspects if n != answer.entry.number]
    if others:
        lines.append(f"one of these may be wrong: {readings_text(entry_session, others)}")
    return lines


def advice(found: "Verdict") -> str:
    """What a doubtful reading may have been, hypotheses named as such."""
    parts = [f"would fit {plain(h.metres)} ({h.slip})" for h in found.hypotheses]
    parts += [f"would fit world point {name}" for name in found.other_ends]
    return "; ".join(parts)


def readings_text(entry_session: EntrySession, numbers: list[int], most: int = 6) -> str:
    """Readings by pair and value, a few of them."""
    entries = [entry_session.state.entries[n] for n in numbers[:most]]
    said = ", ".join(f"{e.start}–{e.end} {plain(e.metres or 0.0)}" for e in entries)
    return said + (f" and {len(numbers) - most} more" if len(numbers) > most else "")


def undone_text(undone: Entry | None) -> str:
    """What was taken back."""
    if undone is None:
        return "there is nothing to undo"
    what = f"{undone.start}–{undone.end} {undone.text}" if undone.start else undone.text
    return f"undone: {undone.kind} {what}"


def jumped_text(entry_session: EntrySession, target: Target, person: Person) -> str:
    """That the work goes on with a target, or that it has a reading and is not asked for."""
    numbers = entry_session.state.counting(target.pair)
    if not numbers or entry_session.guide.is_open_for(target, person):
        return f"going on with {target.start}–{target.end}"
    what = f"{target.start}–{target.end}"
    value = "a reading" if person.second else value_text(entry_session, target.pair, blind=False)
    return f"{what} has {value} already; r {target.start} {target.end} measures it again"


def disagreeing_text(entry_session: EntrySession, most: int = 6) -> str:
    """The pairs of which two people's entries disagree, without their values; '' if none."""
    pairs = entry_session.disagreeing()
    if not pairs:
        return ""
    said = ", ".join("–".join(sorted(pair)) for pair in pairs[:most])
    more = f" and {len(pairs) - most} more" if len(pairs) > most else ""
    return f"two entries disagree, measure again: {said}{more}"


def enough_text(entry_session: EntrySession, target: Target) -> str:
    """That a stop is good enough, and how much of it may be left out; '' while it is not."""
    status = entry_session.status(target)
    stop = stop_of(target)
    if status is None or not status.good_enough or not stop:
        return ""
    left = entry_session.guide.progress(entry_session.guide.targets_of(stop)).left
    if not left:
        return ""
    needed = "1 more reading is" if left == 1 else f"{left} more readings are"
    return f"stop {stop} is good enough: {needed} not needed"


def progress_text(progress: Progress) -> str:
    """'64 of 1312 done, 3 skipped'."""
    said = f"{progress.done} of {progress.done + progress.left} done"
    return said + (f", {progress.skipped} skipped" if progress.skipped else "")


def taken_over_text(entry_session: EntrySession) -> str:
    """That readings of a file were taken over; '' if none were."""
    count = entry_session.taken_over
    name = entry_session.readings_file.path.name
    return f"{count} reading(s) of {name} were taken over into the journal" if count else ""


def progress_of(
    entry_session: EntrySession, person: Person, targets: Sequence[Target] | None = None
) -> str:
    """How far a person's work is, at some targets or in all: readings, or blind second ones."""
    guide = entry_session.guide
    if person.second:
        return f"second entries: {progress_text(guide.second_progress(person, targets))}"
    return progress_text(guide.progress(targets))


def value_text(entry_session: EntrySession, pair: Pair, *, blind: bool) -> str:
    """The value of a pair as a list shows it: '5.378', '–'.

    For whom the first value is not to see: whether there is a second.
    """
    numbers = entry_session.state.counting(pair)
    if entry_session.state.disagrees(pair):
        return "two entries disagree"
    if blind:
        skipped = pair in entry_session.state.without_second
        return "done" if entry_session.state.has_second(pair) else "skipped" if skipped else "–"
    if not numbers:
        reason = entry_session.guide.skipped(pair)
        return "–" if reason is None else f"skipped: {reason}"
    return " / ".join(plain(entry_session.state.entries[n].metres or 0.0) for n in numbers)
