"""What a reading should be, and how far off one is."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from validation.poses.angles import Array


@dataclass(frozen=True)
class Sides:
    """Triangles that a reading closes: one side known, one read, the third asked for.

    Parameters
    ----------
    known, read : (t,) array
        Metres.
    sigma : (t,) array
        Standard deviation of a violation, metres.
    numbers : tuple of int, length t
        Journal entries of the sides that were read.
    """

    known: Array
    read: Array
    sigma: Array
    numbers: tuple[int, ...] = ()

    @classmethod
    def none(cls) -> Self:
        """No triangle."""
        return cls(np.empty(0), np.empty(0), np.empty(0))

    def misfit(self, metres: float) -> float:
        """Standard deviations by which a side breaks the triangle inequality; 0 if it does not."""
        return float(self._misfits(metres).max(initial=0.0))

    def broken(self, metres: float, limit: float) -> tuple[int, ...]:
        """Entries of the sides read of the triangles that a reading does not close."""
        return tuple(
            number
            for number, misfit in zip(self.numbers, self._misfits(metres), strict=True)
            if misfit > limit
        )

    def _misfits(self, metres: float) -> Array:
        too_short = np.abs(self.known - self.read) - metres
        too_long = metres - (self.known + self.read)
        return np.asarray(np.maximum(too_short, too_long) / self.sigma)


@dataclass(frozen=True)
class Prediction:
    """What a reading should be.

    Parameters
    ----------
    distances, sigmas : (k,) array
        One for each solution of what is known so far, metres; none where too little is known.
        The sigma includes that of the reading itself.
    sides : Sides
        Triangles that it closes.
    basis : str
        What it rests on, in words.
    """

    distances: Array
    sigmas: Array
    sides: Sides
    basis: str

    @classmethod
    def unknown(cls, sides: Sides) -> Self:
        """Nothing but triangles."""
        return cls(np.empty(0), np.empty(0), sides, "")

    @property
    def checks(self) -> bool:
        """Whether there is a predicted value to check with."""
        return len(self.distances) > 0

    def misfit(self, metres: float) -> float:
        """Standard deviations that a distance is off the nearest solution, or breaks a triangle."""
        off = np.abs(metres - self.distances) / self.sigmas
        return max(
            float(off.min(initial=np.inf)) if self.checks else 0.0, self.sides.misfit(metres)
        )

    def nearest(self, metres: float) -> tuple[float, float]:
        """The predicted distance that fits best, and its sigma."""
        best = int((np.abs(metres - self.distances) / self.sigmas).argmin())
        return float(self.distances[best]), float(self.sigmas[best])
