"""Rawlogs of MRPT, written here byte by byte after its public sources."""

import gzip
import struct
from contextlib import suppress

import numpy as np
import pytest

from laser_gt.logs.rawlog import read_rawlog
from validation.errors import InputError

EPOCH = 11644473600
TIME = 1_200_000_000.5


def _object(name, version, content):
    return bytes([0x80 | len(name)]) + name.encode() + bytes([version]) + content + b"\x88"


def _text(words):
    return struct.pack("<I", len(words)) + words.encode()


def _stamp(time):
    return struct.pack("<Q", round((time + EPOCH) * 1e7))


def _matrix(rows, columns, name="CMatrixD", code="d"):
    values = np.eye(rows, columns).ravel()
    head = struct.pack("<II", rows, columns)
    return _object(name, 0, head + struct.pack(f"<{len(values)}{code}", *values))


def _pose3d(version):
    content = {
        0: _matrix(4, 4, "CMatrixF", "f"),
        1: _matrix(4, 4),
        2: struct.pack("<7d", 0, 0, 0, 1, 0, 0, 0),
        3: struct.pack("<12d", *np.eye(3, 4).ravel()),
    }[version]
    return _object("CPose3D", version, content)


def _scan(version, ranges, *, time=TIME, rising=True, pose=1, prefix=""):
    valid = bytes(int(one > 0) for one in ranges)
    content = struct.pack("<f?f", np.pi, rising, 30.0) + _pose3d(pose)
    if version < 6:
        content += _matrix(6, 6, "CMatrix", "f")
    content += struct.pack(f"<I{len(ranges)}f", len(ranges), *ranges)
    if version >= 1:
        content += valid
    if version >= 2:
        content += struct.pack("<f", 0.01)
    if version >= 3:
        content += _stamp(time)
    if version >= 4:
        content += struct.pack("<f", 0.004)
    if version >= 5:
        content += _text("LASER1") + struct.pack("<d", 0.0)
    if version >= 7:
        content += b"\x01" + struct.pack(f"<{len(ranges)}i", *range(len(ranges)))
    return _object(prefix + "CObservation2DRangeScan", version, content)


def _odometry(version, pose, time):
    content = _object("CPose2D", 1, struct.pack("<ddd", *pose)) + _text("ODO") + _stamp(time)
    if version == 1:
        content += struct.pack("<?ii?ff", True, 3, 4, True, 0.1, 0.2)
    if version == 2:
        content += struct.pack("<?ii?ddd", True, 3, 4, True, 0.1, 0.0, 0.2)
    return _object("CObservationOdometry", version, content)


RANGES = [*np.linspace(1, 2, 20), 0.0]


@pytest.mark.parametrize(
    ("version", "pose", "prefix"),
    [(v, min(v // 2, 3), "mrpt::obs::" if v == 7 else "") for v in range(8)],
)
def test_scans_of_every_version_are_read_with_the_odometry_of_their_time(
    tmp_path, version, pose, prefix
):
    path = tmp_path / "log.rawlog"
    comment = _object("CObservationComment", 0, _text("a comment") + _stamp(TIME))
    log = (
        comment
        + _odometry(version % 3, (1.0, 2.0, 3.1), TIME - 0.1)
        + _scan(version, RANGES, pose=pose, prefix=prefix)
        + _odometry(version % 3, (1.2, 2.0, -3.1), TIME + 0.1)
    )
    path.write_bytes(gzip.compress(log) if version % 2 else log)
    (found,) = read_rawlog(path)
    scan = found.scan
    assert np.allclose(scan.ranges[:-1], RANGES[:-1])
    assert np.isinf(scan.ranges[-1])
    assert np.allclose(scan.angles[[0, -1]], [-np.pi / 2, np.pi / 2])
    if version >= 3:
        assert scan.time == pytest.approx(TIME, abs=1e-6)
        middle = (3.1 + 2 * np.pi - 3.1) / 2
        assert np.allclose(np.cos(found.odometry[2]), np.cos(middle))
        assert np.allclose(found.odometry[:2], [1.1, 2.0])
    assert scan.sensor == ("LASER1" if version >= 5 else "laser")


def test_scans_from_left_to_right_are_turned_and_frames_are_opened(tmp_path):
    path = tmp_path / "log.rawlog"
    inside = _scan(6, RANGES) + _scan(6, RANGES, time=TIME + 1, rising=False)
    path.write_bytes(_object("CSensoryFrame", 2, struct.pack("<I", 2) + inside))
    one, other = read_rawlog(path)
    assert np.array_equal(one.scan.ranges, other.scan.ranges[::-1])
    assert one.odometry is None


def test_what_cannot_be_stepped_over_is_refused_with_what_to_do(tmp_path):
    path = tmp_path / "log.rawlog"
    path.write_bytes(_scan(6, RANGES) + _object("CActionCollection", 0, struct.pack("<I", 0)))
    with pytest.raises(InputError, match=r"CActionCollection, version 0.*observation-only"):
        read_rawlog(path)


def test_damaged_rawlogs_are_refused(tmp_path):
    path = tmp_path / "log.rawlog"
    whole = _scan(6, RANGES) + _odometry(2, (1.0, 2.0, 3.0), TIME)
    rng = np.random.default_rng(0)
    for cut in [*range(1, len(whole), 7), len(whole) - 1]:
        path.write_bytes(whole[:cut])
        if cut != len(_scan(6, RANGES)):
            with pytest.raises(InputError):
                read_rawlog(path)
    for _ in range(200):
        spoilt = bytearray(whole)
        spoilt[rng.integers(len(whole))] = rng.integers(256)
        path.write_bytes(bytes(spoilt))
        with suppress(InputError):  # many bytes may be anything; none may end in another error
            read_rawlog(path)
