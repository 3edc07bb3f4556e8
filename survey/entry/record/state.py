"""What stands after all entries of a journal: which readings count, which were replaced."""

from collections.abc import Callable, Container, Iterable
from dataclasses import dataclass, field
from operator import attrgetter

from survey.entry.record.entries import FROM_FILE, FROM_FILE_UNUSED, Entry

Pair = frozenset[str]
WAS_SET_ASIDE = "set aside"
"""Text of a keep entry whose reading did not count before."""
Agree = Callable[[float, float], bool]
"""Whether two people's values of one pair agree."""


@dataclass
class PairState:
    """The readings of one pair of points.

    Parameters
    ----------
    numbers : list of int
        Entries of its readings that were neither undone nor replaced, in their order.
    skipped : str or None
        Why a person decided not to measure it; None where nobody did.
    """

    numbers: list[int] = field(default_factory=list)
    skipped: str | None = None


@dataclass
class EntryState:
    """What stands, kept up to date entry by entry.

    Parameters
    ----------
    agree : callable
        Whether the values of a double entry agree.
    second_measures : bool
        Whether the second of a double entry is a measurement of its own, not the same display
        typed again.
    heading : str
        Of the distances in the readings file: with the unit where the campaign's is another.
    """

    agree: Agree
    second_measures: bool = True
    heading: str = "distance"
    entries: dict[int, Entry] = field(default_factory=dict)
    by_id: dict[str, int] = field(default_factory=dict)
    pairs: dict[Pair, PairState] = field(default_factory=dict)
    undone: set[int] = field(default_factory=set)
    replaced: dict[int, int] = field(default_factory=dict)
    kept: set[int] = field(default_factory=set)
    set_aside: set[int] = field(default_factory=set)
    notes: dict[int, list[str]] = field(default_factory=dict)
    stops: list[str] = field(default_factory=list)
    wanted: set[Pair] = field(default_factory=set)
    doubled: dict[Pair, None] = field(default_factory=dict)
    """Pairs with a blind second entry, taken back or not, in the order of these."""
    without_second: set[Pair] = field(default_factory=set)
    """Pairs that are not to be measured a second time."""
    cursor: Pair | None = None

    def apply(self, entry: Entry) -> None:
        """Take one more entry into account."""
        self.entries[entry.number] = entry
        if entry.id:
            self.by_id.setdefault(entry.id, entry.number)
        action = _ACTIONS.get(entry.kind)
        if action is not None:
            action(self, entry)

    def pair(self, pair: Pair) -> PairState:
        """The state of a pair; a blank one where nothing was done with it."""
        return self.pairs.get(pair, _BLANK)

    def counting(self, pair: Pair) -> list[int]:
        """Entries of the readings of a pair that count as measurements, in their order.

        Of a double entry only values that two people agree on count.
        """
        own = self.pairs.get(pair)
        if own is None:
            return []
        if len(own.numbers) == 1:  # as most have; thousands are asked for at a start
            number = own.numbers[0]
            entry = self.entries[number]
            if not entry.second and self._is_considered(entry):
                return [number]
        numbers = self._considered(pair)
        if not any(self.entries[n].second for n in numbers):
            return numbers
        agreed = self.agreeing(numbers)
        return agreed if self.second_measures else agreed[:1]

    def agreeing(self, numbers: list[int]) -> list[int]:
        """The last two of the entries, by different people, that agree; none if none do."""
        for i in reversed(range(len(numbers))):
            for j in reversed(range(i)):
                one, other = self.entries[numbers[j]], self.entries[numbers[i]]
                if one.by != other.by and self.agree(_metres(one), _metres(other)):
                    return [numbers[j], numbers[i]]
        return []

    def has_second(self, pair: Pair) -> bool:
        """Whether a blind second entry of a pair counts."""
        return pair in self.doubled and any(self.entries[n].second for n in self.counting(pair))

    def disagrees(self, pair: Pair) -> bool:
        """Whether there is a double entry, and no two values of it agree."""
        if pair not in self.doubled:
            return False
        numbers = self._considered(pair)
        return any(self.entries[n].second for n in numbers) and not self.agreeing(numbers)

    def _considered(self, pair: Pair) -> list[int]:
        """Readings of a pair that were neither undone, replaced nor set aside."""
        return [n for n in self.pair(pair).numbers if self._is_considered(self.entries[n])]

    def _is_considered(self, entry: Entry) -> bool:
        """Whether a reading was set aside neither here nor in the file it came from."""
        return entry.number not in self.set_aside and entry.device != FROM_FILE_UNUSED

    def rows_of_file(self) -> list[Entry]:
        """All readings that count, and those that a file set aside, in the order entered."""
        found = [entry for pair in self.pairs for entry in self.rows_of_pair(pair)]
        return sorted(found, key=attrgetter("number"))

    def rows_of_pair(self, pair: Pair) -> list[Entry]:
        """Those of one pair."""
        found = [self.entries[n] for n in self.counting(pair)]
        own = (self.entries[n] for n in self.pair(pair).numbers)
        return found + [entry for entry in own if entry.device == FROM_FILE_UNUSED]

    def last_action(self, device: str, others: Container[int] = ()) -> Entry | None:
        """The last thing done on a device that can be undone, the entries of others left out."""
        for number in sorted(self.entries, reverse=True):
            entry = self.entries[number]
            if number in self.undone or number in others:
                continue
            if entry.device == device and entry.kind in _REVERSED:
                return entry
        return None

    def _own(self, pair: Pair) -> PairState:
        own = self.pairs.get(pair)
        if own is None:
            own = self.pairs[pair] = PairState()
        return own

    def _reading(self, entry: Entry) -> None:
        own = self._own(entry.pair)
        if entry.second:
            self.doubled[entry.pair] = None
        if entry.of and entry.of in own.numbers:
            own.numbers.remove(entry.of)
            self.replaced[entry.of] = entry.number
        elif own.numbers and _needs_keeping(entry) and _is_repeat(self, own):
            self.set_aside.add(entry.number)
        own.numbers.append(entry.number)
        own.skipped = None
        self.wanted.add(entry.pair)
        self.cursor = entry.pair

    def _undo(self, entry: Entry) -> None:
        undone = self.entries.get(entry.of)
        if undone is None or entry.of in self.undone:
            return
        self.undone.add(entry.of)
        if undone.start:
            self.cursor = undone.pair
        _REVERSED[undone.kind](self, undone)

    def _unread(self, undone: Entry) -> None:
        own = self._own(undone.pair)
        if undone.number in own.numbers:
            own.numbers.remove(undone.number)
        if undone.of and self.replaced.get(undone.of) == undone.number:
            del self.replaced[undone.of]
            own.numbers.append(undone.of)
            own.numbers.sort()

    def _unkeep(self, undone: Entry) -> None:
        self.kept.discard(undone.of)
        if undone.text == WAS_SET_ASIDE:
            self.set_aside.add(undone.of)

    def _unnote(self, undone: Entry) -> None:
        self.notes[undone.of].remove(undone.text)

    def _unstop(self, undone: Entry) -> None:
        self.stops.remove(undone.text)

    def _keep(self, entry: Entry) -> None:
        self.kept.add(entry.of)
        self.set_aside.discard(entry.of)

    def _skip(self, entry: Entry) -> None:
        if entry.second:
            self.without_second.add(entry.pair)
        else:
            self._own(entry.pair).skipped = entry.text
            self.wanted.discard(entry.pair)
        self.cursor = entry.pair

    def _unskip(self, entry: Entry) -> None:
        if entry.second:
            self.without_second.discard(entry.pair)
        else:
            self._own(entry.pair).skipped = None
            self.wanted.add(entry.pair)
        self.cursor = entry.pair

    def _jump(self, entry: Entry) -> None:
        self.cursor = entry.pair

    def _stop(self, entry: Entry) -> None:
        if entry.text not in self.stops:
            self.stops.append(entry.text)

    def _note(self, entry: Entry) -> None:
        self.notes.setdefault(entry.of, []).append(entry.text)


