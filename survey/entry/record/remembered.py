"""What was doubtful among all readings, kept for the next start.

To find it again takes numpy and a judgement of every stop; neither the first question of the
entry nor a look at what is doubtful need wait for that. What is kept is a mere copy: it counts
only for the very campaign.toml and journal that it was made with; whatever is amiss with it, the
answer is computed anew.
"""

import contextlib
import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from survey.entry.record.entries import Entry
from validation.campaign.folder import Campaign

Doubts = Mapping[str, frozenset[int]]
"""Doubtful readings by the group they are of, for each group that was examined."""
_CHANGES = ("reading", "undo", "keep")
"""Kinds of entries that make readings doubtful, or no more so."""


class RememberedDoubts:
    """The copy of what is doubtful.

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

    def recall(self, entries: Sequence[Entry]) -> Doubts:
        """Doubtful readings of the groups for which they are known; none where nothing is."""
        try:
            said = json.loads(self._path.read_text(encoding="utf-8"))
            if said["of"] != self._stamp(entries):
                return {}
            known = range(1, len(entries) + 1)
            return {
                key: frozenset(known[known.index(number)] for number in numbers)
                for key, numbers in said["doubtful"].items()
            }
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return {}

    def keep(self, entries: Sequence[Entry], doubts: Doubts) -> None:
        """Write down what is doubtful; no harm is done where that fails."""
        found = {key: sorted(numbers) for key, numbers in doubts.items()}
        with contextlib.suppress(OSError):
            said = json.dumps({"of": self._stamp(entries), "doubtful": found})
            if said != self._kept:
                self._path.write_text(said, encoding="utf-8")
                self._kept = said

    def _stamp(self, entries: Sequence[Entry]) -> str:
        """What the answer depends on."""
        last = next((e for e in reversed(entries) if e.kind in _CHANGES), None)
        settings = hashlib.sha256(self._toml.read_bytes()).hexdigest()
        return f"{settings} {last.as_json() if last else ''}"
