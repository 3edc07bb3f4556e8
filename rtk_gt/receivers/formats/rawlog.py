"""GPS observations of an MRPT rawlog (gzip or plain).

Objects of a rawlog carry no length, so one of an unknown class cannot be stepped over: only
logs of `CObservationComment` and `CObservationGPS` (version 8, as in the Malaga data of 2009) are
read, anything else is an error that names the class.
"""

from collections import Counter
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from rtk_gt.receivers.fixes import Fixes
from rtk_gt.receivers.formats.packed import contents
from validation.errors import InputError, Problem
from validation.poses.angles import Array
from validation.trajectories.formats.rawlog_objects import Objects


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
    return rawlog_of(path, contents(path))


@lru_cache(maxsize=2)
def rawlog_of(path: Path, data: bytes) -> Rawlog:
    """The GPS records of a rawlog's contents; several receivers ask for the same."""
    log = Rawlog()
    rows: dict[str, list[_Row]] = {}
    empty: Counter[str] = Counter()
    cursor = Objects(path, data)
    number = 0
    while not cursor.at_end:
        number += 1
        name, version = cursor.head()
        if name == "CObservationComment":
            log.comment += cursor.text()
            cursor.time()
        elif name == "CObservationGPS" and version == 8:
            label, row, position = _observation(cursor, number)
            log.sensor_positions.setdefault(label, position)
            if row is None:
                empty[label] += 1
            else:
                rows.setdefault(label, []).append(row)
        else:
            raise cursor.bad(
                f"an object of class {name}, version {version}; only comments and GPS "
                "observations of version 8 are known, and an unknown object cannot be stepped "
                "over"
            )
        cursor.end(name)
    if not rows:
        raise InputError([Problem(path, "the rawlog holds no GPS position")])
    log.fixes = {label: _fixes(path, label, found, empty[label]) for label, found in rows.items()}
    return log


def _observation(cursor: Objects, number: int) -> tuple[str, _Row | None, Array]:
    """Sensor label, position record if there is one, and antenna position."""
    row = _gga(cursor, cursor.time(), number)
    if cursor.numbers("?")[0]:  # RMC: its position repeats the GGA's
        cursor.numbers("BBdbdddd")
    label = cursor.text()
    position = _sensor_pose(cursor)
    if any(cursor.numbers("??")):
        raise cursor.bad("a PZS or SATS record of Topcon receivers, which is not known here")
    return label, row, position


def _gga(cursor: Objects, stamp: float, number: int) -> _Row | None:
    """The GGA part; its time of day with the day of the observation's stamp."""
    if not cursor.numbers("?")[0]:
        return None
    hour, minute, second = cursor.numbers("BBd")
    latitude, longitude, kind, altitude = cursor.numbers("ddBd")
    satellites, _, hdop = cursor.numbers("I?f")
    time_of_day = 3600 * hour + 60 * minute + second
    day = round((stamp - time_of_day) / 86400)
    place = (float(np.radians(latitude)), float(np.radians(longitude)), altitude)
    return _Row(day * 86400 + time_of_day, place, int(kind), int(satellites), hdop, number)


def _sensor_pose(cursor: Objects) -> Array:
    """Position of the antenna on the vehicle from a CPose3D of version 1."""
    name, version = cursor.head()
    if (name, version) != ("CPose3D", 1):
        raise cursor.bad(f"a pose of class {name}, version {version}; expected CPose3D, version 1")
    inner, _ = cursor.head()
    rows, columns = cursor.numbers("II")
    if (inner, rows, columns) != ("CMatrixD", 4, 4):
        raise cursor.bad("a pose without its 4 x 4 matrix")
    matrix = np.array(cursor.numbers("16d")).reshape(4, 4)
    cursor.end(inner)
    cursor.end(name)
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
