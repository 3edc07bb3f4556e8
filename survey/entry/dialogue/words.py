"""What both front ends say, in the same words."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from survey.entry.dialogue.answers import Answer
from survey.entry.dialogue.entry_session import EntrySession
from survey.entry.dialogue.entry_view import EntryView
from survey.entry.dialogue.guide import Progress
from survey.entry.record.entries import Entry
from survey.entry.record.numbers import plain, signed_mm
from survey.entry.record.state import Pair
from survey.entry.room.targets import Target, stop_of
from validation.page.people import Person

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
    ("w 13", "a further world point called 13"),
    ("n TEXT", "a remark about the last reading"),
    ("b BOB", "somebody else is at the laser from now on"),
    ("l", "list the readings of this station"),
    ("d", "list all doubtful readings, and those that nothing checks yet"),
    ("f", "what somebody changed in readings.csv meanwhile; f take, f aside"),
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
        which = "this may be wrong instead" if len(others) == 1 else "one of these may be wrong"
        lines.append(f"{which}: {doubts_text(entry_session, others)}")
    return lines


def doubts_text(entry_session: EntryView, numbers: list[int], most: int = 6) -> str:
    """Doubtful readings, a few of them, each with what it would have to be for the others."""
    said = []
    for number in numbers[:most]:
        fitting = entry_session.would_fit(number)
        text = readings_text(entry_session, [number])
        said.append(f"{text} would fit {fitting}" if fitting else text)
    more = f" and {len(numbers) - most} more" if len(numbers) > most else ""
    return ", ".join(said) + more


def unchecked_text(entry_session: EntryView) -> str:
    """How many readings nothing checks yet, and of what; '' if there are none."""
    numbers = entry_session.unchecked()
    if not numbers:
        return ""
    entries = [entry_session.state.entries[n] for n in numbers]
    marks = list(dict.fromkeys(_checked_by(e, entry_session) for e in entries))
    shown = ", ".join(marks[:6]) + (" and others" if len(marks) > 6 else "")
    count = "1 reading" if len(numbers) == 1 else f"{len(numbers)} readings"
    return f"{count} nothing can check yet: of {shown}"


def _checked_by(entry: Entry, entry_session: EntryView) -> str:
    """The mark or world point whose further readings would check one."""
    ends = (entry.start, entry.end)
    world = entry_session.guide.names.world
    return next((e for e in ends if "/" in e), next((e for e in ends if e in world), ends[0]))


def advice(found: "Verdict") -> str:
    """What a doubtful reading may have been, hypotheses named as such."""
    parts = [f"would fit {plain(h.metres)} ({h.slip})" for h in found.hypotheses]
    parts += [f"would fit world point {name}" for name in found.other_ends]
    return "; ".join(parts)


def readings_text(entry_session: EntryView, numbers: list[int], most: int = 6) -> str:
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
    """'64 of 1312 readings done, 3 skipped'."""
    said = f"{progress.done} of {progress.done + progress.left} readings done"
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
