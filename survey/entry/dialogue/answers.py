"""What becomes of a number that is entered."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from survey.entry.record.entries import Entry

if TYPE_CHECKING:
    from survey.entry.room.checks import Verdict


def same_text(before: Entry) -> str:
    """What is asked of a value that was entered for another pair just before."""
    return (
        f"the same value as for {before.start}–{before.end} just before: was it sent twice, or not "
        "measured anew? If the display shows it, enter it once more"
    )


@dataclass(frozen=True)
class Answer:
    """What became of a number that was entered.

    Parameters
    ----------
    entry : Entry
        As it stands in the journal.
    outcome : str
        'recorded', 'refused' (no possible distance), 'set aside' (the pair has a reading),
        'repeated' (this very entry was there already), 'agrees' or 'disagrees' (blind entry).
    text : str
        In a sentence, with the value where it may be seen.
    verdict : Verdict or None
        What the check says; None where nothing may be said, or there is nothing to check.
    """

    entry: Entry
    outcome: str
    text: str
    verdict: "Verdict | None" = None

    @property
    def needs_a_look(self) -> bool:
        """Whether a person should stop and look."""
        doubtful = self.verdict is not None and (
            self.verdict.status == "doubtful" or bool(self.verdict.suspects)
        )
        return doubtful or self.outcome in ("refused", "set aside", "disagrees")
