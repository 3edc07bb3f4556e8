"""NMEA 0183 logs: positions of GGA, stated errors of GST, dates of RMC and ZDA.

Receivers depart from the standard in ways that do no harm; each is accepted and counted:
one-digit or lower-case checksums, missing checksums, bytes before the ``$``, empty fields, a
second GGA of one time, sentences out of order. Of a checksum of one digit that digit is tested. A
number before the ``$`` that is seconds since 1970 is the clock of the computer that wrote the log;
it gives the date where no sentence does. Sentences whose checksum is wrong, or that are cut, are
left out and counted where they are few; they are errors where they are many or the caller says so.
"""

import re
from collections.abc import Callable
from datetime import UTC, date, datetime
from pathlib import Path

import numpy as np

from rtk_gt.receivers.fixes import FIX_NAMES, Fixes
from rtk_gt.receivers.formats.dates import DAY, TIME, Calendar, seconds_of
from rtk_gt.receivers.formats.error_ellipses import EllipseRecord, covariances_from_gst
from rtk_gt.receivers.formats.nmea_log import STANDS, NmeaLog, above_sea, in_order
from rtk_gt.receivers.formats.packed import contents
from validation.errors import InputError, Problem, shown
from validation.text_files.reading import is_utf16

NO_GEOID = (
    "GGA without geoid separation: its altitudes, above the sea or not, are taken as heights above "
    "the ellipsoid: between receivers an offset, on the Earth an error of tens of metres."
)
NO_DATE = (
    "The log has no date (RMC, ZDA): its days are counted from 1970-01-01. The drive needs none; "
    'where other sensors or logs have dates, state `date = "YYYY-MM-DD"` at its receiver.'
)
_SENTENCE = re.compile(r"\$([A-Z]{2})([A-Z]{3}),([^*$]*)(?:\*([0-9A-Fa-f]{0,2}))?\s*$")
_CONTROL = re.compile(r"[\x00-\x08\x0a-\x1f\x7f]")
"""What no sentence has. Tabs at its end do no harm."""
_NUMBER = re.compile(r"[+-]?\d+(\.\d*)?|[+-]?\.\d+")
_HOST = re.compile(r"\s*(\d{9,10}(?:\.\d+)?)\s*[,;]?\s*$")


def read_nmea(
    path: Path, receiver: str, *, day: date | None = None, skip_damaged: bool | None = None
) -> Fixes:
    """The fixes of an NMEA log.

    Parameters
    ----------
    path : Path
        The log.
    receiver : str
        Name for the record.
    day : date, optional
        UTC date of the first sentence, where the log has neither RMC nor ZDA.
    skip_damaged : bool, optional
        Whether sentences that are cut or whose checksum is wrong are left out and counted; by
        default where they are few.

    Returns
    -------
    Fixes
        Heights are above the ellipsoid: GGA altitude plus geoid separation.

    Raises
    ------
    InputError
        Naming line, field and value of every bad place.
    """
    data = contents(path)
    if is_utf16(data):
        raise InputError([Problem(path, "saved as UTF-16; save the file as UTF-8", 1)])
    return nmea_fixes(path, data, receiver, day=day, skip_damaged=skip_damaged)


def nmea_fixes(
    path: Path,
    data: bytes,
    receiver: str,
    *,
    day: date | None = None,
    skip_damaged: bool | None = None,
) -> Fixes:
    """The fixes of the contents of an NMEA log; see `read_nmea`."""
    text = data.decode("latin-1")
    if "\n" not in text:
        text = text.replace("\r", "\n")
    start = None if day is None else datetime(day.year, day.month, day.day, tzinfo=UTC).timestamp()
    log = NmeaLog(path, skip_damaged)
    log.calendar = Calendar.of(text, start)
    log.dated = log.calendar.known
    for number, line in enumerate(text.split("\n"), 1):
        if line.strip():
            log.lines += 1
            log.whole = True
            _read_line(log, number, line.rstrip("\r"))
    if not log.sentences and log.lost:
        said = "no whole NMEA sentence in the file; name the receiver's log, or set its format"
        raise InputError([Problem(path, said, log.lost[0].line, "line", log.lost[0].value)])
    if log.many_lost or (log.lost and not log.rows):
        log.problems += log.lost_in_words
    if not log.rows and not log.problems:
        log.problems.append(Problem(path, _no_position(log, text)))
    if log.problems:
        raise InputError(log.problems)
    return _fixes(log, receiver)


