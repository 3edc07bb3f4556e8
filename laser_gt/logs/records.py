"""Scans as logs hold them: with time, sensor, and the odometry that came along."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from laser_gt.scans.scan import Scan, scan_fault
from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array

MAX_LOG_BYTES = 500_000_000


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
    """

    scan: Scan
    odometry: Array | None = None
    laser_odometry: Array | None = None
    line: int = 0
    stop: str = ""
    undistorted: bool = False


def make_scan(
    path: Path,
    line: int,
    ranges: Array,
    angles: Array,
    *,
    range_min: float,
    range_max: float,
    time: float,
    sensor: str,
    sigma: float | None = None,
) -> Scan | Problem:
    """A scan, or what is wrong with the line that it came from."""
    fault = scan_fault(ranges, angles, range_min, range_max)
    if fault is not None:
        return Problem(path, f"not a scan: {fault}", line, "ranges")
    return Scan(ranges, angles, range_min, range_max, sigma, time, sensor)


def checked(path: Path, records: Sequence[ScanRecord | Problem]) -> list[ScanRecord]:
    """The records, if all lines were good and no sensor has a time stamp twice.

    Raises
    ------
    InputError
        Naming every bad line; or the file, if it holds no scan.
    """
    problems = [record for record in records if isinstance(record, Problem)]
    good = [record for record in records if isinstance(record, ScanRecord)]
    first: dict[tuple[str, float], int] = {}
    for record in good:
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
    if not good and not problems:
        problems.append(Problem(path, "the file holds no scan that can be read"))
    if problems:
        raise InputError(sorted(problems, key=lambda problem: problem.line or 0))
    return good


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
        if path.stat().st_size > MAX_LOG_BYTES:
            raise InputError([Problem(path, "larger than 500 MB; cut the log into parts")])
        data = path.read_bytes()
        if data[:2] == b"\x1f\x8b":
            data = gzip.decompress(data)
    except FileNotFoundError:
        raise InputError([Problem(path, "there is no such file")]) from None
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise InputError([Problem(path, f"the compressed log is damaged: {error}")]) from error
    except OSError as error:
        raise GtvalError(f"cannot read {path}: {error.strerror or error}") from error
    return data.decode("utf-8", errors="replace").splitlines()


def numbers(
    path: Path, line: int, words: Sequence[str], what: str, *, finite: bool = False
) -> Array | Problem:
    """Words as numbers, or the problem of the first that is none.

    Parameters
    ----------
    path, line
        Where they stand.
    words : sequence of str
        Blanks around each do not matter.
    what : str
        The field, as a problem names it.
    finite : bool
        Whether infinite and not-a-number are problems too.
    """
    try:
        values = np.array(words, dtype=float)
    except ValueError:
        return Problem(path, "not a number", line, what, next(filter(_no_number, words), None))
    if finite and not np.isfinite(values).all():
        bad = words[int((~np.isfinite(values)).argmax())]
        return Problem(path, "expected a finite number", line, what, bad)
    return values


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
