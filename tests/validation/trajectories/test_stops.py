import numpy as np
import pytest
from moving_robots import robot_between_stops

from validation.errors import GtvalError, InputError
from validation.poses.pose_table import pose_difference
from validation.poses.trajectory import Trajectory
from validation.trajectories.naming import name_standstills
from validation.trajectories.stops import (
    POOLED_POSES,
    Stop,
    check_stops,
    find_standstills,
    poses_at_stops,
    read_stops,
)


def nees_of_means(rate, memory, seeds):
    scores = []
    for seed in seeds:
        seen, stops, truth = robot_between_stops(seed, rate=rate, memory=memory)
        table = poses_at_stops(seen, stops).table
        error = pose_difference(table.poses, truth[[int(name) for name in table.ids]])
        scores.append(
            np.einsum("ni,nij,nj->n", error, np.linalg.inv(table.covariances), error).mean()
        )
    return np.mean(scores)


@pytest.mark.parametrize(("rate", "memory"), [(10, 0.0), (10, 0.7), (50, 0.9)])
def test_correlated_poses_are_counted_as_such(rate, memory):
    # Stops of 7 s have so many independent poses, beside those that all stops lend each other.
    freedom = 7 * rate * (1 - memory) / (1 + memory) + POOLED_POSES
    # The squared error over an estimated variance is Hotelling's; 8 drives of 26 stops have
    # their mean to sqrt(6 / 208).
    expected, sigma = 3 * freedom / (freedom - 4), np.sqrt(6 / 208) * freedom / (freedom - 4)
    assert 3 - 4 * np.sqrt(6 / 208) < nees_of_means(rate, memory, range(8)) < expected + 4 * sigma


def test_what_the_scatter_does_not_show_of_a_stated_covariance_stays():
    seen, stops, _ = robot_between_stops(3, flips=0, outliers=0)
    centimetre = np.tile(np.eye(3) * 1e-4, (len(seen), 1, 1))
    stated = Trajectory("r", seen.times, seen.poses, covariances=centimetre)
    table = poses_at_stops(stated, stops).table
    # One centimetre is stated and 3 mm scatter: sqrt(10^2 - 3^2) mm are shared by a stop.
    sigma = np.sqrt(table.covariances[:, 0, 0])
    assert np.abs(sigma - 0.0096).max() < 0.0005


def test_standstills_lie_within_the_stops():
    for seed in range(5):
        seen, stops, _ = robot_between_stops(seed, rate=20.0)
        found = find_standstills(seen)
        assert abs(len(found) - 26) <= 1
        for start, end in found:
            # A robot that slows down smoothly creeps below 5 mm a second for a tenth of a second.
            inside = [s for s in stops if start > s.start - 0.3 and end < s.end + 0.3]
            assert len(inside) == 1


@pytest.mark.parametrize("same_frame", [True, False])
def test_standstills_get_the_names_of_their_stops(same_frame):
    for seed in range(5):
        seen, stops, truth = robot_between_stops(seed)
        found = find_standstills(seen)
        places = np.array(
            [np.median(seen.positions[(seen.times > a) & (seen.times < b)], 0) for a, b in found]
        )
        turn = 0.0 if same_frame else 2.1
        c, s = np.cos(turn), np.sin(turn)
        moved = places @ [[c, s], [-s, c]] + (0.0 if same_frame else 7.0)
        names = tuple(stop.name for stop in stops)
        named = name_standstills(moved, truth[:, :2], names, same_frame=same_frame)
        wrong = [
            name
            for name, (a, b) in zip(named.names, found, strict=True)
            if name and not stops[int(name)].start < (a + b) / 2 < stops[int(name)].end
        ]
        assert not wrong
        assert sum(bool(name) for name in named.names) >= 15


def test_a_square_of_stops_has_no_name_in_a_frame_of_its_own():
    square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    named = name_standstills(square + 5, square, ("a", "b", "c", "d"), same_frame=False)
    assert named.names == ("",) * 4
    assert "several frames" in named.reason


