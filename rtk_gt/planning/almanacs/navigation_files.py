"""RINEX navigation files of version 2 and 3: broadcast elements of GPS, Galileo and QZSS.

Source: "RINEX, the receiver independent exchange format", version 2.11, Tables A3 and A4, and
version 3.04, Tables A5 to A8. GLONASS and SBAS records are places and speeds, those of BeiDou and
NavIC have other times and frames; they are skipped and counted.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path

from rtk_gt.planning.almanacs.almanac import SYSTEMS, KeplerAlmanac
from rtk_gt.planning.almanacs.orbits import GPS_EPOCH, GRAVITY_GALILEO, GRAVITY_GPS, WEEK, Elements
from rtk_gt.planning.almanacs.tokens import Reading
from validation.errors import GtvalError

HEADER_END = "END OF HEADER"
_WIDTH = 19
_LINES = 8
"""Of a record of GPS, Galileo or QZSS."""
_FIELDS = (
    ("", "", ""),
    ("", "crs", "motion", "anomaly"),
    ("cuc", "eccentricity", "cus", "root_a"),
    ("toe", "cic", "node", "cis"),
    ("inclination", "crc", "perigee", "node_rate"),
    ("inclination_rate",),
    ("", "health"),
)
"""Names of the numbers of each line of a record that are used."""
_GRAVITY = {"G": GRAVITY_GPS, "J": GRAVITY_GPS, "E": GRAVITY_GALILEO}


def read_navigation(path: Path, lines: Sequence[str]) -> KeplerAlmanac:
    """The satellites of a RINEX navigation file.

    Raises
    ------
    InputError
        Naming line, field and value of every bad place.
    GtvalError
        For a version or a kind of file that is not read here.
    """
    version, kind = _version(path, lines[0])
    end = next((n for n, line in enumerate(lines, 1) if line[60:].strip() == HEADER_END), None)
    reading = Reading(path)
    if end is None:
        reading.bad(1, "header", None, f"there is no line '{HEADER_END}'; was the file cut?")
        reading.stop()
    skipped: Counter[str] = Counter()
    records: dict[str, dict[float, tuple[float, dict[str, float]]]] = {}
    for number, letter, block in _blocks(lines, end or 0, version, kind):
        if letter not in _GRAVITY:
            skipped[letter] += 1
            continue
        got = _record(reading, number, letter, block, version)
        if got is not None:
            name, health, values = got
            own = records.setdefault(name, {})
            own[values["reference"]] = (health, {**values, "gravity": _GRAVITY[letter]})
    reading.stop()
    unhealthy = tuple(sorted(name for name, own in records.items() if own[max(own)][0]))
    names = tuple(sorted(name for name in records if name not in unhealthy))
    used = [
        (name, values) for name in names for health, values in records[name].values() if not health
    ]
    return KeplerAlmanac(
        path, "RINEX", names, unhealthy, _notes(path, skipped, names, unhealthy),
        Elements.of_rows([values for _, values in used]), tuple(name for name, _ in used),
    )  # fmt: skip


def _notes(
    path: Path, skipped: Counter[str], names: Sequence[str], unhealthy: Sequence[str]
) -> tuple[str, ...]:
    """What was skipped; a GtvalError if that is all."""
    said = ", ".join(
        f"{number} of {SYSTEMS.get(letter, letter)}" for letter, number in sorted(skipped.items())
    )
    if not names and not unhealthy:
        raise GtvalError(
            f"{path}: no record of GPS, Galileo or QZSS in the file"
            + (f" (skipped: {said})" if said else "; was it cut?")
        )
    return (f"Records that are not read here were skipped: {said}.",) if said else ()


def _version(path: Path, line: str) -> tuple[float, str]:
    """Version and kind of the file."""
    try:
        version = float(line[:9])
    except ValueError:
        version = 0.0
    kind = line[20:21]
    if not 2 <= version < 4:
        raise GtvalError(
            f"{path}, line 1: RINEX version {line[:9].strip()}; versions 2 and 3 are read here. "
            "Convert the file, or take a YUMA almanac"
        )
    if kind != "N" and not (version < 3 and kind in "GHE"):
        raise GtvalError(
            f"{path}, line 1: a RINEX file of kind '{kind}', not of navigation data ('N')"
        )
    return version, kind


def _blocks(
    lines: Sequence[str], end: int, version: float, kind: str
) -> Iterator[tuple[int, str, list[str]]]:
    """Number of the first line, letter of the system, and the lines of each record."""
    body = [(n, line.rstrip("\r\n")) for n, line in enumerate(lines[end:], end + 1) if line.strip()]
    starts = [at for at, (_, line) in enumerate(body) if line[:2].strip()]
    for at, following in zip(starts, [*starts[1:], len(body)], strict=True):
        block = [line for _, line in body[at:following]]
        # Before version 3 GLONASS and SBAS have files of their own.
        letter = block[0][0] if version >= 3 else {"G": "R", "H": "S", "E": "E"}.get(kind, "G")
        yield body[at][0], letter, block


def _record(
    reading: Reading, start: int, letter: str, block: list[str], version: float
) -> tuple[str, float, dict[str, float]] | None:
    """Name, health and elements of a record of eight lines; None if it is bad."""
    if len(block) != _LINES:
        said = f"a record of {len(block)} lines, expected {_LINES}; was the file cut?"
        reading.bad(start, "record", block[0], said)
        return None
    before = len(reading.problems)
    first = 23 if version >= 3 else 22
    number = block[0][1:3] if version >= 3 else block[0][:2]
    prn = reading.whole(start, "satellite", number, 1, 99)
    clock = _clock(block[0][3:23] if version >= 3 else block[0][2:22])
    if clock is None:
        reading.bad(start, "epoch", block[0][:first], "not a time of year, month, day, hour, ...")
        return None
    got = {}
    for row, names in enumerate(_FIELDS):
        left = first if row == 0 else first - 19
        for column, name in enumerate(names):
            cell = block[row][left + _WIDTH * column : left + _WIDTH * (column + 1)]
            if name:
                got[name] = reading.number(start + row, name, cell, name)
    if len(reading.problems) > before:
        return None
    health, toe = got.pop("health"), got.pop("toe")
    got["reference"] = toe + WEEK * round((clock - toe) / WEEK)
    return f"{letter}{prn:02d}", health, got


def _clock(text: str) -> float | None:
    """GPS seconds of the time of a record, or None."""
    cells = text.split()
    try:
        year, month, day, hour, minute = (int(cell) for cell in cells[:5])
        seconds = float(cells[5])
    except (ValueError, IndexError):
        return None
    if year < 100:
        year += 1900 if year >= 80 else 2000
    try:
        stamp = datetime(year, month, day, hour, minute, tzinfo=UTC)
    except ValueError:
        return None
    return stamp.timestamp() + seconds - GPS_EPOCH
