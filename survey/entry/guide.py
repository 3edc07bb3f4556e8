"""What is to be measured next, as it follows from the plan and from what was done."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from survey.entry.entries import Person
from survey.entry.settings import EntrySettings
from survey.entry.state import EntryState, Pair
from survey.entry.targets import (
    Names,
    Station,
    Target,
    find_target,
    load_names,
    load_skipped,
    stations,
)
from validation.campaign import Campaign


@dataclass(frozen=True)
class Progress:
    """How many pairs are done, left, and not to be measured."""

    done: int
    left: int
    skipped: int


DoubtfulAt = Callable[[Station], set[Pair]]
"""The pairs of a station whose readings are doubtful."""


class Guide:
    """The plan of a campaign and the way through it.

    Parameters
    ----------
    campaign : Campaign
        Names the points, and the pairs that cannot be seen.
    settings : EntrySettings
        Order and kind of double entry.
    state : EntryState
        What was done; kept up to date by its owner.
    doubtful_at : callable
        Asked only when nothing else is left to do at a station.
    """

    def __init__(
        self,
        campaign: Campaign,
        settings: EntrySettings,
        state: EntryState,
        doubtful_at: DoubtfulAt,
    ) -> None:
        self._campaign = campaign
        self._settings = settings
        self._state = state
        self._doubtful_at = doubtful_at
        self.make_plan()

    def make_plan(self) -> None:
        """Read the names of all points, and lay out the plan."""
        self.names: Names = load_names(self._campaign, self._state.stops)
        self.hidden = load_skipped(self._campaign, self.names)
        self.plan: list[Station] = stations(self.names, self._settings)
        self._where = {
            target.pair: (i, j)
            for i, station in enumerate(self.plan)
            for j, target in enumerate(station.targets)
        }

    def skipped(self, pair: Pair) -> str | None:
        """Why a pair is not measured; None where it is."""
        if pair in self._state.wanted:
            return None
        return self._state.pair(pair).skipped or self.hidden.get(pair)

    def is_open(self, target: Target) -> bool:
        """Whether a target still needs a reading."""
        if self.skipped(target.pair) is not None:
            return False
        return not self._state.counting(target.pair)

    def is_open_for(self, target: Target, person: Person) -> bool:
        """Whether a target needs a reading by this person, blind second entries included."""
        if not person.second or self._state.disagrees(target.pair):
            return self.is_open(target)
        numbers = self._state.counting(target.pair)
        entries = [self._state.entries[n] for n in numbers]
        return bool(entries) and not any(e.second or e.by == person.name for e in entries)

    def next_target(self, person: Person, *, look_again: bool = True) -> Target | None:
        """What to measure next; None when all is done.

        First the rest of the station that the laser stands at, then its doubtful readings once
        more, before the laser is moved; then the stations after it, then any left out before.
        For a list that was written before, ``look_again`` is false: it knows of no doubts.
        """
        at, place = self._position()
        here = self.plan[at].targets
        for target in (*here[place:], *here[:place]):
            if self.is_open_for(target, person):
                return self._turned(target, person)
        if look_again and not person.second:
            doubtful = self._doubtful_at(self.plan[at])
            for target in here:
                if target.pair in doubtful:
                    return target
        for station in (*self.plan[at + 1 :], *self.plan[:at]):
            for target in station.targets:
                if self.is_open_for(target, person):
                    return self._turned(target, person)
        return None

    def following(self, person: Person, most: int) -> list[Target]:
        """The next targets in their order, for a device that may lose the link."""
        first = self.next_target(person)
        if first is None:
            return []
        found = [first]
        start = self._where.get(first.pair, (0, 0))[0]
        for station in (*self.plan[start:], *self.plan[:start]):
            for target in station.targets:
                if len(found) >= most:
                    return found
                if target.pair != first.pair and self.is_open_for(target, person):
                    found.append(self._turned(target, person))
        return found

    def target(self, where: str) -> Target:
        """The target that a person means by a text such as '7/O 3'."""
        return find_target(where, self.plan)

    def progress(self, targets: Iterable[Target] | None = None) -> Progress:
        """How far the work is, at some targets or in all."""
        if targets is None:
            targets = (target for station in self.plan for target in station.targets)
        done = left = skipped = 0
        for target in targets:
            if self._state.counting(target.pair):
                done += 1
            elif self.skipped(target.pair) is None:
                left += 1
            else:
                skipped += 1
        return Progress(done, left, skipped)

    def targets_from(self, start: str) -> tuple[Target, ...]:
        """All targets of the station at a point; none where nothing is read from there."""
        return next((s.targets for s in self.plan if s.name == start), ())

    def targets_of(self, stop: str) -> list[Target]:
        """All targets of the marks of a stop."""
        return [t for s in self.plan if s.name.startswith(f"{stop}/") for t in s.targets]

    def stop_after(self, stop: str, person: Person) -> str:
        """The next stop with something left to measure, from a stop on and round; '' if none."""
        stops = self.names.stops
        at = stops.index(stop) + 1 if stop in stops else 0
        for other in (*stops[at:], *stops[: max(at - 1, 0)]):
            if any(self.is_open_for(target, person) for target in self.targets_of(other)):
                return other
        return ""

    def station_of(self, target: Target) -> Station:
        """The station that a target belongs to."""
        return self.plan[self._where[target.pair][0]]

    def _position(self) -> tuple[int, int]:
        """Station and place in it at which the work goes on."""
        if self._state.cursor is None:
            return 0, 0
        return self._where.get(self._state.cursor, (0, 0))

    def _turned(self, target: Target, person: Person) -> Target:
        """A second measurement is taken from the other end."""
        if person.second and self._settings.second == "measure":
            return Target(target.end, target.start)
        return target
