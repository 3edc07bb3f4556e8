"""Campaigns entered by a simulated person who goes wrong at one number in a hundred."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np
from entry_rooms import ANN, EntryRoom, entry_room
from trials.typing_errors import TYPING_ERRORS, mistyped

from survey.entry.dialogue.answers import Answer
from survey.entry.dialogue.entry_session import EntrySession
from survey.entry.record.numbers import parse_distance
from survey.entry.room.targets import Target, stop_of

LARGE = 0.03
"""An error of so many metres or more must be noticed."""
KINDS = (*TYPING_ERRORS, "wrong point", "previous number")
"""Digits exchanged, left out, doubled, the point misplaced (as when metres and millimetres are
mixed up); the laser on another world point; the number before typed once more."""


@dataclass
class Slip:
    """A wrong number.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    size : float
        Typed less shown, metres; infinite where the text was no possible distance.
    earlier : int
        Readings of the same stop (or world point) before it.
    of_stop : bool
        Whether it was a reading of a stop.
    at_once : bool
        Whether the answer to it said that something is wrong.
    of_mark : int
        Readings of the same mark before it.
    unnoticed : bool
        Whether it was still there and not doubtful when the stop was left.
    end : {"corrected", "named", "left"}
        What became of it: not in the readings file at the end; there, but suspected by the
        adjustment of all readings; there, and not suspected.
    """

    kind: str
    size: float
    earlier: int
    of_stop: bool
    at_once: bool
    of_mark: int = 0
    unnoticed: bool = False
    end: Literal["corrected", "named", "left"] = "corrected"

    @property
    def is_large(self) -> bool:
        return abs(self.size) > LARGE


@dataclass
class Tally:
    """What happened in some campaigns.

    Parameters
    ----------
    readings : int
        Correct numbers typed.
    false_alarms : int
        Alarms at correct numbers while nothing typed was wrong in what they were checked with.
    slips : list of Slip
        The wrong ones.
    """

    readings: int = 0
    false_alarms: int = 0
    slips: list[Slip] = field(default_factory=list)

    def add(self, other: "Tally") -> None:
        self.readings += other.readings
        self.false_alarms += other.false_alarms
        self.slips += other.slips

    def first_of_marks(self) -> list[Slip]:
        """Errors to be noticed in the first three readings of a mark."""
        return [s for s in self.slips if s.is_large and s.of_stop and s.of_mark < 3]

    def large(self, *, of_stop: bool, earlier: int) -> list[Slip]:
        """Errors to be noticed, with so many earlier readings or more."""
        return [
            s for s in self.slips if s.is_large and s.of_stop == of_stop and s.earlier >= earlier
        ]


class Typist:
    """A person who types what the instrument shows, now and then wrongly, and heeds alarms."""

    def __init__(
        self, room: EntryRoom, rng: np.random.Generator, rate: float, *, first: bool = False
    ) -> None:
        self.room, self.rng, self.rate = room, rng, rate
        self.entry_session: EntrySession = room.open()
        self.tally = Tally()
        self.only_first = first
        self.wrong: dict[int, Slip] = {}
        self.previous = ""

    def run(self) -> Tally:
        stop = ""
        while (target := self.entry_session.guide.next_target(ANN)) is not None:
            if stop_of(target) != stop:
                self.leave(stop)
                stop = stop_of(target)
            if target.pair not in self.room.shown:
                self.entry_session.skip(target, "not seen", ANN)
                continue
            again = bool(self.entry_session.state.counting(target.pair))
            answer = self.type(target, again=again)
            if again and answer.needs_a_look and answer.outcome == "recorded":
                self.entry_session.keep(answer.entry.number, ANN)
        self.leave(stop)
        self.judge_the_rest()
        self.entry_session.close()
        return self.tally

    def leave(self, stop: str) -> None:
        """Note the wrong readings of a stop that nothing says are wrong when it is left."""
        state = self.entry_session.state
        doubtful = set(self.entry_session.doubtful()) | state.kept
        for number, slip in self.live_wrong().items():
            entry = state.entries[number]
            if stop and stop_of(Target(entry.start, entry.end)) == stop:
                slip.unnoticed = number not in doubtful

    def type(self, target: Target, *, again: bool) -> Answer:
        """Type one number, and look again at what is said to be doubtful."""
        answer = self.once(target, again=again)
        if answer.outcome == "refused":
            return self.once(target, again=again)
        if not answer.needs_a_look or again:
            return answer
        suspects = answer.verdict.suspects if answer.verdict else ()
        here = (answer.entry.number,) if answer.verdict.status == "doubtful" else ()
        for number in dict.fromkeys((*here, *suspects[:4])):
            entry = self.entry_session.state.entries[number]
            if number not in self.entry_session.state.counting(entry.pair):
                continue
            self.once(Target(entry.start, entry.end), again=True, in_answer=True)
        return answer

    def once(self, target: Target, *, again: bool, in_answer: bool = False) -> Answer:
        """Type a number, rightly or wrongly, and count what comes of it."""
        shown = self.room.shown[target.pair]
        kind, text = "", shown
        earlier = self.readings_before(target)
        of_mark = sum(
            bool(self.entry_session.state.counting(one.pair))
            for one in self.entry_session.guide.targets_from(target.start)
            if one.pair != target.pair
        )
        may = not self.only_first or (stop_of(target) and of_mark < 3 and not (again or in_answer))
        if may and self.rng.uniform() < self.rate:
            kind, text = self.go_wrong(target, shown)
        clean = not self.wrong_around(target)
        answer = self.entry_session.record(target, text, ANN, again=again)
        self.previous = text
        if not kind:
            self.tally.readings += 1
            if answer.needs_a_look and clean and not (in_answer or again):
                self.tally.false_alarms += 1
            return answer
        size = np.inf
        if answer.entry.metres is not None:
            instrument = self.entry_session.campaign.settings.instrument
            size = parse_distance(text, instrument).metres - float(shown)
        if abs(size) > 1e-9:
            of_stop = "/" in target.start + target.end
            slip = Slip(kind, size, earlier, of_stop, answer.needs_a_look, of_mark)
            self.tally.slips.append(slip)
            if answer.outcome == "recorded":
                self.wrong[answer.entry.number] = slip
        return answer

    def go_wrong(self, target: Target, shown: str) -> tuple[str, str]:
        """A kind of error that is possible here, drawn at random, and what is typed then."""
        others = [
            self.room.shown[one.pair]
            for one in self.entry_session.guide.targets_from(target.start)
            if one.pair != target.pair and one.pair in self.room.shown
        ]
        made: dict[str, Callable[[], list[str]]] = {
            kind: lambda kind=kind: mistyped(shown, kind) for kind in TYPING_ERRORS
        }
        made["wrong point"] = lambda: others
        made["previous number"] = lambda: [self.previous] if self.previous else []
        texts: list[str] = []
        while not texts:
            kind = KINDS[int(self.rng.integers(len(KINDS)))]
            texts = made[kind]()
        return kind, texts[int(self.rng.integers(len(texts)))]

    def live_wrong(self) -> dict[int, Slip]:
        state = self.entry_session.state
        return {
            n: slip for n, slip in self.wrong.items() if n in state.counting(state.entries[n].pair)
        }

    def wrong_around(self, target: Target) -> bool:
        """Whether a wrong reading is among those that a target is checked with."""
        key = self.entry_session.checks.knowledge.group_key(target.pair)
        keys = {
            self.entry_session.checks.knowledge.group_key(self.entry_session.state.entries[n].pair)
            for n in self.live_wrong()
        }
        worlds = {name for name in keys if not name.endswith("/")}
        return key in keys or (key.endswith("/") and bool(worlds))

    def readings_before(self, target: Target) -> int:
        knowledge, state = self.entry_session.checks.knowledge, self.entry_session.state
        key = knowledge.group_key(target.pair)
        return sum(
            pair != target.pair and knowledge.group_key(pair) == key and bool(state.counting(pair))
            for pair in state.pairs
        )

    def judge_the_rest(self) -> None:
        """Say of each error still there whether the survey's own search for blunders names it."""
        remaining = self.live_wrong()
        if not remaining:
            return
        from survey.estimation.solve import solve_survey
        from survey.readings.readings import load_readings
        from survey.settings import SurveySettings

        campaign = self.entry_session.campaign
        settings = campaign.section("survey", SurveySettings)
        file = load_readings(campaign, settings)
        assert file is not None
        base = campaign.settings
        solution = solve_survey(base.vframe, base.robot_frame, file.used, settings.world_points)
        named = {
            frozenset((solution.used.start[i], solution.used.end[i]))
            for suspicion in solution.suspicions
            for i in suspicion.candidates
        }
        for number, slip in remaining.items():
            pair = self.entry_session.state.entries[number].pair
            slip.end = "named" if pair in named else "left"


