import numpy as np
import pytest

from laser_gt.logs.carmen import read_carmen
from laser_gt.logs.rawseeds import read_rawseeds_odometry, read_rawseeds_sick
from laser_gt.logs.scan_csv import read_scan_csv, scan_csv
from laser_gt.scans.scan import Scan
from validation.errors import GtvalError, InputError

RANGES = " ".join(f"{2 + 0.01 * i:.2f}" for i in range(180))
FLASER = f"FLASER 180 {RANGES} 1 2 0.5 1.1 2.1 0.6 100.5 host 0.5"
ROBOT = (
    "ROBOTLASER1 0 -1.570796 3.141593 0.017453 81.90 0.01 0 180 "
    f"{RANGES} 0 0.9 2 0.5 1 2 0.5 0 0 0 0 0 200.25 host 1.0"
)


def _write(tmp_path, text, name="log.txt"):
    path = tmp_path / name
    path.write_text(text)
    return path


def test_carmen_messages_are_read_with_their_poses(tmp_path):
    old, new = read_carmen(_write(tmp_path, f"# comment\n{FLASER}\nODOM 0 0 0\n{ROBOT}\n"))
    assert (old.scan.time, new.scan.time) == (100.5, 200.25)
    assert np.array_equal(old.odometry, [1.1, 2.1, 0.6])
    assert np.array_equal(new.odometry, [1, 2, 0.5])
    assert np.array_equal(new.laser_odometry, [0.9, 2, 0.5])
    assert len(old.scan) == len(new.scan) == 180
    assert new.scan.ranges[3] == 2.03


def test_the_rear_scanner_of_newer_logs_is_read_too(tmp_path):
    both = f"{ROBOT}\n{ROBOT.replace('ROBOTLASER1', 'ROBOTLASER2')}\n"
    front, rear = read_carmen(_write(tmp_path, both))
    assert (front.scan.sensor, rear.scan.sensor) == ("front", "rear")


def test_ranges_at_the_limit_are_no_returns(tmp_path):
    far = FLASER.replace("2.05", "81.91")
    (record,) = read_carmen(_write(tmp_path, far))
    assert not record.scan.returned[5]
    assert record.scan.returned.sum() == 179


def test_a_log_cut_in_the_middle_of_a_line_names_the_line(tmp_path):
    path = _write(tmp_path, f"{FLASER}\n{ROBOT[:400]}")
    with pytest.raises(InputError, match=r"log.txt, line 2.*cut short"):
        read_carmen(path)


def test_the_same_stamp_twice_and_words_for_numbers_are_all_named(tmp_path):
    path = _write(tmp_path, f"{FLASER}\n{FLASER}\n{ROBOT.replace('2.07', 'two')}\n")
    with pytest.raises(InputError) as caught:
        read_carmen(path)
    assert [problem.line for problem in caught.value.problems] == [2, 3]
    assert "'two'" in str(caught.value)


def test_a_file_without_scans_and_one_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="no scan"):
        read_carmen(_write(tmp_path, "ODOM 0 0 0\n"))
    with pytest.raises(InputError, match="no such file"):
        read_carmen(tmp_path / "missing.log")
    bad = tmp_path / "cut.log.gz"
    bad.write_bytes(b"\x1f\x8b\x08\x00broken")
    with pytest.raises(InputError, match="damaged"):
        read_carmen(bad)


def test_rawseeds_formats(tmp_path):
    line = "1234.5, 181, 2, " + ", ".join(["3.5"] * 180 + ["0"])
    (record,) = read_rawseeds_sick(_write(tmp_path, line))
    assert record.scan.returned.sum() == 180
    assert np.isclose(record.scan.angles[0], np.deg2rad(-89.5))
    times, poses = read_rawseeds_odometry(_write(tmp_path, "7.5, 1, 2, 3, 0.5, 0.25, 1.5\n"))
    assert times.tolist() == [7.5]
    assert poses.tolist() == [[0.5, 0.25, 1.5]]
    with pytest.raises(InputError, match=r"line 1.*181 expected"):
        read_rawseeds_sick(_write(tmp_path, "1234.5, 181, 0, 3.5, 3.5"))


