"""Cameras without odometry: delays by what two see at the same time, from one to the next."""

from dataclasses import replace

import numpy as np
import pytest
from made_streams import bends, standing, straight, stream

from validation.poses.trajectory import Trajectory
from vision_gt.driving.drive import solve_drive
from vision_gt.driving.pair_delay import Seen, pair_delay
from vision_gt.driving.set_back import set_back


def told(first, second):
    return pair_delay(Seen.of(first, 0), Seen.of(second, 0), 5.0)


@pytest.mark.parametrize(("way", "most_ms"), [(bends, 2.5), (straight, 8.0)])
def test_intervals_of_delays_between_two_cameras_hold(way, most_ms):
    held, halves, scores = [], [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        late = rng.uniform(0, 0.34, 2)
        one, two = (stream(i, way, (0.0, 16.0), late[i], rng, rate=10.0)[0] for i in (0, 1))
        found = told(one, two)
        assert found.verdict == "determined", found.reason
        off = found.delay - (late[0] - late[1])
        held.append(abs(off) <= found.half)
        halves.append(found.half)
        scores.append(off**2 / found.covariance[0, 0])
    # Of 12 intervals of 95 %, fewer than 9 hold in two of a thousand series.
    assert sum(held) >= 9
    # Errors and what is said of them are of one size. Squares of Student's with 16 freedoms have
    # a mean of 1.14, and that of 12 a standard deviation of 0.5: two of it.
    assert 0.15 < np.mean(scores) < 2.2
    assert 1e3 * np.median(halves) < most_ms


def test_a_camera_that_is_not_where_the_network_has_it_tells_the_same_delay():
    for seed in range(6):
        rng = np.random.default_rng(seed)
        one, _ = stream(0, bends, (0.0, 25.0), 0.1, rng)
        two, _ = stream(1, bends, (0.0, 25.0), 0.3, rng, off=(0.03, -0.02, 0.01))
        found = told(one, two)
        assert found.verdict == "determined"
        assert abs(found.delay + 0.2) < 2 * found.half
        assert found.half < 0.01


def test_delays_are_handed_on_from_camera_to_camera():
    rng = np.random.default_rng(3)
    seen, late = [(0.0, 14.0), (10.0, 26.0), (22.0, 34.0)], [0.05, 0.3, 0.15]
    made = [stream(i, bends, seen[i], late[i], rng, of=3)[0] for i in range(3)]
    outcome = solve_drive(made)
    # The middle one has most poses.
    assert set(outcome.clocks) == {"1", "3"}
    for name in ("1", "3"):
        clock, true = outcome.clocks[name], late[1] - late[int(name) - 1]
        assert clock.verdict == "determined"
        assert abs(clock.delay_s - true) < clock.high_s - clock.low_s < 0.03
    first, last = outcome.trajectory.times[[0, -1]]
    assert first < 1.0
    assert last > 33.0


@pytest.mark.parametrize("apart", [True, False])
def test_without_a_delay_frames_are_clock_unknown_and_none_is_spurious(apart):
    rng = np.random.default_rng(4)
    first, bad = stream(0, bends if apart else standing, (0.0, 20.0), 0.1, rng)
    begun = 25.0 if apart else 0.0
    second, _ = stream(1, bends if apart else standing, (begun, begun + 15.0), 0.3, rng, wrong=0.0)
    outcome = solve_drive([first, second])
    assert set(outcome.left_out) == {"2"}
    assert outcome.clocks["2"].verdict != "determined"
    one, two = outcome.streams
    assert set(two.verdicts) == {"clock unknown"}
    assert len(two.trajectory()) == len(two)
    assert one.count("spurious") <= bad.sum() + 1
    # Stated to be of one clock, it is taken in.
    stated = solve_drive([first, second], one_clock=True)
    assert stated.assumed == ("2",)
    assert not stated.left_out


def test_two_cameras_that_see_a_turning_robot_lose_no_good_frame():
    rng = np.random.default_rng(5)
    made = [stream(i, bends, (0.0, 30.0), late, rng) for i, late in ((0, 0.1), (1, 0.25))]
    outcome = solve_drive([one for one, _ in made])
    for judged, (_, bad) in zip(outcome.streams, made, strict=True):
        assert not (judged.kept & bad).any()
        assert (~judged.kept & ~bad).sum() <= 1


def test_a_wrong_first_or_last_frame_does_not_bend_the_path():
    rng = np.random.default_rng(6)
    made, _ = stream(0, straight, (0.0, 16.0), 0.0, rng, rate=10.0, wrong=0.0)
    for place in (0, -1):
        made.poses[place, :2] += 1.0
    path = Seen.of(made, 0).path
    # Places of frames beside the wrong ones stay within five standard deviations of a frame.
    off = path.positions[1:-1] - straight(path.times)[1:-1, :2]
    assert np.abs(off).max() < 5 * 0.003 + 0.002


def test_a_clock_that_jumps_is_followed_and_said_without_odometry_too():
    rng = np.random.default_rng(7)

    def jumps(times):
        return np.where(times < 16.0, 0.1, 0.4)

    late = (0.05, jumps, 0.2)
    made = [stream(i, bends, (0.0, 30.0), one, rng, of=3) for i, one in enumerate(late)]
    outcome = solve_drive([one for one, _ in made])
    (jump,) = outcome.clocks["2"].jumps
    # What is added to the stamps gets less.
    assert abs(jump.size_s + 0.3) < jump.high_s - jump.low_s < 0.03
    assert abs(jump.stamp_s - 16.25) < 0.5
    assert not any(clock.jumps for name, clock in outcome.clocks.items() if name != "2")
    for judged, (_, bad) in zip(outcome.streams, made, strict=True):
        assert not (judged.kept & bad).any()
        assert (~judged.kept & ~bad).sum() <= 2


def test_odometry_of_a_straight_way_leaves_the_trajectory_of_the_cameras():
    rng = np.random.default_rng(8)
    late = (0.1, 0.3)
    made = [stream(i, straight, (0.0, 16.0), late[i], rng, rate=10.0)[0] for i in (0, 1)]
    times = np.arange(-2.0, 18.0, 0.02)
    odometry = Trajectory("odometry", times, straight(times) - [3.0, 2.0, 0.0])
    outcome = solve_drive(made, odometry)
    assert outcome.without_odometry == "the robot drives straight at constant speed"
    assert not outcome.left_out
    ((name, clock),) = outcome.clocks.items()
    own, other = late[int(outcome.reference) - 1], late[int(name) - 1]
    assert abs(clock.delay_s - (own - other)) < clock.high_s - clock.low_s < 0.03
    # On the stamps of the reference: late by as much as these are. The cameras' own shifts are of
    # 1 mm, and the scatter of 3 mm is that of a frame.
    told = outcome.trajectory
    off = told.poses[outcome.supported] - straight(told.times[outcome.supported] - own)
    assert np.sqrt((off[:, :2] ** 2).sum(1).mean()) < 0.004


@pytest.mark.parametrize("seed", [11, 12])
def test_a_clock_that_was_set_back_is_told_with_its_time_where_one_part_is_short(seed):
    rng = np.random.default_rng(seed)
    made = [
        stream(i, bends, (0.0, 30.0), late, rng, of=3, rate=10.0)[0]
        for i, late in enumerate((0.05, 0.1, 0.2))
    ]
    # The third sees the robot for four seconds before its clock is set back by two, at 14.2.
    third = made[2].part((made[2].times < 2.5) | (made[2].times > 12.5))
    stamps = np.where(third.times < 14.2, third.times, third.times - 2.0)
    order = np.argsort(stamps)
    made[2] = replace(
        third, times=stamps[order], poses=third.poses[order], common=third.common[order]
    )
    times = np.arange(-1.0, 31.0, 0.02)
    odometry = Trajectory("odometry", times, bends(times) - [1.0, 2.0, 0.0])
    outcome = solve_drive(made, odometry)
    assert not outcome.clocks["3"].jumps
    found = {
        one.camera: set_back(one, outcome.clocks[one.camera], outcome.trajectory, 5.0)
        for one in outcome.streams
    }
    assert found["1"] is found["2"] is None
    # Poses of 3 mm at 0.3 m/s tell 10 ms each, forty of them 2 ms; stamps scatter by 3 ms.
    assert abs(found["3"].size - 2.0) < 0.006
    # The last frame before it that is contradicted is at most a few periods earlier.
    assert -0.5 < found["3"].stamp - 14.2 < 0.02
