"""Bags of all three kinds, written by rosbags and read back."""

import numpy as np
import pytest

from laser_gt.logs.bags import read_bag
from validation.errors import GtvalError, InputError

pytest.importorskip("rosbags", reason="pip install 'gtval[bags]'")
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

LASER = "sensor_msgs/msg/LaserScan"
RANGES = np.where(np.arange(90) == 3, np.inf, 2.5).astype(np.float32)
FIELDS = {
    "angle_min": -1.5,
    "angle_max": 1.5,
    "angle_increment": 3 / 89,
    "time_increment": 0.0,
    "scan_time": 0.0,
    "range_min": 0.1,
    "range_max": 30.0,
    "ranges": RANGES,
    "intensities": np.zeros(0, dtype=np.float32),
}


def _message(store, second, **fields):
    types = store.types
    header = {"stamp": types["builtin_interfaces/msg/Time"](sec=second, nanosec=500_000_000)}
    if "seq" in types["std_msgs/msg/Header"].__dataclass_fields__:
        header["seq"] = second
    values = {**FIELDS, **fields}
    return types[LASER](
        header=types["std_msgs/msg/Header"](frame_id="laser", **header),
        **values,
    )


def _ros1(path, messages):
    store = get_typestore(Stores.ROS1_NOETIC)
    with Ros1Writer(path) as writer:
        connection = writer.add_connection("/front", LASER, typestore=store)
        for number, (second, fields) in enumerate(messages):
            raw = store.serialize_ros1(_message(store, second, **fields), LASER)
            writer.write(connection, number + 1, raw)
    return path


def _ros2(path, messages, plugin):
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Ros2Writer(path, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/front", LASER, typestore=store)
        for number, (second, fields) in enumerate(messages):
            raw = store.serialize_cdr(_message(store, second, **fields), LASER)
            writer.write(connection, number + 1, raw)
    return path


WRITERS = {
    "ros1": lambda folder, messages: _ros1(folder / "log.bag", messages),
    "ros2": lambda folder, messages: _ros2(folder / "log", messages, StoragePlugin.SQLITE3),
    "mcap folder": lambda folder, messages: _ros2(folder / "log", messages, StoragePlugin.MCAP),
    "mcap file": lambda folder, messages: next(
        _ros2(folder / "log", messages, StoragePlugin.MCAP).glob("*.mcap")
    ),
}


@pytest.mark.parametrize("kind", WRITERS)
def test_every_kind_of_bag_gives_the_scans_that_were_written(tmp_path, kind):
    path = WRITERS[kind](tmp_path, [(12, {}), (13, {"ranges": RANGES * 2})])
    first, second = read_bag(path)
    assert (first.scan.time, second.scan.time) == (12.5, 13.5)
    assert first.scan.sensor == "front"
    assert first.scan.returned.sum() == 89
    assert not first.scan.returned[3]
    assert np.isclose(second.scan.ranges[0], 5.0)
    assert np.allclose(first.scan.angles, np.linspace(-1.5, 1.5, 90), atol=1e-6)


def test_bad_messages_are_named_by_their_number(tmp_path):
    none = np.zeros(0, dtype=np.float32)
    path = _ros1(
        tmp_path / "x.bag",
        [(1, {}), (2, {"ranges": none}), (3, {"angle_increment": 0.0}), (1, {}),
         (5, {"angle_min": float("nan")}), (6, {"range_max": float("inf")})],
    )  # fmt: skip
    with pytest.raises(InputError) as caught:
        read_bag(path)
    assert [problem.line for problem in caught.value.problems] == [2, 3, 4, 5, 6]
    assert "no beams" in str(caught.value)
    assert "same sensor and time stamp" in str(caught.value)


def test_a_scanner_upside_down_is_turned_around(tmp_path):
    ranges = np.linspace(1, 2, 90).astype(np.float32)
    path = _ros1(
        tmp_path / "x.bag", [(1, {"angle_min": 1.5, "angle_increment": -3 / 89, "ranges": ranges})]
    )
    (record,) = read_bag(path)
    assert (np.diff(record.scan.angles) > 0).all()
    assert record.scan.ranges[0] == 2.0


def test_a_bag_cut_short_or_of_other_things_is_refused_in_words(tmp_path):
    whole = _ros1(tmp_path / "whole.bag", [(second, {}) for second in range(20)])
    data = whole.read_bytes()
    for share in (0.1, 0.5, 0.9, 0.99):
        cut = tmp_path / "cut.bag"
        cut.write_bytes(data[: int(share * len(data))])
        with pytest.raises(GtvalError, match=r"cut\.bag"):
            read_bag(cut)
    mcap = _ros2(tmp_path / "log", [(1, {})], StoragePlugin.MCAP)
    file = next(mcap.glob("*.mcap"))
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    with pytest.raises(GtvalError, match=r"cut\.mcap"):
        read_bag(cut)
    with pytest.raises(GtvalError, match="no such file"):
        read_bag(tmp_path / "missing.bag")
    (tmp_path / "folder").mkdir()
    with pytest.raises(GtvalError, match="folder"):
        read_bag(tmp_path / "folder")


def _odometry(store, second):
    types = store.types
    header = types["std_msgs/msg/Header"](
        stamp=types["builtin_interfaces/msg/Time"](sec=second, nanosec=0), frame_id="odom"
    )
    return header, types["geometry_msgs/msg/Transform"](
        translation=types["geometry_msgs/msg/Vector3"](x=0.5 * second, y=0.0, z=0.0),
        rotation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
    )


def test_a_bag_tells_when_beams_are_fired_and_where_its_odometry_is(tmp_path):
    from laser_gt.logs.bags import odometry_in
    from validation.trajectories.formats import read_trajectory

    store = get_typestore(Stores.ROS2_HUMBLE)
    tf = "tf2_msgs/msg/TFMessage"
    with Ros2Writer(tmp_path / "log", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        laser = writer.add_connection("/scan", LASER, typestore=store)
        raw = store.serialize_cdr(_message(store, 1, time_increment=1e-4), LASER)
        writer.write(laser, 1, raw)
        frames = writer.add_connection("/tf", tf, typestore=store)
        for second in range(3):
            header, transform = _odometry(store, second)
            one = store.types["geometry_msgs/msg/TransformStamped"](
                header=header, child_frame_id="base_link", transform=transform
            )
            message = store.types[tf](transforms=[one])
            writer.write(frames, second + 2, store.serialize_cdr(message, tf))
    (record,) = read_bag(tmp_path / "log")
    assert np.isclose(record.increment, 1e-4)
    topic, body = odometry_in(tmp_path / "log")
    assert (topic, body) == ("/tf", "odom:base_link")
    found = read_trajectory(tmp_path / "log", topic=topic, body=body).planar()
    assert np.allclose(found.poses[:, 0], [0, 0.5, 1.0])


def test_a_bag_without_odometry_says_none(tmp_path):
    from laser_gt.logs.bags import odometry_in

    assert odometry_in(_ros1(tmp_path / "x.bag", [(1, {})])) is None