def _read_line(log: NmeaLog, number: int, line: str) -> None:
    """Add what one line says."""
    start = line.find("$")
    if start < 0:
        log.damaged(number, line, "no sentence begins in this line")
        return
    log.host = np.nan
    if start > 0:
        written = _HOST.match(line[:start])
        log.host = float(written[1]) if written else np.nan
        what = "stamp of a computer" if written else "bytes"
        log.tolerated[f"{what} before the sentence"] += 1
    match = _SENTENCE.match(line[start:])
    if match is None:
        if re.match(r"\$P[A-Z]", line[start:]):
            return  # a maker's own sentence
        log.damaged(number, line, "not a whole NMEA sentence")
        return
    if _CONTROL.search(line, start):  # a checksum does not tell: two NULs cancel
        log.damaged(number, line[start:], "control characters in the sentence")
        return
    log.sentences += 1
    talker, kind, body, checksum = match.groups()
    readers: dict[str, Callable[[NmeaLog, int, list[str]], None]] = {"GGA": _gga, "GST": _gst}
    if kind not in readers or not _checksum_holds(log, number, line[start:], checksum):
        return
    log.talker = talker
    readers[kind](log, number, body.split(","))


def _checksum_holds(log: NmeaLog, number: int, sentence: str, checksum: str | None) -> bool:
    """Whether the sentence arrived as sent, as far as its checksum tells."""
    if not checksum:
        if checksum == "" or sentence.count(",") < 8:
            log.damaged(number, sentence, "the sentence is cut")
            return False
        log.whole = False
        log.tolerated["no checksum"] += 1
        return True
    value = 0
    for character in sentence[1 : sentence.rindex("*")]:
        value ^= ord(character)
    whole = f"{value:02X}"
    # Some loggers lose the last digit, others a leading zero.
    cut = len(checksum) == 1 and checksum.upper() == whole[0]
    if int(checksum, 16) != value and not cut:
        log.damaged(number, sentence, f"the checksum is {checksum}, the sentence has {value:02X}")
        return False
    if len(checksum) == 1:
        log.tolerated["checksum of one digit"] += 1
    if checksum != checksum.upper():
        log.tolerated["checksum in lower case"] += 1
    return True


def _clock(log: NmeaLog, number: int, cell: str, *, of_errors: bool = False) -> float | None:
    """Seconds since 1970 of a time of day."""
    match = TIME.fullmatch(cell)
    if match is None or int(match[1]) > 23 or int(match[2]) > 59 or float(match[3]) >= 61:
        log.bad(number, "time", cell, "not a time of day; expected hhmmss.ss")
        return None
    clock = seconds_of(match)
    if log.calendar.day is None:
        log.calendar.day = _day_of_host(log.host, clock)
    return log.calendar.time(number, clock, first=not log.rows, of_errors=of_errors)


def _day_of_host(host: float, clock: float) -> float:
    """Midnight of the day at which a time of day is nearest to a computer's clock."""
    return 0.0 if np.isnan(host) else DAY * round((host - clock) / DAY)


def _gga(log: NmeaLog, number: int, cells: list[str]) -> None:
    """One position; without a fix its cells may be empty."""
    if not 12 <= len(cells) <= 14:
        comma = " (a decimal comma?)" if len(cells) > 14 else ""
        log.bad(number, "GGA", ",".join(cells), f"{len(cells)} fields, expected 14{comma}")
        return
    kind = cells[5]
    if not kind.isdigit() or int(kind) not in FIX_NAMES:
        log.bad(number, "fix quality", kind, "not a fix kind of GGA (0 to 9)")
        return
    if kind == "0":  # its time may be no time, too
        log.tolerated["GGA without a fix"] += 1
        log.without_fix += 1
        return
    time = _clock(log, number, cells[0])
    if time is not None and not cells[8]:
        log.tolerated["GGA with an empty altitude left out"] += 1
        log.without_fix += 1
        return
    place = None if time is None else _place(log, number, cells)
    if time is None or place is None:
        return
    satellites = int(cells[6]) if cells[6].isdigit() else -1
    hdop = float(cells[7]) if _NUMBER.fullmatch(cells[7]) else np.nan
    log.rows.append((time, *place, int(kind), satellites, hdop, number, log.host, log.talker))


def _place(log: NmeaLog, number: int, cells: list[str]) -> tuple[float, float, float] | None:
    """Latitude and longitude in radians, and height; None after recording what is bad."""
    for name, cell in (("altitude", cells[9]), ("geoid separation", cells[11])):
        if cell not in {"M", "m", ""}:
            log.bad(number, f"unit of the {name}", cell, "not metres; set the receiver to M")
            return None
    latitude = _angle(log, number, "latitude", cells[1], cells[2], "NS", 90.0)
    longitude = _angle(log, number, "longitude", cells[3], cells[4], "EW", 180.0)
    altitude = _cell(log, number, "altitude", cells[8])
    separation = _cell(log, number, "geoid separation", cells[10] or "0")
    if latitude is None or longitude is None or altitude is None or separation is None:
        return None
    if cells[10]:
        log.geoid.append(separation)
    else:
        log.without_geoid.append(len(log.rows))
    return latitude, longitude, altitude + separation


