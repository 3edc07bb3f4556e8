"""What is to be measured next, as it follows from the plan and from what was done."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from survey.entry.record.state import EntryState, Pair
from survey.entry.room.targets import (
    Names,
    Station,
    Target,
    find_target,
    from_the_other_end,
    load_names,
    load_skipped,
    stations,
    stop_of,
)
from survey.settings import EntrySettings
from validation.campaign.folder import Campaign
from validation.page.people import Person


@dataclass(frozen=True)
class Progress:
    """How many pairs are done, left, and not to be measured."""

    done: int
    left: int
    skipped: int


class Way:
    """Stations in their order, and where each pair is among them.

    Parameters
    ----------
    stations : sequence of Station
        All of them.
    """

    def __init__(self, stations: Sequence[Station]) -> None:
        self.stations = stations
        self._where = {
            target.pair: (i, j)
            for i, station in enumerate(stations)
            for j, target in enumerate(station.targets)
        }

    def position(self, pair: Pair | None) -> tuple[int, int]:
        """Station and place in it of a pair; the beginning for one that is none of the plan."""
        return (0, 0) if pair is None else self._where.get(pair, (0, 0))


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

    def of_campaign(self, campaign: Campaign) -> None:
        """Plan anew for a campaign that has further points."""
        self._campaign = campaign
        self.make_plan()

    def make_plan(self) -> None:
        """Read the names of all points, and lay out the plan."""
        self.names: Names = load_names(self._campaign, self._state.stops)
        self.hidden = load_skipped(self._campaign, self.names)
        self.plan: list[Station] = stations(self.names, self._settings)
        self._way = Way(self.plan)
        self._way_back: Way | None = None

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
        if person.second and target.pair in self._state.without_second:
            return False
        if not person.second or self._state.disagrees(target.pair):
            return self.is_open(target)
        numbers = self._state.counting(target.pair)
        entries = [self._state.entries[n] for n in numbers]
        return bool(entries) and not any(e.second or e.by == person.name for e in entries)

    def next_target(self, person: Person, *, look_again: bool = True) -> Target | None:
        """What to measure next; None when all is done.

        First the rest of the station that the laser stands at, then its doubtful readings once
        more, before the laser is moved; then the stations after it, then any left out before.
        Before a stop is left, or the frame with its world points, all that is doubtful of it comes
        once more, and at the end all that is doubtful anywhere. For a list that was written before,
        ``look_again`` is false: it knows of no doubts.
        """
        way = self._way_of(person)
        at, place = way.position(self._state.cursor)
        here = way.stations[at].targets
        for target in (*here[place:], *here[:place]):
            if self.is_open_for(target, person):
                return target
        others = (*way.stations[at + 1 :], *way.stations[:at])
        following = next(
            (one for station in others for one in station.targets if self.is_open_for(one, person)),
            None,
        )
        if not look_again or person.second:
            return following
        stop = stop_of(here[0])
        if following is None:
            again: Iterable[Station] = (way.stations[at], *others)
        elif stop_of(following) == stop:
            again = way.stations[at : at + 1]
        else:
            around = [one for one in others if stop_of(one.targets[0]) == stop]
            again = (way.stations[at], *around)
        for station in again:
            doubtful = self._doubtful_at(station)
            for target in station.targets:
                if target.pair in doubtful:
                    return target
        return following

    def following(self, person: Person, most: int) -> list[Target]:
        """The next targets in their order, for a device that may lose the link."""
        first = self.next_target(person)
        if first is None:
            return []
        found = [first]
        way = self._way_of(person)
        start, _ = way.position(first.pair)
        for station in (*way.stations[start:], *way.stations[:start]):
            for target in station.targets:
                if len(found) >= most:
                    return found
                if target.pair != first.pair and self.is_open_for(target, person):
                    found.append(target)
        return found

    def target(self, where: str) -> Target:
        """The target that a person means by a text such as '7/O 3'."""
        return find_target(where, self.plan)

    def progress(self, targets: Iterable[Target] | None = None) -> Progress:
        """How far the work is, at some targets or in all."""
        done = left = skipped = 0
        for target in self._all_targets() if targets is None else targets:
            if self._state.counting(target.pair):
                done += 1
            elif self.skipped(target.pair) is None:
                left += 1
            else:
                skipped += 1
        return Progress(done, left, skipped)

    def second_progress(self, person: Person, targets: Iterable[Target] | None = None) -> Progress:
        """How far the blind second entries of a person are, at some targets or in all."""
        state = self._state
        some = list(self._all_targets() if targets is None else targets)
        done = sum(state.has_second(target.pair) for target in some)
        left = sum(self.is_open_for(target, person) for target in some)
        return Progress(done, left, sum(target.pair in state.without_second for target in some))

    def _all_targets(self) -> Iterator[Target]:
        return (target for station in self.plan for target in station.targets)

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

    def station_of(self, target: Target, person: Person) -> Station:
        """The station that a target belongs to, on the way of a person."""
        way = self._way_of(person)
        return way.stations[way.position(target.pair)[0]]

    def _way_of(self, person: Person) -> Way:
        """A second measurement is taken from the other end, and the laser moved as little."""
        if not (person.second and self._settings.second == "measure"):
            return self._way
        if self._way_back is None:
            self._way_back = Way(from_the_other_end(self.plan))
        return self._way_back
