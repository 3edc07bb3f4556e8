"""Clocks of what else is on the vehicle, against the path: IMUs, odometers, any trajectory."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from rtk_gt.sensors.camera_pose import Lens
from rtk_gt.sensors.sensor_files import SeenPoints, read_turns
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.trajectory import Trajectory
from validation.trajectories.clock.estimate import Turns, estimate_clock, turn_clock
from validation.trajectories.clock.result import ClockEstimate
from validation.trajectories.formats.bags import MAGIC, header_stamps, topic_messages
from validation.trajectories.formats.reading import read_trajectory
from validation.trajectories.formats.source import Source, system_name

IMU = "sensor_msgs/msg/Imu"
FEWEST_POINTS = 6
"""Points of an image from which its camera's pose is one, wherever they lie."""
LARGEST_RESIDUAL = 5.0
"""Pixels (root mean square) that points are off at most: more is a point that is another."""


def read_stream(path: Path, topic: str | None = None) -> Trajectory | Turns:
    """What a sensor's file says of the motion: poses, positions, or headings alone.

    Parameters
    ----------
    path : Path
        A trajectory of any format; a table ``time,yaw,pitch,roll`` or ``time,wx,wy,wz`` of an IMU;
        a bag with poses or with messages of an IMU.
    topic : str, optional
        Of a bag.

    Raises
    ------
    GtvalError
        If it is none of these, or has bad places.
    """
    name = system_name(path)
    if _is_bag(path):
        try:
            return _imu_of_bag(path, name, topic)
        except GtvalError as no_imu:
            try:
                return read_trajectory(path, system=name, topic=topic)
            except GtvalError as no_poses:
                raise GtvalError(f"{no_poses}; nor an IMU: {no_imu}") from None
    turns = read_turns(path)
    if turns is None:
        return read_trajectory(path, system=name, topic=topic)
    times, values, rates = turns
    return turns_of(name, times, values, rates=rates)


def turns_of(name: str, times: Array, values: Array, *, rates: bool = False) -> Turns:
    """Headings of a source from its yaw (n,), or from its rates about the upward axis."""
    epoch = int(np.floor(times[0]))
    if rates:
        return Turns.of_rates(name, times - epoch, values, epoch)
    return Turns(name, times - epoch, np.unwrap(values), epoch)


def camera_stream(name: str, seen: SeenPoints, lens: Lens) -> Trajectory:
    """Where a camera was, from the points that each image shows; its clock is the images'.

    Parameters
    ----------
    name : str
        Of the camera.
    seen : SeenPoints
        Points known in the local frame, and their pixels.
    lens : Lens
        Of the camera.

    Raises
    ------
    GtvalError
        If fewer than three images show `FEWEST_POINTS` points that fit one pose.

    Notes
    -----
    Each image by itself, by the least squares of its pixels; images whose pixels are off by more
    than `LARGEST_RESIDUAL` (root mean square) are left out.
    """
    import cv2  # noqa: PLC0415  (half a second that other streams do without)

    times, poses = [], []
    for time in np.unique(seen.times):
        rows = seen.times == time
        if rows.sum() < FEWEST_POINTS:
            continue
        points, pixels = seen.points[rows], seen.pixels[rows]
        found, turn, shift = cv2.solvePnP(
            points - points.mean(0), pixels, lens.matrix, lens.distortion, flags=cv2.SOLVEPNP_SQPNP
        )
        if not found:
            continue
        turn, shift = cv2.solvePnPRefineLM(
            points - points.mean(0), pixels, lens.matrix, lens.distortion, turn, shift
        )
        rotation = cv2.Rodrigues(turn)[0]
        left = lens.project((points - points.mean(0)) @ rotation.T + shift.ravel()) - pixels
        if not np.sqrt(np.mean(left**2)) < LARGEST_RESIDUAL:
            continue
        place = points.mean(0) - rotation.T @ shift.ravel()
        times.append(float(time))
        poses.append([*place, *Rotation.from_matrix(rotation.T).as_quat()])
    if len(times) < 3:
        raise GtvalError(
            f"{name}: {len(times)} images show {FEWEST_POINTS} points that fit one pose; three at "
            "least have a clock, and thirty or more are needed to tell it"
        )
    epoch = int(np.floor(times[0]))
    since = np.array(times) - epoch
    return Trajectory(name, since, np.array(poses), kind="space", epoch=epoch)


def stream_clock(
    reference: Trajectory, stream: Trajectory | Turns, window: float = 60.0
) -> ClockEstimate:
    """What is added to a stream's stamps to get the path's time, by the clock of trajectories.

    Parameters
    ----------
    reference : Trajectory
        The path.
    stream : Trajectory or Turns
        Of one vehicle with it, in a frame and on a mount of its own.
    window : float
        Seconds to both sides in which the delay is sought.

    Raises
    ------
    GtvalError
        If the stream has headings only and the path has none, or one has fewer than three poses.

    Notes
    -----
    Whether the z axis of a gyroscope points up or down its file does not tell: the turns do.
    """
    if isinstance(stream, Trajectory):
        return estimate_clock(reference, stream, window=window)
    return turn_clock(reference, stream, window=window)


def _is_bag(path: Path) -> bool:
    if path.is_dir():
        return True
    try:
        with path.open("rb") as stream:
            return stream.read(16).startswith(MAGIC)
    except OSError:
        return False


def _imu_of_bag(path: Path, name: str, topic: str | None) -> Turns:
    """Rates about z of the messages of an IMU."""
    source = Source(path, b"")
    _, _, messages = topic_messages(source, (IMU,), topic, "IMU messages")
    stamps, _, _ = header_stamps(messages)
    rates = np.array([message.angular_velocity.z for _, message in messages], dtype=float)
    order = np.argsort(stamps, kind="stable")
    order = order[np.diff(stamps[order], prepend=stamps.min() - 1) > 0]
    if len(order) < 3 or not np.isfinite(rates).all():
        raise source.error("too few rates with stamps of their own, or rates that are no numbers")
    epoch = int(stamps.min() // 1_000_000_000)
    times = (stamps[order] - epoch * 1_000_000_000) / 1e9
    return Turns.of_rates(name, times, rates[order], epoch)
