"""gtval's own table of a trajectory: what is written is read back to the last bit."""

import gzip

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from validation.errors import InputError
from validation.poses.trajectory import NUMBERS, Clock, Trajectory
from validation.trajectories.formats import (
    is_trajectory,
    read_trajectory,
    trajectory_text,
    write_trajectory,
)

KINDS = ["plane", "space", "points_plane", "points_space"]


def identical(a: Trajectory, b: Trajectory):
    assert (a.system, a.kind, a.epoch, a.clock) == (b.system, b.kind, b.epoch, b.clock)
    assert (a.frame, a.child_frame) == (b.frame, b.child_frame)
    assert a.longest_interval == b.longest_interval
    np.testing.assert_array_equal(a.times, b.times)
    np.testing.assert_array_equal(a.poses, b.poses)
    np.testing.assert_array_equal(a.covariances, b.covariances)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("covariance", [True, False])
@pytest.mark.parametrize("name", ["motion.csv", "motion.csv.gz"])
def test_all_there_is_comes_back(tmp_path, drive, kind, covariance, name):
    before = drive(kind, covariance=covariance)
    before = Trajectory(
        "the robot, of 'ours'",
        before.times,
        before.poses,
        kind,
        before.covariances,
        epoch=before.epoch,
        clock=Clock("receipt", 19.98, 0.004),
        longest_interval=0.25,
        frame="mäp\nof it",
        child_frame="base",
    )
    assert write_trajectory(before, tmp_path / name) == [tmp_path / name]
    assert is_trajectory(tmp_path / name)
    identical(read_trajectory(tmp_path / name), before)


def test_covariances_of_some_poses_only(tmp_path, drive):
    before = drive("plane")
    covariances = before.covariances.copy()
    covariances[3:9] = np.nan
    before = Trajectory("robot", before.times, before.poses, "plane", covariances)
    write_trajectory(before, tmp_path / "robot.csv")
    identical(read_trajectory(tmp_path / "robot.csv"), before)


finite = st.floats(-1e6, 1e6, allow_nan=False, width=64)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    data=st.data(),
    kind=st.sampled_from(KINDS),
    epoch=st.integers(-(10**9), 4 * 10**9),
    times=st.lists(
        st.floats(-1e4, 1e5).filter(lambda t: t == 0 or abs(t) > 1e-15),
        min_size=1,
        max_size=6,
        unique=True,
    ),
)
def test_any_numbers_come_back(tmp_path, data, kind, epoch, times):
    size = NUMBERS[kind]
    row = st.lists(finite, min_size=size, max_size=size)
    poses = np.array(data.draw(st.lists(row, min_size=len(times), max_size=len(times))))
    if kind == "space":
        poses[:, 3:] = [0.5, -0.5, 0.1, 0.7]
    before = Trajectory("robot", np.sort(times), poses, kind, epoch=epoch)
    path = tmp_path / "robot.csv"
    path.write_text(trajectory_text(before, "csv"))
    identical(read_trajectory(path), before)


def test_the_stamps_in_the_file_are_whole_for_any_reader(drive):
    before = drive("plane")
    text = trajectory_text(before)
    rows = [line.split(",") for line in text.splitlines() if line[0].isdigit()]
    whole, _, parts = rows[0][0].partition(".")
    assert int(whole) == before.epoch
    assert float(f"0.{parts}") == before.times[0]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("# epoch = x", "field 'epoch': ' x' — not a value"),
        ("# epoch = 1.5", "field 'epoch': '1.5' — not a value for this"),
        ('# stamps = "sent"', "field 'stamps': 'sent' — expected capture, receipt or unknown"),
        ("# frame = 3", "field 'frame': '3' — not a value for this"),
    ],
)
def test_a_comment_that_is_wrong_is_told(written, line, said):
    path = written("a.csv", f"# gtval trajectory\n{line}\ntime,x,y\n0,0,0\n1,0,0\n")
    with pytest.raises(InputError) as caught:
        read_trajectory(path)
    assert said.replace("' x'", "'x'") in str(caught.value)


def test_a_compressed_file_that_is_cut_off(written, drive):
    packed = gzip.compress(trajectory_text(drive()).encode())
    with pytest.raises(InputError, match="the gzip file is damaged or cut off"):
        read_trajectory(written("a.csv.gz", packed[:-30]), format="csv")
