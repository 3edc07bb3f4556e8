"""Scans as logs hold them: with time, sensor, and the odometry that came along."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from laser_gt.scans.scan import Scan
from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array
from validation.text_files.reading import file_bytes, is_utf16

P = TypeVar("P")
R = TypeVar("R")

MAX_LOG_BYTES = 500_000_000
"""Bytes of the largest log that is read. A judgement: two hours of a scanner with 75 scans a
second; more does not fit into the memory of a small computer."""

SICK_RANGE_MAX = 81.0
"""Metres from which on a range in a log of a SICK scanner is none: nothing came back is written
as 81.91 m, other codes as a few centimetres less."""


@dataclass(frozen=True)
class ScanRecord:
    """A scan of a log.

    Parameters
    ----------
    scan : Scan
        With its time stamp and sensor.
    odometry : (3,) array or None
        Robot pose by odometry, as logged.
    laser_odometry : (3,) array or None
        Sensor pose by odometry, where the log has that too.
    line : int
        Where it stands in its file, from 1; the number of the message in a bag.
    stop : str
        Name of the stop, where the file tells it.
    undistorted : bool
        Whether the beams were put where the moving scanner was when it fired.
    increment : float
        Seconds from beam to beam where the log tells it, the first at the time stamp; negative
        where the angles fall in time; 0 where it does not.
    """

    scan: Scan
    odometry: Array | None = None
    laser_odometry: Array | None = None
    line: int = 0
    stop: str = ""
    undistorted: bool = False
    increment: float = 0.0


@dataclass(frozen=True)
class Line:
    """A place in a file that one scan is read from.

    Parameters
    ----------
    path : Path
        The file.
    number : int
        Line, from 1; number of the message in a bag.
    """

    path: Path
    number: int

    def bad(self, expected: str, name: str, value: str | None = None) -> InputError:
        """The error of a field of this line."""
        return InputError([Problem(self.path, expected, self.number, name, value)])

    def numbers(self, words: Sequence[str], what: str, *, finite: bool = False) -> Array:
        """Words as numbers.

        Parameters
        ----------
        words : sequence of str
            Blanks around each do not matter.
        what : str
            The field, as an error names it.
        finite : bool
            Whether infinite and not-a-number are errors too.

        Raises
        ------
        InputError
            Naming the first word that is no number.
        """
        try:
            values = np.array(words, dtype=float)
        except ValueError:
            value = next(filter(_no_number, words), None)
            raise self.bad("not a number", what, value) from None
        if finite and not np.isfinite(values).all():
            wrong = words[int((~np.isfinite(values)).argmax())]
            raise self.bad("expected a finite number", what, wrong)
        return values


def read_each(
    path: Path, parts: Iterable[tuple[int, P]], read: Callable[[Line, P], R]
) -> tuple[list[R], list[Problem]]:
    """What each part of a file holds, and what is wrong with those that cannot be read.

    Parameters
    ----------
    path : Path
        The file.
    parts : iterable of (int, any)
        Number of each line, and the line.
    read : callable
        Reads one; raises GtvalError.
    """
    found: list[R] = []
    problems: list[Problem] = []
    for number, part in parts:
        try:
            found.append(read(Line(path, number), part))
        except InputError as error:
            problems += error.problems
        except GtvalError as error:  # the numbers are not a scan
            problems.append(Problem(path, str(error), number, "ranges"))
    return found, problems


def checked(
    path: Path, records: Sequence[ScanRecord], problems: Sequence[Problem]
) -> list[ScanRecord]:
    """The records, if there is no problem and no sensor has a time stamp twice.

    Raises
    ------
    InputError
        Naming every bad line; or the file, if it holds no scan.
    """
    problems = list(problems)
    first: dict[tuple[str, float], int] = {}
    for record in records:
        key = (record.scan.sensor, record.scan.time)
        if np.isfinite(key[1]) and key in first:
            problems.append(
                Problem(
                    path,
                    f"the same sensor and time stamp as on line {first[key]}; remove one of them",
                    record.line,
                    "time",
                    repr(record.scan.time),
                )
            )
        first.setdefault(key, record.line)
    if not records and not problems:
        problems.append(Problem(path, "the file holds no scan that can be read"))
    if problems:
        raise InputError(sorted(problems, key=lambda problem: problem.line or 0))
    return list(records)


def read_lines(path: Path) -> list[str]:
    """Lines of a text log, gzip-compressed or not.

    Raises
    ------
    InputError, GtvalError
        If there is no such file, it is too large, or it cannot be unpacked.
    """
    import gzip  # noqa: PLC0415  (only for logs)
    import zlib  # noqa: PLC0415

    try:
        data = file_bytes(path, MAX_LOG_BYTES, "a log")
        if data[:2] == b"\x1f\x8b":
            data = gzip.decompress(data)
        if is_utf16(data):
            raise InputError([Problem(path, "saved as UTF-16; save the file as UTF-8", 1)])
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise InputError([Problem(path, f"the compressed log is damaged: {error}")]) from error
    return data.decode("utf-8", errors="replace").splitlines()


def _no_number(word: str) -> bool:
    """Whether a word cannot be read as a number."""
    try:
        float(word)
    except ValueError:
        return True
    return False


def without_far(ranges: Array, range_max: float) -> Array:
    """Ranges with those at or beyond the sensor's limit as infinite: nothing came back."""
    return np.where(ranges >= range_max, np.inf, ranges)
