"""Units of time that headings of tables name."""

from validation.text_files.lengths import split_heading

SCALES = {"s": 1, "ms": 1_000, "us": 1_000_000, "ns": 1_000_000_000}
"""How many of each unit make a second."""
UNIT_NAMES = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), "s"),
    **dict.fromkeys(("ms", "msec", "msecs", "milliseconds", "millis"), "ms"),
    **dict.fromkeys(("us", "usec", "usecs", "microseconds", "µs", "micros"), "us"),
    **dict.fromkeys(("ns", "nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds", "nanos"), "ns"),
}
"""Spellings of the units in headers."""


def time_heading(heading: str) -> tuple[str, str]:
    """The name of a column of times, and the unit that its heading states, '' where none.

    Parameters
    ----------
    heading : str
        'time_ms', 't [us]', 'stamp in ns', 'time'.

    Returns
    -------
    name : str
        In small letters, with _ for blanks.
    unit : str
        A key of `SCALES` where it is one of these; else as it stands in the heading's brackets.
    """
    name, unit = split_heading(heading)
    stem, _, last = name.rpartition("_")
    if not unit and stem and last in UNIT_NAMES:
        name, unit = stem.removesuffix("_in"), last
    return name, UNIT_NAMES.get(unit, unit)
