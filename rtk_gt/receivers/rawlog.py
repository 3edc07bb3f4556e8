"""GPS observations of an MRPT rawlog (gzip or plain).

Objects of a rawlog carry no length, so one of an unknown class cannot be stepped over: only
logs of `CObservationComment` and `CObservationGPS` (version 8, as in the Malaga data of 2009) are
read, anything else is an error that names the class.
"""

import gzip
import struct
import zlib
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rtk_gt.receivers.fixes import Fixes
from validation.errors import InputError, Problem
from validation.poses.angles import Array
from validation.text_files.reading import file_bytes

MAX_BYTES = 2_000_000_000
"""A judgement: what fits into the memory of a laptop, unpacked."""
FILETIME_TO_UNIX = 11644473600.0
"""Seconds from 1601-01-01, from which MRPT counts, to 1970-01-01."""
_END = 0x88


@dataclass
class _Row:
    """One GGA record."""

    time: float
    geodetic: tuple[float, float, float]
    kind: int
    satellites: int
    hdop: float
    number: int


@dataclass
class Rawlog:
    """What a rawlog holds.

    Parameters
    ----------
    fixes : dict of str to Fixes
        One record for each sensor label.
    sensor_positions : dict of str to (3,) array
        Where the log says that each antenna is on the vehicle, in metres.
    comment : str
        The whole comment.
    """

    fixes: dict[str, Fixes] = field(default_factory=dict)
    sensor_positions: dict[str, Array] = field(default_factory=dict)
    comment: str = ""


def read_rawlog(path: Path) -> Rawlog:
    """The GPS records of a rawlog.

    Heights are taken as the log has them: it keeps one altitude and no geoid separation. In
    the Malaga data that is the height above the ellipsoid.

    Raises
    ------
    InputError
        Where the file is cut, damaged or holds an object of a class not known here.
    """
    data = _decompressed(path)
    log = Rawlog()
    rows: dict[str, list[_Row]] = {}
    empty: Counter[str] = Counter()
    cursor = _Cursor(path, data)
    number = 0
    while not cursor.at_end:
        number += 1
        name, version = cursor.head()
        if name == "CObservationComment":
            log.comment += cursor.text()
            cursor.take("<Q")
        elif name == "CObservationGPS" and version == 8:
            label, row, position = _observation(cursor, number)
            log.sensor_positions.setdefault(label, position)
            if row is None:
                empty[label] += 1
            else:
                rows.setdefault(label, []).append(row)
        else:
            cursor.fail(
                f"an object of class {name}, version {version}; only comments and GPS "
                "observations of version 8 are known, and an unknown object cannot be stepped "
                "over"
            )
        cursor.end_of_object()
    if not rows:
        raise InputError([Problem(path, "the rawlog holds no GPS position")])
    log.fixes = {label: _fixes(path, label, found, empty[label]) for label, found in rows.items()}
    return log


def _decompressed(path: Path) -> bytes:
    """Contents of the file, unpacked."""
    data = file_bytes(path, MAX_BYTES)
    if not data.startswith(b"\x1f\x8b"):
        return data
    try:
        return gzip.decompress(data)
    except (EOFError, OSError, zlib.error) as error:
        raise InputError([Problem(path, f"the gzip file is cut or damaged: {error}")]) from None


class _Cursor:
    """A place in the bytes of a rawlog."""

    def __init__(self, path: Path, data: bytes) -> None:
        self.path, self.data, self.at = path, data, 0

    @property
    def at_end(self) -> bool:
        return self.at >= len(self.data)

    def fail(self, expected: str) -> None:
        raise InputError([Problem(self.path, expected, field=f"byte {self.at}")])

    def take(self, layout: str) -> tuple[float, ...]:
        size = struct.calcsize(layout)
        if self.at + size > len(self.data):
            self.fail("the file ends in the middle of an observation; it was cut")
        values = struct.unpack_from(layout, self.data, self.at)
        self.at += size
        return values

    def text(self) -> str:
        (size,) = self.take("<I")
        raw = self.data[self.at : self.at + int(size)]
        if len(raw) < size:
            self.fail("the file ends in the middle of a text; it was cut")
        self.at += int(size)
        return raw.decode("latin-1")

    def head(self) -> tuple[str, int]:
        """Class name and version of the object that begins here."""
        (length,) = self.take("<B")
        size = int(length) & 0x7F
        name = self.data[self.at : self.at + size]
        if not int(length) & 0x80 or not name.isalnum():
            self.fail("no object of an MRPT rawlog begins here")
        self.at += size
        (version,) = self.take("<B")
        return name.decode("ascii"), int(version)

    def end_of_object(self) -> None:
        (mark,) = self.take("<B")
        if mark != _END:
            self.at -= 1
            self.fail("the object does not end where its class and version say")


def _observation(cursor: _Cursor, number: int) -> tuple[str, _Row | None, Array]:
    """Sensor label, position record if there is one, and antenna position."""
    (stamp,) = cursor.take("<Q")
    row = _gga(cursor, stamp / 1e7 - FILETIME_TO_UNIX, number)
    if cursor.take("<?")[0]:  # RMC: its position repeats the GGA's
        cursor.take("<BBdbdddd")
    label = cursor.text()
    position = _sensor_pose(cursor)
    if any(cursor.take("<??")):
        cursor.fail("a PZS or SATS record of Topcon receivers, which is not known here")
    return label, row, position


def _gga(cursor: _Cursor, stamp: float, number: int) -> _Row | None:
    """The GGA part; its time of day with the day of the observation's stamp."""
    if not cursor.take("<?")[0]:
        return None
    hour, minute, second = cursor.take("<BBd")
    latitude, longitude, kind, altitude = cursor.take("<ddBd")
    satellites, _, hdop = cursor.take("<I?f")
    time_of_day = 3600 * hour + 60 * minute + second
    day = round((stamp - time_of_day) / 86400)
    place = (float(np.radians(latitude)), float(np.radians(longitude)), altitude)
    return _Row(day * 86400 + time_of_day, place, int(kind), int(satellites), hdop, number)


def _sensor_pose(cursor: _Cursor) -> Array:
    """Position of the antenna on the vehicle from a CPose3D of version 1."""
    name, version = cursor.head()
    if (name, version) != ("CPose3D", 1):
        cursor.fail(f"a pose of class {name}, version {version}; expected CPose3D, version 1")
    inner, _ = cursor.head()
    rows, columns = cursor.take("<II")
    if (inner, rows, columns) != ("CMatrixD", 4, 4):
        cursor.fail("a pose without its 4 x 4 matrix")
    matrix = np.array(cursor.take("<16d")).reshape(4, 4)
    cursor.end_of_object()
    cursor.end_of_object()
    return np.asarray(matrix[:3, 3])


def _fixes(path: Path, label: str, rows: list[_Row], empty: int) -> Fixes:
    n = len(rows)
    return Fixes(
        receiver=label,
        times=np.array([row.time for row in rows]),
        geodetic=np.array([row.geodetic for row in rows]).reshape(-1, 3),
        kinds=np.array([row.kind for row in rows]),
        satellites=np.array([row.satellites for row in rows]),
        hdop=np.array([row.hdop if row.hdop > 0 else np.nan for row in rows]),
        covariances=np.full((n, 3, 3), np.nan),
        lines=np.array([row.number for row in rows]),
        source=path,
        tolerated={"observation without a position": empty} if empty else {},
    )
