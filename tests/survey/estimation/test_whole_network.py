"""Whatever the readings determine together is found, and what they leave open is said."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2
from sparse_rooms import SIGMA, oracle, pose_error, sparse_room

from survey.estimation.solve import solve_survey
from survey.readings.readings import Readings

LIMIT = chi2.ppf(0.999, 3)


def solved(room, readings=None, evidence=None):
    return solve_survey(
        room.vframe,
        room.rig,
        room.readings if readings is None else readings,
        room.world_names,
        room.evidence if evidence is None else evidence,
    )


def checked(seeds, **asked):
    """Stops determined, solved, and beyond the limit; joint NEES and its freedom; rooms accused."""
    determined = found = beyond = accused = freedom = 0
    nees = 0.0
    for seed in seeds:
        room = sparse_room(seed, **asked)
        solution, wanted = solved(room), oracle(room).determined
        table = solution.pose_table()
        there = [name for name in wanted if table is not None and name in table.ids]
        determined, found = determined + len(wanted), found + len(there)
        accused += bool(solution.suspicions)
        if not there:
            continue
        chosen = table.select(there)
        truth = np.array([room.stops[name] for name in there])
        error = pose_error(chosen.poses.copy(), truth)
        single = np.einsum("ni,nij,nj->n", error, np.linalg.inv(chosen.covariances), error)
        beyond += int((single > LIMIT).sum())
        nees += float(error.ravel() @ np.linalg.solve(chosen.joint_covariance, error.ravel()))
        freedom += error.size
    return determined, found, beyond, accused, nees, freedom


def test_determined_stops_are_solved_and_no_better_or_worse_than_said():
    determined, found, beyond, accused, nees, freedom = checked(range(100, 116), stops=8)
    assert found == determined > 100
    # 0.1 % are beyond the limit: of 128, more than 2 would be chance in three thousand runs.
    assert beyond <= 2
    low, high = chi2.ppf([0.0005, 0.9995], freedom)
    assert low < nees < high
    assert accused <= 4  # 5 % of rooms: more of 16 would be chance in a thousand runs


@pytest.mark.full
def test_two_hundred_rooms():
    determined, found, beyond, accused, nees, freedom = checked(range(1000, 1200))
    assert found >= 0.99 * determined
    assert beyond <= 0.005 * found
    low, high = chi2.ppf([0.0005, 0.9995], freedom)
    assert low < nees < high
    assert accused <= 14


@pytest.mark.parametrize("rough", ["none", "two", "all"])
def test_it_is_the_solution_of_dense_least_squares(rough):
    room = sparse_room(7, stops=6, missing=0.55, rough=rough)
    dense, solution = oracle(room), solved(room)
    table = solution.pose_table()
    assert set(table.ids) == set(room.stops)
    for name, pose, covariance in zip(table.ids, table.poses, table.covariances, strict=True):
        assert np.abs(pose_error(pose.copy(), dense.poses[name])).max() < 1e-5
        assert np.sqrt(np.diagonal(covariance)) == pytest.approx(dense.sigma[name], rel=0.01)


def test_rough_values_a_metre_off_change_nothing():
    room = sparse_room(3, stops=6, missing=0.55, rough="all")
    with_them, without = (
        solved(room),
        solved(room, evidence=replace(room.evidence, hand={}, guesses={})),
    )
    a, b = with_them.pose_table(), without.pose_table()
    assert a.ids == b.ids
    assert np.abs(pose_error(a.poses.copy(), b.poses)).max() < 1e-8


def kept(room, keep):
    """The readings of a room for whose pair of ends ``keep`` holds."""
    pairs = zip(room.readings.start, room.readings.end, strict=True)
    return room.readings.select(np.array([bool(keep(a, b)) for a, b in pairs]))


def stop_of(name):
    return name.partition("/")[0] if "/" in name else None


def test_marks_hang_on_stops_that_hang_on_marks():
    # The Vframe is read to four marks only, to each from two points: none is located from it.
    room = sparse_room(11, stops=8, missing=0.35, rough="none")
    corners = list(room.vframe.points)
    seen = {"1": corners[:2], "4": corners[1:3], "7": corners[2:4], "10": [corners[0], corners[3]]}

    def keep(a, b):
        return b not in room.world or a not in corners or a in seen.get(b, ())

    solution = solved(room, kept(room, keep))
    assert not solution.world.points
    assert set(solution.poses) == set(room.stops)
    for name, pose in zip(solution.poses, solution.adjustment.parameters.poses, strict=True):
        assert np.abs(pose_error(pose.copy(), room.stops[name])[:2]).max() < 0.05
    assert solution.suspicions == ()


def wanted_pairs(reason):
    """The pairs that a reason asks for."""
    asked = reason.partition("for instance ")[2].partition(" would")[0]
    return [tuple(one.partition(" (")[0].split("–")) for one in asked.split(", ")]


def with_pairs(room, readings, pairs):
    """Readings with further exact ones."""
    exact = [np.linalg.norm(room.places[a] - room.places[b]) for a, b in pairs]
    return Readings(
        (*readings.start, *(a for a, _ in pairs)),
        (*readings.end, *(b for _, b in pairs)),
        np.concatenate([readings.distance, exact]),
        np.full(len(readings) + len(pairs), SIGMA),
    )


def reason_for(solution, stop):
    return next(lost for lost in solution.not_posed if lost.pose == stop)


@pytest.mark.parametrize("left", [1, 2, 3])
def test_a_stop_with_too_few_readings_says_which_would_determine_it(left):
    room = sparse_room(5, stops=6, missing=0.4, rough="none")
    own = [i for i, name in enumerate(room.readings.start) if stop_of(name) == "2"]
    rows = np.ones(len(room.readings), dtype=bool)
    rows[own[left:]] = False
    readings = room.readings.select(rows)
    lost = reason_for(solved(room, readings), "2")
    assert "contradict" not in lost.reason
    for _ in range(4):  # what is asked for is an example, and after it more may be
        readings = with_pairs(room, readings, wanted_pairs(lost.reason))
        again = solved(room, readings)
        if "2" in again.poses:
            break
        lost = reason_for(again, "2")
    pose = again.adjustment.parameters.poses[again.poses.index("2")]
    assert np.abs(pose_error(pose.copy(), room.stops["2"])[:2]).max() < 0.05


def test_a_mirror_image_that_fits_is_named_and_told_apart_by_one_reading():
    # A stop of two marks read to two points only may lie on either side of their line.
    room = sparse_room(5, stops=6, missing=0.4, rough="none")
    pairs = [("2/O", "1"), ("2/O", "2"), ("2/X", "1"), ("2/X", "2")]
    readings = kept(room, lambda a, _: stop_of(a) != "2")
    lost = reason_for(solved(room, with_pairs(room, readings, pairs)), "2")
    assert len(lost.candidates) > 1
    assert np.abs(pose_error(lost.candidates.copy(), room.stops["2"])[:, :2]).max(1).min() < 0.05
    more = with_pairs(room, readings, [*pairs, *wanted_pairs(lost.reason)])
    assert "2" in solved(room, more).poses


def test_a_rough_place_tells_a_stop_from_its_mirror_image():
    room = sparse_room(5, stops=6, missing=0.4, rough="all")
    pairs = [("2/O", "1"), ("2/O", "2"), ("2/X", "1"), ("2/X", "2")]
    readings = with_pairs(room, kept(room, lambda a, _: stop_of(a) != "2"), pairs)
    solution = solved(room, readings)
    pose = solution.adjustment.parameters.poses[solution.poses.index("2")]
    assert np.abs(pose_error(pose.copy(), room.stops["2"])[:2]).max() < 0.05


@pytest.mark.parametrize("seed", range(6))
def test_a_wrong_reading_is_the_one_accused(seed):
    room = sparse_room(seed, stops=8, missing=0.5, rough="none")
    rng = np.random.default_rng(seed)
    row = int(rng.integers(len(room.readings)))
    while stop_of(room.readings.start[row]) is None:
        row = int(rng.integers(len(room.readings)))
    distance = room.readings.distance.copy()
    distance[row] += 0.3
    solution = solved(room, replace(room.readings, distance=distance))
    assert set(solution.poses) == set(room.stops)
    first = solution.suspicions[0].candidates[0]
    assert solution.used.line[first] == room.readings.line[row]
    assert len(solution.suspicions) == 1
