"""The doubtful readings of the station where the work stands, kept for the next start.

To find them again takes numpy and all readings of the room; the first question of a session need
not wait for that. What is kept is a mere copy: it counts only for the very campaign.toml and
journal that it was made with; whatever is amiss with it, the answer is computed anew.
"""

import contextlib
import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

from survey.entry.entries import Entry
from validation.campaign import Campaign

_CHANGES = ("reading", "undo", "keep")
"""Kinds of entries that make readings doubtful, or no more so."""


class RememberedDoubts:
    """The copy of what is doubtful at one station.

    Parameters
    ----------
    path : Path
        Where it lies.
    campaign : Campaign
        The campaign that it is of.
    """

    def __init__(self, path: Path, campaign: Campaign) -> None:
        self._path = path
        self._toml = campaign.toml
        self._kept = ""

    def recall(self, station: str, entries: Sequence[Entry]) -> list[int] | None:
        """Entries of the doubtful readings of a station; None where they are not known."""
        try:
            said = json.loads(self._path.read_text(encoding="utf-8"))
            if said["of"] == self._stamp(station, entries):
                return [int(number) for number in said["doubtful"]]
        except (OSError, ValueError, KeyError, TypeError):
            pass
        return None

    def keep(self, station: str, entries: Sequence[Entry], numbers: Sequence[int]) -> None:
        """Write down what is doubtful; no harm is done where that fails."""
        with contextlib.suppress(OSError):
            said = json.dumps({"of": self._stamp(station, entries), "doubtful": list(numbers)})
            if said != self._kept:
                self._path.write_text(said, encoding="utf-8")
                self._kept = said

    def _stamp(self, station: str, entries: Sequence[Entry]) -> str:
        """What the answer depends on."""
        last = next((e for e in reversed(entries) if e.kind in _CHANGES), None)
        settings = hashlib.sha256(self._toml.read_bytes()).hexdigest()
        return f"{station} {settings} {last.as_json() if last else ''}"