def _needs_keeping(entry: Entry) -> bool:
    """Whether a reading of a pair that has one was perhaps not meant as a further one."""
    return not (entry.second or entry.of or entry.device in (FROM_FILE, FROM_FILE_UNUSED))


def _is_repeat(state: EntryState, own: PairState) -> bool:
    """Whether a pair has a reading already, so that one more is set aside until it is meant.

    Where two people disagree, one more reading is what was asked for.
    """
    if any(state.entries[n].second for n in own.numbers):
        return bool(state.agreeing(own.numbers))
    return any(n not in state.set_aside for n in own.numbers)


def replayed(
    entries: Iterable[Entry],
    agree: Agree,
    *,
    second_measures: bool = True,
    heading: str = "distance",
) -> EntryState:
    """What stands after the entries of a journal."""
    state = EntryState(agree, second_measures, heading)
    for entry in entries:
        state.apply(entry)
    return state


def _metres(entry: Entry) -> float:
    """The distance of a reading."""
    if entry.metres is None:
        raise ValueError(f"entry {entry.number} is no reading")
    return entry.metres


_BLANK = PairState()
_ACTIONS: dict[str, Callable[[EntryState, Entry], None]] = {
    "reading": EntryState._reading,  # noqa: SLF001  (the class's own table of actions)
    "undo": EntryState._undo,  # noqa: SLF001
    "keep": EntryState._keep,  # noqa: SLF001
    "skip": EntryState._skip,  # noqa: SLF001
    "unskip": EntryState._unskip,  # noqa: SLF001
    "jump": EntryState._jump,  # noqa: SLF001
    "stop": EntryState._stop,  # noqa: SLF001
    "note": EntryState._note,  # noqa: SLF001
}
_REVERSED: dict[str, Callable[[EntryState, Entry], None]] = {
    "reading": EntryState._unread,  # noqa: SLF001
    "skip": EntryState._unskip,  # noqa: SLF001
    "unskip": EntryState._skip,  # noqa: SLF001
    "keep": EntryState._unkeep,  # noqa: SLF001
    "note": EntryState._unnote,  # noqa: SLF001
    "stop": EntryState._unstop,  # noqa: SLF001
}
