"""What an odometer knows, and how well."""

import numpy as np

from laser_gt.driving.odometer import Odometer
from laser_gt.driving.sweeps import Sensor, sweeps_of
from laser_gt.logs.motion import MirrorTiming, SteadyTiming, moved
from laser_gt.scans.planar import compose, wrapped
from laser_gt.scans.scan import Scan


def _circle(seconds=10.0, rate=50.0):
    """Half a metre and half a radian a second."""
    times = np.arange(0, seconds, 1 / rate)
    return Odometer(times, moved(np.array([0.5, 0.0, 0.5]), times))


def test_poses_and_speeds_between_the_stamps_of_a_circle():
    odometer = _circle()
    asked = np.array([1.003, 2.517, 7.777])
    true = moved(np.array([0.5, 0, 0.5]), asked)
    assert np.abs(wrapped(odometer.at(asked) - true)).max() < 1e-4
    assert np.allclose(odometer.twists(asked), [0.5, 0.0, 0.5], atol=1e-4)


def test_nothing_is_known_in_a_gap_nor_after_the_end():
    odometer = _circle()
    kept = (odometer.times < 3) | (odometer.times > 6)
    holed = Odometer(odometer.times[kept], odometer.poses[kept])
    assert holed.known(np.array([2.0, 4.5, 8.0, 12.0])).tolist() == [True, False, True, False]
    assert np.isnan(holed.twists(np.array([4.5]))).all()


def test_the_noise_of_turning_is_told_from_that_of_the_way():
    # six straight steps, then four turns, with noise that only turning makes large, over and over
    length, angle = np.array([4e-4, 1e-4, 1e-6]), np.array([1e-5, 2e-3, 2.5e-7])
    found = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        steps = np.tile([[0.1, 0.0, 0.002]] * 6 + [[0.0, 0.0, 0.2]] * 4, (60, 1))
        noise = Odometer(np.arange(2.0), np.zeros((2, 3)), length, angle).covariance(steps)
        truth, poses = [np.zeros(3)], [np.zeros(3)]
        for number, (step, root) in enumerate(zip(steps, np.linalg.cholesky(noise), strict=True)):
            slip = np.array([0.05, 0, 0.3]) if number % 50 == 7 else 0.0
            truth.append(compose(truth[-1], step))
            poses.append(compose(poses[-1], step + root @ rng.normal(size=3) + slip))
        times = np.arange(len(poses)) * 0.2
        judged = Odometer(times, np.array(poses)).judged(times, np.array(truth))
        turn, straight = judged.covariance(np.array([[0, 0, 0.2], [0.1, 0, 0.0]]))
        found.append(
            [
                turn[2, 2] / (angle @ [0, 0.2, 1]),
                straight[2, 2] / (angle @ [0.1, 0, 1]),
                turn[0, 0] / (length @ [0, 0.2, 1]),
                straight[0, 0] / (length @ [0.1, 0, 1]),
            ]
        )
    # a variance from 240 turns, or 360 straight steps, is known to 9 % or 7 %; slips add some
    ratios = np.array(found)
    assert (np.abs(np.log(ratios.mean(0))) < np.log(1.3)).all()
    assert (np.abs(np.log(ratios)) < np.log(1.6)).all()


def test_a_robot_that_never_turned_keeps_some_noise_of_turning():
    rng = np.random.default_rng(0)
    times = np.arange(200.0)
    truth = np.column_stack([0.1 * times, 0 * times, 0 * times])
    poses = truth + np.cumsum(rng.normal(size=(200, 3)) * 1e-3, axis=0)
    judged = Odometer(times, poses).judged(times, truth)
    assert judged.covariance(np.array([[0.0, 0.0, 1.0]]))[0, 2, 2] > 0.01**2


def _wall(origins, headings):
    """Ranges to a wall at x = 5 of beams from points, infinite for those that go away."""
    ranges = (5 - origins[:, 0]) / np.cos(headings)
    return np.where((np.cos(headings) > 0.05) & (ranges < 30), ranges, np.inf)


def test_beams_fired_on_the_way_come_to_lie_on_the_wall():
    odometer = _circle()
    angles = np.linspace(-1.2, 1.2, 241)
    for timing in (MirrorTiming(1 / 75, 2), SteadyTiming(1e-4), SteadyTiming(-1e-4)):
        time = 1.0
        laser = odometer.at(time + timing.times(angles))
        scan = Scan(_wall(laser[:, :2], laser[:, 2] + angles), angles, time=time, sensor="front")
        sensors = {"front": Sensor(np.zeros(3), timing)}
        (straight,), corrected = sweeps_of({"front": [scan]}, sensors, odometer, 0.05)
        assert corrected == 1
        points = compose(
            odometer.at(np.array([time])),
            np.column_stack([straight.points, np.zeros(len(straight.points))]),
        )
        bent = compose(
            odometer.at(np.array([time])),
            np.column_stack([scan.points, np.zeros(len(scan.points))]),
        )
        assert np.abs(points[:, 0] - 5).max() < 1e-3
        assert np.abs(bent[:, 0] - 5).max() > 4e-3
