"""Bags of ROS 1 and ROS 2 and MCAP files, through rosbags."""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array
from validation.poses.earth_frames import LocalFrame
from validation.poses.trajectory import Clock, Trajectory
from validation.trajectories.formats.records import Records
from validation.trajectories.formats.source import LARGEST, Asked, Source, missing_extra

POSE, POSE_COVARIANCE, ODOMETRY, TRANSFORM, TF, POINT, FIX = (
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/TransformStamped",
    "tf2_msgs/msg/TFMessage",
    "geometry_msgs/msg/PointStamped",
    "sensor_msgs/msg/NavSatFix",
)
KINDS = (POSE, POSE_COVARIANCE, ODOMETRY, TRANSFORM, TF, POINT, FIX)
"""Messages that are poses or positions."""
MAGIC = (b"\x89MCAP0\r\n", b"#ROSBAG V", b"SQLite format 3\0")
"""First bytes of MCAP files, of bags of ROS 1, and of the databases in folders of ROS 2."""
SUFFIXES = {".mcap", ".bag"}


def bag_fault(path: Path, head: bytes) -> str | None:
    """Why a path is no bag, None if it is one."""
    if path.is_dir():
        return None if (path / "metadata.yaml").is_file() else "the folder has no metadata.yaml"
    if head.startswith(MAGIC[:2]):
        return None
    if head.startswith(MAGIC[2]):
        return "this is the database inside a bag; name its folder"
    return "the first bytes are not those of a bag"


@contextmanager
def _reading(path: Path) -> Iterator[Any]:
    """An open bag; whatever is wrong with it is a known error."""
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError  # noqa: PLC0415
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415
    except ImportError:
        raise missing_extra("reading bags") from None
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            yield reader
    except GtvalError:
        raise
    except (AnyReaderError, OSError, ValueError, KeyError, AssertionError, IndexError) as error:
        raise InputError([Problem(path, f"the bag cannot be read: {error}")]) from error
    except Exception as error:
        # rosbags and its parsers raise errors of many kinds on damaged files.
        if type(error).__module__.partition(".")[0] in {"rosbags", "struct", "lz4", "zstandard"}:
            raise InputError([Problem(path, f"the bag cannot be read: {error}")]) from error
        raise


def read_bag(source: Source, asked: Asked) -> Records:
    """The poses of one topic of a bag.

    Raises
    ------
    GtvalError
        If rosbags is not installed.
    InputError
        If the bag is damaged, has no poses, or several topics and none is asked for.
    """
    topic, kind, messages = topic_messages(source, KINDS, asked.topic, "poses")
    records = _records(source, kind, messages, asked)
    records.facts |= {"topic": topic, "message": kind}
    return records


def topic_messages(
    source: Source, kinds: Sequence[str], topic: str | None, what: str
) -> tuple[str, str, list[tuple[int, Any]]]:
    """The messages of one topic of a bag.

    Parameters
    ----------
    source : Source
        The bag.
    kinds : sequence of str
        Kinds of messages that will do, such as ``sensor_msgs/msg/NavSatFix``.
    topic : str, optional
        The topic wanted; by default the only one of these kinds.
    what : str
        What its messages are, for errors.

    Returns
    -------
    topic, kind : str
        The topic, and the kind of its messages.
    messages : list of (int, message)
        Nanoseconds of receipt, and the message.

    Raises
    ------
    GtvalError
        If rosbags is not installed.
    InputError
        If the bag is damaged or has no such topic, or several and none is asked for.
    """
    with _reading(source.path) as reader:
        able = {c.topic: c.msgtype for c in reader.connections if c.msgtype in kinds}
        found = _topic(source, able, topic, what, kinds)
        wanted = [c for c in reader.connections if c.topic == found]
        messages = [
            (stamp, reader.deserialize(raw, connection.msgtype))
            for connection, stamp, raw in reader.messages(wanted)
        ]
    if not messages:
        raise source.error(f"no message on {found}")
    return found, able[found], messages


