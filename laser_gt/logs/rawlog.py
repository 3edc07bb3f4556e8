"""Reader of MRPT's rawlogs of observations: laser scans with odometry and comments beside them.

Objects of a rawlog carry no length, so one of a class not known here cannot be stepped over: it is
refused with what makes a file of it that can be read. Layouts are those of the public sources of
MRPT (`CObservation2DRangeScan` to version 7, `CObservationOdometry` to 2, `CPose3D` to 3).
"""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from laser_gt.logs.records import MAX_LOG_BYTES, Line, ScanRecord, checked
from laser_gt.scans.planar import wrapped
from laser_gt.scans.scan import Scan
from validation.errors import GtvalError, InputError
from validation.poses.angles import Array
from validation.trajectories.formats.rawlog_objects import Objects, unpacked

MOST_BEAMS = 100_000
"""Beams of a scan beyond which the file is damaged. A judgement: a hundred times a usual scan."""
FAR = 0.5
"""Seconds between odometry and a scan beyond which the scan gets none. A judgement: a robot whose
wheels are read less often has no use of them."""
CONVERT = (
    "make a log of observations of it (RawLogViewer: Edit, 'Convert to observation-only format'; "
    "rawlog-edit --keep-label LABELS leaves other sensors out), or export the scans "
    "(rawlog-edit --export-2d-scans-txt) and write them as the columns of laser/scans.csv"
)


@dataclass
class _Log:
    """What was read so far."""

    records: list[ScanRecord] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    poses: list[tuple[float, ...]] = field(default_factory=list)


def read_rawlog(path: Path) -> list[ScanRecord]:
    """All scans of a rawlog, with the odometry of their time where the log has it.

    Raises
    ------
    InputError
        Where the file is cut or damaged, or holds an object that is not known here.
    """
    place = _Place(path, unpacked(path, MAX_LOG_BYTES))
    log = _Log()
    while not place.at_end:
        _observation(place, log)
    return checked(path, _with_odometry(log), [])


class _Place(Objects):
    """A place in the bytes of a rawlog, with the number of the observation."""

    number = 0

    def unknown(self, name: str, version: int) -> InputError:
        text = f"an object of class {name}, version {version}, which cannot be stepped over"
        return self.bad(f"{text}: {CONVERT}")


def _observation(place: _Place, log: _Log) -> None:
    """One object: a scan, odometry, a comment, or a frame of such."""
    name, version = place.head()
    place.number += 1
    if name == "CObservation2DRangeScan" and version <= 7:
        log.records.append(_scan(place, version))
    elif name == "CObservationOdometry" and version <= 2:
        _odometry(place, version, log)
    elif name == "CObservationComment" and version <= 1:
        place.text()
        place.time()
        if version == 1:
            place.text()
    elif name == "CSensoryFrame" and version == 2:
        for _ in range(place.count(1000)):
            _observation(place, log)
    else:
        raise place.unknown(name, version)
    place.end(name)


def _scan(place: _Place, version: int) -> ScanRecord:
    """A scan: directions from right to left or the other way, middle ahead."""
    number = place.number
    aperture, rising, most = place.numbers("f?f")
    _pose(place)
    if version < 6:
        _matrix(place)
    count = place.count(MOST_BEAMS)
    ranges = np.frombuffer(place.bytes(4 * count), dtype="<f4").astype(float)
    back = np.isfinite(ranges) & (ranges > 0) & (ranges < most)
    if version >= 1:
        back &= np.frombuffer(place.bytes(count), dtype=np.uint8) != 0
    if version >= 2:
        place.numbers("f")
    time, label = np.nan, "laser"
    if version >= 3:
        time = place.time()
    if version >= 4:
        place.numbers("f")
    if version >= 5:
        label = place.text() or label
        place.numbers("d")
    if version >= 7 and place.numbers("?")[0]:
        place.bytes(4 * count)
    ranges = np.where(back, ranges, np.inf)
    angles = np.linspace(-aperture / 2, aperture / 2, count)
    try:
        scan = Scan(
            ranges if rising else ranges[::-1],
            angles,
            range_max=float(most) if most > 0 else 80.0,
            time=time,
            sensor=label,
        )
    except GtvalError as error:
        raise Line(place.path, number).bad(str(error), "scan") from None
    return ScanRecord(scan, line=number)


def _odometry(place: _Place, version: int, log: _Log) -> None:
    """A pose by odometry, with what encoders and speeds come with it."""
    name, inner = place.head()
    if name != "CPose2D" or inner > 1:
        raise place.unknown(name, inner)
    pose = place.numbers("ddd" if inner else "fff")
    place.end(name)
    place.text()
    time = place.time()
    if version >= 1:
        (ticks,) = place.numbers("?")
        if ticks or version < 2:
            place.numbers("ii")
        (speeds,) = place.numbers("?")
        if version < 2:
            place.numbers("ff")
        elif speeds:
            place.numbers("ddd")
    if not np.isfinite(pose).all():
        raise Line(place.path, place.number).bad("expected finite numbers", "odometry")
    log.times.append(time)
    log.poses.append(pose)


def _pose(place: _Place) -> None:
    """A pose in space, read over: the mount is stated in campaign.toml."""
    name, version = place.head()
    if name != "CPose3D" or version > 3:
        raise place.unknown(name, version)
    if version <= 1:
        _matrix(place)
    else:
        place.numbers("7d" if version == 2 else "12d")
    place.end(name)


def _matrix(place: _Place) -> None:
    """A matrix, read over."""
    name, version = place.head()
    if name not in {"CMatrix", "CMatrixF", "CMatrixD"}:
        raise place.unknown(name, version)
    rows, columns = place.count(100), place.count(100)
    place.bytes((8 if name == "CMatrixD" else 4) * rows * columns)
    place.end(name)


def _with_odometry(log: _Log) -> list[ScanRecord]:
    """The scans with odometry of their time, in between linearly."""
    if not log.times:
        return log.records
    order = np.argsort(log.times, kind="stable")
    times, poses = np.array(log.times)[order], np.array(log.poses, dtype=float)[order]
    asked = np.array([record.scan.time for record in log.records])
    track = np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])
    found: Array = wrapped(np.column_stack([np.interp(asked, times, each) for each in track.T]))
    near = np.abs(asked[:, None] - times[_nearest(times, asked)]).min(1) <= FAR
    return [
        replace(record, odometry=pose) if there else record
        for record, pose, there in zip(log.records, found, near, strict=True)
    ]


def _nearest(times: Array, asked: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.intp]]:
    """(n, 2) places of the times before and after each that is asked for."""
    after = np.clip(np.searchsorted(times, asked), 0, len(times) - 1)
    return np.stack([np.maximum(after - 1, 0), after], axis=1)
