"""Which unit the distances of a readings file are in: told by the frame, never guessed."""

import math
import re
from collections.abc import Mapping, Sequence

from validation.statistics.units import CLOSE
from validation.text_files.csv_tables import Column, CsvTable, expected
from validation.text_files.lengths import METRES, UNIT_NAMES

Places = Mapping[str, tuple[float, float]]
_THOUSANDS = re.compile(r"[+-]?\d{1,3}([.,]\d{3})+\D")


def check_distances(table: CsvTable, places: Places, distance: Column) -> None:
    """Flag distances in another unit than they are taken in, and those that cannot be.

    Parameters
    ----------
    table : CsvTable
        Columns 'from', 'to' and 'distance', the numbers metres, of any size.
    places : mapping of str to (float, float)
        The Vframe points by their names in the file, metres.
    distance : Column
        Limits of a distance, metres, and the unit of those that state none.
    """
    before = len(table.problems)
    check_unit(table, places, distance.written_in)
    if len(table.problems) > before:
        return
    numbers, own = table.numbers["distance"], table.own_unit["distance"]
    low, high = distance.low, distance.high
    bad = [row for row, number in enumerate(numbers) if number < low or number > high]
    plain = [row for row in range(len(numbers)) if not own[row] and not math.isnan(numbers[row])]
    large = [row for row in bad if numbers[row] > high and not own[row]]
    if len(large) >= 3 and 2 * len(large) >= len(plain):
        said = f"out of range, like {len(large)} of {len(plain)} cells; expected"
        fix = _fix([numbers[row] / METRES[distance.written_in] for row in plain], low, high)
        table.flag(large[0], "distance", f"{said} {expected(distance)}: {fix}")
        return

    def _perhaps(row: int) -> str:
        number, cell = numbers[row] / METRES[distance.written_in], table.raw["distance"][row]
        if own[row] and _THOUSANDS.match(cell.strip()):
            return "; write it without signs between the thousands"
        small = low <= number / 1000 <= high and number > high and not own[row]
        return f"; if it is in millimetres, write '{cell.strip()} mm'" if small else ""

    for row in bad:
        table.flag(row, "distance", f"out of range; expected {expected(distance)}{_perhaps(row)}")


def _fix(numbers: Sequence[float], low: float, high: float) -> str:
    """The line of campaign.toml that puts all numbers within range."""
    fitting = [
        unit
        for unit, metres in METRES.items()
        if all(low <= number * metres <= high for number in numbers)
    ]
    if not fitting:
        return "divide millimetres by 1000, centimetres by 100"
    lines = " or ".join(f'units = "{unit}" ({UNIT_NAMES[unit]})' for unit in fitting)
    return f"write under [survey] of campaign.toml what they are in: {lines}"


def check_unit(table: CsvTable, places: Places, written_in: str) -> None:
    """Flag distances of a frame whose sides are as many times the stated ones as feet a metre.

    Parameters
    ----------
    table : CsvTable
        Columns 'from', 'to' and 'distance', the numbers taken as ``written_in``.
    places : mapping of str to (float, float)
        The Vframe points by their names in the file, metres.
    written_in : {"m", "cm", "mm", "ft", "in"}
        The unit of campaign.toml.

    Notes
    -----
    Only rows that do not state their own unit are looked at. Where the frame, by two pairs or
    more, says one unit and no pair contradicts it, the line to write is named; where pairs
    contradict one another, each row that is in another unit.
    """
    units = _units_by_row(table, places, written_in)
    pairs: dict[frozenset[str], set[str]] = {}
    for row, unit in units.items():
        ends = frozenset((table.text["from"][row], table.text["to"][row]))
        pairs.setdefault(ends, set()).add(unit)
    found = {unit for said in pairs.values() for unit in said}
    others = found - {"", written_in}
    if len(pairs) < 2 or not others:
        return
    first = min(row for row, unit in units.items() if unit in others)
    if len(found) == 1:
        unit = next(iter(others))
        table.flag(
            first,
            "distance",
            f"the lengths between Vframe points are in {UNIT_NAMES[unit]}, by [vframe]; write "
            f'units = "{unit}" under [survey] of campaign.toml, or write '
            f"{UNIT_NAMES[written_in]} here",
        )
    elif sum(bool(said & others) for said in pairs.values()) > 1:
        for row, unit in units.items():
            if unit in others:
                table.flag(
                    row,
                    "distance",
                    f"by [vframe] this is in {UNIT_NAMES[unit]}, and other rows are not; write the "
                    f"unit behind the number, as in '{table.raw['distance'][row].strip()} {unit}'",
                )


def _units_by_row(table: CsvTable, places: Places, written_in: str) -> dict[int, str]:
    """The unit that each row within the frame is in by its length, '' where it is none."""
    units = {}
    own = table.own_unit["distance"]
    for row, ends in enumerate(zip(table.text["from"], table.text["to"], strict=True)):
        a, b = (places.get(name) for name in ends)
        number = table.numbers["distance"][row]
        if a and b and a != b and not own[row] and not math.isnan(number):
            ratio = number / METRES[written_in] / math.dist(a, b)
            units[row] = _unit_of(ratio)
    return units


def _unit_of(ratio: float) -> str:
    """The unit that is so many times in a metre, '' if none."""
    near = (unit for unit, metres in METRES.items() if abs(ratio * metres - 1) < CLOSE)
    return next(near, "")


def places_of_frame(points: Places, labels: Mapping[str, str]) -> Places:
    """The points of the frame by the names that stand for them in the file."""
    named = {label: points[meaning] for label, meaning in labels.items() if meaning in points}
    return {**points, **named}
