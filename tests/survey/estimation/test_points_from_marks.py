"""A wall mark that the Vframe hardly sees is located from the robot's marks, and honestly."""

from dataclasses import replace

import numpy as np
from scipy.stats import chi2
from surveys import simulated

from survey.campaign.result_files import adjusted_points
from survey.estimation.solve import solve_survey

HIDDEN = ("3", "9")
SEEDS = 30


def hidden_from(readings, vframe_points):
    """The readings without those between the hidden world points and some Vframe points."""
    gone = [
        {a, b} & set(HIDDEN) and {a, b} & set(vframe_points)
        for a, b in zip(readings.start, readings.end, strict=True)
    ]
    return readings.select(~np.array([bool(g) for g in gone]))


def solved(seed, vframe_points=("Y", "XY"), stops=4):
    room, survey = simulated(seed, stops)
    readings = hidden_from(survey.readings, vframe_points)
    return room, survey, solve_survey(room.vframe, survey.robot_frame, readings, room.world_names)


def error_of(room, solution, names):
    truth = dict(zip(room.world_names, np.asarray(room.world_points), strict=True))
    places, covariances = adjusted_points(solution, names)
    return places - [truth[name] for name in names], covariances


def test_their_places_and_covariances_are_right():
    total = 0.0
    for seed in range(SEEDS):
        room, _, solution = solved(seed)
        assert [lost.name for lost in solution.world.missing] == list(HIDDEN)
        assert set(solution.from_marks) == set(HIDDEN)
        error, covariance = error_of(room, solution, HIDDEN[:1])
        total += float(error[0] @ np.linalg.solve(covariance[0], error[0]))
    low, high = chi2.ppf([0.0005, 0.9995], 2 * SEEDS)
    assert low < total < high


def test_a_point_that_the_vframe_does_not_see_at_all_is_located():
    room, _, solution = solved(1, ("O", "X", "Y", "XY"))
    error, covariance = error_of(room, solution, HIDDEN)
    assert (np.abs(error) < 4 * np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))).all()
    assert solution.adjustment.degrees_of_freedom > 0


def test_their_readings_make_the_poses_better():
    room, survey, solution = solved(2)
    seen = [not {a, b} & set(HIDDEN) for a, b in zip(*ends(survey.readings), strict=True)]
    without = solve_survey(
        room.vframe,
        survey.robot_frame,
        survey.readings.select(np.array(seen)),
        [name for name in room.world_names if name not in HIDDEN],
    )
    better = np.trace(solution.pose_table().joint)
    assert better < np.trace(without.pose_table().joint)


def ends(readings):
    return readings.start, readings.end


def test_without_marks_the_point_stays_open():
    room, survey = simulated(3)
    readings = hidden_from(survey.readings, ("Y", "XY"))
    only = np.array([not any("/" in n for n in pair) for pair in zip(*ends(readings), strict=True)])
    solution = solve_survey(
        room.vframe, survey.robot_frame, readings.select(only), room.world_names
    )
    assert solution.from_marks == {}
    assert {lost.name for lost in solution.world.missing} == set(HIDDEN)


def test_a_point_whose_readings_contradict_each_other_stays_open():
    room, survey = simulated(4)
    readings = hidden_from(survey.readings, ("Y", "XY"))
    distance = readings.distance.copy()
    of_point = [i for i, pair in enumerate(zip(*ends(readings), strict=True)) if "3" in pair]
    distance[of_point[::2]] += 0.5
    solution = solve_survey(
        room.vframe, survey.robot_frame, replace(readings, distance=distance), room.world_names
    )
    assert set(solution.from_marks) == {"9"}
