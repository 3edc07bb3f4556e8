"""Days of an NMEA log: its positions have times of day only, RMC and ZDA have dates."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache
from typing import NamedTuple

import numpy as np

DAY, HALF_DAY = 86400.0, 43200.0
LATE_DATE = 60.0
"""Seconds at most for which a date may be wrong and then go on as before, and is left out: some
receivers write the date of the day before until a while after midnight. A judgement."""
TIME = re.compile(r"(\d{2})(\d{2})(\d{2}(?:\.\d*)?)")
_DATED = re.compile(
    r"\$(..(?:RMC,([^,\n]*),([^,\n]*),(?:[^,\n]*,){6}(\d{6})|ZDA,([^,\n]*),(\d\d,\d\d,\d{4}))"
    r"[^*\n$]*)(?:\*([0-9A-Fa-f]{2}))?"
)


class Dated(NamedTuple):
    """A sentence with a date: its line, midnight of its day (s since 1970), its time of day (s).

    ``leap`` says that half a day or more passes from the dated sentence before to it, so that times
    of day alone do not tell the day.
    """

    line: int
    day: float
    clock: float
    leap: bool = False

    @property
    def time(self) -> float:
        """Seconds since 1970."""
        return self.day + self.clock


@dataclass
class Calendar:
    """Tells the day of times of day, as the lines of a log come.

    Parameters
    ----------
    dated : sequence of Dated
        The log's sentences with a date, in its order.
    day : float, optional
        Midnight of the current day, seconds since 1970; at first that of the first date.
    last : float, optional
        Time of day of what came last.
    stated : bool
        Whether ``day`` at the beginning is stated by a person: then the log's own dates tell only
        how many days pass.
    """

    dated: Sequence[Dated] = ()
    day: float | None = None
    last: float | None = None
    stated: bool = False
    _at: int = 0
    _shift: float | None = field(default=None, init=False)

    @classmethod
    def of(cls, text: str, start: float | None) -> "Calendar":
        """For the text of a log whose first day is stated, or told by its first date."""
        dated, first = dated_sentences(text)
        if start is not None:
            return cls(dated, start, None, stated=True)
        if first is None:
            return cls()
        # With its time of day, fixes of the evening before a date that was written after midnight
        # are of the day before.
        return cls(dated, first.day, first.clock)

    @property
    def known(self) -> bool:
        """Whether a person or a sentence tells the day."""
        return self.stated or bool(self.dated) or self.day is not None

    def time(self, line: int, clock: float, *, first: bool, of_errors: bool) -> float:
        """Seconds since 1970 of a time of day in a line.

        Parameters
        ----------
        line : int
            Lines come in the order of the log.
        clock : float
            Seconds of the day.
        first : bool
            Whether there is no position yet.
        of_errors : bool
            Whether it is the time of errors, not of a position.

        Notes
        -----
        Midnight passes where the clock falls by half a day. Where it rises by half a day midnight
        was not yet: at the first fix, if the date was written after midnight, and at the errors of
        a fix, which may be written after the next fix. Other rises are pauses.
        """
        for one in self._passed(line):
            if self._shift is None:
                self._shift = self._day_at(one.clock) - one.day if self.stated else 0.0
            self.day, self.last = one.day + self._shift, one.clock
        leapt = self._before_its_date(clock)
        if leapt is not None:
            self.day, self.last = leapt, clock
            return leapt + clock
        rise = 0.0 if self.last is None else clock - self.last
        if rise > HALF_DAY and of_errors:
            return (self.day or 0.0) - DAY + clock
        self.day = self._day_at(clock)
        if rise > HALF_DAY and first:
            self.day -= DAY
        self.last = clock
        return self.day + clock

    def _day_at(self, clock: float) -> float:
        """The day of a time of day that comes next, by the clock alone."""
        fell = self.last is not None and clock - self.last < -HALF_DAY
        return (self.day or 0.0) + (DAY if fell else 0.0)

    def _passed(self, line: int) -> Iterator[Dated]:
        """The dated sentences above a line that have not been passed."""
        while self._at < len(self.dated) and self.dated[self._at].line < line:
            yield self.dated[self._at]
            self._at += 1

    def _before_its_date(self, clock: float) -> float | None:
        """The day of a time after a leap whose date is still to come; None if there is no leap.

        A position may be written before the date of its epoch. It is after the leap if it is nearer
        to the date to come than to what came last.
        """
        if self._at == len(self.dated) or self.last is None:
            return None
        coming = self.dated[self._at]
        if not coming.leap or abs(_apart(clock, coming.clock)) >= abs(_apart(clock, self.last)):
            return None
        return coming.time + (self._shift or 0.0) + _apart(clock, coming.clock) - clock


def _apart(clock: float, other: float) -> float:
    """Seconds from another time of day to one, the shorter way around midnight."""
    return (clock - other + HALF_DAY) % DAY - HALF_DAY


def seconds_of(clock: re.Match[str]) -> float:
    """Seconds of the day of a match of hhmmss.ss."""
    return 3600 * int(clock[1]) + 60 * int(clock[2]) + float(clock[3])


def dated_sentences(text: str) -> tuple[list[Dated], Dated | None]:
    """The sentences of a log that tell the day, and the first that has any date.

    Notes
    -----
    RMC with status A; without them ZDA; without these none, but the first date of an RMC without a
    fix. Left out are dates that leap by half a day or more and are followed within `LATE_DATE` by
    one that goes on from before (a date that is late at midnight, or damaged), and single ones that
    leap and have a wrong checksum.
    """
    found: dict[str, list[tuple[Dated, bool]]] = {"A": [], "ZDA": [], "": []}
    line, at = 1, 0
    for match in _DATED.finditer(text):
        line, at = line + text.count("\n", at, match.start()), match.start()
        clock = TIME.fullmatch(match[2] or match[5] or "")
        day = _midnight(match[4] or match[6])
        if clock is None or day is None:
            continue
        kind = "ZDA" if match[6] else "A" if match[3] == "A" else ""
        whole = match[7] is None or _sum_of(match[1]) == int(match[7], 16)
        found[kind].append((Dated(line, day, seconds_of(clock)), whole))
    dated = _without_late(found["A"] or found["ZDA"])
    return dated, dated[0] if dated else found[""][0][0] if found[""] else None


@cache
def _midnight(value: str) -> float | None:
    """Seconds since 1970 of the midnight that begins a day, of ddmmyy or dd,mm,yyyy."""
    layout = "%d,%m,%Y" if "," in value else "%d%m%y"
    try:
        return datetime.strptime(value, layout).replace(tzinfo=UTC).timestamp()
    except ValueError:
        return None


def _sum_of(body: str) -> int:
    """Checksum of what is between the dollar and the star."""
    value = 0
    for character in body:
        value ^= ord(character)
    return value


def _without_late(found: Sequence[tuple[Dated, bool]]) -> list[Dated]:
    """Dated sentences without dates that are late or damaged, their leaps marked."""
    if not found:
        return []
    times = np.array([one.time for one, _ in found])
    starts = np.flatnonzero(np.r_[True, np.abs(np.diff(times)) >= HALF_DAY])
    ends = np.r_[starts[1:], len(found)]
    taken: list[Dated] = []
    for first, end in zip(starts.tolist(), ends.tolist(), strict=True):
        run = [one for one, _ in found[first:end]]
        wrong = len(run) == 1 and not found[first][1]
        if taken and end < len(found):
            goes_on = abs(found[end][0].time - taken[-1].time) < HALF_DAY
            wrong |= goes_on and run[-1].time - run[0].time < LATE_DATE
        if wrong and len(found) > 1:
            continue
        leap = bool(taken) and abs(run[0].time - taken[-1].time) >= HALF_DAY
        taken += [run[0]._replace(leap=leap), *run[1:]]
    return taken
