"""Faults that a record of fixes shows by itself or beside the other receivers' records."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from rtk_gt.receivers.fixes import Bools, Fixes
from validation.errors import MANY_ALIKE, InputError, Problem
from validation.poses.angles import Array
from validation.poses.earth_frames import LocalFrame, ecef_from_geodetic

FAR = 100_000.0
"""Metres from the other receivers or the frame's origin: farther is another drive. A judgement; RTK
needs its base station within some 50 km."""
FASTEST = 150.0
"""m/s; road vehicles stay below 120, damaged digits make kilometres."""
LONGEST = 86_400.0
"""A pause longer than a day between two fixes is a wrong clock, not a pause."""

COPIES = 10
"""Common fixes that show a copy: one in a million is the same by chance where digits are 1 mm and
noise is 5 mm, ten never are."""


def check_fixes(records: Sequence[Fixes], frame: LocalFrame | None = None) -> None:
    """Raise for leaps in time or place and exchanged coordinates, all of them at once.

    Parameters
    ----------
    records : sequence of Fixes
        Of all receivers.
    frame : LocalFrame, optional
        Where the drive took place.

    Raises
    ------
    InputError
        Naming file, line and value.
    """
    problems = [p for record in records for p in (*_in_time(record), *_in_place(record))]
    problems += _apart(records, frame)
    problems += _copies(records)
    if problems:
        raise InputError(problems)


def _copies(records: Sequence[Fixes]) -> list[Problem]:
    """Pairs of receivers with one record: noise keeps even neighbouring antennas apart."""
    found = []
    for first, second in combinations(records, 2):
        _, mine, theirs = np.intersect1d(first.times, second.times, return_indices=True)
        same = (first.geodetic[mine] == second.geodetic[theirs]).all(1)
        if len(same) >= COPIES and same.mean() > 0.5:
            found.append(
                Problem(
                    second.source,
                    f"the record of receiver {first.receiver} ({first.source.name}) once more: "
                    f"{int(same.sum())} of {len(same)} positions are the same to the last digit; "
                    f"name the file that receiver {second.receiver} wrote",
                    int(second.lines[0]),
                    "receiver",
                    second.receiver,
                )
            )
    return found


def _in_time(record: Fixes) -> list[Problem]:
    """Fixes that are not later than the one before, and pauses of days."""
    steps = np.diff(record.times)
    found = []
    for row in np.flatnonzero((steps <= 0) | (steps > LONGEST)):
        step = float(steps[row])
        what = (
            "the same time as"
            if step == 0
            else (
                f"{abs(step):g} s " if abs(step) < LONGEST else f"{abs(step) / LONGEST:.2f} days "
            )
        )
        if step:
            what += "earlier than" if step < 0 else "later than"
        found.append(
            Problem(
                record.source,
                f"{what} the fix before (receiver {record.receiver}); times must increase, "
                "without leaps of days"
                + ("; cut the log here, one drive a campaign" if step > LONGEST else ""),
                int(record.lines[row + 1]),
                "time",
                f"{record.times[row + 1]:.3f}",
            )
        )
    return found


def _in_place(record: Fixes) -> list[Problem]:
    """RTK-fixed positions that no vehicle could have reached from the one before."""
    nowhere = record.fixed & (record.geodetic[:, :2] == 0).all(1)
    found = [] if nowhere.all() or not nowhere.any() else [_nowhere(record, nowhere)]
    fixed = record.select(record.fixed & ~nowhere)
    if len(fixed) < 2:
        return found
    places = ecef_from_geodetic(fixed.geodetic)
    lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
    times = np.maximum(np.diff(fixed.times), 1e-3)
    # False fixes of metres are for the estimators to weigh; this is for damaged numbers. 1 km: a
    # judgement, a hundred times the largest false fix and a digit of a degree of latitude less.
    impossible = np.flatnonzero((lengths > FASTEST * times) & (lengths > 1000.0)).tolist()
    many = len(impossible) > MANY_ALIKE
    more = (
        f"; {len(impossible)} positions of this file are so far from the one before: look at the "
        "columns and the digits of its coordinates, or leave these lines out"
    )
    return found + [
        Problem(
            record.source,
            f"{lengths[row] / 1000:.1f} km from the fix {times[row]:g} s before (receiver "
            f"{record.receiver}){more if many else ''}",
            int(fixed.lines[row + 1]),
            "position",
            _degrees(fixed, row + 1),
        )
        for row in impossible[: 1 if many else None]
    ]


def _nowhere(record: Fixes, rows: Bools) -> Problem:
    """Positions of latitude and longitude 0 among others, which receivers write without a fix."""
    first = int(np.flatnonzero(rows)[0])
    said = (
        f"{int(rows.sum())} positions of receiver {record.receiver} are 0, 0, though they are "
        "marked RTK fixed: it wrote them without a position; leave these lines out, or give them "
        "the fix kind 0"
    )
    return Problem(
        record.source, said, int(record.lines[first]), "position", _degrees(record, first)
    )


def _degrees(record: Fixes, row: int) -> str:
    latitude, longitude = np.degrees(record.geodetic[row, :2])
    return f"{latitude:.7f}, {longitude:.7f}"


def _apart(records: Sequence[Fixes], frame: LocalFrame | None) -> list[Problem]:
    """Records of another place; exchanged latitude and longitude are named."""
    records = [record for record in records if len(record)]
    if not records:
        return []
    where = [np.median(ecef_from_geodetic(r.geodetic), axis=0) for r in records]
    centre = frame.origin if frame is not None else np.median(where, axis=0)
    found = []
    for record, place in zip(records, where, strict=True):
        if np.linalg.norm(place - centre) <= FAR:
            continue
        distance = np.linalg.norm(place - centre) / 1000
        found.append(
            Problem(
                record.source,
                _mistaken(record, centre)
                or f"receiver {record.receiver} is {distance:.0f} km from the frame's origin or "
                "the other receivers; state the origin of this drive, or the file of it",
                int(record.lines[0]),
                "position",
                _degrees(record, 0),
            )
        )
    return found


def _mistaken(record: Fixes, centre: Array) -> str:
    """Which mistake of writing would explain that a record is far away; '' if none would."""
    latitude, longitude, height = np.median(record.geodetic, axis=0)
    for words, north, east in (
        ("latitude and longitude are exchanged", longitude, latitude),
        ("the hemisphere is wrong: N and S are exchanged", -latitude, longitude),
        ("the hemisphere is wrong: E and W are exchanged", latitude, -longitude),
        ("the hemispheres are wrong: N and S, E and W are exchanged", -latitude, -longitude),
        ("latitude and longitude are exchanged, without their hemispheres", -longitude, -latitude),
        ("latitude and longitude are exchanged, without their hemispheres", longitude, -latitude),
        ("latitude and longitude are exchanged, without their hemispheres", -longitude, latitude),
        (
            "latitude and longitude are in radians; write degrees",
            np.degrees(latitude),
            np.degrees(longitude),
        ),
    ):
        if abs(north) > np.pi / 2:
            continue
        if np.linalg.norm(ecef_from_geodetic([north, east, height]) - centre) <= FAR:
            return f"receiver {record.receiver}: {words}"
    return ""
