"""What is written to the journal: one entry for everything that a person did."""

import json
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any, Literal, get_args

Kind = Literal[
    "begin",  # an entry session began
    "reading",  # a number was entered
    "refused",  # a text was entered that is no possible distance
    "undo",  # an earlier entry is taken back
    "keep",  # a doubtful reading, or one set aside, is meant
    "skip",  # a pair is not measured, with the reason
    "unskip",  # it is, after all
    "jump",  # go on with this pair
    "stop",  # a further stop is to be measured
    "mark",  # a further world point was put on a wall
    "note",  # a remark
    "end",  # the entry session ended
]
KINDS: frozenset[str] = frozenset(get_args(Kind))
FROM_FILE = "file"
FROM_FILE_UNUSED = "file, set aside"
"""Devices of readings that were taken over from a readings file; the second: with use = no."""
MAX_NOTE = 1000
"""Characters kept of a remark. A judgement: more is a mistake of a program."""


@lru_cache(maxsize=1 << 16)
def pair_of(start: str, end: str) -> frozenset[str]:
    """Two points without order; the same object for the same points, which is quick to look up."""
    return frozenset((start, end))


@dataclass(frozen=True)
class Entry:
    """One line of the journal.

    Parameters
    ----------
    kind : str
        What was done; see `Kind`.
    number : int
        1, 2, ... in the order written; 0 before that.
    time : str
        Local time with its offset, ISO 8601, milliseconds.
    id : str
        Made by the device, so that an entry sent twice is recorded once.
    by, device : str
        Who, and on what: 'terminal', 'page', 'file'.
    start, end : str
        The pair of points.
    text : str
        As typed; the reason of a skip; the text of a note; the name of a stop.
    metres : float or None
        What a reading stands for, as the instrument showed it.
    of : int
        The entry that this one is about: undone, kept, replaced, noted. 0: none.
    second : bool
        Whether a reading is the other person's blind entry, or a skip is of that one alone.
    measured : str
        When a reading was measured, where that is not when it was written: read from a file, or
        queued while the link was down.
    """

    kind: Kind
    number: int = 0
    time: str = ""
    id: str = ""
    by: str = ""
    device: str = ""
    start: str = ""
    end: str = ""
    text: str = ""
    metres: float | None = None
    of: int = 0
    second: bool = False
    measured: str = ""

    @property
    def pair(self) -> frozenset[str]:
        """The two points, without order."""
        return pair_of(self.start, self.end)

    @property
    def when(self) -> str:
        """When a reading was measured; '' where a file that it was taken over from did not say."""
        from_file = self.device in (FROM_FILE, FROM_FILE_UNUSED)
        return self.measured or ("" if from_file else self.time)

    def as_json(self) -> str:
        """A JSON object of all that is not at its default."""
        said = {
            field.name: getattr(self, field.name)
            for field in fields(self)
            if getattr(self, field.name) != field.default
        }
        return json.dumps(said, ensure_ascii=False, separators=(",", ":"))


def entry_from_json(said: Any) -> Entry:
    """The entry that a line's JSON object holds, of a line whose checksum was right.

    Raises
    ------
    ValueError
        Naming the member that is missing or unknown.
    """
    if not isinstance(said, dict):
        raise ValueError("expected an object")  # noqa: TRY004  (of the file, not of the caller)
    said.pop("check", None)
    unknown = said.keys() - _MEMBERS
    if unknown:
        raise ValueError(f"unknown: {', '.join(sorted(unknown))}")
    if said.get("kind") not in KINDS:
        raise ValueError(f"kind: expected one of {', '.join(sorted(KINDS))}")
    # Thousands are read at a start: this is four times as quick as the constructor, which sets
    # each default anew. What is not said is the class's own default.
    entry = object.__new__(Entry)
    vars(entry).update(said)
    if entry.kind == "reading" and not (entry.start and entry.end and entry.metres is not None):
        raise ValueError("a reading needs 'start', 'end' and 'metres'")
    return entry


_MEMBERS = frozenset(field.name for field in fields(Entry))
