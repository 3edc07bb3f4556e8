"""What a person or a program decided about a pair of scans."""

from dataclasses import dataclass

from laser_gt.scans.planar import inverse
from validation.poses.angles import Array

KINDS = ("accept", "reject", "guess", "open")


@dataclass(frozen=True)
class Decision:
    """What was decided about a pair.

    Parameters
    ----------
    reference, moving : str
        Stops.
    kind : {"accept", "reject", "guess", "open"}
        Take it, leave it, match again from ``guess``, or decide nothing any more.
    guess : (3,) array or None
        Moving laser frame in the reference laser frame.
    by, note : str
        Who or what decided, and why.
    """

    reference: str
    moving: str
    kind: str
    guess: Array | None = None
    by: str = ""
    note: str = ""

    def turned(self) -> "Decision":
        """The same decision with the pair named the other way round."""
        guess = None if self.guess is None else inverse(self.guess)
        return Decision(self.moving, self.reference, self.kind, guess, self.by, self.note)
