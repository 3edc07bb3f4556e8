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


def test_the_noise_that_odometry_shows_is_found_to_a_quarter():
    rng = np.random.default_rng(0)
    steps = np.tile([0.1, 0.0, 0.05], (400, 1))
    truth, poses = [np.zeros(3)], [np.zeros(3)]
    base = Odometer(np.arange(401.0), np.zeros((401, 3)))
    for step, root in zip(steps, np.linalg.cholesky(base.covariance(steps)), strict=True):
        truth.append(compose(truth[-1], step))
        poses.append(compose(poses[-1], step + 2.0 * root @ rng.normal(size=3)))
    odometer = Odometer(np.arange(401.0), np.array(poses))
    judged = odometer.judged(np.arange(401.0), np.array(truth))
    # the least noise of a step does not grow with it: 2 becomes a little more
    assert 1.5 < judged.worse[0] < 2.6
    assert 1.5 < judged.worse[1] < 2.6


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
