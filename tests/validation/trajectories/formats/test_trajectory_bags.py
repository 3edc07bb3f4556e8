"""Bags of ROS 1 and 2 and MCAP files with poses, written by rosbags and by gtval."""

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="pip install 'gtval[bags]'")
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

from validation.errors import InputError
from validation.poses.earth_frames import LocalFrame
from validation.trajectories.formats import is_trajectory, read_trajectory, write_trajectory
from validation.trajectories.formats.bags import (
    FIX,
    ODOMETRY,
    POINT,
    POSE,
    POSE_COVARIANCE,
    TF,
    TRANSFORM,
)

COVARIANCE = np.diag([1e-4, 2e-4, 3e-4, 4e-6, 5e-6, 6e-6])


class Messages:
    """Makes messages of one generation of ROS from the poses of a drive."""

    def __init__(self, store, trajectory):
        self.types = store.types
        self.trajectory = trajectory
        self.quaternions = trajectory.rotations.as_quat()

    def make(self, kind, **parts):
        return self.types[kind](**parts)

    def header(self, row, frame="map", *, stamped=True):
        total = round(self.trajectory.times[row] * 1e9) + self.trajectory.epoch * 10**9
        sec, nanosec = divmod(total, 10**9) if stamped else (0, 0)
        parts = {"stamp": self.make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)}
        if "seq" in self.types["std_msgs/msg/Header"].__dataclass_fields__:
            parts["seq"] = row
        return self.make("std_msgs/msg/Header", frame_id=frame, **parts)

    def vector(self, kind, row):
        x, y, z = map(float, self.trajectory.positions[row])
        return self.make(f"geometry_msgs/msg/{kind}", x=x, y=y, z=z)

    def turn(self, row):
        x, y, z, w = map(float, self.quaternions[row])
        return self.make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)

    def pose(self, row):
        place, turn = self.vector("Point", row), self.turn(row)
        return self.make("geometry_msgs/msg/Pose", position=place, orientation=turn)

    def transform(self, row, child="base"):
        place, turn = self.vector("Vector3", row), self.turn(row)
        moved = self.make("geometry_msgs/msg/Transform", translation=place, rotation=turn)
        return self.make(TRANSFORM, header=self.header(row), child_frame_id=child, transform=moved)

    def message(self, kind, row, *, stamped=True):
        header = self.header(row, stamped=stamped)
        sure = {"pose": None, "covariance": COVARIANCE.ravel().copy()}
        if kind == POSE:
            return self.make(kind, header=header, pose=self.pose(row))
        if kind == POINT:
            return self.make(kind, header=header, point=self.vector("Point", row))
        if kind == TRANSFORM:
            return self.transform(row)
        if kind == TF:
            return self.make(kind, transforms=[self.transform(row), self.transform(row, "head")])
        sure["pose"] = self.pose(row)
        pose = self.make("geometry_msgs/msg/PoseWithCovariance", **sure)
        if kind == POSE_COVARIANCE:
            return self.make(kind, header=header, pose=pose)
        still = self.make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
        twist = self.make("geometry_msgs/msg/Twist", linear=still, angular=still)
        twist = self.make(
            "geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)
        )
        return self.make(kind, header=header, child_frame_id="base", pose=pose, twist=twist)


def bag(path, trajectory, topics, kind="mcap", *, stamped=True):
    """A bag with all the poses on each topic."""
    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    make = Messages(store, trajectory)
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    opened = (
        Ros1Writer(path) if kind == "ros1" else Ros2Writer(path, version=9, storage_plugin=plugin)
    )
    with opened as writer:
        for topic, message in topics.items():
            connection = writer.add_connection(topic, message, typestore=store)
            serialize = store.serialize_ros1 if kind == "ros1" else store.serialize_cdr
            for row in range(len(trajectory)):
                raw = serialize(make.message(message, row, stamped=stamped), message)
                writer.write(connection, (trajectory.epoch + 100) * 10**9 + row * 10**8, raw)
    return next(path.glob("*.mcap")) if kind == "mcap" else path


@pytest.mark.parametrize("kind", ["mcap", "ros1", "ros2"])
@pytest.mark.parametrize("message", [POSE, POSE_COVARIANCE, ODOMETRY, TRANSFORM])
def test_poses_of_all_kinds_of_bags(tmp_path, drive, same, kind, message):
    before = drive(covariance=False)
    path = bag(
        tmp_path / ("a.bag" if kind == "ros1" else "a"), before, {"/robot/pose": message}, kind
    )
    assert is_trajectory(path)
    found = read_trajectory(path)
    same(found, before)
    assert found.frame == "map"
    assert found.provenance["topic"] == "/robot/pose"
    if message in {POSE_COVARIANCE, ODOMETRY}:
        np.testing.assert_array_equal(found.covariances[3], COVARIANCE)
    else:
        assert not found.has_covariance.any()


def test_points(tmp_path, drive):
    before = drive(covariance=False)
    found = read_trajectory(bag(tmp_path / "a", before, {"/prism": POINT}))
    assert found.kind == "points_space"
    np.testing.assert_array_equal(found.positions, before.positions)


