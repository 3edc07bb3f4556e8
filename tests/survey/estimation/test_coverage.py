"""Are the covariances right? Many seeded surveys against chi-squared intervals."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2
from surveys import Case, case, simulated

from survey.estimation.solve import solve_survey

QUICK = 40
SEEDS = 200
BLUNDER = 0.03


def nees(error, covariance):
    return float(error @ np.linalg.solve(covariance, error))


def measures(solved: Case) -> dict[str, tuple[float, int]]:
    """Chi-squared and degrees of freedom of everything that states a covariance.

    One world point and one pose of each survey: those of different surveys are independent.
    """
    joint, joint_c, everything = solved.joint_errors()
    single, single_c = solved.single_errors()
    world, world_c = solved.world_errors()
    world_all = solved.solution.world.covariance
    return {
        "world point": (nees(world[0], world_c[0]), 2),
        "all world points": (nees(world.ravel(), world_all), world.size),
        "single position": (nees(single[0, :2], single_c[0, :2, :2]), 2),
        "single heading": (single[0, 2] ** 2 / single_c[0, 2, 2], 1),
        "joint position": (nees(joint[0, :2], joint_c[0, :2, :2]), 2),
        "joint heading": (joint[0, 2] ** 2 / joint_c[0, 2, 2], 1),
        "all poses": (nees(joint.ravel(), everything), joint.size),
        "unit weight": (
            solved.solution.adjustment.chi_squared,
            solved.solution.adjustment.degrees_of_freedom,
        ),
    }


def check_coverage(seeds, confidence):
    totals: dict[str, float] = {}
    freedoms: dict[str, int] = {}
    for seed in seeds:
        solved = case(seed)
        assert not solved.solution.not_posed, seed
        assert not solved.solution.world.missing, seed
        for name, (value, freedom) in measures(solved).items():
            totals[name] = totals.get(name, 0.0) + value
            freedoms[name] = freedoms.get(name, 0) + freedom
    tail = (1 - confidence) / 2
    for name, total in totals.items():
        low, high = chi2.ppf([tail, 1 - tail], freedoms[name])
        assert low < total < high, (name, total / freedoms[name])


def test_covariances_of_some_surveys():
    # 99.9 %, because eight quantities are looked at.
    check_coverage(range(QUICK), 0.999)


@pytest.mark.full
def test_covariances_of_two_hundred_surveys():
    check_coverage(range(SEEDS), 0.95)


def finds_the_blunder(seed):
    """Whether one reading off by 3 cm is among the candidates, and how many those are."""
    room, survey = simulated(seed)
    rng = np.random.default_rng([3, seed])
    readings = survey.readings
    marks = [("/" in a) != ("/" in b) for a, b in zip(readings.start, readings.end, strict=True)]
    row = int(rng.choice(np.flatnonzero(marks)))
    distance = readings.distance.copy()
    distance[row] += rng.choice([-BLUNDER, BLUNDER])
    bad = replace(readings, distance=distance)
    solved = solve_survey(room.vframe, survey.robot_frame, bad, room.world_names)
    wanted = {bad.start[row], bad.end[row]}
    candidates = [
        {solved.used.start[i], solved.used.end[i]} for s in solved.suspicions for i in s.candidates
    ]
    return wanted in candidates, len(candidates)


def test_a_blunder_of_three_centimetres_is_among_few_candidates():
    results = [finds_the_blunder(seed) for seed in range(20)]
    assert all(found for found, _ in results)
    assert np.mean([count for _, count in results]) < 2


@pytest.mark.full
def test_a_blunder_of_three_centimetres_is_found_in_two_hundred_surveys():
    results = [finds_the_blunder(seed) for seed in range(SEEDS)]
    assert np.mean([found for found, _ in results]) >= 0.95


@pytest.mark.full
def test_surveys_without_blunders_are_accused_as_rarely_as_stated():
    accused = sum(bool(case(seed).solution.suspicions) for seed in range(SEEDS))
    # Binomial with p = 0.05, 99.8 % interval.
    assert 0 < accused <= 20
