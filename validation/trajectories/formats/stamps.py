"""Time stamps: their unit, their exact value, and their order."""

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Context, Decimal, localcontext
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.text_files.time_units import SCALES

FIRST_EPOCH, LAST_EPOCH = 1e9, 4.3e9
"""Seconds since 1970 of the years 2001 and 2106: a stamp inside, in one of the units, has 10, 13,
16 or 19 digits before the point."""
SHORTEST, LONGEST = 0.0009, 30.0
"""Seconds from pose to pose that need no word: motion capture of a whole body stays at or below
1 kHz, and whoever moves less often than every 30 s records stops. A unit is certain where no other
one gives an interval inside."""
MOST_SECONDS = 1e11
"""Beyond this a stamp is of no time of ours: the year 5138."""
LARGE = 1e6
"""Stamps above, in seconds, are counted from a whole second near the first: below, a double holds
them to 0.1 ns."""
MOST_DISORDER = 0.03
"""Share of rows with a stamp that repeats or goes back. A logger that writes from several threads
exchanges some in a thousand; at one in thirty the column is no time, or two recordings were put
together."""
_DIGITS = Context(prec=60)
"""Of a stamp: ten before the point, and all that a double of a femtosecond has behind it."""


class UncertainUnitError(GtvalError):
    """The unit of the stamps cannot be told from the numbers."""


def unit_of(values: Array) -> str:
    """The unit of stamps, where their size or their rate leaves one only.

    Parameters
    ----------
    values : (n,) array
        Stamps as written.

    Returns
    -------
    str
        's', 'ms', 'us' or 'ns'.

    Raises
    ------
    UncertainUnitError
        If none or several are possible; the message says what to do.
    """
    steps = np.abs(np.diff(values))
    steps = steps[steps > 0]
    interval = float(np.median(steps)) if len(steps) else None
    size = float(np.median(np.abs(values)))
    dated = [
        unit
        for unit, scale in SCALES.items()
        if FIRST_EPOCH <= size / scale <= LAST_EPOCH
        and (interval is None or 1e-4 <= interval / scale <= 1e5)
    ]
    if len(dated) == 1:
        return dated[0]
    if interval is None:
        raise UncertainUnitError(
            f"the unit of the stamps is not told by the only value {values[0]:g}; say it with "
            "--unit s, ms, us or ns"
        )
    fitting = [u for u, scale in SCALES.items() if SHORTEST <= interval / scale <= LONGEST]
    if len(fitting) == 1:
        return fitting[0]
    shown = " or ".join(f"{SCALES[u] / interval:.4g} Hz in {u}" for u in fitting or ("s",))
    raise UncertainUnitError(
        f"the unit of the stamps is not certain: the usual interval {interval:g} would be {shown}; "
        "say it with --unit s, ms, us or ns"
    )


def exact_times(
    stamps: Sequence[str] | npt.NDArray[np.int64], unit: str, epoch: int | None = None
) -> tuple[int, Array]:
    """Seconds since a whole second, without the loss of a double that holds 1970 to now.

    Parameters
    ----------
    stamps : sequence of str, or (n,) array of int
        As written.
    unit : str
        One of `SCALES`.
    epoch : int, optional
        The whole second; by default that before the earliest stamp, or 0 where stamps are small.

    Returns
    -------
    int, (n,) array
        The epoch and the times.

    Raises
    ------
    GtvalError
        If the times are of no year of ours.
    """
    scale = SCALES[unit]
    numbers: list[Any]  # int, or Decimal where there are decimals
    if isinstance(stamps, np.ndarray):
        numbers = stamps.tolist()
    elif all(map(str.isdigit, stamps)):
        numbers = [int(stamp[:40]) for stamp in stamps]
    else:
        numbers = list(map(Decimal, stamps))
    largest = max(abs(numbers[0]), abs(max(numbers)), abs(min(numbers)))
    if largest > MOST_SECONDS * scale:
        raise GtvalError(f"stamps of {float(largest):.4g} {unit} are of no year of ours")
    if epoch is None:
        epoch = int(min(numbers) // scale) if largest >= LARGE * scale else 0
        epoch -= 1 if epoch * scale > min(numbers) else 0
    start = epoch * scale
    if isinstance(numbers[0], int):
        return epoch, np.array([number - start for number in numbers], dtype=float) / scale
    with localcontext(_DIGITS):
        if scale == 1:
            return epoch, np.array([float(number - start) for number in numbers])
        return epoch, np.array([float((number - start) / scale) for number in numbers])


@dataclass(frozen=True)
class Order:
    """Rows in the order of time, each stamp once.

    Parameters
    ----------
    rows : (m,) array of int, optional
        Which rows, in which order; None where all are as they should be.
    back, repeated : (…) array of int
        Rows with a stamp before an earlier row's, and rows left out.
    """

    rows: npt.NDArray[np.intp] | None
    back: npt.NDArray[np.intp]
    repeated: npt.NDArray[np.intp]

    @property
    def share(self) -> float:
        """Share of rows that are not as they should be."""
        n = len(self.repeated) + (0 if self.rows is None else len(self.rows))
        return (len(self.back) + len(self.repeated)) / n if n else 0.0


def order_of(times: Array) -> Order:
    """How rows must be sorted and which be left out, so that times increase.

    Of rows with the same stamp the first stays.
    """
    none = np.empty(0, dtype=np.intp)
    if (np.diff(times) > 0).all():
        return Order(None, none, none)
    back = np.flatnonzero(times < np.maximum.accumulate(times))
    rows = np.argsort(times, kind="stable")
    again = np.flatnonzero(np.diff(times[rows]) == 0) + 1
    return Order(np.delete(rows, again), back, rows[again])


def texts_of(times: Array, epoch: int, unit: str = "s") -> list[str]:
    """Stamps as decimal text that `exact_times` reads back to the last bit.

    Nanoseconds are whole numbers: they are rounded.
    """
    if unit == "ns":
        whole = np.floor(times)
        nanoseconds = np.rint((times - whole) * 1e9).astype(np.int64)
        total = (whole.astype(np.int64) + epoch) * 1_000_000_000 + nanoseconds
        return [str(one) for one in total.tolist()]
    with localcontext(_DIGITS):
        return [format(Decimal(repr(one)) + epoch, "f") for one in times.tolist()]


def lines_shown(lines: Sequence[int]) -> str:
    """Line numbers as far as a person would read them, runs joined: '3, 7 to 12, …'."""
    runs: list[list[int]] = []
    ordered = sorted(lines)
    for before, line in pairwise([None, *ordered]):
        if before is not None and line is not None and line - before == 1:
            runs[-1][1] = line
        elif line is not None:
            runs.append([line, line])
    said = [f"{a}" if a == b else f"{a} to {b}" for a, b in runs[:5]]
    return ", ".join(said) + (", …" if len(runs) > 5 else "")
