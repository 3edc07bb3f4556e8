"""The logic of entering readings: what is recorded, what becomes of it, what is taken back.

It knows nothing of screens: the terminal and the page call the same methods and show what they
return. Every change goes to the journal first and is only then taken into account.
"""

import gc
import threading
import uuid
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Self

from survey.entry.dialogue.answers import Answer, same_text
from survey.entry.dialogue.entry_view import EntryView
from survey.entry.dialogue.file_changes import bring_together, refuse_sheet
from survey.entry.record.entries import MAX_NOTE, Entry, Kind
from survey.entry.record.journal import BehindError, Journal, NotRecordedError
from survey.entry.record.numbers import TypedDistance, both_units, parse_distance
from survey.entry.record.remembered import RememberedDoubts
from survey.entry.record.state import WAS_SET_ASIDE, Pair
from survey.entry.room.double import check_second
from survey.entry.room.further_points import with_world_point
from survey.entry.room.targets import Target, check_new_name, load_names
from survey.settings import SurveySettings
from validation.campaign.folder import Campaign
from validation.errors import GtvalError
from validation.page.people import MAX_NAME, Person, clean_text

if TYPE_CHECKING:
    pass

PREPARE_AFTER = 0.2
"""Seconds: the first question is on the screen by then."""


class EntrySession(EntryView):
    """Readings of a campaign being entered.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    journal : Journal
        Open for writing.
    """

    def __init__(self, campaign: Campaign, journal: Journal) -> None:
        super().__init__(campaign, journal)
        self.taken_over = 0
        """Rows of the readings file that the journal did not have when this was opened."""
        self.others: set[int] = set()
        """Entries that another process wrote to the journal while this one was open."""
        self._preparing: threading.Timer | None = None
        self._last_of: dict[str, Entry] = {}
        """The last number entered on each device, taken or asked about."""

    @classmethod
    def open(cls, campaign: Campaign, who: str = "", *, adopt: bool = False) -> Self:
        """The entry session of a campaign, as it was left.

        Parameters
        ----------
        campaign : Campaign
            The campaign.
        who : str
            Told to others who try to open it meanwhile.
        adopt : bool
            Take changes over that a person made in the readings file.

        Raises
        ------
        GtvalError
            If it is open elsewhere, cannot be written, is damaged, or the readings file was
            changed by hand and that is not to be taken over.
        """
        settings = campaign.section("survey", SurveySettings)
        load_names(campaign)  # a bad campaign is told before anything is made
        refuse_sheet(campaign, settings)
        journal = Journal.open(campaign.folder / settings.entry.journal, who)
        try:
            entry_session = cls(campaign, journal)
            bring_together(entry_session, adopt=adopt)
        except BaseException:
            journal.close()
            raise
        return entry_session

    @classmethod
    def look(cls, campaign: Campaign) -> Self:
        """The entry session as it is on the disk; nothing can be recorded in it."""
        settings = campaign.section("survey", SurveySettings)
        return cls(campaign, Journal.look(campaign.folder / settings.entry.journal))

    def close(self) -> None:
        """End it; the readings file is brought up to date."""
        if self._preparing is not None:
            self._preparing.cancel()
            self._preparing.join()  # a process must not end in the middle of an import
        self._remember()
        if self.journal.is_open:
            with suppress(NotRecordedError):
                self.catch_up()
            behind = self.readings_file.problem or self.others
            if behind and not self.readings_file.edited:
                self.readings_file.write(self.state, self.readings_file.held())
        self.journal.close()

    def prepare(self, *others: Callable[[], object]) -> threading.Thread:
        """A thread that makes the checks, and whatever else is slow, while nobody types yet.

        A moment later, so that it does not hold up the first question. What is there then stays,
        and need not be looked through for garbage again and again.
        """

        def make() -> None:
            for other in others:
                other()
            with self.changing:
                self.checks  # noqa: B018  (made when first asked for)
                self.readings_file.prepare(self.state)
            gc.freeze()

        self._preparing = threading.Timer(PREPARE_AFTER, make)
        self._preparing.daemon = True
        self._preparing.start()
        return self._preparing

    # -- what people do ---------------------------------------------------------------------

    def record(
        self,
        target: Target,
        text: str,
        person: Person,
        *,
        entry_id: str = "",
        again: bool = False,
        measured: str = "",
        sure: bool = False,
    ) -> Answer:
        """What became of a number; it is on the disk when this returns.

        Parameters
        ----------
        target : Target
            What it is the distance of.
        text : str
            As typed.
        person : Person
            Who measured, on which device.
        entry_id : str
            Made by the device; the same again is recorded once.
        again : bool
            Whether it replaces the reading that the pair has.
        measured : str
            When, if not now.
        sure : bool
            Whether a value that is that of the target just before is taken without asking.

        Raises
        ------
        GtvalError
            If the pair cannot be measured, the id is that of another reading, or nothing could
            be written.
        """
        if entry_id != clean_text(entry_id, MAX_NAME):
            raise GtvalError(f"the id of an entry is one word of at most {MAX_NAME} characters")
        entry_id = entry_id or uuid.uuid4().hex
        self.catch_up()
        if entry_id in self.state.by_id:
            return self._repeated(entry_id, target, text)
        self._check_pair(target.pair)
        if person.second:
            check_second(self.state, target.pair, person, self.settings.second)
        blind = person.second or self.state.disagrees(target.pair)
        entry = self._entry("reading", person, target, text)
        entry = replace(entry, id=entry_id, measured=clean_text(measured, MAX_NAME))
        try:
            typed = parse_distance(text, self.campaign.settings.instrument, self.survey.units)
        except ValueError as error:
            return Answer(self._write(replace(entry, kind="refused")), "refused", str(error))
        entry = replace(entry, metres=typed.metres, second=person.second)
        before, self._last_of[person.device] = self._last_of.get(person.device), entry
        if before and not (sure or again) and self._is_same(before, entry):
            said = same_text(before)
            return Answer(self._write(replace(entry, kind="refused", metres=None)), "refused", said)
        if blind:
            return self._blind_answer(self._write(entry))
        if again and self.state.counting(target.pair):
            entry = replace(entry, of=self.state.counting(target.pair)[-1])
        return self._checked(entry, typed)

    def undo(self, person: Person) -> Entry | None:
        """The entry taken back: this device's last; None where there is none."""
        last = self.state.last_action(person.device, self.others)
        if last is not None:
            self._write(replace(self._entry("undo", person), of=last.number))
        if last is not None and last.kind == "stop":
            self.guide.make_plan()
        return last

    def keep(self, number: int, person: Person) -> None:
        """Say that a doubtful reading, or one set aside, is meant.

        Raises
        ------
        GtvalError
            If there is no such reading.
        """
        aside = WAS_SET_ASIDE if number in self.state.set_aside else ""
        self._write(replace(self._about(number, "keep", person), text=aside))

    def note(self, number: int, text: str, person: Person) -> None:
        """A remark about a reading.

        Raises
        ------
        GtvalError
            If there is no such reading, or nothing is said.
        """
        said = clean_text(text, MAX_NOTE)
        if not said:
            raise GtvalError("the remark is empty")
        self._write(replace(self._about(number, "note", person), text=said))

    def skip(self, target: Target, reason: str, person: Person) -> None:
        """Do not measure a pair, or not a second time, for a reason."""
        self._check_pair(target.pair)
        entry = self._entry("skip", person, target, reason or "no reason given")
        self._write(replace(entry, second=person.second))

    def jump(self, target: Target, person: Person) -> None:
        """Go on with a target, also if it was to be skipped."""
        self._check_pair(target.pair)
        reason = self.guide.skipped(target.pair)
        of_second = person.second and target.pair in self.state.without_second
        kind: Kind = "jump" if reason is None and not of_second else "unskip"
        entry = self._entry(kind, person, target, reason or "")
        self._write(replace(entry, second=of_second))

    def begin_stop(self, name: str, person: Person) -> Target:
        """The first target of a further stop.

        Raises
        ------
        GtvalError
            If the name cannot be one, or is there already.
        """
        stop = check_new_name(clean_text(name, MAX_NAME), "stop", self.guide.names.stops)
        self._write(self._entry("stop", person, None, stop))
        self.guide.make_plan()
        target = self.guide.target(stop)
        self.jump(target, person)
        return target

    def add_world_point(self, name: str, person: Person) -> Target:
        """The first target of a further world point, which campaign.toml lists from now on.

        Raises
        ------
        GtvalError
            If the name cannot be one or is there already, or campaign.toml cannot be written.
        """
        point = check_new_name(clean_text(name, MAX_NAME), "mark", self.guide.names.points)
        with self.changing:
            self.campaign = with_world_point(self.campaign, point)
            self.survey = self.campaign.section("survey", SurveySettings)
            self._write(self._entry("mark", person, None, point))
            self._checks = None  # what was known of the room stands; it is made anew when needed
            self._remembered = RememberedDoubts(
                self.journal.path.with_suffix(".doubts"), self.campaign
            )
            self.guide.of_campaign(self.campaign)
        target = self.guide.target(f"{self.guide.names.vframe[0]} {point}")
        self.jump(target, person)
        return target

    def begin(self, person: Person) -> None:
        """Note that somebody began to enter readings."""
        self._write(self._entry("begin", person))

    def end(self, person: Person) -> None:
        """Note that somebody ended."""
        self._write(self._entry("end", person))

    # -- inside -----------------------------------------------------------------------------

    def _entry(
        self, kind: Kind, person: Person, target: Target | None = None, text: str = ""
    ) -> Entry:
        return Entry(
            kind,
            by=clean_text(person.name, MAX_NAME),
            device=clean_text(person.device, MAX_NAME),
            start=target.start if target else "",
            end=target.end if target else "",
            text=clean_text(text, MAX_NOTE),
        )

    def _about(self, number: int, kind: Kind, person: Person) -> Entry:
        """An entry about a reading."""
        reading = self.state.entries.get(number)
        if reading is None or reading.kind != "reading":
            raise GtvalError(f"there is no reading number {number}")
        entry = self._entry(kind, person, Target(reading.start, reading.end))
        return replace(entry, of=number)

    def _write(self, entry: Entry) -> Entry:
        """To the journal, then to everything that follows from it."""
        with self.changing:
            written = self._append(entry)
            pairs = self._apply(written)
            self.readings_file.follow(written, self.state)
            if self._checks is not None and written.kind in ("reading", "undo", "keep"):
                # Kept at once, for a start after a crash.
                self._checks.doubtful(pairs)
                self._remember()
            self.version += 1
        return written

    def _append(self, entry: Entry) -> Entry:
        """To the journal, after what another process has written there."""
        while True:
            self.catch_up()
            # The lines as they are before, so that those that go can be told.
            self.readings_file.prepare(self.state)
            try:
                return self.journal.append(entry)
            except BehindError:
                continue

    def catch_up(self) -> None:
        """Take in what another process has written to the journal."""
        with self.changing:
            for entry in self.journal.catch_up():
                self.others.add(entry.number)
                self.readings_file.prepare(self.state)
                self._apply(entry)
                self.readings_file.expect(entry, self.state)
                if entry.kind == "stop":
                    self.guide.make_plan()
                self.version += 1

    def _apply(self, entry: Entry) -> set[Pair]:
        """Take an entry of the journal into account; the pairs that it changes."""
        self.state.apply(entry)
        pairs = {entry.pair, self.state.entries.get(entry.of, entry).pair}
        if self._checks is not None:
            for pair in pairs:
                self._checks.update(pair)
        return pairs

    def _checked(self, entry: Entry, typed: TypedDistance) -> Answer:
        """Record a reading and say whether it fits what was known without it."""
        expected = self.checks.expect(entry)
        entry = self._write(entry)
        echo = f"{entry.start}–{entry.end} {both_units(typed.metres)}"
        if entry.number in self.state.set_aside:
            return Answer(entry, "set aside", self._already_measured(entry, echo))
        ends = (target.end for target in self.guide.targets_from(entry.start))
        return Answer(entry, "recorded", echo, self.checks.verdict(entry, typed, expected, ends))

    @staticmethod
    def _is_same(before: Entry, entry: Entry) -> bool:
        """Whether a value was entered for another pair just before: sent twice, perhaps.

        Asked once: entered again for the same pair, it is meant.
        """
        return before.metres == entry.metres and before.pair != entry.pair

    def _repeated(self, entry_id: str, target: Target, text: str) -> Answer:
        """The answer to an entry that was sent once more."""
        known = self.state.entries[self.state.by_id[entry_id]]
        if known.pair != target.pair or known.text != clean_text(text, MAX_NOTE):
            raise GtvalError("NOT recorded: the id of this entry is that of another one")
        return Answer(known, "repeated", "this entry is there already")

    def _already_measured(self, entry: Entry, echo: str) -> str:
        first = self.state.entries[self.state.counting(entry.pair)[0]]
        return (
            f"{echo} is set aside: {first.by or 'somebody'} entered "
            f"{both_units(first.metres or 0.0)} for it already"
        )

    def _blind_answer(self, entry: Entry) -> Answer:
        """Whether two people agree; no value is shown where they do not."""
        what = f"{entry.start}–{entry.end}"
        if not self.state.disagrees(entry.pair):
            return Answer(entry, "agrees", f"{what}: both agree, {both_units(entry.metres or 0)}")
        return Answer(
            entry, "disagrees", f"{what}: the two entries disagree; measure or read it again"
        )

    def _check_pair(self, pair: Pair) -> None:
        """Raise where a pair is not among the points of the survey."""
        if not self.guide.names.may_be_measured(pair):
            raise GtvalError(f"{' and '.join(sorted(pair))} are no pair of points to measure")

    def append_only(self, entry: Entry) -> Entry:
        """To the journal without writing the readings file anew."""
        written = self.journal.append(entry)
        self._apply(written)
        self.readings_file.take_in(written, self.state)
        return written
