from dataclasses import replace

import numpy as np
import pytest
from laser_rooms import error, pair_of

from data_samples.rooms.scanners import cast, furnished_room
from laser_gt.logs.motion import (
    MirrorTiming,
    moved,
    moving_stops,
    sensor_twist,
    twist_between,
    twists,
    undistorted,
    undistorted_records,
)
from laser_gt.logs.records import ScanRecord
from laser_gt.matching.judgement import MatchSettings, match
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.planar import between, compose
from laser_gt.scans.scan import Scan, sweep
from validation.errors import GtvalError

SICK = MirrorTiming(1 / 75, 2)
DRIVING = np.array([0.5, 0.05, 0.7])
ANGLES = np.linspace(-np.pi / 2, np.pi / 2, 361)


def scan_on_the_move(room, pose, twist, timing=SICK, sigma=0.0, angles=ANGLES):
    """Every beam from where the sensor is when it fires; the pose is that of the middle."""
    poses = compose(pose, moved(twist, timing.times(angles)))
    ranges = np.empty(len(angles))
    for beam, (place, angle) in enumerate(zip(poses, angles, strict=True)):
        way = place[2] + angle
        origin = np.array([place[0], place[1], 0.2])
        direction = np.array([[np.cos(way), np.sin(way), 0.0]])
        ranges[beam] = cast(room, origin, direction).ranges[0]
    noise = np.random.default_rng(1).normal(0, 1, len(angles)) * sigma
    return Scan(ranges + noise, angles, sigma=max(sigma, 0.002), sensor="front")


def test_a_twist_and_its_motion_belong_together():
    end = moved(DRIVING, np.array([1.3]))[0]
    assert np.allclose(twist_between(np.zeros(3), end, 1.3), DRIVING)
    straight = np.array([0.4, 0.1, 0.0])
    assert np.allclose(moved(straight, np.array([2.0])), [[0.8, 0.2, 0.0]])
    # many small steps lead to the same place
    pose = np.zeros(3)
    for _ in range(1000):
        pose = compose(pose, DRIVING * 1.3e-3)
    assert np.allclose(pose, end, atol=1e-3)


def test_the_twist_of_a_sensor_moves_it_as_the_robot_carries_it():
    mount = np.array([0.2, -0.4, 1.1])
    time = np.array([0.7])
    carried = between(mount, compose(moved(DRIVING, time)[0], mount))
    assert np.allclose(moved(sensor_twist(DRIVING, mount), time)[0], carried)


def test_points_of_an_undistorted_scan_lie_on_the_walls():
    room = furnished_room(np.random.default_rng(3))
    pose = np.array([4.0, 3.0, 0.4])
    still = sweep(scan_on_the_move(room, pose, np.zeros(3)))
    driving = scan_on_the_move(room, pose, DRIVING)
    corrected = sweep(undistorted(driving, DRIVING, SICK))

    def off_the_walls(points):
        """Distances to the nearest beam of a dense scan at rest, along the ray."""
        way = compose(pose, np.zeros(3))[2] + np.arctan2(points[:, 1], points[:, 0])
        direction = np.column_stack([np.cos(way), np.sin(way), np.zeros(len(way))])
        there = cast(room, np.array([pose[0], pose[1], 0.2]), direction).ranges
        return np.abs(np.hypot(*points.T) - there)

    assert np.median(off_the_walls(still.points)) < 1e-9
    assert np.median(off_the_walls(sweep(driving).points)) > 0.003
    # exact but where the other place of the sensor sees round an edge
    assert np.quantile(off_the_walls(corrected.points), 0.9) < 1e-6


