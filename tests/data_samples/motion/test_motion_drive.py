import numpy as np
import pytest

from data_samples.motion.drive import EPOCH, motion_drive
from data_samples.motion.files import write_motion
from data_samples.motion.sensors import LEVELS
from validation.campaign.folder import load_campaign
from validation.poses.angles import wrap
from validation.trajectories.formats import read_trajectory
from validation.trajectories.stops import poses_at_stops


def true_at(drive, times):
    truth = drive.truth
    heading = np.unwrap(truth.poses[:, 2])
    columns = [truth.poses[:, 0], truth.poses[:, 1], heading]
    return np.column_stack([np.interp(times, truth.times, column) for column in columns])


@pytest.fixture(scope="module")
def drives():
    return {level: motion_drive(7, level=level, minutes=4.0) for level in LEVELS}


@pytest.mark.parametrize("level", LEVELS)
def test_the_true_clock_leaves_the_stated_noise(drives, level):
    drive, quality = drives[level], LEVELS[level]
    for name, camera in drive.cameras.items():
        clock = drive.clocks[name]
        late = clock.delay_s + 1e-6 * clock.drift_ppm * (camera.times - clock.at_s)
        error = camera.poses - true_at(drive, camera.times + late)
        error[:, 2] = wrap(error[:, 2])
        quiet = np.abs(error[:, 2]) < 0.3
        turning = 1.4826 * np.median(np.abs(error[quiet, 2]))
        # The edge of the view has up to 1.5 times the noise, the tails' middle is narrower, and a
        # latency that scatters by 30 ms adds the way in that time.
        assert 0.7 * quality.angle < turning < 1.6 * quality.angle + 0.7 * quality.jitter
        assert abs(np.median(error[quiet, 0])) < 0.25 * quality.length + 0.003


# At 30 ms a latency is often nearer to the next frame's time than to its own.
@pytest.mark.parametrize("level", [1, 2, 3])
def test_latencies_scatter_as_stated_and_are_never_negative(drives, level):
    quality = LEVELS[level]
    for camera in drives[level].cameras.values():
        # Frames are whole tenths of a second apart but for the latencies.
        steps = np.diff(camera.times)
        off = steps - 0.1 * np.round(steps / 0.1)
        assert np.std(off) == pytest.approx(np.sqrt(2) * quality.jitter, rel=0.35, abs=1e-5)


def test_wrong_poses_are_as_many_as_stated(drives):
    share, n = LEVELS[4].outliers, 0
    wrong = 0
    for name, camera in drives[4].cameras.items():
        error = camera.poses - true_at(drives[4], camera.times + drives[4].clocks[name].delay_s)
        far = (np.abs(wrap(error[:, 2])) > 0.4) | (np.abs(error[:, :2]) > 0.3).any(1)
        wrong, n = wrong + int(far.sum()), n + len(camera)
    # A few of those that are placed at random are near by chance.
    assert abs(wrong / n - 0.95 * share) < 4 * np.sqrt(share / n) + 0.1 * share


def test_the_robot_stands_where_it_is_said_to(drives):
    drive = drives[1]
    for stop in drive.stops:
        inside = (drive.truth.times >= stop.start - EPOCH) & (drive.truth.times <= stop.end - EPOCH)
        assert np.ptp(drive.truth.poses[inside], axis=0).max() == 0.0
    seen = poses_at_stops(drive.reference, drive.stops)
    error = seen.table.poses - drive.true_stops.select(seen.table.ids).poses
    assert np.abs(error[:, :2]).max() < 6 * 0.0003


def test_a_seed_gives_one_drive():
    one, same = motion_drive(3, minutes=0.5), motion_drive(3, minutes=0.5)
    np.testing.assert_array_equal(one.odometry.poses, same.odometry.poses)
    other = motion_drive(4, minutes=0.5)
    assert len(other.odometry) == len(one.odometry)
    assert not np.array_equal(one.odometry.poses, other.odometry.poses)


def test_the_files_hold_the_same_numbers(tmp_path):
    drive = motion_drive(3, minutes=0.5)
    write_motion(tmp_path, drive)
    assert len(load_campaign(tmp_path).settings.published) == 7
    read = read_trajectory(tmp_path / "gt" / "mocap.csv")
    np.testing.assert_array_equal(read.poses, drive.reference.poses)
    np.testing.assert_array_equal(read.times_since(EPOCH), drive.reference.times)
