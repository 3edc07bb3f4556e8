"""The terminal front end: one number and Enter, whatever else one letter."""

import os
import select
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, TextIO

from survey.entry.dialogue.answers import Answer
from survey.entry.dialogue.entry_session import EntrySession
from survey.entry.dialogue.file_changes import (
    put_edited_file_aside,
    take_edited_file,
    warnings,
)
from survey.entry.dialogue.words import (
    COMMANDS,
    answer_lines,
    disagreeing_text,
    doubts_text,
    enough_text,
    jumped_text,
    pair_text,
    progress_of,
    taken_over_text,
    unchecked_text,
    undone_text,
    value_text,
)
from survey.entry.record.entries import Entry
from survey.entry.room.targets import Target, stop_of
from validation.errors import GtvalError
from validation.page.people import MAX_NAME, Person, clean_text
from validation.text_files.lengths import with_unit

if TYPE_CHECKING:
    from rich.console import Console


class TerminalEntry:
    """Readings entered line by line, from a keyboard, a paste or a pipe.

    Every number belongs to the target that was shown before it, and the next target comes after
    it whether it is doubtful or not: so a line that nobody looked at can never shift the others.
    At a keyboard, doubtful readings come back before the laser is moved.

    Parameters
    ----------
    entry_session : EntrySession
        Where they are recorded.
    person : Person
        Who is at the laser.
    source : text stream
        Where lines come from; a keyboard if it is a terminal.
    """

    def __init__(self, entry_session: EntrySession, person: Person, source: TextIO) -> None:
        self._session = entry_session
        self._person = person
        self._source = source
        self._keyboard = source.isatty()
        self._last: Entry | None = None
        self._again: Target | None = None
        self._asked: Target | None = None
        self._enough: set[str] = set()
        self._standing = ""

    def run(self) -> int:
        """Exit status: 0, or 2 where a line of a pipe could not be taken.

        At a keyboard a bad line is said and the rest of a paste dropped; from a pipe nothing
        after a bad line is recorded, as it might belong to another target.
        """
        taken_over = taken_over_text(self._session)
        if taken_over:
            self._say(taken_over)
        if self._keyboard:
            self._welcome()
            # numpy and rich take a while to load; the first number can be typed meanwhile.
            self._session.prepare(lambda: self._console)
        number = 0
        while True:
            line = self._read()
            if line is None:
                break
            number += 1
            try:
                going_on = self._take(line.strip())
            except GtvalError as error:
                self._drop_rest_of_paste()
                self._say(f"{error}", "bold red")
                going_on = self._keyboard
                if not self._keyboard:
                    self._say(f"Stopped at line {number}; nothing after it was recorded.", "red")
                    return 2
            if not going_on:
                break
        self._goodbye()
        return 0

    # -- lines ------------------------------------------------------------------------------

    def _read(self) -> str | None:
        """The next line; None at the end."""
        self._asked = self._target()
        if not self._keyboard:
            return self._source.readline().removeprefix("\ufeff") or None
        what = ""
        if self._person.second:
            what = "nothing left that somebody else measured; q to end"
        if self._asked is None and not self._person.second:
            what = self._end_text()
        if self._asked is not None:
            what = pair_text(self._asked)
            if self._standing not in ("", self._asked.start):
                self._say(f"Move the laser to {self._asked.start}.")
                self._standing = ""  # said once
        try:
            return input(f"{what}  ")
        except (EOFError, KeyboardInterrupt):
            print()  # noqa: T201  (leave the line of the prompt)
            return None

    def _end_text(self) -> str:
        """That all is done; or how much of it is doubtful, or two people disagree on."""
        open_still = len(self._session.doubtful()) + len(self._session.disagreeing())
        if open_still:
            return f"{open_still} doubtful still (d lists them): r, k or j, q to end"
        return "all done; j to go on elsewhere, q to end"

    def _target(self) -> Target | None:
        """What the next number is the distance of.

        A pipe or a paste was written before anything was doubtful: its numbers follow the plan.
        """
        look_again = self._keyboard and not self._is_paste()
        guide = self._session.guide
        return self._again or guide.next_target(self._person, look_again=look_again)

    def _is_paste(self) -> bool:
        """Whether more is waiting already than anyone types."""
        return os.name == "posix" and bool(select.select([self._source], [], [], 0)[0])

    def _take(self, line: str) -> bool:
        """Do what a line says; False to end."""
        if not line:
            return True
        word, _, rest = line.partition(" ")
        if word.lower() == "q":
            return False
        action = self._actions().get(word.lower())
        if action is not None:
            action(rest.strip())
        else:
            self._take_number(line)
        return True

    def _take_number(self, line: str) -> None:
        """Record '5.378', or '7/O 3 5.378' for a pair that is named, also '7/O–3 5.378'."""
        words = line.replace(";", " ").replace("–", " ").split()
        if len(words) >= 3 and with_unit(line) is None:
            named = self._session.guide.target(f"{words[0]} {words[1]}")
            self._record(named, " ".join(words[2:]), again=False)
            return
        target = self._asked
        if target is None:
            raise GtvalError("everything is done; say j and where to go on, or q to end")
        if words[0].isalpha():
            raise GtvalError(f"there is no command '{words[0][:40]}'; ? lists the commands")
        self._record(target, line, again=self._is_measured(target))

    def _is_measured(self, target: Target) -> bool:
        """Whether a target that was asked for has a reading, which the new one replaces."""
        return bool(self._session.state.counting(target.pair))

    def _actions(self) -> dict[str, Callable[[str], None]]:
        return {
            "u": self._undo,
            "r": self._repeat,
            "k": self._keep,
            "s": self._skip,
            "j": self._jump,
            "p": self._begin_stop,
            "w": self._add_world_point,
            "f": self._file,
            "n": self._note,
            "b": self._by,
            "l": self._list,
            "d": self._list_doubtful,
            "i": self._info,
            "?": self._help,
            "h": self._help,
        }

    # -- actions ----------------------------------------------------------------------------

    def _record(self, target: Target, text: str, *, again: bool) -> None:
        entry_session = self._session
        # A list was written before: nobody is there to be asked.
        sure = not self._keyboard
        answer = entry_session.record(target, text, self._person, again=again, sure=sure)
        if answer.outcome == "refused":
            raise GtvalError(answer.text)
        self._again = None
        self._standing = target.start
        self._last = answer.entry
        self._tell(answer)
        self._tell_how_well(target)
        self._tell_if_enough(target)

    def _undo(self, _: str) -> None:
        undone = self._session.undo(self._person)
        self._again = None
        if undone is not None and self._last is not None and undone.number == self._last.number:
            self._last = None
        self._say(undone_text(undone), "yellow")

    def _repeat(self, text: str) -> None:
        """Measure the last reading again, or one that is named: 'r', 'r 5.378', 'r 7/O 3'."""
        words = text.split()
        if len(words) >= 2 and words[0] in self._session.guide.names.points:
            target = self._session.guide.target(f"{words[0]} {words[1]}")
            text = " ".join(words[2:])
        else:
            last = self._last_reading()
            target = Target(last.start, last.end)
        if text:
            self._record(target, text, again=True)
        else:
            self._again = target

    def _keep(self, _: str) -> None:
        last = self._last_reading()
        self._session.keep(last.number, self._person)
        self._say(f"kept: {last.start}–{last.end}", "green")

    def _skip(self, reason: str) -> None:
        target = self._asked
        if target is not None:
            self._session.skip(target, reason, self._person)
            self._again = None
            self._say(f"skipped: {pair_text(target)}", "yellow")

    def _jump(self, where: str) -> None:
        target = self._session.guide.target(where)
        self._session.jump(target, self._person)
        self._again = None
        if len(where.split()) > 1:
            self._say(jumped_text(self._session, target, self._person))

    def _begin_stop(self, name: str) -> None:
        self._session.begin_stop(name, self._person)

    def _add_world_point(self, name: str) -> None:
        target = self._session.add_world_point(name, self._person)
        self._again = None
        self._say(
            f"{target.end} is in campaign.toml now; going on with {pair_text(target)}", "green"
        )

    def _file(self, what: str) -> None:
        """What somebody changed in the readings file while the entry runs."""
        if what == "take":
            self._say(take_edited_file(self._session), "green")
        elif what == "aside":
            self._say(put_edited_file_aside(self._session), "green")
        elif what:
            raise GtvalError("say f take, or f aside")
        else:
            for text in warnings(self._session) or ["nobody else changed the readings file"]:
                self._say(text, "yellow")

    def _note(self, text: str) -> None:
        last = self._last_reading()
        self._session.note(last.number, text, self._person)
        self._say(f"noted at {last.start}–{last.end}", "green")

    def _by(self, name: str) -> None:
        said = clean_text(name, MAX_NAME)
        if not said:
            raise GtvalError("say who is at the laser: b BOB")
        self._person = replace(self._person, name=said)
        self._session.begin(self._person)
        self._say(f"at the laser: {said}", "green")

    def _list(self, _: str) -> None:
        target = self._asked or self._session.guide.plan[0].targets[0]
        blind = self._person.second
        doubtful = set() if blind else set(self._session.doubtful())
        for one in self._session.guide.station_of(target, self._person).targets:
            value = value_text(self._session, one.pair, blind=blind)
            marked = doubtful & set(self._session.state.counting(one.pair))
            self._say(f"{one.start}–{one.end}  {value}{'  DOUBTFUL' if marked else ''}")

    def _list_doubtful(self, _: str) -> None:
        numbers = [] if self._person.second else self._session.doubtful()
        if not numbers and not self._person.second:
            self._say("no reading is doubtful", "green")
        for number in numbers:
            self._say(doubts_text(self._session, [number]), "bold red")
        self._say_disagreeing()
        if not self._person.second:
            self._say_unchecked()

    def _say_unchecked(self) -> None:
        said = unchecked_text(self._session)
        if said:
            self._say(said, "yellow")

    def _say_disagreeing(self) -> None:
        said = disagreeing_text(self._session)
        if said:
            self._say(said, "bold red")

    def _info(self, _: str) -> None:
        self._say(progress_of(self._session, self._person))
        target = self._asked
        status = None if target is None or self._person.second else self._session.status(target)
        if status is not None:
            self._say(status.text)
        if not self._person.second:
            self._say_unchecked()

    def _help(self, _: str) -> None:
        for command, meaning in COMMANDS:
            self._say(f"  {command:12} {meaning}")

    def _last_reading(self) -> Entry:
        """The reading that was entered last here.

        Raises
        ------
        GtvalError
            If there is none.
        """
        if self._last is None:
            raise GtvalError("no reading was entered yet in this run; say j and which one")
        return self._last

    # -- what is shown ----------------------------------------------------------------------

    def _tell(self, answer: Answer) -> None:
        lines = answer_lines(self._session, answer)
        doubtful = answer.needs_a_look
        if doubtful and self._keyboard:
            self._console.bell()
        first = "!!" if doubtful else "ok"
        self._say(f"{first} {lines[0]}", "bold red" if doubtful else "green")
        for line in lines[1:]:
            self._say(f"   {line}", "red")
        for text in warnings(self._session):
            self._say(f"   {text}", "yellow")

    def _tell_how_well(self, target: Target) -> None:
        """Redundancy, m0 and sigmas of the stop or world point, for who can read them."""
        if not self._keyboard or self._person.second:
            return
        status = self._session.status(target)
        if status is not None:
            self._say(f"   {status.text}", "dim")

    def _tell_if_enough(self, target: Target) -> None:
        """Say once that a stop is as exact as planned."""
        stop = stop_of(target)
        if not stop or stop in self._enough or self._person.second:
            return
        said = enough_text(self._session, target)
        if not said:
            return
        self._enough.add(stop)
        after = self._session.guide.stop_after(stop, self._person)
        self._say(
            f"{said}{f'; j {after} goes on with stop {after}' if after else ''}", "bold green"
        )

    def _welcome(self) -> None:
        entry_session = self._session
        if entry_session.journal.recovered_bytes:
            self._say("An unfinished last line of the journal was cut off.", "yellow")
        name = entry_session.campaign.settings.name
        self._say(f"{name}: {progress_of(entry_session, self._person)}")
        role = "blind second entry" if self._person.second else "at the laser"
        who = self._person.name or "nobody named (b BOB names somebody)"
        self._say(f"{who}, {role}. ? lists the commands.")

    def _goodbye(self) -> None:
        entry_session = self._session
        entry_session.guide.next_target(self._person)  # the next start asks this at once
        self._say(progress_of(entry_session, self._person))
        if self._person.second or not entry_session.state.pairs:
            return
        numbers = entry_session.doubtful()
        if numbers:
            self._say(f"{len(numbers)} doubtful: {doubts_text(entry_session, numbers)}", "bold red")
        self._say_disagreeing()
        self._say_unchecked()

    def _say(self, text: str, style: str = "") -> None:
        """One line, as it is: nothing in it is taken as markup."""
        if style:
            self._console.print(text, style=style, markup=False, highlight=False)
        else:
            sys.stdout.write(f"{text}\n")
        sys.stdout.flush()

    @cached_property
    def _console(self) -> "Console":
        """For what is coloured; nothing is before the first question."""
        from validation.report.terminal import console  # noqa: PLC0415  (slow to import)

        return console()

    def _drop_rest_of_paste(self) -> None:
        """Forget the lines after a bad one: they would go to the wrong targets."""
        try:
            import termios  # noqa: PLC0415  (not on Windows)
        except ImportError:
            return
        if self._keyboard:
            termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)
