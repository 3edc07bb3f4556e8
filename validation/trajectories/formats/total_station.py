"""Points of total stations with the time of each: Leica GSI and LandXML."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from xml.etree import ElementTree as ET

import numpy as np

from validation.errors import InputError
from validation.trajectories.formats.records import Records
from validation.trajectories.formats.source import MAX_PROBLEMS, Asked, Source, read_times_file

NO_TIMES = (
    "these are points without times: give a file with one time a line, in the order of the points, "
    "with --times times.txt; or, if they are named stops, make a table pose,x,y,theta of them"
)
_WORD = re.compile(r"(\d{2})([\d.]{4})([+-])([0-9A-Za-z.\-_]+)$")
_GSI_UNITS = {"0": 1e-3, "6": 1e-4, "8": 1e-5, "1": 0.3048e-3, "7": 0.3048e-4}
"""Metres of the last digit, by the sixth character of a word: mm, 0.1 mm, 0.01 mm; feet / 1,000 and
/ 10,000. Source: Leica Geosystems, GSI Online for TPS and DNA, data format."""
_LANDXML_UNITS = {
    "meter": 1.0,
    "millimeter": 1e-3,
    "centimeter": 1e-2,
    "kilometer": 1e3,
    "foot": 0.3048,
    "USSurveyFoot": 1200 / 3937,
    "inch": 0.0254,
}


def gsi_fault(source: Source) -> str | None:
    """Why a file is no Leica GSI, None if it is."""
    first = next((line.split() for line in source.lines if line.strip()), [])
    if first and all(_WORD.match(word.lstrip("*")) for word in first):
        return None
    return "the first line is not of words such as 110001+00000001"


def landxml_fault(source: Source) -> str | None:
    """Why a file is no LandXML, None if it is."""
    return None if b"<LandXML" in source.data[:4096] else "there is no element <LandXML"


def read_gsi(source: Source, asked: Asked) -> Records:
    """Points of a GSI-8 or GSI-16 file: east, north, height of the words 81, 82, 83.

    Notes
    -----
    The time is in the words 18 (year, seconds, milliseconds) and 19 (month, day, hour, minute).
    """
    points: list[list[float]] = []
    lines: list[int] = []
    stamps: list[str | None] = []
    bad = []
    for number, line in enumerate(source.lines, 1):
        words = {}
        for word in line.split():
            found = _WORD.match(word.lstrip("*"))
            if found is None:
                bad.append(source.problem("not a word of GSI", number, None, word))
                continue
            words[found.group(1)] = found.groups()[1:]
        if not {"81", "82"} <= set(words) or len(bad) >= MAX_PROBLEMS:
            continue
        point = []
        for key in ("81", "82", "83"):
            if key not in words:
                continue
            info, sign, digits = words[key]
            if not digits.isdigit() or info[3] not in _GSI_UNITS:
                bad.append(source.problem("not a coordinate", number, key, digits))
                break
            point.append(float(f"{sign}{digits}") * _GSI_UNITS[info[3]])
        points.append(point)
        lines.append(number)
        stamps.append(_gsi_time(words))
    if bad:
        raise InputError(bad[:MAX_PROBLEMS])
    return _points(source, asked, "gsi", points, lines, stamps)


def _gsi_time(words: dict[str, tuple[str, ...]]) -> str | None:
    """Seconds since 1970 as text, if both words of the time are there."""
    if not {"18", "19"} <= set(words):
        return None
    fine, coarse = words["18"][2][-8:].zfill(8), words["19"][2][-8:].zfill(8)
    if not (fine + coarse).isdigit():
        return None
    try:
        minute = datetime(
            2000 + int(fine[:2]),
            int(coarse[:2]),
            int(coarse[2:4]),
            int(coarse[4:6]),
            int(coarse[6:]),
            tzinfo=UTC,
        )
    except ValueError:
        return None
    return f"{int(minute.timestamp()) + int(fine[2:4])}.{fine[4:7]}"


def read_landxml(source: Source, asked: Asked) -> Records:
    """Points of the elements CgPoint: north, east, height; the time is their timeStamp."""
    if b"<!DOCTYPE" in source.data or b"<!ENTITY" in source.data:
        raise source.error("a document type is not taken in a LandXML file")
    try:
        root = ET.fromstring(source.data)  # noqa: S314  (entities are refused above)
    except ET.ParseError as error:
        raise source.error(f"not XML: {error}", error.position[0]) from None
    scale = 1.0
    points: list[list[float]] = []
    stamps: list[str | None] = []
    for element in root.iter():
        name = str(element.tag).rpartition("}")[2]
        if name in {"Metric", "Imperial"}:
            unit = element.get("linearUnit", "")
            if unit not in _LANDXML_UNITS:
                raise source.error("not a length", None, "linearUnit", unit)
            scale = _LANDXML_UNITS[unit]
        if name != "CgPoint" or not (element.text or "").strip():
            continue
        text = (element.text or "").split()
        try:
            numbers = [float(one) for one in text]
        except ValueError:
            numbers = []
        if len(numbers) not in {2, 3} or not np.isfinite(numbers).all():
            said = "expected north, east and height"
            raise source.error(said, None, element.get("name", "CgPoint"), " ".join(text))
        points.append([numbers[1], numbers[0], *numbers[2:]])
        stamps.append(_iso_time(element.get("timeStamp")))
    points = [[one * scale for one in point] for point in points]
    return _points(source, asked, "landxml", points, list(range(1, len(points) + 1)), stamps)


def _iso_time(text: str | None) -> str | None:
    """Seconds since 1970 of a date and time; without a zone it is taken as UTC."""
    try:
        moment = datetime.fromisoformat(text or "")
    except ValueError:
        return None
    moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return f"{int((moment.replace(microsecond=0)).timestamp())}.{moment.microsecond:06d}"


def _points(
    source: Source,
    asked: Asked,
    form: str,
    points: Sequence[Sequence[float]],
    lines: Sequence[int],
    stamps: Sequence[str | None],
) -> Records:
    """Positions at their times.

    Raises
    ------
    InputError
        If there is no point, if they have no times and none are given.
    """
    if not points:
        raise source.error("the file has no point with coordinates")
    if len({len(point) for point in points}) > 1:
        raise source.error("some points have a height, others none")
    notes = ["times without a zone are taken as UTC"]
    told: list[str] = [one for one in stamps if one is not None]
    if asked.times is not None:
        told, _ = read_times_file(asked.times)
        notes = []
        if len(told) != len(points):
            raise source.error(f"{len(points)} points, but {asked.times} has {len(told)} times")
    elif not told:
        raise source.error(NO_TIMES)
    elif len(told) < len(points):
        without = stamps.index(None)
        raise source.error("this point has no time, others have", lines[without])
    return Records(
        source,
        form,
        lines,
        told,
        np.array(points, dtype=float),
        unit="s" if asked.times is None else None,
        notes=notes,
        row="line" if form == "gsi" else "point",
    )
