"""Lengths as people write them: metres, centimetres, millimetres, feet and inches."""

import math
import re
from decimal import Decimal
from fractions import Fraction

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254}
"""Length of each unit that campaign.toml may name, metres."""
UNIT_NAMES = {
    "m": "metres",
    "cm": "centimetres",
    "mm": "millimetres",
    "ft": "feet",
    "in": "inches",
}

_SPELT = {
    "m": ("m", "metre", "metres", "meter", "meters"),
    "cm": ("cm", "centimetre", "centimetres", "centimeter", "centimeters"),
    "mm": ("mm", "millimetre", "millimetres", "millimeter", "millimeters"),
    "ft": ("ft", "ft.", "foot", "feet", "'", "′", "’", "‘"),
    "in": ("in", "in.", "inch", "inches", '"', "″", "”", "“", "''", "′′", "’’"),
}
_UNIT_OF = {word: unit for unit, words in _SPELT.items() for word in words}
_PLAIN = r"(?:\d+(?:[.,]\d*)?|[.,]\d+)"
_METRIC = re.compile(rf"([+-]?{_PLAIN}(?:[eE][+-]?\d+)?)\s*(\[?)([^\W\d_]+\.?)(\]?)")
_FEET = "|".join(re.escape(word) for word in sorted(_SPELT["ft"], key=len, reverse=True))
_INCH = "|".join(re.escape(word) for word in sorted(_SPELT["in"], key=len, reverse=True))
_FRACTION = r"(\d+)\s*[/⁄]\s*(\d+)"
_INCHES = rf"(?:({_PLAIN})(?:(?:\s+|\s*-\s*){_FRACTION})?|{_FRACTION})"
_FEET_INCHES = re.compile(
    rf"({_PLAIN})\s*(?:{_FEET})(?:\s*-?\s*{_INCHES}\s*(?:{_INCH})?)?", re.IGNORECASE
)
_ONLY_INCHES = re.compile(rf"(){_INCHES}\s*(?:{_INCH})", re.IGNORECASE)
_VULGAR = {"½": "1/2", "¼": "1/4", "¾": "3/4", "⅛": "1/8", "⅜": "3/8", "⅝": "5/8", "⅞": "7/8"}
_LONGEST_TEXT = 60
"""Characters. A judgement: a longer text is no length."""


def unit_of_word(word: str) -> str:
    """The unit that a word or sign stands for: 'mm' for 'Millimetres'; '' if it is none."""
    word = word.strip().lower()
    return _UNIT_OF.get(word, "") or _UNIT_OF.get(word.removesuffix("."), "")


def with_unit(text: str) -> tuple[float, str] | None:
    r"""The length that a text states with its unit, in metres, and that unit.

    Parameters
    ----------
    text : str
        '2.504 m', '2504mm', '8,215 ft', "11' 4 7/8\"", '136 1/2 in'.

    Returns
    -------
    (float, str) or None
        'ft' where feet are stated, with or without inches. None where the text is no number
        with a unit of length.
    """
    text = _plain_text(text)
    if len(text) > _LONGEST_TEXT:
        return None
    metric = _METRIC.fullmatch(text)
    if metric is not None and unit_of_word(metric[3]) and len(metric[2]) == len(metric[4]):
        unit = unit_of_word(metric[3])
        return in_metres(_number(metric[1]), unit), unit
    found = _FEET_INCHES.fullmatch(text) or _ONLY_INCHES.fullmatch(text)
    if found is None:
        return None
    feet, whole, top, bottom, top_alone, bottom_alone = found.groups()
    top, bottom = top or top_alone or "0", bottom or bottom_alone or "1"
    if int(bottom) == 0:
        return None
    inches = _number(whole or "0") + float(Fraction(int(top), int(bottom)))
    if feet and inches and (inches >= 12 or re.search("[.,]", feet)):
        return None
    return _number(feet or "0") * METRES["ft"] + inches * METRES["in"], "ft" if feet else "in"


_PER = {"m": 1, "cm": 100, "mm": 1000}


def in_metres(number: float, unit: str) -> float:
    """A number of a unit in metres: of the metric ones, the double nearest to what is written."""
    if unit == "m" or not math.isfinite(number):
        return number
    return float(Decimal(repr(number)) / _PER[unit]) if unit in _PER else number * METRES[unit]


def split_heading(heading: str) -> tuple[str, str]:
    """The name of a column and the unit that its heading states, '' where it states none.

    Parameters
    ----------
    heading : str
        'Distance [mm]', 'distance (m)', 'distance_mm', 'distance in feet', 'world point'.

    Returns
    -------
    name : str
        In small letters, with _ for blanks.
    unit : str
        As written, without brackets.
    """
    text = " ".join(heading.replace("_", " ").replace("\u00a0", " ").split()).strip("'\"").lower()
    bracket = re.fullmatch(r"(.+?)\s*[\[({]\s*([^\[\](){}]*?)\s*[\])}]", text)
    if bracket:
        return bracket[1].replace(" ", "_"), bracket[2].removeprefix("in ")
    words = re.fullmatch(r"(.+?)(?:\s+in\s+|\s*[/,]\s*|\s+)([^\s/,]+)", text)
    if words and unit_of_word(words[2]):
        return words[1].replace(" ", "_"), words[2]
    return text.replace(" ", "_"), ""


def _plain_text(text: str) -> str:
    """The text with fractions of one sign and special blanks written out."""
    for sign, written in _VULGAR.items():
        text = text.replace(sign, f" {written}")
    return " ".join(text.split())


def _number(text: str) -> float:
    return float(text.replace(",", "."))