def _topic(
    source: Source, able: Mapping[str, str], asked: str | None, what: str, kinds: Sequence[str]
) -> str:
    """The topic that is asked for, or the only one of the kinds wanted."""
    named = ", ".join(f"{topic} ({kind.rpartition('/')[2]})" for topic, kind in able.items())
    if asked is not None:
        found = [topic for topic in able if topic.strip("/") == asked.strip("/")]
        if not found:
            raise source.error(f"no {what} on {asked}; there are {named or 'none at all'}")
        return found[0]
    if not able:
        wanted = ", ".join(kind.rpartition("/")[2] for kind in kinds)
        raise source.error(f"the bag has no topic with {what} ({wanted})")
    if len(able) > 1:
        raise source.error(f"several topics with {what}: {named}; choose one with --topic")
    return next(iter(able))


def _records(
    source: Source, kind: str, messages: Sequence[tuple[int, Any]], asked: Asked
) -> Records:
    """Stamps, positions, quaternions and covariances of messages of one kind."""
    if kind == TF:
        messages = _transforms(source, messages, asked)
    numbers = list(range(1, len(messages) + 1))
    stamps, clock, notes = header_stamps(messages)
    first = messages[0][1]
    records = Records(
        source,
        "bag",
        numbers,
        stamps,
        np.empty(0),
        unit="ns",
        clock=clock,
        notes=notes,
        frame=str(first.header.frame_id),
        child_frame=str(getattr(first, "child_frame_id", "")),
        row="message",
    )
    if kind == FIX:
        return _of_fixes(records, messages)
    if kind == POINT:
        records.positions = _checked(
            records, [(m.point.x, m.point.y, m.point.z) for _, m in messages]
        )
        return records
    poses = [_pose(kind, message) for _, message in messages]
    records.positions = _checked(records, [(p.x, p.y, p.z) for p, _ in poses])
    records.quaternions = _checked(records, [(q.x, q.y, q.z, q.w) for _, q in poses])
    if kind in {POSE_COVARIANCE, ODOMETRY}:
        covariances = np.array([m.pose.covariance for _, m in messages], dtype=float)
        covariances = covariances.reshape(-1, 6, 6)
        # By convention -1 in the first place says that nothing is known.
        unknown = (covariances[:, 0, 0] < 0) | ~(np.abs(covariances) < LARGEST).all((1, 2))
        covariances[unknown] = np.nan
        records.covariances = covariances
    return records


def _pose(kind: str, message: Any) -> tuple[Any, Any]:
    """Position and quaternion of a message."""
    if kind in {TF, TRANSFORM}:
        return message.transform.translation, message.transform.rotation
    pose = message.pose if kind == POSE else message.pose.pose
    return pose.position, pose.orientation


def _checked(records: Records, rows: Sequence[tuple[float, ...]]) -> Array:
    """Rows of numbers, all of them finite."""
    values = np.array(rows, dtype=float)
    bad = np.flatnonzero(~(np.abs(values) < LARGEST).all(1))
    if len(bad):
        raise InputError(
            Problem(records.source.path, f"message {row + 1} has a number that is not finite")
            for row in bad[:1000]
        )
    return values


def header_stamps(messages: Sequence[tuple[int, Any]]) -> tuple[Any, Clock, list[str]]:
    """(n,) stamps of the headers in nanoseconds, or of receipt where no header has one."""
    stamps = np.array(
        [m.header.stamp.sec * 1_000_000_000 + m.header.stamp.nanosec for _, m in messages],
        dtype=np.int64,
    )
    if stamps.any():
        return stamps, Clock(), []
    notes = ["the headers have no stamps: the times of receipt are taken"]
    return np.array([received for received, _ in messages], dtype=np.int64), Clock("receipt"), notes


def _transforms(
    source: Source, messages: Sequence[tuple[int, Any]], asked: Asked
) -> list[tuple[int, Any]]:
    """The transforms of one pair of frames among messages of many."""
    pairs: dict[tuple[str, str], list[tuple[int, Any]]] = {}
    for received, message in messages:
        for one in message.transforms:
            pair = (str(one.header.frame_id), str(one.child_frame_id))
            pairs.setdefault(pair, []).append((received, one))
    wanted = [
        pair for pair in pairs if asked.body is None or asked.body in {pair[1], ":".join(pair)}
    ]
    named = ", ".join(":".join(pair) for pair in pairs)
    if not wanted:
        raise source.error(f"no transform to '{asked.body}'; there are {named or 'none at all'}")
    if len(wanted) > 1:
        raise source.error(f"several transforms: {named}; choose one with --body CHILD")
    return pairs[wanted[0]]


