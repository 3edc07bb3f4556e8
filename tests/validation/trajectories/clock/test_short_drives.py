"""Less than a minute of a robot that mostly stands, and poses without any noise."""

import warnings

import numpy as np
import pytest
from scipy.stats import binom

from data_samples.motion.path import drive
from data_samples.motion.sensors import odometry
from validation.poses.trajectory import Clock, Trajectory
from validation.trajectories.clock.continuous import continuous_path
from validation.trajectories.clock.estimate import estimate_clock

EYES = ((-0.5, -0.5), (8.5, -0.5), (8.5, 6.5), (-0.5, 6.5))
SIGMAS = np.array([0.003, 0.003, 0.004])
REACH = 6.0
TICK = 0.0002


def seen(path, eye, rng):
    """What a camera sees at 10 Hz, and its delay: jitter of 3 ms, 2 % lost, 3 % elsewhere."""
    late = float(rng.uniform(0, 0.34))
    times = np.arange(rng.uniform(0, 0.1), path.times[-1] - 0.1, 0.1)
    times = times[rng.random(len(times)) > 0.02]
    stamps = times + late + 0.003 * (rng.gamma(4.0, 0.5, len(times)) - 2)
    stamps = np.maximum.accumulate(stamps + 1e-9 * np.arange(len(stamps)))
    poses = path.at(times)
    far = np.hypot(*(poses[:, :2] - eye).T)
    poses += SIGMAS * (0.5 + (far[:, None] / 5) ** 2) * rng.standard_normal(poses.shape)
    wrong = rng.random(len(times)) < 0.03
    poses[wrong] += rng.normal(0, 1, (int(wrong.sum()), 3))
    poses[:, 2] = np.angle(np.exp(1j * poses[:, 2]))
    near = far < REACH
    return Trajectory("seen", stamps[near], poses[near], clock=Clock("receipt")), -late


def short(seed, seconds=50.0):
    """Odometry, and by name what each camera sees with its delay."""
    rng = np.random.default_rng(seed)
    path = drive(seconds, rng)
    cameras = {str(number): seen(path, eye, rng) for number, eye in enumerate(EYES)}
    wheels = odometry(path, rng)
    return Trajectory("odometry", wheels.stamps, wheels.poses), cameras


def held(seeds):
    """(n, 2) errors of the delays that are told, and halves of their intervals; how many are."""
    rows, count = [], 0
    for seed in seeds:
        reference, cameras = short(seed)
        for one, true in cameras.values():
            if len(one) < 3:
                continue
            count += 1
            found = estimate_clock(reference, one, window=5.0)
            if found.verdict == "determined":
                rows.append((found.delay_s - true, (found.high_s - found.low_s) / 2))
    return np.array(rows), count


@pytest.mark.parametrize("standing", [0, 5000])
def test_the_path_of_an_odometer_follows_it_where_it_moves(standing):
    # While it stands it is exact, which is most of the time: poses in motion are no outliers.
    for seed in range(4):
        rng = np.random.default_rng(seed)
        wheels = odometry(drive(50.0, rng), rng)
        poses = np.vstack([np.tile(wheels.poses[0], (standing, 1)), wheels.poses])
        headings = np.unwrap(poses[:, 2])
        path = continuous_path(0.02 * np.arange(len(poses)), poses[:, :2], headings, 0.1)
        # Ticks, and the slip of a step: three ticks in 7,500 numbers.
        assert np.abs(path.positions - poses[:, :2]).max() < 3 * TICK


def test_wrong_poses_do_not_pull_the_path_of_one_that_mostly_stands():
    rng = np.random.default_rng(5)
    true = drive(50.0, rng)
    times = np.arange(0, 49.9, 0.05)
    poses = true.at(times) + 0.001 * rng.standard_normal((len(times), 3))
    wrong = rng.random(len(times)) < 0.05
    poses[wrong, :2] += rng.uniform(-1, 1, (int(wrong.sum()), 2))
    path = continuous_path(times, poses[:, :2], poses[:, 2], 0.2)
    # Between two poses of 1 mm, at times three in a row of which are wrong: 0.15 s at 2 m/s^2.
    assert np.abs(path.positions - true.at(times)[:, :2]).max() < 5 * 0.001 + 2 * 0.15**2 / 2


def test_intervals_of_short_drives_hold_the_truth():
    rows, _ = held(range(3))
    off, half = rows.T
    assert np.mean(np.abs(off) <= half) > 0.6  # of ten, 95 % hold fewer in one of 10,000 times


@pytest.mark.full
def test_intervals_of_short_drives_hold_the_truth_as_often_as_they_say():
    rows, count = held(range(40))
    off, half = rows.T
    assert len(rows) > 0.9 * count
    held_often = int(np.sum(np.abs(off) <= half))
    assert binom.cdf(held_often, len(rows), 0.95) > 1e-3
    # Neither needlessly wide: the errors' spread is what the intervals say, to a fifth.
    spread = 1.4826 * np.median(np.abs(off) / (half / 1.96))
    assert 0.75 < spread < 1.25


def bends(times):
    """A way that bends both ways."""
    x, y = 0.55 * np.sin(0.26 * times), 0.9 * np.sin(0.52 * times)
    slope = np.arctan2(0.468 * np.cos(0.52 * times), 0.143 * np.cos(0.26 * times))
    return np.column_stack([x, y, np.unwrap(slope)])


def there_and_back(times):
    """A line at one speed, that turns round every ten seconds, at once."""
    return np.column_stack([np.abs((0.4 * times) % 8 - 4), 0 * times, 0 * times])


def straight(times):
    """A line at one speed."""
    return np.column_stack([0.4 * times, 0 * times, 0 * times])


@pytest.mark.parametrize("way", [bends, there_and_back, straight])
@pytest.mark.parametrize("rates", [(50.0, 10.0), (10.0, 10.0), (100.0, 5.0)])
def test_poses_without_noise_have_a_result(way, rates):
    first, second = (np.arange(0, 50, 1 / rate) for rate in rates)
    late = Trajectory("late", second + 0.1, way(second))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = estimate_clock(Trajectory("exact", first, way(first)), late, window=5.0)
    if way is bends:
        assert found.verdict == "determined"
        # A micrometre of the path between its poses, at 0.2 m/s.
        assert abs(found.delay_s + 0.1) < 5e-6
    elif way is straight:
        assert found.verdict == "not_determinable"
        assert "straight at constant speed" in found.reason
    else:
        assert found.verdict != "determined" or abs(found.delay_s + 0.1) < 0.001
