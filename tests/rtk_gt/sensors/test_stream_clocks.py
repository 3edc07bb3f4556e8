"""Clocks of other sensors on the vehicle against its path."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from data_samples.drives.drive import DriveSettings, simulate_drive
from data_samples.drives.files import write_drive
from rtk_gt.sensors.camera_pose import Lens
from rtk_gt.sensors.sensor_files import SeenPoints
from rtk_gt.sensors.stream_clocks import camera_stream, read_stream, stream_clock
from validation.cli import main
from validation.errors import GtvalError, InputError
from validation.poses.trajectory import Trajectory
from validation.trajectories.clock.estimate import Turns, turn_clock

EPOCH = 1_700_000_000


def turning(seed, seconds=240.0, turns=0.15, speed=6.0):
    """Times at 100 Hz, planar poses and turn rates of a drive with turns of many lengths."""
    generator = np.random.default_rng(seed)
    times = np.arange(0.0, seconds, 0.01)
    rates = np.zeros_like(times)
    for _ in range(8):
        rates += np.sin(2 * np.pi * (times * generator.uniform(0.005, 0.08) + generator.random()))
    rates = turns * rates
    yaw = np.concatenate([[0.0], np.cumsum((rates[1:] + rates[:-1]) / 2) * 0.01])
    steps = 0.01 * speed * np.column_stack([np.cos(yaw), np.sin(yaw)])
    return times, np.column_stack([np.cumsum(steps, axis=0), yaw]), rates


def path_of(times, poses, generator, every=20):
    """What three receivers make of a drive, five times a second."""
    noise = generator.standard_normal((len(times[::every]), 3)) * [0.005, 0.005, 0.012]
    return Trajectory(
        "rtk", times[::every], poses[::every] + noise, epoch=EPOCH, longest_interval=2.0
    )


def gyro_of(times, rates, generator, late, bias=0.003):
    """A gyroscope at 20 Hz with a bias and white noise, whose stamps are late."""
    noise = 0.005 * generator.standard_normal(len(times[::5]))
    return Turns.of_rates("imu", times[::5] + late, rates[::5] + bias + noise, EPOCH)


def test_a_late_gyroscope_is_found_with_an_interval_that_holds():
    """Delays of both signs; of 6 intervals of 95 %, 4 to 6 hold the truth (binomial, 1 %)."""
    held = 0
    for seed in range(6):
        generator = np.random.default_rng(seed)
        times, poses, rates = turning(seed + 50, seconds=120.0)
        late = generator.uniform(-0.5, 0.5)
        found = turn_clock(
            path_of(times, poses, generator), gyro_of(times, rates, generator, late), window=5.0
        )
        assert found.verdict == "determined"
        assert abs(found.delay_s + late) < 0.02
        held += found.low_s <= -late <= found.high_s
    assert held >= 4


def test_without_a_turn_a_gyroscope_has_no_clock():
    generator = np.random.default_rng(3)
    times, poses, rates = turning(3, turns=0.0)
    found = turn_clock(path_of(times, poses, generator), gyro_of(times, rates, generator, 0.3))
    assert found.verdict == "not_determinable"
    assert "does not turn" in found.reason
    assert np.isnan(found.delay_s)


def test_the_axis_of_a_gyroscope_may_point_down():
    generator = np.random.default_rng(4)
    times, poses, rates = turning(4)
    stream = gyro_of(times, -rates, generator, 0.3)
    found = stream_clock(path_of(times, poses, generator), stream)
    assert found.delay_s == pytest.approx(-0.3, abs=0.01)
    assert "down" in found.reason


def test_turns_of_another_drive_are_not_taken_for_this_one():
    """Turns of all lengths are somewhat alike at some delay: of three pairs none is told."""
    for seed in range(3):
        generator = np.random.default_rng(seed)
        times, poses, _ = turning(seed + 20, seconds=120.0)
        _, _, other = turning(seed + 80, seconds=120.0)
        stream = gyro_of(times, other, generator, 0.0)
        path = path_of(times, poses, generator)
        assert turn_clock(path, stream, window=20.0).verdict != "determined"


def test_positions_without_headings_have_no_clock_of_turns():
    generator = np.random.default_rng(5)
    times, poses, rates = turning(5, seconds=20.0)
    points = Trajectory("rtk", times, poses[:, :2], kind="points_plane", epoch=EPOCH)
    with pytest.raises(GtvalError, match="positions without headings"):
        turn_clock(points, gyro_of(times, rates, generator, 0.0))


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drive")
    made = simulate_drive(5, DriveSettings(loops=2))
    write_drive(folder, made, other_sensors=True)
    return folder


def run(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def shifted(source, target, late):
    """An IMU's file with late stamps."""
    head, *rows = source.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    moved = [",".join([f"{float(one[0]) + late:.3f}", *one[1:]]) for one in cells]
    target.write_text("\n".join([head, *moved]) + "\n")