def test_own_format_reads_back_what_was_written(tmp_path):
    angles = np.linspace(-1, 1, 50)
    ranges = np.where(np.arange(50) % 7 == 0, np.inf, 2.5)
    scan = Scan(ranges, angles, 0.1, 30.0, time=5.0, sensor="front")
    (record,) = read_scan_csv(_write(tmp_path, scan_csv([("7", scan)]), "scans.csv"))
    assert record.stop == "7"
    assert np.array_equal(record.scan.ranges, ranges)
    assert np.allclose(record.scan.angles, angles)
    assert (record.scan.range_min, record.scan.range_max) == (0.1, 30.0)


def test_own_format_names_every_bad_row(tmp_path):
    text = (
        "pose,sensor,time,angle_min,angle_step,ranges\n"
        "1,front,0,-1,0.1,1 2 nan\n"
        "2,front,0.5,-1,0.1,1 2 x\n"
        "3,front,0.7,-1,0,1 2 3\n"
    )
    with pytest.raises(InputError) as caught:
        read_scan_csv(_write(tmp_path, text, "scans.csv"))
    assert [problem.line for problem in caught.value.problems] == [2, 3, 4]


def test_bags_read_back_what_rosbags_wrote(tmp_path):
    rosbags = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    from laser_gt.logs.bags import read_bag

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    ranges = np.full(90, 2.5, dtype=np.float32)
    ranges[3], ranges[4] = np.inf, np.nan
    message = types["sensor_msgs/msg/LaserScan"](
        header=types["std_msgs/msg/Header"](
            stamp=types["builtin_interfaces/msg/Time"](sec=12, nanosec=500_000_000),
            frame_id="laser",
        ),
        angle_min=1.5,
        angle_max=-1.5,
        angle_increment=-3 / 89,
        time_increment=0.0,
        scan_time=0.0,
        range_min=0.1,
        range_max=30.0,
        ranges=ranges,
        intensities=np.zeros(0, dtype=np.float32),
    )
    with rosbags.Writer(tmp_path / "bag", version=9) as writer:
        connection = writer.add_connection("/front", "sensor_msgs/msg/LaserScan", typestore=store)
        writer.write(connection, 1, store.serialize_cdr(message, "sensor_msgs/msg/LaserScan"))
    (record,) = read_bag(tmp_path / "bag")
    assert record.scan.sensor == "front"
    assert record.scan.time == 12.5
    assert record.scan.returned.sum() == 88
    assert not record.scan.returned[-4]
    with pytest.raises(GtvalError):
        read_bag(_write(tmp_path, "nothing", "x.bag"))


def test_a_csv_scan_with_fewer_ranges_than_its_sensor_has_was_cut(tmp_path):
    head = "pose,sensor,angle_min,angle_step,ranges\n"
    path = tmp_path / "scans.csv"
    path.write_text(
        head
        + "1,a,0,0.1,1 1 1 1\n2,a,0,0.1,1 1 1 1\n3,a,0,0.2,1 1 1\n1,b,0,0.1,1 1 1\n4,a,0,0.1,1 1"
    )
    with pytest.raises(InputError) as error:
        read_scan_csv(path)
    (problem,) = error.value.problems
    assert (problem.line, problem.field) == (6, "ranges")
    assert "2 ranges, where other scans of 'a' with these angles have 4" in problem.expected
    path.write_text(head + "1,a,0,0.1,\n")
    with pytest.raises(InputError, match=r"line 2, field 'ranges'.*no beams"):
        read_scan_csv(path)


def test_a_log_saved_as_utf_16_is_told_in_one_line(tmp_path):
    path = tmp_path / "log.txt"
    path.write_bytes(("FLASER 3 1.0 1.0 1.0 0 0 0 0 0 0 1.0 host 1.0\n" * 20).encode("utf-16-le"))
    with pytest.raises(InputError, match=r"saved as UTF-16; save the file as UTF-8") as caught:
        read_carmen(path)
    assert len(caught.value.problems) == 1
