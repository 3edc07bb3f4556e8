"""What a number may have been before it was mistyped.

Every slip is undone in every way that it could have happened; a value is a hypothesis only if it
fits what is known of the room, and is never applied by itself.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import ceil, log10

from survey.entry.record.numbers import TypedDistance
from validation.campaign.folder import Instrument

SLIPS = (
    "two digits exchanged",
    "a digit left out",
    "a digit typed twice",
    "the decimal point misplaced",
    "one digit wrong",
)
"""In the order in which they are offered: a slip that many values could have is offered last."""


@dataclass(frozen=True)
class Hypothesis:
    """A value that the display may have shown.

    Parameters
    ----------
    metres : float
        The value.
    slip : str
        What would have happened: one of `SLIPS`.
    """

    metres: float
    slip: str


def possible_originals(typed: TypedDistance, instrument: Instrument) -> list[Hypothesis]:
    """All values from which one slip leads to what was typed, each with its first slip.

    Parameters
    ----------
    typed : TypedDistance
        The number as typed.
    instrument : Instrument
        Its resolution says how many decimals a display shows, its range what it can show.
    """
    decimals = shown_decimals(instrument)
    found: dict[int, str] = {}
    low, high = instrument.range_min, instrument.range_max
    for slip, value in _unslipped(typed, decimals):
        if abs(value / 10**decimals - typed.metres) > 1e-9 and low <= value / 10**decimals <= high:
            found.setdefault(value, slip)
    return [Hypothesis(value / 10**decimals, slip) for value, slip in found.items()]


def fitting_originals(
    typed: TypedDistance, instrument: Instrument, misfit: Callable[[float], float], limit: float
) -> list[Hypothesis]:
    """Those that fit, the most common slips and best fits first.

    Parameters
    ----------
    typed : TypedDistance
        The number as typed.
    instrument : Instrument
        Its resolution and range.
    misfit : callable
        Metres to how many standard deviations they are off.
    limit : float
        More than so many do not fit.
    """
    rated = [
        (SLIPS.index(guess.slip), misfit(guess.metres), guess)
        for guess in possible_originals(typed, instrument)
    ]
    fitting = [row for row in rated if row[1] <= limit]
    return [guess for *_, guess in sorted(fitting, key=lambda row: row[:2])]


def shown_decimals(instrument: Instrument) -> int:
    """Decimals of a metre that the instrument shows; 3 where it states no resolution."""
    if instrument.resolution == 0:
        return 3
    return max(0, ceil(-log10(instrument.resolution) - 1e-9))


def _unslipped(typed: TypedDistance, decimals: int) -> Iterator[tuple[str, int]]:
    """Slip and original, in units of the last decimal shown."""
    shown = f"{typed.metres:.{decimals}f}".replace(".", "")
    digits = typed.digits
    exchanged, left_out, twice, misplaced, wrong = SLIPS
    for i in range(len(shown) - 1):
        yield exchanged, int(shown[:i] + shown[i + 1] + shown[i] + shown[i + 2 :])
    for text in {digits, shown.lstrip("0")}:
        for i in range(len(text) + 1):
            for new in "0123456789"[i == 0 :]:  # a zero in front changes nothing
                yield left_out, int(text[:i] + new + text[i:])
    for i in range(len(digits) - 1):
        if digits[i] == digits[i + 1]:
            yield twice, int(digits[:i] + digits[i + 1 :])
    for power in (-3, -2, -1, 1, 2, 3):
        yield misplaced, round(typed.metres * 10 ** (power + decimals))
    yield misplaced, int(digits)
    for i in range(len(shown)):
        for new in "0123456789":
            yield wrong, int(shown[:i] + new + shown[i + 1 :])