def test_matches_of_scans_taken_while_turning_are_more_exact_without_the_distortion():
    room = furnished_room(np.random.default_rng(8))
    limits = MatchSettings(guess_length=0.05, guess_angle=0.05)
    plain, corrected, scales = [], [], []
    for number in range(6):
        first = np.array([3.0 + 0.3 * number, 2.6, 0.9 * number])
        second = compose(first, [0.2, 0.1, 0.4])
        turning = np.array([0.1, 0.0, 0.7])
        truth = between(first, second)
        one = scan_on_the_move(room, first, turning, sigma=0.005)
        two = scan_on_the_move(room, second, -turning, sigma=0.005)
        raw = match(Prepared(sweep(one)), Prepared(sweep(two)), truth, limits)
        mended = match(
            Prepared(sweep(undistorted(one, turning, SICK))),
            Prepared(sweep(undistorted(two, -turning, SICK))),
            truth,
            limits,
        )
        plain.append(error(raw.pose, truth))
        corrected.append(error(mended.pose, truth))
        scales.append((raw.scale, mended.scale))
    assert np.median(corrected, axis=0)[0] < np.median(plain, axis=0)[0]
    assert np.median(corrected, axis=0)[1] < np.median(plain, axis=0)[1]
    raw_scale, mended_scale = np.median(scales, axis=0)
    assert mended_scale < raw_scale
    assert mended_scale < 1.3


def test_speeds_come_from_the_odometry_on_both_sides():
    times = np.array([0.0, 0.4, 1.0, 9.0, 20.0])
    poses = moved(DRIVING, times)
    found = twists(times, poses)
    assert np.allclose(found[:3], DRIVING)
    assert np.isnan(found[4]).all()


def test_records_without_near_odometry_stay_as_they_are():
    scan = pair_of(1).moving.views[0].scan
    far = [
        ScanRecord(Scan(scan.ranges, scan.angles, time=time, sensor="front"), np.zeros(3))
        for time in (0.0, 60.0)
    ]
    same = undistorted_records(far, {"front": SICK}, {"front": np.zeros(3)})
    assert all(one is other for one, other in zip(far, same, strict=True))


def test_a_scanner_all_around_gives_no_more_than_a_turn():
    angles = np.linspace(-np.pi, np.pi, 722, endpoint=False)
    scan = Scan(np.full(722, 3.0), angles)
    for turn in (0.7, -0.7):
        found = undistorted(scan, np.array([0.0, 0.0, turn]), MirrorTiming(0.1))
        assert found.angles[-1] - found.angles[0] <= 2 * np.pi
        assert 700 < len(found) <= 722
    with pytest.raises(GtvalError, match="not known"):
        undistorted(scan, np.full(3, np.nan), SICK)


def test_no_returns_stay_no_returns():
    ranges = np.where(np.arange(361) % 5 == 0, np.inf, 4.0)
    found = undistorted(Scan(ranges, ANGLES), DRIVING, SICK)
    assert found.returned.sum() == np.isfinite(ranges).sum()


def test_stops_at_which_the_robot_moves_are_named():
    """Ten scans in a row: at rest, at half a metre a second, and turning at half a radian."""
    steps = [[0.0, 0.0, 0.0]] * 3 + [[0.1, 0.0, 0.0]] * 3 + [[0.0, 0.0, 0.1]] * 3
    poses = [np.zeros(3)]
    for step in steps:
        poses.append(compose(poses[-1], step))
    records = [
        ScanRecord(Scan(np.ones(9), np.linspace(-1, 1, 9), time=0.2 * row), pose, line=row)
        for row, pose in enumerate(poses)
    ]
    by_stop = {str(row): [records[row]] for row in (1, 4, 8)}
    (found,) = moving_stops(records, by_stop)
    assert found.stops == ("4", "8")
    assert found.speed == pytest.approx(0.5)
    assert found.turn == pytest.approx(0.5)
    corrected = {stop: [replace(one, undistorted=True) for one in by_stop[stop]] for stop in "48"}
    assert moving_stops(records, corrected) == []
    without = [replace(one, odometry=None) for one in records]
    assert moving_stops(without, by_stop) == []
