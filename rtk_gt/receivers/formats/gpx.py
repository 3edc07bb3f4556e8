"""Tracks of GPX files.

GPX 1.1 knows the kinds of fixes none, 2d, 3d, dgps and pps, not RTK. Where a point's comment or an
extension names one (as those that gtval writes do) that is taken.
"""

import re
from collections import Counter
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from xml.parsers import expat

import numpy as np

from rtk_gt.receivers.fixes import AUTONOMOUS, DGPS, NO_FIX, PPS, RTK_FIXED, RTK_FLOAT, Fixes
from validation.errors import MAX_SHOWN_PROBLEMS, InputError, Problem

FIXES = {"none": NO_FIX, "2d": AUTONOMOUS, "3d": AUTONOMOUS, "dgps": DGPS, "pps": PPS}
_SAID = ((RTK_FIXED, re.compile(r"(?i)\brtk[ _-]?(fix|fixed|int)\b|^fixed$|^fix$")),
         (RTK_FLOAT, re.compile(r"(?i)\brtk[ _-]?float\b|^float$")))  # fmt: skip
_SIGMA = re.compile(r"sigma_(level|up) ([0-9.eE+-]+) m")
UNTOLD = (
    "GPX does not say which points are RTK-fixed, nor does this file: none is taken as such. State "
    "`all_fixed = true` at the receiver if all are."
)
SEA = "Heights of GPX are above the sea; here they are taken as heights above the ellipsoid."


@dataclass
class _Track:
    """What has been read so far, and the point that is being read."""

    path: Path
    rows: list[list[float]] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)
    told: bool = False
    ellipsoidal: bool = False
    point: dict[str, str] | None = None
    line: int = 0
    name: str = ""
    text: str = ""

    def bad(self, name: str, value: str, expected: str) -> None:
        """Record a bad place."""
        self.problems.append(Problem(self.path, expected, self.line, name, value))
        if len(self.problems) > 10 * MAX_SHOWN_PROBLEMS:
            raise InputError(self.problems)


def gpx_fixes(path: Path, data: bytes, receiver: str, *, all_fixed: bool = False) -> Fixes:
    """The points of the tracks of a GPX file's contents.

    Parameters
    ----------
    path : Path
        For messages.
    data : bytes
        Contents.
    receiver : str
        Name for the record.
    all_fixed : bool
        Whether points whose kind is not told are RTK-fixed.

    Raises
    ------
    InputError
        Naming line, field and value of every bad place.
    """
    track = _Track(path)
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.StartElementHandler = lambda name, given: _start(track, parser, name, given)
    parser.EndElementHandler = lambda name: _end(track, name)
    parser.CharacterDataHandler = lambda text: _add(track, text)
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        said = f"not whole XML: {expat.ErrorString(error.code)}; was the file cut?"
        track.problems.append(Problem(path, said, error.lineno))
    if not track.rows and not track.problems:
        said = "no track point (trkpt) with a time; waypoints and routes have none"
        track.problems.append(Problem(path, said))
    if track.problems:
        raise InputError(track.problems)
    return _fixes(track, receiver, all_fixed=all_fixed)


def _start(track: _Track, parser: expat.XMLParserType, name: str, given: dict[str, str]) -> None:
    track.name, track.text = name.rpartition(" ")[2].lower(), ""
    if track.name == "trkpt":
        track.point = {key.lower(): value for key, value in given.items()}
        track.line = parser.CurrentLineNumber
    elif track.name == "desc" and track.point is None:
        track.text = ""


def _add(track: _Track, text: str) -> None:
    track.text += text


def _end(track: _Track, name: str) -> None:
    short = name.rpartition(" ")[2].lower()
    if short == "desc" and track.point is None and "ellipsoid" in track.text:
        track.ellipsoidal = True
    if track.point is None:
        return
    if short == "trkpt":
        _point(track, track.point)
        track.point = None
    elif track.text.strip():
        track.point.setdefault(short, track.text.strip())


def _number(track: _Track, name: str, low: float, high: float) -> float | None:
    text = (track.point or {}).get(name, "")
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not low <= value <= high:
        track.bad(name, text, f"not a number from {low:g} to {high:g}")
        return None
    return value


def _point(track: _Track, point: dict[str, str]) -> None:
    """One point of a track."""
    if "time" not in point:
        track.counts["point without a time left out"] += 1
        return
    if "ele" not in point:
        track.counts["point without a height left out"] += 1
        return
    try:
        stamp = datetime.fromisoformat(point["time"])
    except ValueError:
        track.bad("time", point["time"], "not a time; expected 2024-04-10T09:00:00Z")
        return
    latitude, longitude = _number(track, "lat", -90, 90), _number(track, "lon", -180, 360)
    height = _number(track, "ele", -1000, 20000)
    above = _number(track, "geoidheight", -200, 200) if "geoidheight" in point else 0.0
    if latitude is None or longitude is None or height is None or above is None:
        return
    track.ellipsoidal |= "geoidheight" in point
    kind = _kind(track, point)
    if kind == NO_FIX:
        track.counts["point without a fix"] += 1
        return
    sigmas = {name: float(value) for name, value in _SIGMA.findall(point.get("cmt", ""))}
    time = (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()
    quality = [_optional(point, "sat"), _optional(point, "hdop")]
    stated = [sigmas.get("level", np.nan), sigmas.get("up", np.nan)]
    track.rows.append(
        [time, latitude, longitude, height + above, kind, *quality, *stated, track.line]
    )


def _optional(point: dict[str, str], name: str) -> float:
    try:
        return float(point.get(name, "nan"))
    except ValueError:
        return np.nan


def _kind(track: _Track, point: dict[str, str]) -> int:
    for name in ("cmt", "type", "desc", "fixtype", "quality", "status", "fix"):
        for kind, words in _SAID:
            if words.search(point.get(name, "")):
                track.told = True
                return kind
    return FIXES.get(point.get("fix", "3d").lower(), AUTONOMOUS)


def _fixes(track: _Track, receiver: str, *, all_fixed: bool) -> Fixes:
    rows = np.array(track.rows)
    kinds = rows[:, 4].astype(np.int64)
    notes = () if track.ellipsoidal else (SEA,)
    if not track.told:
        notes = notes if all_fixed else (*notes, UNTOLD)
        kinds = np.where(all_fixed, RTK_FIXED, kinds)
    covariances = np.full((len(rows), 3, 3), np.nan)
    stated = np.isfinite(rows[:, 7:9]).all(1)
    covariances[stated] = rows[stated][:, [7, 7, 8], None] ** 2 * np.eye(3)
    without = track.counts.pop("point without a fix", 0)
    return Fixes(
        receiver=receiver,
        times=rows[:, 0],
        geodetic=np.column_stack([np.radians(rows[:, 1:3]), rows[:, 3]]),
        kinds=kinds,
        satellites=np.nan_to_num(rows[:, 5], nan=-1).astype(np.int64),
        hdop=rows[:, 6],
        covariances=covariances,
        lines=rows[:, 9].astype(np.int64),
        source=track.path,
        tolerated=dict(track.counts),
        notes=notes,
        without_fix=without,
    )
