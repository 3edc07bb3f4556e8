"""One journal out of those of two writers who did not see one another."""

import heapq
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from survey.entry.record.entries import FROM_FILE, Entry
from survey.entry.record.journal import Line, line_of, lines_of
from survey.entry.record.state import WAS_SET_ASIDE, Agree, EntryState


@dataclass(frozen=True)
class Merged:
    """What two writers wrote, in the order of time.

    Parameters
    ----------
    entries : tuple of Entry
        All that was ever written, each once, numbered anew.
    branches : int
        How many chains of lines there were; 1: nobody was overlooked.
    """

    entries: tuple[Entry, ...]
    branches: int

    def as_bytes(self) -> bytes:
        """The journal file that holds them."""
        data, check = [], None
        for entry in self.entries:
            line, check = line_of(entry, check)
            data.append(line)
        return b"".join(data)


def merge_journals(paths: Iterable[Path], agree: Agree, *, second_measures: bool) -> Merged:
    """The entries of some journal files, or of one that two writers wrote to.

    Parameters
    ----------
    paths : iterable of Path
        The files.
    agree : callable
        Whether the values of a double entry agree.
    second_measures : bool
        See `EntryState`.

    Raises
    ------
    InputError
        Naming a line that follows on no other: it was damaged.

    Notes
    -----
    Each line holds a checksum over itself and the line that its writer knew before it; so the
    lines are a tree, however they lie in the files. A reading that counted for its writer counts
    after the merge, as one more reading where both read the same pair.
    """
    lines: dict[bytes, Line] = {}
    for path in paths:
        for check, line in lines_of(path, lines).items():
            lines.setdefault(check, line)
    followed = {line.before for line in lines.values()}
    tips = [check for check in lines if check not in followed]
    aside = {check for tip in tips for check in _set_aside(lines, tip, agree, second_measures)}
    state = EntryState(agree, second_measures)
    number: dict[bytes, int] = {}
    entries: list[Entry] = []

    def add(entry: Entry) -> int:
        entries.append(replace(entry, number=len(entries) + 1))
        state.apply(entries[-1])
        return len(entries)

    for check in _in_time(lines):
        entry = lines[check].entry
        if entry.id and entry.id in state.by_id:
            number[check] = state.by_id[entry.id]
            continue
        of = number[_before(lines, check, entry.of)] if entry.of else 0
        number[check] = add(replace(entry, of=of))
        if number[check] in state.set_aside and check not in aside:
            kept = replace(Entry("keep", device=FROM_FILE), start=entry.start, end=entry.end)
            add(replace(kept, time=entry.time, of=number[check], text=WAS_SET_ASIDE))
    return Merged(tuple(entries), len(tips))


def _in_time(lines: Mapping[bytes, Line]) -> Iterable[bytes]:
    """The checksums of the lines, each after the line before it, else in the order of time."""
    order = {check: place for place, check in enumerate(lines)}
    after: dict[bytes, list[bytes]] = {}
    for check, line in lines.items():
        after.setdefault(line.before if line.before in lines else b"", []).append(check)

    def key(check: bytes) -> tuple[float, int, bytes]:
        return datetime.fromisoformat(lines[check].entry.time).timestamp(), order[check], check

    waiting = [key(check) for check in after.get(b"", [])]
    heapq.heapify(waiting)
    while waiting:
        check = heapq.heappop(waiting)[2]
        yield check
        for following in after.get(check, []):
            heapq.heappush(waiting, key(following))


def _before(lines: Mapping[bytes, Line], check: bytes, number: int) -> bytes:
    """The checksum of the line that an entry means by a number."""
    while lines[check].entry.number != number:
        check = lines[check].before
    return check


def _chain(lines: Mapping[bytes, Line], tip: bytes) -> Sequence[bytes]:
    """The checksums from the first line to a last one."""
    found = []
    while tip in lines:
        found.append(tip)
        tip = lines[tip].before
    return found[::-1]


def _set_aside(
    lines: Mapping[bytes, Line], tip: bytes, agree: Agree, second_measures: bool
) -> Iterable[bytes]:
    """Lines with readings that did not count for their own writer either."""
    state = EntryState(agree, second_measures)
    chain = _chain(lines, tip)
    for check in chain:
        state.apply(lines[check].entry)
    return [check for check in chain if lines[check].entry.number in state.set_aside]