def simulate_entry(seed: int, stops: int = 2, rate: float = 0.01, *, first: bool = False) -> Tally:
    """A whole campaign entered with typing errors; ``first``: in first readings of marks alone."""
    with TemporaryDirectory() as folder:
        room = entry_room(seed, stops, Path(folder) / "room")
        return Typist(room, np.random.default_rng([7, seed]), rate, first=first).run()


def table(tally: Tally) -> Iterable[str]:
    """Shares by kind of error, of those over 3 cm."""
    yield f"{'':18}{'after the third reading of a stop':>36}{'anywhere':>42}"
    yield (
        f"{'errors over 3 cm':18}{'errors':>12}{'at once':>12}{'share':>12}"
        f"{'errors':>12}{'at once':>10}{'in the end':>12}{'left':>8}"
    )
    for kind in (*KINDS, "all"):
        own = [s for s in tally.slips if s.is_large and kind in (s.kind, "all")]
        late = [s for s in own if s.of_stop and s.earlier >= 3]
        yield (
            f"{kind:18}{len(late):12}{_share(s.at_once for s in late)}{'':0}"
            f"{len(own):12}{_share((s.at_once for s in own), 10)}"
            f"{_share((s.end != 'left' for s in own), 12)}{sum(s.end == 'left' for s in own):8}"
        )
    alarms = tally.false_alarms
    rate = alarms / tally.readings
    yield f"false alarms: {alarms} of {tally.readings} correct readings, {rate:.3%}"


def _share(flags: Iterable[bool], width: int = 12) -> str:
    found = list(flags)
    return f"{np.mean(found) if found else np.nan:{width}.2%}"
