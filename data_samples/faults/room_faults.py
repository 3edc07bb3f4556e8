"""Readings that are wrong by more than noise: blunders and typing errors."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from validation.campaign.folder import Instrument
from validation.errors import GtvalError
from validation.poses.angles import Array


@dataclass(frozen=True)
class Fault:
    """A wrong reading.

    Parameters
    ----------
    row : int
        Row of the readings, from 0.
    kind : {"blunder", "typo"}
        What happened.
    size : float
        What it added to the reading, metres.
    """

    row: int
    kind: Literal["blunder", "typo"]
    size: float


def decimals(instrument: Instrument) -> int:
    """Digits after the point that the instrument shows; 6 where it has no resolution."""
    if instrument.resolution == 0:
        return 6
    return max(0, math.ceil(-math.log10(instrument.resolution) - 1e-9))


def rounded(reading: Array, instrument: Instrument) -> Array:
    """Readings (...) in metres as the instrument shows them."""
    step = instrument.resolution
    exact = np.round(reading / step) * step if step else reading
    return np.asarray(np.round(exact, decimals(instrument)))


def transpositions(reading: float, instrument: Instrument) -> list[float]:
    """All readings that come of typing two neighbouring digits in the wrong order.

    Parameters
    ----------
    reading : float
        As shown, metres. 5.321 can become 3.521, 5.231 or 5.312.
    instrument : Instrument
        Its number of digits and its range, which the results keep.
    """
    text = f"{reading:.{decimals(instrument)}f}"
    digits = [place for place, character in enumerate(text) if character.isdigit()]
    wrong = set()
    for a, b in pairwise(digits):
        typed = list(text)
        typed[a], typed[b] = typed[b], typed[a]
        wrong.add(float("".join(typed)))
    low, high = instrument.range_min, instrument.range_max
    return sorted(value for value in wrong - {reading} if low <= value <= high)


def draw_faults(
    shown: Array,
    instrument: Instrument,
    rng: np.random.Generator,
    *,
    blunders: int,
    blunder_size: float,
    typos: int,
) -> tuple[Fault, ...]:
    """Faults in different rows, in the order of the rows.

    Parameters
    ----------
    shown : (n,) array
        Readings as the instrument shows them, metres.
    instrument : Instrument
        Its range, which faulty readings keep, and its digits.
    rng : numpy.random.Generator
        Source of all that is drawn.
    blunders : int
        Readings off by ``blunder_size`` metres, up or down.
    typos : int
        Readings with two neighbouring digits exchanged.

    Raises
    ------
    GtvalError
        If there are fewer readings than faults.
    """
    order = [int(row) for row in rng.permutation(len(shown))]
    faults = [
        Fault(row, "blunder", _blunder(shown[row], blunder_size, instrument, rng))
        for row in order[:blunders]
    ]
    choices = ((row, transpositions(shown[row], instrument)) for row in order[blunders:])
    while len(faults) < blunders + typos:
        row, typed = next(((row, typed) for row, typed in choices if typed), (-1, []))
        if row < 0:
            raise GtvalError(
                f"{len(shown)} readings are too few for {blunders} blunders and {typos} typos"
            )
        faults.append(Fault(row, "typo", float(rng.choice(typed) - shown[row])))
    return tuple(sorted(faults, key=lambda fault: fault.row))


def _blunder(
    reading: float, size: float, instrument: Instrument, rng: np.random.Generator
) -> float:
    """The size with a random sign, the other one where the first would leave the range."""
    step = size if rng.uniform() < 0.5 else -size
    inside = instrument.range_min <= reading + step <= instrument.range_max
    return step if inside else -step
