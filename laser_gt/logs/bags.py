"""Reader of LaserScan messages from ROS 1 and ROS 2 bags and MCAP files, through rosbags."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from laser_gt.logs.records import Line, ScanRecord, checked, read_each
from laser_gt.scans.scan import Scan
from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array

MESSAGE = "sensor_msgs/msg/LaserScan"
ODOMETRY, TRANSFORMS = "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
PARSERS = {"rosbags", "struct", "lz4", "zstandard", "yaml", "ruamel"}
"""Packages whose errors say that a bag is damaged."""
SLOWEST = 1.0
"""Seconds that a scan lasts at most; a `time_increment` that makes it longer is not one."""


def read_bag(path: Path) -> list[ScanRecord]:
    """All scans of a bag; the topic is the name of the sensor.

    Parameters
    ----------
    path : Path
        A ROS 1 .bag, a ROS 2 folder, or an .mcap file.

    Raises
    ------
    GtvalError
        If the library is not installed, or the bag cannot be read.
    InputError
        If it holds no scan, or bad ones.

    Notes
    -----
    As REP 117 has it, an infinite range is no return; a range that is not a number is an error of
    the sensor and is kept as no return too. Scanners mounted upside down give falling angles;
    they are turned around.
    """
    with _reading(path) as reader:
        wanted = [c for c in reader.connections if c.msgtype == MESSAGE]
        messages = (
            (connection.topic.strip("/"), reader.deserialize(raw, connection.msgtype))
            for connection, _, raw in reader.messages(wanted)
        )
        records, problems = read_each(path, enumerate(messages, 1), _record)
    if not records and not problems:
        raise InputError([Problem(path, "the bag holds no sensor_msgs/LaserScan message")])
    return checked(path, records, problems)


@contextmanager
def _reading(path: Path) -> Iterator[Any]:
    """An open bag; whatever is wrong with it is a known error."""
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError  # noqa: PLC0415
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415
    except ImportError:
        raise GtvalError("reading bags needs an extra: pip install 'gtval[bags]'") from None
    if not path.exists():
        raise InputError([Problem(path, "there is no such file")])
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            yield reader
    except GtvalError:
        raise
    except (AnyReaderError, OSError, ValueError, KeyError, AssertionError, IndexError) as error:
        raise GtvalError(f"cannot read the bag {path}: {error}") from error
    except Exception as error:
        # rosbags and its parsers raise errors of many kinds on damaged files.
        if type(error).__module__.partition(".")[0] not in PARSERS:
            raise
        raise GtvalError(f"cannot read the bag {path}: {error}") from error


def odometry_in(path: Path) -> tuple[str, str | None] | None:
    """Topic, and pair of frames, of the odometry in a bag; None where there is none.

    An Odometry topic, the first by name; else the transforms from a frame whose name ends in
    'odom' to the first of the frames below it.
    """
    with _reading(path) as reader:
        kinds = {connection.topic: connection.msgtype for connection in reader.connections}
        for topic in sorted(kinds):
            if kinds[topic] == ODOMETRY:
                return topic, None
        wanted = [one for one in reader.connections if one.msgtype == TRANSFORMS]
        # Without a connection the library gives the messages of all.
        for connection, _, raw in reader.messages(wanted) if wanted else ():
            for one in reader.deserialize(raw, connection.msgtype).transforms:
                if str(one.header.frame_id).endswith("odom"):
                    return connection.topic, f"{one.header.frame_id}:{one.child_frame_id}"
    return None


def _record(line: Line, topic_and_message: tuple[str, Any]) -> ScanRecord:
    """A scan of one message."""
    topic, message = topic_and_message
    low, high = float(message.range_min), float(message.range_max)
    start, step = float(message.angle_min), float(message.angle_increment)
    ranges = np.array(message.ranges, dtype=float)
    angles = np.asarray(start + step * np.arange(len(ranges)), dtype=float)
    ranges = np.where(np.isnan(ranges) | (ranges < low) | (ranges > high), np.inf, ranges)
    if step < 0:
        ranges, angles = ranges[::-1], angles[::-1]
    stamp = message.header.stamp
    scan = Scan(
        ranges,
        _at_most_a_turn(angles),
        range_min=low,
        range_max=high + 1e-6,
        time=stamp.sec + 1e-9 * stamp.nanosec,
        sensor=topic,
    )
    between = float(message.time_increment)
    told = np.isfinite(between) and 0 < abs(between) * len(ranges) <= SLOWEST
    increment = (between if step > 0 else -between) if told else 0.0
    return ScanRecord(scan, line=line.number, increment=increment)


def _at_most_a_turn(angles: Array) -> Array:
    """Angles squeezed by rounding errors of single precision where they just exceed a turn."""
    span = angles[-1] - angles[0] if len(angles) else 0.0
    if 2 * np.pi < span < 2 * np.pi + 1e-3:
        return np.asarray(angles[0] + (angles - angles[0]) * (2 * np.pi / span))
    return angles
