"""Numbers of almanac files, with the place of every bad one."""

import re
from dataclasses import dataclass, field
from math import pi
from pathlib import Path

from rtk_gt.planning.almanacs.orbits import LARGEST_ECCENTRICITY
from validation.errors import MAX_SHOWN_PROBLEMS, InputError, Problem

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eEdD][+-]?\d+)?")
TURN = 2 * pi * 1.001
"""Angles in radians are written within a turn."""
LIMITS = {
    "eccentricity": (0.0, LARGEST_ECCENTRICITY),
    "inclination": (0.0, pi),
    "node_rate": (-1e-6, 1e-6),
    "root_a": (4000.0, 7000.0),
    "node": (-TURN, TURN),
    "perigee": (-TURN, TURN),
    "anomaly": (-TURN, TURN),
    "inclination_rate": (-1e-6, 1e-6),
    "motion": (-1e-6, 1e-6),
    **dict.fromkeys(("cuc", "cus", "cic", "cis"), (-1e-2, 1e-2)),
    **dict.fromkeys(("crc", "crs"), (-1e5, 1e5)),
    "toe": (0.0, 604800.0),
    "week": (0.0, 10000.0),
    "health": (0.0, 1023.0),
}
"""Between these lies what a navigation satellite can have, in rad, m and s: a number beyond stands
in the wrong place. The semi-major axes are 16,000 to 49,000 km."""


@dataclass
class Reading:
    """A file being read.

    Parameters
    ----------
    path : Path
        The file.
    problems : list of Problem
        The bad places so far.
    """

    path: Path
    problems: list[Problem] = field(default_factory=list)

    def bad(self, line: int, name: str, value: str | None, expected: str) -> None:
        """Note a bad place; raise once there are far too many."""
        self.problems.append(Problem(self.path, expected, line, name, value))
        if len(self.problems) > 10 * MAX_SHOWN_PROBLEMS:
            self.stop()

    def stop(self) -> None:
        """Raise an InputError if there was a bad place."""
        if self.problems:
            raise InputError(self.problems)

    def number(self, line: int, name: str, cell: str, kind: str = "", scale: float = 1.0) -> float:
        """A number within the limits of its kind after scaling; 0 after noting that it is none."""
        text = cell.strip()
        if _NUMBER.fullmatch(text) is None:
            said = "is missing" if not text else "not a number"
            self.bad(line, name, text, f"{said}; was the line cut, or columns moved?")
            return 0.0
        value = float(text.replace("D", "E").replace("d", "e")) * scale
        low, high = LIMITS.get(kind, (float("-inf"), float("inf")))
        if not low <= value <= high:
            said = f"{low / scale:.6g} to {high / scale:.6g}"
            self.bad(line, name, text, f"out of range; expected {said}")
            return 0.0
        return value

    def whole(self, line: int, name: str, cell: str, low: int, high: int) -> int:
        """A whole number within limits, or 0 after noting that it is none."""
        text = cell.strip()
        if not text.isdigit() or not low <= int(text) <= high:
            self.bad(line, name, text, f"expected a whole number from {low} to {high}")
            return 0
        return int(text)


def nearest_week(week: int, seconds: float, gps: float) -> int:
    """The whole GPS week meant by one written modulo 1024.

    Parameters
    ----------
    week : int
        As written. 1024 and above is whole already.
    seconds : float
        Of the week, at which the elements hold.
    gps : float
        Time for which the almanac is wanted, GPS seconds: the weeks possible are 19.6 years
        apart, and the one nearest to this time is meant.
    """
    if week >= 1024:
        return week
    turns = round((gps - (week * 604800.0 + seconds)) / (1024 * 604800.0))
    return week + 1024 * max(turns, 0)