def test_of_several_topics_one_is_chosen(tmp_path, drive, same):
    before = drive(covariance=False)
    path = bag(tmp_path / "a", before, {"/pose": POSE, "/odom": ODOMETRY})
    with pytest.raises(InputError, match=r"several topics .*/pose \(PoseStamped\), /odom"):
        read_trajectory(path)
    same(read_trajectory(path, topic="odom"), before)
    with pytest.raises(InputError, match=r"no poses on /imu; there are /pose"):
        read_trajectory(path, topic="/imu")


def test_of_several_transforms_one_is_chosen(tmp_path, drive, same):
    before = drive(covariance=False)
    path = bag(tmp_path / "a", before, {"/tf": TF})
    with pytest.raises(InputError, match="several transforms: map:base, map:head"):
        read_trajectory(path)
    same(read_trajectory(path, body="head"), before)
    assert read_trajectory(path, body="map:base").child_frame == "base"
    with pytest.raises(InputError, match="no transform to 'arm'"):
        read_trajectory(path, body="arm")


def test_headers_without_stamps_leave_the_times_of_receipt(tmp_path, drive):
    before = drive(covariance=False)
    found = read_trajectory(bag(tmp_path / "a", before, {"/pose": POSE}, stamped=False))
    assert found.clock.stamps == "receipt"
    np.testing.assert_allclose(found.times_since(before.epoch + 100), np.arange(60) / 10, atol=1e-9)


def test_satellite_fixes_become_metres(tmp_path):
    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    frame = LocalFrame.from_degrees(45.5, 9.2, 120.0)
    local = np.column_stack([np.linspace(0, 50, 20), np.linspace(0, -30, 20), np.zeros(20)])
    places = frame.to_geodetic(local)
    with Ros2Writer(tmp_path / "a", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/fix", FIX, typestore=store)
        for k, (latitude, longitude, height) in enumerate(places):
            header = types["std_msgs/msg/Header"](
                stamp=types["builtin_interfaces/msg/Time"](sec=1_600_000_000 + k, nanosec=0),
                frame_id="gps",
            )
            status = types["sensor_msgs/msg/NavSatStatus"](status=-1 if k == 7 else 2, service=1)
            fix = types[FIX](
                header=header,
                status=status,
                latitude=np.degrees(latitude).item(),
                longitude=np.degrees(longitude).item(),
                altitude=float(height),
                position_covariance=np.diag([1e-4, 1e-4, 4e-4]).ravel(),
                position_covariance_type=2 if k else 0,
            )
            writer.write(connection, k + 1, store.serialize_cdr(fix, FIX))
    found = read_trajectory(tmp_path / "a")
    seen = np.delete(np.arange(20), 7)
    # Degrees as doubles hold a place to 1e-9 m.
    np.testing.assert_allclose(found.positions, local[seen], rtol=0, atol=2e-8)
    assert found.has_covariance.tolist() == [False] + [True] * 18
    assert found.provenance["origin"]["latitude_deg"] == pytest.approx(45.5)
    assert "1 messages without a fix" in " ".join(found.provenance["notes"])


@pytest.mark.parametrize("kind", ["space", "plane", "points_space"])
@pytest.mark.parametrize("covariance", [True, False])
def test_what_gtval_writes_it_reads(tmp_path, drive, same, kind, covariance):
    before = drive(kind, covariance=covariance)
    (path,) = write_trajectory(before, tmp_path / "a.mcap")
    after = read_trajectory(path)
    same(after, before, atol=1e-12)
    if covariance and before.has_orientation:
        np.testing.assert_allclose(after.covariances, before.covariances, rtol=1e-12)


def test_a_robot_that_states_the_plane_only_is_in_the_plane(tmp_path, drive):
    """Zero variances of z, roll and pitch say nothing; they do not make a covariance singular."""
    before = drive("plane")
    (path,) = write_trajectory(before, tmp_path / "a.mcap")
    found = read_trajectory(path)
    assert found.kind == "plane"
    assert found.has_covariance.all()


@pytest.mark.parametrize(
    "spoilt", [np.diag([1e-4, 1e-4, 0, 1e-6, 1e-6, 1e-6]), COVARIANCE + np.eye(6)[::-1]]
)
def test_covariances_of_a_bag_that_are_none_are_not_used(
    tmp_path, drive, same, monkeypatch, spoilt
):
    before = drive(covariance=False)
    monkeypatch.setattr(__name__ + ".COVARIANCE", spoilt)
    found = read_trajectory(bag(tmp_path / "a", before, {"/pose": POSE_COVARIANCE}))
    same(found, before)
    assert not found.has_covariance.any()
    assert "60 covariances" in found.provenance["notes"][0]


def test_damaged_and_other_bags_are_refused(tmp_path, written, drive):
    (path,) = write_trajectory(drive(), tmp_path / "a.mcap")
    data = path.read_bytes()
    for cut in (20, 200, len(data) // 2, len(data) - 20):
        with pytest.raises(InputError, match=r"the bag cannot be read|no message|no topic"):
            read_trajectory(written("b.mcap", data[:cut]))
    with pytest.raises(InputError, match="cannot be read"):
        read_trajectory(written("c.bag", b"#ROSBAG V2.0\n" + b"\0" * 50))
    with pytest.raises(InputError, match="name its folder"):
        read_trajectory(written("d.db3", b"SQLite format 3\0" + b"\0" * 50))
    assert not is_trajectory(tmp_path)
    with pytest.raises(InputError, match=r"no format of a trajectory fits.*metadata\.yaml"):
        read_trajectory(tmp_path)
