"""A distance as people and distance meters type it: millimetres or metres, comma or point."""

import re
from dataclasses import dataclass

from validation.campaign.folder import Instrument
from validation.text_files.lengths import in_metres, with_unit

MAX_TEXT = 40
"""Characters. A judgement: a longer text is no distance."""
_TYPED = re.compile(r"([0-9]{1,9}(?:[.,][0-9]{1,9})?|[.,][0-9]{1,9})\s*(mm|m)?", re.IGNORECASE)
_SMALLEST = 1e-6
"""Metres to which a typed number is kept: a thousandth of what instruments show."""


@dataclass(frozen=True)
class TypedDistance:
    """A number as typed, and what it stands for.

    Parameters
    ----------
    text : str
        As typed, without surrounding blanks.
    metres : float
        What it stands for.
    metric : bool
        Whether it is in metres or parts of them: of inches nothing says how fine they are shown.
    """

    text: str
    metres: float
    metric: bool = True

    @property
    def digits(self) -> str:
        """The digits alone, in the order typed."""
        return "".join(character for character in self.text if "0" <= character <= "9")


def parse_distance(text: str, instrument: Instrument, units: str = "m") -> TypedDistance:
    r"""The distance that a typed text means.

    Parameters
    ----------
    text : str
        '5.378', '5,378', '5378', '5378 mm', '5.378 m', "17' 7 3/4\"". Without a unit, numbers up to
        the range of the instrument are metres, and larger ones without decimals millimetres.
    instrument : Instrument
        Gives the range.
    units : {"m", "cm", "mm", "ft", "in"}
        What numbers without a unit are in, where the campaign's readings are not in metres.

    Raises
    ------
    ValueError
        If the text is no distance, or none within the range; the message says what was expected.
    """
    shown = text.strip()
    match = _TYPED.fullmatch(shown) if len(shown) <= MAX_TEXT else None
    stated = with_unit(shown) if len(shown) <= MAX_TEXT else None
    if match is None and stated is None:
        raise ValueError("not a distance; expected a number such as 5.378 or 5378")
    metres = stated[0] if stated else _without_unit(match, instrument, units) if match else 0.0
    metres = round(metres, 6)
    if not instrument.range_min <= metres <= instrument.range_max:
        raise ValueError(
            f"{plain(metres)} m is out of range; the instrument measures "
            f"{instrument.range_min:g} to {instrument.range_max:g} m"
        )
    return TypedDistance(shown, metres, metric=(stated[1] if stated else units) not in {"ft", "in"})


def _without_unit(match: re.Match[str], instrument: Instrument, units: str) -> float:
    """Metres of a number that states no unit."""
    number = float(match[1].replace(",", "."))
    if units == "m" and number > instrument.range_max and not re.search("[.,]", match[1]):
        units = "mm"
    return in_metres(number, units)


def plain(metres: float) -> str:
    """Metres to the millimetre, with more decimals only where there are more."""
    text = f"{metres:.6f}"
    return text[:-3] if text.endswith("000") else text.rstrip("0")


def signed_mm(metres: float) -> str:
    """A difference to the millimetre: '+12 mm', '−3 mm', '0 mm'."""
    whole = round(1000 * metres)
    return f"{whole:+d} mm".replace("-", "−") if whole else "0 mm"


def both_units(metres: float) -> str:
    """'5.378 m = 5378 mm'."""
    return f"{plain(metres)} m = {round(metres / _SMALLEST) / 1000:.10g} mm"
