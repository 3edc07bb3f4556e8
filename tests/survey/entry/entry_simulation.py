"""Campaigns entered by a simulated person who mistypes one number in a hundred."""

from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from entry_rooms import ANN, EntryRoom, entry_room

from data_samples.typing_errors import draw_mistyped
from survey.entry.entry_session import Answer, EntrySession
from survey.entry.numbers import parse_distance
from survey.entry.targets import Target

LARGE = 0.03
"""An error of so many metres or more must be noticed."""


@dataclass(frozen=True)
class Slip:
    """A mistyped number.

    Parameters
    ----------
    size : float
        Typed less shown, metres; infinite where the text was no possible distance.
    earlier : int
        Readings of the same stop (or world point) before it.
    of_stop : bool
        Whether it was a reading of a stop.
    at_once : bool
        Whether the answer to it said that something is wrong.
    first_of_mark : bool
        Whether its mark had no reading before.
    """

    size: float
    earlier: int
    of_stop: bool
    at_once: bool
    first_of_mark: bool


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
        The mistyped ones.
    left : list of (float, bool)
        Errors that were still in the readings file at the end, and whether the adjustment of all
        readings suspects them.
    """

    readings: int = 0
    false_alarms: int = 0
    slips: list[Slip] = field(default_factory=list)
    left: list[tuple[float, bool]] = field(default_factory=list)

    def add(self, other: "Tally") -> None:
        self.readings += other.readings
        self.false_alarms += other.false_alarms
        self.slips += other.slips
        self.left += other.left

    def large(self, *, of_stop: bool, earlier: int) -> list[Slip]:
        """Errors to be noticed, with so many earlier readings or more."""
        return [
            s
            for s in self.slips
            if abs(s.size) > LARGE and s.of_stop == of_stop and s.earlier >= earlier
        ]


class Typist:
    """A person who types what the instrument shows, now and then wrongly, and heeds alarms."""

    def __init__(self, room: EntryRoom, rng: np.random.Generator, rate: float) -> None:
        self.room, self.rng, self.rate = room, rng, rate
        self.entry_session: EntrySession = room.open()
        self.tally = Tally()
        self.wrong: dict[int, float] = {}

    def run(self) -> Tally:
        while (target := self.entry_session.guide.next_target(ANN)) is not None:
            if target.pair not in self.room.shown:
                self.entry_session.skip(target, "not seen", ANN)
                continue
            again = bool(self.entry_session.state.counting(target.pair))
            answer = self.type(target, again=again)
            if again and answer.needs_a_look and answer.outcome == "recorded":
                self.entry_session.keep(answer.entry.number, ANN)
        self.tally.left = self.left()
        self.entry_session.close()
        return self.tally

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
            second = Target(entry.start, entry.end)
            self.once(second, again=True, in_answer=True)
        return answer

    def once(self, target: Target, *, again: bool, in_answer: bool = False) -> Answer:
        """Type a number, rightly or wrongly, and count what comes of it."""
        shown = self.room.shown[target.pair]
        wrong = self.rng.uniform() < self.rate
        text = draw_mistyped(shown, self.rng) if wrong else shown
        earlier, first = self.readings_before(target)
        clean = not self.wrong_around(target)
        answer = self.entry_session.record(target, text, ANN, again=again)
        if wrong:
            size = np.inf
            if answer.entry.metres is not None:
                size = parse_distance(text, self.entry_session.campaign.settings.instrument).metres
                size -= float(shown)
            if abs(size) < 1e-9:
                return answer
            of_stop = "/" in target.start + target.end
            self.tally.slips.append(Slip(size, earlier, of_stop, answer.needs_a_look, first))
            if answer.outcome == "recorded":
                self.wrong[answer.entry.number] = size
        else:
            self.tally.readings += 1
            if answer.needs_a_look and clean and not (in_answer or again):
                self.tally.false_alarms += 1
        return answer

    def live_wrong(self) -> dict[int, float]:
        state = self.entry_session.state
        return {
            n: size for n, size in self.wrong.items() if n in state.counting(state.entries[n].pair)
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

    def readings_before(self, target: Target) -> tuple[int, bool]:
        knowledge, state = self.entry_session.checks.knowledge, self.entry_session.state
        key = knowledge.group_key(target.pair)
        own = [p for p in state.pairs if knowledge.group_key(p) == key and state.counting(p)]
        others = [p for p in own if p != target.pair]
        return len(others), not any(target.start in p for p in others)

    def left(self) -> list[tuple[float, bool]]:
        """Errors still there, and whether the survey's own search for blunders names them."""
        remaining = self.live_wrong()
        if not remaining:
            return []
        from survey.readings import load_readings
        from survey.settings import SurveySettings
        from survey.solve import solve_survey

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
        state = self.entry_session.state
        return [(size, state.entries[n].pair in named) for n, size in remaining.items()]


def simulate_entry(seed: int, stops: int = 2, rate: float = 0.01) -> Tally:
    """A whole campaign entered with typing errors."""
    with TemporaryDirectory() as folder:
        room = entry_room(seed, stops, Path(folder) / "room")
        return Typist(room, np.random.default_rng([7, seed]), rate).run()
