"""Almanac files of any kind, told apart by what stands in them."""

from datetime import UTC, date, datetime
from pathlib import Path

import numpy as np

from rtk_gt.planning.almanacs import sem, two_line, yuma
from rtk_gt.planning.almanacs.almanac import Almanac, gps_seconds
from rtk_gt.planning.almanacs.navigation_files import HEADER_END, read_navigation
from validation.errors import GtvalError, InputError, Problem
from validation.text_files.reading import is_utf16
from validation.trajectories.formats.rawlog_objects import unpacked

MAX_BYTES = 200_000_000
"""A judgement: a day of broadcast elements of all systems and stations has some 10 MB."""
_HEADER_LINES = 200


def midnight(day: date) -> float:
    """The start of a day in UTC, seconds since 1970."""
    return datetime(day.year, day.month, day.day, tzinfo=UTC).timestamp()


def read_almanac(path: Path, day: date) -> Almanac:
    """The satellites of a YUMA or SEM almanac, of two-line elements, or of a navigation file.

    Parameters
    ----------
    path : Path
        The file; it may be compressed (.gz).
    day : date
        UTC day for which it is wanted. Almanacs count weeks modulo 1024; the week nearest to it
        is meant.

    Raises
    ------
    InputError
        Naming line, field and value of every bad place.
    GtvalError
        If the file is none of these, or holds no healthy satellite.
    """
    data = unpacked(path, MAX_BYTES)
    if is_utf16(data):
        raise InputError([Problem(path, "saved as UTF-16; save the file as UTF-8", 1)])
    lines = data.decode("utf-8-sig", errors="replace").splitlines()
    while lines and not lines[-1].strip():
        lines.pop()
    almanac = _read(path, lines, float(gps_seconds(np.array([midnight(day) + 43200.0]))[0]))
    if not almanac.names:
        raise GtvalError(f"{path}: no healthy satellite in the file")
    return almanac


def _read(path: Path, lines: list[str], gps: float) -> Almanac:
    """By the kind of its lines."""
    if any("RINEX VERSION" in line[60:] for line in lines[:1]) or any(
        line[60:].strip() == HEADER_END for line in lines[:_HEADER_LINES]
    ):
        return read_navigation(path, lines)
    filled = [line.strip() for line in lines if line.strip()]
    if any(yuma.HEADING.match(line) for line in filled[:10]):
        return yuma.read_yuma(path, lines, gps)
    if any(two_line.FIRST.match(line) for line in filled[:3]):
        return two_line.read_two_line(path, lines)
    if len(lines) > 2 and sem.FIRST.fullmatch(lines[0]) and sem.SECOND.fullmatch(lines[1]):
        return sem.read_sem(path, lines, gps)
    first = filled[0] if filled else ""
    said = (
        "neither a YUMA or SEM almanac, nor two-line elements, nor a RINEX navigation file; "
        "the Navigation Center of the U.S. Coast Guard has almanacs of each week"
    )
    raise InputError([Problem(path, said, 1, None, first)])