def _angle(
    log: NmeaLog, number: int, name: str, cell: str, side: str, sides: str, largest: float
) -> float | None:
    """Radians of an angle written as dddmm.mmmm with its hemisphere."""
    digits = len(str(int(largest)))  # 2 for latitude, 3 for longitude
    if _NUMBER.fullmatch(cell) is None or not cell[:digits].isdigit():
        log.bad(number, name, cell, f"not an angle; expected {'d' * digits}mm.mmmm")
        return None
    degrees, minutes = int(cell[:digits]), float(cell[digits:] or "0")
    value = degrees + minutes / 60
    if minutes >= 60 or value > largest:
        log.bad(number, name, cell, _beyond(cell, digits, minutes, largest))
        return None
    if side not in tuple(sides):
        log.bad(number, name, side, f"not a hemisphere; expected {sides[0]} or {sides[1]}")
        return None
    return float(np.radians(value if side == sides[0] else -value))


def _beyond(cell: str, digits: int, minutes: float, largest: float) -> str:
    """What is wrong with an angle that is none: usually its digits, not its size."""
    written = cell.partition(".")[0]
    if len(written) != digits + 2:
        return (
            f"{len(written)} digits before the point, expected {digits + 2} ({'d' * digits}mm); "
            "are latitude and longitude exchanged?"
        )
    if minutes >= 60:
        return f"{minutes:g} minutes; expected less than 60"
    return f"out of range; expected up to {largest:g} degrees"


def _cell(log: NmeaLog, number: int, name: str, cell: str) -> float | None:
    """A number, or None after recording that it is none."""
    if _NUMBER.fullmatch(cell) is None:
        log.bad(number, name, cell, "not a number")
        return None
    return float(cell)


def _gst(log: NmeaLog, number: int, cells: list[str]) -> None:
    """Stated errors, kept by their time until all positions are known."""
    if len(cells) != 8:
        log.bad(number, "GST", ",".join(cells), f"{len(cells)} fields, expected 8")
        return
    if all(_NUMBER.fullmatch(c) and float(c) == 0 for c in cells[1:]):
        log.tolerated["GST without a fix"] += 1
        return
    time = _clock(log, number, cells[0], of_errors=True)
    numbers = [float(c) if _NUMBER.fullmatch(c) else np.nan for c in cells[2:]]
    if time is None or any(np.isnan(numbers)):
        log.tolerated["GST with empty fields"] += 1
        if time is None or any(np.isnan(numbers[3:])):
            return
    names = ("major sigma", "minor sigma", "", "latitude sigma", "longitude sigma", "height sigma")
    for name, value, cell in zip(names, numbers, cells[2:], strict=True):
        if name and value < 0:
            log.bad(number, f"GST {name}", cell, "a standard deviation cannot be negative")
            return
    log.ellipses[time] = EllipseRecord(*numbers)


def _no_position(log: NmeaLog, text: str) -> str:
    """Why a log has no position, and what to do."""
    said = "no GGA sentence with a position in the file"
    if log.without_fix:
        return f"{said}: in {log.without_fix} the receiver has no fix, or writes no altitude"
    if re.search(r"\$..(RMC|GLL)", text):
        return f"{said}, only sentences without height (RMC, GLL): let the receiver write GGA"
    return said


def _fixes(log: NmeaLog, receiver: str) -> Fixes:
    order = in_order(log)
    if len(order) < STANDS * len(log.rows):
        row = log.rows[1]
        said = f"{len(log.rows)} positions at {len(order)} times: the receiver's clock stands still"
        raise InputError([Problem(log.path, said, row[7], "time", f"{row[0] % 86400:.2f} s")])
    above = above_sea(log)
    table = np.array([log.rows[row][:-1] for row in order], dtype=float)
    table[:, 3] += above[order]
    records = [log.ellipses.get(float(time)) for time in table[:, 0]]
    covariances, notes = covariances_from_gst(records)
    without = len(log.ellipses) - sum(record is not None for record in records)
    if without:
        log.tolerated["GST of a time without a fix"] += without
    if not log.dated and log.calendar.day:
        notes = (*notes, "The log has no date (RMC, ZDA); it is that of the computer's clock.")
    elif not log.dated:
        notes = (*notes, NO_DATE)
    if log.without_geoid and not log.geoid:
        notes = (*notes, NO_GEOID)
    skipped = sum(n for what, n in log.tolerated.items() if what.startswith("damaged"))
    if skipped:
        notes = (*notes, f"{shown(log.path.name)}: {skipped} damaged sentences were left out.")
    return Fixes(
        receiver=receiver,
        times=table[:, 0],
        geodetic=table[:, 1:4],
        kinds=table[:, 4].astype(np.int64),
        satellites=table[:, 5].astype(np.int64),
        hdop=table[:, 6],
        covariances=covariances,
        lines=table[:, 7].astype(np.int64),
        source=log.path,
        host=table[:, 8],
        without_fix=log.without_fix,
        tolerated=dict(log.tolerated),
        notes=notes,
    )