def test_stops_without_poses_say_why():
    seen, stops, _ = robot_between_stops(1, stops=3)
    late = Stop("late", 1e6, 1e6 + 5)
    found = poses_at_stops(seen, [*stops, late])
    assert "after the last pose" in found.missing["late"]
    with pytest.raises(GtvalError, match="saw none of the 1 stops"):
        poses_at_stops(seen, [late])


def test_a_stop_in_which_the_robot_drives_has_no_pose():
    seen, stops, _ = robot_between_stops(1, stops=4)
    wide = [stops[0], Stop("wide", stops[1].start, stops[2].start)]
    found = poses_at_stops(seen, wide)
    assert "the robot moves by" in found.missing["wide"]
    assert found.table.ids == ("0",)
    assert not poses_at_stops(seen, stops).moved


def test_a_robot_that_settles_within_a_stop_is_as_uncertain_as_its_way():
    seen, stops, _ = robot_between_stops(1, stops=4, flips=0, outliers=0, sigmas=(5e-4,) * 3)
    poses = seen.poses.copy()
    here = (seen.times >= stops[2].start) & (seen.times <= stops[2].end)
    poses[here, 0] += np.linspace(0, 0.04, here.sum())
    found = poses_at_stops(Trajectory("r", seen.times, poses), stops)
    assert found.moved["2"] == pytest.approx(0.03, abs=0.002)  # from quarter to quarter
    assert np.sqrt(found.table.covariances[2, 0, 0]) > 0.03 / np.sqrt(12)


def test_bad_stops_name_their_places(tmp_path):
    path = tmp_path / "stops.csv"
    path.write_text("pose,from,to\n1,10,20\n2,30,25\n1,40,50\n")
    with pytest.raises(InputError) as error:
        read_stops(path)
    assert "must end after its start" in str(error.value)
    assert "stops.csv" in str(error.value)
    with pytest.raises(InputError, match="overlaps the stop 'a'"):
        check_stops([Stop("a", 0, 10), Stop("b", 5, 12)], path)


def _at_stops_with(rng, errors, count=12, poses=26):
    """A trajectory that stands `count` times, with errors of a millimetre made by a function."""
    truth = rng.uniform(-3, 3, (count, 3)) * [1, 1, 0.3]
    seen = np.concatenate([one + 1e-3 * errors(rng, poses) for one in truth])
    starts = 20.0 * np.arange(count)
    times = (starts[:, None] + 0.2 * np.arange(poses)).ravel()
    stops = [Stop(str(k), float(a) - 0.05, float(a) + 0.2 * poses) for k, a in enumerate(starts)]
    return truth, poses_at_stops(Trajectory("r", times, seen), stops)


def _correlated(memory):
    def errors(rng, poses):
        values = rng.normal(size=(poses, 3))
        for at in range(1, poses):
            values[at] = memory * values[at - 1] + np.sqrt(1 - memory**2) * values[at]
        return values

    return errors


def _sliding(rng, poses):
    """White noise, and a slide by half of its size to either side of the middle."""
    slide = 0.5 * np.linspace(-1, 1, poses)[:, None] * rng.normal(size=3)
    return rng.normal(size=(poses, 3)) + slide


@pytest.mark.parametrize(
    ("errors", "low", "high"),
    [
        (_correlated(0.0), 0.75, 1.25),
        (_correlated(0.5), 0.75, 1.35),
        (_correlated(0.9), 0.5, 1.8),
        (_sliding, 0.1, 1.2),
    ],
)
def test_means_of_stops_are_as_uncertain_as_they_are_off(errors, low, high):
    squared, largest = [], 1.0
    for seed in range(15):
        truth, found = _at_stops_with(np.random.default_rng(seed), errors)
        off = found.table.poses - truth
        solved = np.linalg.solve(found.table.covariances, off[..., None])[..., 0]
        squared.append(float((off * solved).sum(1).mean()) / 3)
        largest = max(largest, float(found.inflation.max()))
    # 540 squared numbers: 99.9 % of white ones within 0.2 of 1; what correlates is known worse
    assert low < np.mean(squared) < high
    # An error that is correlated as long as a stop makes the mean as uncertain as one of its poses.
    assert largest < 2 * 26
