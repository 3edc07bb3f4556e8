"""What is said of the robot that drives is so: rates, views, noise, latencies, gaps."""

import numpy as np
import pytest
from scipy import stats

from data_samples.motion.drive import SURVEY_SIGMA, motion_drive
from data_samples.motion.path import ROOM
from data_samples.motion.sensors import LEVELS, REFERENCE_SIGMA
from validation.errors import GtvalError
from validation.poses.angles import wrap

RARE = 1e-6
"""Chance with which a right sample is called wrong."""


@pytest.fixture(scope="module")
def drives():
    return {level: motion_drive(11, level=level, minutes=5.0) for level in (1, 2)}


def true_at(drive, times):
    truth = drive.truth
    columns = [*truth.poses[:, :2].T, np.unwrap(truth.poses[:, 2])]
    return np.column_stack([np.interp(times, truth.times, column) for column in columns])


def errors(drive, trajectory, late=0.0):
    off = trajectory.poses - true_at(drive, trajectory.times + late)
    off[:, 2] = wrap(off[:, 2])
    return off


def centre_of(name):
    number = int(name[-1]) - 1
    return ROOM * [0.25 + 0.5 * (number % 2), 0.25 + 0.5 * (number // 2)]


def test_the_noise_of_the_reference_is_the_stated_one(drives):
    scaled = errors(drives[1], drives[1].reference) / REFERENCE_SIGMA
    for column in scaled.T:
        low, high = stats.chi2(len(column)).ppf([RARE / 2, 1 - RARE / 2])
        assert low < column @ column < high


def test_the_survey_is_as_good_as_it_says():
    total = n = 0
    for seed in range(4):
        drive = motion_drive(seed, minutes=2.0)
        off = drive.survey.poses - drive.true_stops.poses
        off[:, 2] = wrap(off[:, 2])
        total, n = total + np.sum((off / SURVEY_SIGMA) ** 2), n + off.size
    low, high = stats.chi2(n).ppf([RARE / 2, 1 - RARE / 2])
    assert low < total < high


def test_the_noise_of_a_camera_is_the_stated_one_and_grows_to_the_edge(drives):
    # At level 1 stamps do not scatter, so that errors are those of the poses alone.
    drive, level = drives[1], LEVELS[1]
    middle, edge, slow = [], [], []
    for name, camera in drive.cameras.items():
        off = errors(drive, camera, drive.clocks[name].delay_s)
        off /= [level.length, level.length, level.angle]
        there = np.abs(
            true_at(drive, camera.times + drive.clocks[name].delay_s)[:, :2] - centre_of(name)
        )
        out = (there / (0.31 * ROOM)).max(1)
        good = (np.abs(off) < 8).all(1)
        middle.append(off[good & (out < 0.3)])
        edge.append(off[good & (out > 0.85)])
        scaled = off / (1 + 0.5 * out[:, None] ** 2)
        pairs = good[1:] & good[:-1] & (np.diff(camera.times) < 0.15)
        slow.append((scaled[1:] * scaled[:-1])[pairs].mean())
    # Two thirds of the variance have an excess kurtosis of 3, a third lasts for some frames: the
    # variance of n numbers has a standard deviation of sqrt((2 + 3 * 0.67**2 + 0.4) / n).
    for group, low, high in ((middle, 1.0, 1.045**2), (edge, 1.36**2, 1.5**2)):
        numbers = np.concatenate(group).ravel()
        room = 5 * np.sqrt(3.8 / len(numbers)) + 0.01
        assert low * (1 - room) < np.var(numbers) < high * (1 + room)
    # Neighbours have 0.33 * 0.75 of the variance in common.
    assert np.mean(slow) == pytest.approx(0.25, abs=0.08)


def test_the_true_delay_is_the_one_that_fits(drives):
    tried = np.arange(-0.01, 0.0101, 0.0005)
    for name, camera in drives[1].cameras.items():
        delay = drives[1].clocks[name].delay_s
        level = [0.003, 0.003, 0.002]
        misfit = [
            np.minimum(np.abs(errors(drives[1], camera, delay + t)) / level, 4).sum() for t in tried
        ]
        # 3 mm and 2 mrad of a thousand poses at some 0.4 m/s and 0.3 rad/s: 0.2 to 0.3 ms.
        assert abs(tried[np.argmin(misfit)]) < 0.0015


def test_a_latency_is_never_negative_and_has_a_long_tail(drives):
    jitter = LEVELS[2].jitter
    for camera in drives[2].cameras.values():
        # The cameras' clocks do not drift here: frames are whole tenths of a second apart.
        phase = np.exp(2j * np.pi * camera.times / 0.1)
        off = np.angle(phase / phase.mean()) * 0.1 / (2 * np.pi)
        off -= off.mean()
        # The mean of the latency is twice its scatter: nothing is earlier than that. A normal
        # scatter of so many frames would reach three times as far to both sides.
        assert -2.1 * jitter < off.min()
        assert off.max() > 2.6 * jitter
        assert stats.skew(off) == pytest.approx(1.0, abs=0.5)


def test_rates_and_gaps_are_as_said(drives):
    drive = drives[1]
    intervals = {
        name: np.diff(one.times)
        for name, one in {
            "mocap": drive.reference,
            "odometry": drive.odometry,
            **drive.cameras,
        }.items()
    }
    assert np.median(intervals["mocap"]) == pytest.approx(0.01, abs=1e-9)
    assert np.median(intervals["odometry"]) == pytest.approx(0.02, abs=1e-9)
    assert len(drive.reference.gaps) >= 3
    assert intervals["odometry"].max() < 0.021
    for name in drive.cameras:
        assert np.median(intervals[name]) == pytest.approx(0.1, abs=1e-6)
        assert (intervals[name] > 0.15).any()


def test_each_camera_sees_its_quarter_and_all_see_the_room(drives):
    drive = drives[1]
    seen = np.zeros(len(drive.truth), dtype=bool)
    for name, camera in drive.cameras.items():
        off = np.abs(drive.truth.poses[:, :2] - centre_of(name)) <= 0.31 * ROOM
        seen |= off.all(1)
        frames = drive.truth.times[-1] / 0.1
        share = len(camera) / frames
        # 2 % of frames are lost, and a burst of 9 in 600.
        assert share == pytest.approx(0.965 * off.all(1).mean(), rel=0.06)
        assert share > 0.05
    assert seen.all()
    assert (drive.truth.poses[:, :2] > 0).all()
    assert (drive.truth.poses[:, :2] < ROOM).all()


def test_the_robot_drives_as_robots_do(drives):
    truth = drives[1].truth
    step = np.diff(truth.times)[:, None]
    velocity = np.diff(truth.poses[:, :2], axis=0) / step
    heading = truth.poses[:-1, 2]
    ahead = velocity[:, 0] * np.cos(heading) + velocity[:, 1] * np.sin(heading)
    across = velocity[:, 1] * np.cos(heading) - velocity[:, 0] * np.sin(heading)
    turning = wrap(np.diff(truth.poses[:, 2])) / step[:, 0]
    assert 0.4 < ahead.max() < 1.0
    assert ahead.min() < -0.1
    assert np.abs(across).max() < 0.01
    assert np.abs(np.diff(ahead)).max() / 0.005 < 1.0 / 0.3 + 0.1
    assert np.abs(turning).max() < 1.2


def test_odometry_has_a_frame_of_its_own_and_drifts(drives):
    drive = drives[1]
    wheels, true = drive.odometry, true_at(drive, drive.odometry.times)
    np.testing.assert_array_equal(wheels.poses[0], 0.0)
    way = np.hypot(*np.diff(wheels.poses[:, :2], axis=0).T).sum()
    true_way = np.hypot(*np.diff(true[:, :2], axis=0).T).sum()
    # A scale of 0.5 %, and whole ticks of 0.2 mm.
    assert 0 < abs(way / true_way - 1) < 5 * 0.005
    gone = np.unwrap(wheels.poses[:, 2]) - (true[:, 2] - true[0, 2])
    assert np.abs(gone).max() > 0.002
    # Over half a second it is right to the scale and the slip.
    short = np.abs(gone[25:] - gone[:-25])
    assert short.max() < 5 * 0.005 * 0.6 + 5 * 0.002


def test_delays_and_drifts_are_drawn_from_their_ranges():
    clocks = [
        clock
        for seed in range(10)
        for clock in motion_drive(seed, level=4, minutes=2.0).clocks.values()
    ]
    delays = np.array([clock.delay_s for clock in clocks])
    drifts = np.array([clock.drift_ppm for clock in clocks])
    assert delays.min() >= -0.3
    assert delays.max() <= 0.34
    # Kolmogorov and Smirnov: of 40 uniform numbers once in a million.
    assert stats.kstest(delays, stats.uniform(-0.3, 0.64).cdf).pvalue > RARE
    assert stats.kstest(drifts, stats.uniform(-200, 400).cdf).pvalue > RARE


def test_a_camera_that_never_sees_the_robot_is_named():
    with pytest.raises(GtvalError, match="'camera_1' never sees the robot; let it drive longer"):
        motion_drive(0, level=4, minutes=0.05)
