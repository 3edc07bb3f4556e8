"""What takes back the last decision of a person, from a history to which all is appended."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Protocol, TypeVar

TAKEN_BACK = "taken back"
"""Note of a decision that restores what counted before."""


class Decision(Protocol):
    """What every decision has."""

    @property
    def by(self) -> str:
        """Who or what decided."""
        ...

    @property
    def note(self) -> str:
        """Why."""
        ...


D = TypeVar("D", bound=Decision)
Key = Callable[[D], Hashable]
Restored = Callable[[D | None, D], D]


def undoing(
    history: Sequence[tuple[str, D]], by: str, key: Key[D], restored: Restored[D]
) -> list[D]:
    """Decisions that take back the last ones of a person; none where there are none.

    Decisions of one moment were one action. What somebody has decided on since keeps that.

    Parameters
    ----------
    history : sequence of (str, decision)
        All decisions with their times.
    by : str
        The person.
    key : callable
        What a decision is about.
    restored : callable
        The decision to record, by the person and with the note `TAKEN_BACK`: of the one that
        counted before, or None, and of the one that is taken back.
    """
    counting: dict[Hashable, list[int]] = {}
    actions: list[list[int]] = []
    last = ""
    for row, (at, one) in enumerate(history):
        rows = counting.setdefault(key(one), [])
        if one.note == TAKEN_BACK:
            del rows[-1:]
            continue
        rows.append(row)
        if one.by == by:
            if at != last:
                actions.append([])
            actions[-1].append(row)
            last = at
    made = [one for _, one in history]
    found = (_restoring(made, rows, counting, key, restored) for rows in reversed(actions))
    return next((some for some in found if some), [])


def _restoring(
    made: Sequence[D],
    rows: Sequence[int],
    counting: Mapping[Hashable, Sequence[int]],
    key: Key[D],
    restored: Restored[D],
) -> list[D]:
    """Decisions that restore what counted before one action, where nobody has decided since."""
    restoring = []
    for row in rows:
        own = counting[key(made[row])]
        if own and own[-1] == row:
            before = made[own[-2]] if len(own) > 1 else None
            restoring.append(restored(before, made[row]))
    return restoring
