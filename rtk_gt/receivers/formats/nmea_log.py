"""What has been read of an NMEA log so far: positions, errors, and lines that are damaged."""

import re
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from rtk_gt.receivers.formats.dates import Calendar
from rtk_gt.receivers.formats.error_ellipses import EllipseRecord
from validation.errors import MANY_ALIKE, MAX_SHOWN_PROBLEMS, InputError, Problem
from validation.poses.angles import Array

FEW_DAMAGED = 0.05
"""Share of the lines that may be damaged for the log to be read without them: a judgement. Serial
lines lose one sentence in thousands; where more are gone, something else is wrong."""
STANDS = 0.2
"""Least share of positions with a time of their own: receivers write a few GGA for each."""
LATE = 10.0
"""Seconds by which sentences may be out of order: networks exchange neighbours. One that goes back
farther begins another log, or a clock was set."""


@dataclass
class NmeaLog:
    """What has been read so far."""

    path: Path
    skip_damaged: bool | None
    calendar: Calendar = field(default_factory=Calendar)
    tolerated: Counter[str] = field(default_factory=Counter)
    problems: list[Problem] = field(default_factory=list)
    lost: list[Problem] = field(default_factory=list)
    lines: int = 0
    whole: bool = True
    rows: list[tuple[float, float, float, float, int, int, float, int, float, str]] = field(
        default_factory=list
    )
    host: float = np.nan
    talker: str = ""
    sentences: int = 0
    without_fix: int = 0
    without_geoid: list[int] = field(default_factory=list)
    geoid: list[float] = field(default_factory=list)
    ellipses: dict[float, EllipseRecord] = field(default_factory=dict)
    dated: bool = False

    def bad(self, line: int, name: str, value: str, expected: str) -> None:
        """Record a bad place."""
        if not self.whole:  # no checksum says that it was written so
            self.damaged(line, value, f"{name}: {expected}")
            return
        self.problems.append(Problem(self.path, expected, line, name, value))
        if len(self.problems) > 10 * MAX_SHOWN_PROBLEMS:
            raise InputError(self.problems)

    def damaged(self, line: int, value: str, what: str) -> None:
        """A sentence that did not arrive whole."""
        if self.skip_damaged is not False:
            # What differs from line to line is in the first one's message.
            kind = re.split(r" is [0-9A-Fa-f]|: ", what)[0]
            self.tolerated[f"damaged sentence skipped ({kind})"] += 1
        hint = "to leave such sentences out, set `skip_damaged = true` in [rtk]"
        if len(self.lost) < 10 * MAX_SHOWN_PROBLEMS:
            self.lost.append(Problem(self.path, f"{what}; {hint}", line, "sentence", value))

    @property
    def many_lost(self) -> bool:
        """Whether damaged sentences are an error."""
        if self.skip_damaged is not None:
            return not self.skip_damaged and bool(self.lost)
        return self.damaged_count > FEW_DAMAGED * self.lines

    @property
    def damaged_count(self) -> int:
        """How many sentences did not arrive whole; where none may be, of those that are kept."""
        count = sum(n for what, n in self.tolerated.items() if what.startswith("damaged"))
        return max(count, len(self.lost))

    @property
    def lost_in_words(self) -> list[Problem]:
        """The damaged sentences as errors: few one by one, many as one, which have one cause."""
        if len(self.lost) <= MANY_ALIKE:
            return self.lost
        first = self.lost[0]
        said = (
            f"{first.expected}. In all {self.damaged_count} of {self.lines} lines are damaged: "
            "look at the cable, its baud rate and the logger, or copy the file again as binary"
        )
        return [replace(first, expected=said)]


def above_sea(log: NmeaLog) -> Array:
    """(n,) added to heights without a geoid separation: the middle of those that are told.

    The geoid changes by centimetres over the kilometre of a drive.
    """
    added = np.zeros(len(log.rows))
    if not log.without_geoid:
        return added
    told = float(np.median(log.geoid)) if log.geoid else 0.0
    what = "that of the rest of the log" if log.geoid else "taken as ellipsoidal height"
    log.tolerated[f"no geoid separation: {what}"] += len(log.without_geoid)
    added[log.without_geoid] = told
    return added


def in_order(log: NmeaLog) -> list[int]:
    """Which rows are taken, in order of time: of several of one time that of the first talker."""
    times = np.array([row[0] for row in log.rows])
    order = np.arange(len(times))
    back = np.diff(times)
    if (back < 0).any() and (back > -LATE).all():
        log.tolerated["sentences out of order, sorted"] += int((back < 0).sum())
        order = np.argsort(times, kind="stable")
    taken: list[int] = []
    for row in order.tolist():
        if not (taken and times[row] == times[taken[-1]]):
            taken.append(row)
            continue
        log.tolerated["another GGA of the same time left out"] += 1
        if log.rows[row][-1] == log.rows[0][-1] != log.rows[taken[-1]][-1]:
            taken[-1] = row
    return taken