def test_an_imu_that_is_late_by_0_3_seconds_is_named(drive, tmp_path):
    """`gtval rtk imu` and `gtval rtk clock` find the same; rates are compared at right times."""
    late = tmp_path / "imu.csv"
    shifted(drive / "sensors" / "imu.csv", late, 0.3)
    told = json.loads(run("rtk", "imu", drive, late, "--json").output)
    assert told["clock"]["verdict"] == "determined"
    assert told["clock"]["low_s"] <= -0.3 <= told["clock"]["high_s"]
    # 0.3 s of its turns of up to 0.45 rad/s would make this 3 degrees a second.
    assert told["angles"][0]["rmse"] < np.radians(0.6)
    done = run("rtk", "clock", drive, late)
    assert done.exit_code == 0, done.output
    assert f"{1000 * told['clock']['delay_s']:.2f}" in done.output
    assert "ms late" in done.output


def test_streams_are_told_by_their_columns(tmp_path):
    times = "\n".join(f"{EPOCH + k}.0,0.1" for k in range(5))
    (tmp_path / "gyro.csv").write_text(f"time,wz\n{times}\n")
    stream = read_stream(tmp_path / "gyro.csv")
    assert isinstance(stream, Turns)
    np.testing.assert_allclose(stream.headings, 0.1 * np.arange(5))
    (tmp_path / "yaw.csv").write_text(f"time,yaw\n{times}\n")
    assert read_stream(tmp_path / "yaw.csv").headings == pytest.approx([0.1] * 5)
    (tmp_path / "odometry.csv").write_text(
        "time,x,y,yaw\n" + "".join(f"{EPOCH + k},{k},0,0\n" for k in range(5))
    )
    assert isinstance(read_stream(tmp_path / "odometry.csv"), Trajectory)
    (tmp_path / "bad.csv").write_text(f"time,wz\n{times}\n{EPOCH + 9},fast\n")
    with pytest.raises(InputError, match=r"bad\.csv"):
        read_stream(tmp_path / "bad.csv")


def test_a_bags_imu_is_a_stream(tmp_path):
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    kind = "sensor_msgs/msg/Imu"
    types = store.types
    with rosbag2.Writer(tmp_path / "bag", version=9) as writer:
        connection = writer.add_connection("/imu", kind, typestore=store)
        for k in range(10):
            stamp = types["builtin_interfaces/msg/Time"](sec=EPOCH, nanosec=100_000_000 * k)
            vector, nine = types["geometry_msgs/msg/Vector3"], np.zeros(9)
            message = types[kind](
                types["std_msgs/msg/Header"](stamp=stamp, frame_id="imu"),
                types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
                nine, vector(0.0, 0.0, 0.5), nine, vector(0.0, 0.0, 9.8), nine,
            )  # fmt: skip
            writer.write(connection, EPOCH * 10**9 + k, store.serialize_cdr(message, kind))
    stream = read_stream(tmp_path / "bag")
    assert isinstance(stream, Turns)
    np.testing.assert_allclose(stream.headings, 0.05 * np.arange(10), atol=1e-12)


def test_a_camera_that_stamps_late_is_told_by_the_points_that_it_sees():
    """Sixty images of eight points around a road, and pixels with noise of one."""
    generator = np.random.default_rng(8)
    times, poses, _ = turning(8, seconds=120.0, speed=3.0)
    lens = Lens(np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]]), np.zeros(4))
    mount = Rotation.from_euler("ZYX", [-np.pi / 2, 0, -np.pi / 2])
    seen = [[], [], []]
    for k in range(200, len(times), 200):
        x, y, yaw = poses[k]
        ahead = np.column_stack(
            [generator.uniform(4, 12, 8), generator.uniform(-3, 3, 8), generator.uniform(-1, 2, 8)]
        )
        points = Rotation.from_euler("Z", yaw).apply(ahead) + np.array([x, y, 0.0])
        pixels = lens.project(mount.inv().apply(ahead)) + generator.standard_normal((8, 2))
        seen[0] += [EPOCH + times[k] + 0.3] * 8
        seen[1] += points.tolist()
        seen[2] += pixels.tolist()
    stream = camera_stream("camera", SeenPoints(*map(np.array, seen)), lens)
    assert len(stream) == len(range(200, len(times), 200))
    found = stream_clock(path_of(times, poses, generator), stream, window=5.0)
    assert found.verdict == "determined"
    assert found.low_s <= -0.3 <= found.high_s
    assert abs(found.delay_s + 0.3) < 0.05
    few = SeenPoints(*(np.array(values)[:16] for values in seen))
    with pytest.raises(GtvalError, match="2 images show"):
        camera_stream("camera", few, lens)