def _of_fixes(records: Records, messages: Sequence[tuple[int, Any]]) -> Records:
    """Local east, north, up of satellite fixes, from the first one."""
    rows = [(m.latitude, m.longitude, m.altitude) for _, m in messages]
    found = np.array([m.status.status >= 0 for _, m in messages])
    finite = np.isfinite(np.array(rows, dtype=float)).all(1)
    kept = np.flatnonzero(found & finite).tolist()
    if not kept:
        raise records.source.error("no message has a fix")
    if len(kept) < len(messages):
        records.notes.append(f"{len(messages) - len(kept)} messages without a fix are left out")
    places = np.array(rows, dtype=float)[kept]
    geodetic = np.column_stack([np.radians(places[:, :2]), places[:, 2]])
    frame = LocalFrame.from_degrees(*_three(places[0]))
    records.positions = frame.from_geodetic(geodetic)
    stated = [messages[row][1].position_covariance for row in kept]
    covariances: Array = np.array(stated, dtype=float).reshape(-1, 3, 3)
    kinds = np.array([messages[row][1].position_covariance_type for row in kept])
    unknown = (covariances[:, 0, 0] < 0) | ~(np.abs(covariances) < LARGEST).all((1, 2))
    covariances[(kinds == 0) | unknown] = np.nan
    records.covariances = covariances
    records.lines = [records.lines[row] for row in kept]
    records.stamps = np.asarray(records.stamps)[kept]
    records.facts["origin"] = {
        "latitude_deg": float(places[0, 0]),
        "longitude_deg": float(places[0, 1]),
        "height_m": float(places[0, 2]),
    }
    records.facts["axes"] = "x east, y north, z up"
    return records


def _three(place: Array) -> tuple[float, float, float]:
    """Latitude, longitude and height as numbers."""
    return float(place[0]), float(place[1]), float(place[2])


def mcap_bytes(trajectory: Trajectory, topic: str = "/pose") -> bytes:
    """An MCAP file with one topic of poses, with covariance where one is stated, or of points.

    Raises
    ------
    GtvalError
        If rosbags is not installed.
    """
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer  # noqa: PLC0415
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415
    except ImportError:
        raise missing_extra("writing bags") from None
    store = get_typestore(Stores.ROS2_HUMBLE)
    kind = POINT
    if trajectory.has_orientation:
        kind = POSE_COVARIANCE if trajectory.has_covariance.any() else POSE
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bag"
        with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connection = writer.add_connection(topic, kind, typestore=store)
            for stamp, message in _messages(trajectory, kind, store.types):
                writer.write(connection, stamp, store.serialize_cdr(message, kind))
        return next(path.glob("*.mcap")).read_bytes()


def _messages(
    trajectory: Trajectory, kind: str, types: Mapping[str, Any]
) -> Iterator[tuple[int, Any]]:
    """Stamp in nanoseconds and message of each pose."""
    header, stamp = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    point = types["geometry_msgs/msg/Point"]
    pose, turn = types["geometry_msgs/msg/Pose"], types["geometry_msgs/msg/Quaternion"]
    both = types["geometry_msgs/msg/PoseWithCovariance"]
    positions = np.zeros((len(trajectory), 3))
    positions[:, : trajectory.dimensions] = trajectory.positions
    quaternions = trajectory.rotations.as_quat() if trajectory.has_orientation else None
    whole = np.floor(trajectory.times)
    parts = np.rint((trajectory.times - whole) * 1e9).astype(np.int64)
    stamps = (whole.astype(np.int64) + trajectory.epoch) * 1_000_000_000 + parts
    covariances = np.zeros((len(trajectory), 6, 6))
    if kind == POSE_COVARIANCE:
        kept = [0, 1, 5] if trajectory.kind == "plane" else list(range(6))
        covariances[np.ix_(range(len(trajectory)), kept, kept)] = np.nan_to_num(
            trajectory.covariances
        )
    for row, total in enumerate(stamps.tolist()):
        sec, nanosec = divmod(total, 1_000_000_000)
        head = header(stamp=stamp(sec=sec, nanosec=nanosec), frame_id=trajectory.frame)
        place = point(*(float(one) for one in positions[row]))
        if quaternions is None:
            yield total, types[POINT](header=head, point=place)
            continue
        one = pose(position=place, orientation=turn(*(float(q) for q in quaternions[row])))
        if kind == POSE_COVARIANCE:
            one = both(pose=one, covariance=covariances[row].ravel())
        yield total, types[kind](header=head, pose=one)
