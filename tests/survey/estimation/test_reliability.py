import numpy as np
import pytest
from scipy.stats import chi2
from surveys import case, simulated

from survey.estimation.reliability import (
    DETECTABLE,
    added_reading_gain,
    critical_w,
    reading_tests,
    suspected_blunders,
)
from survey.estimation.solve import solve_survey


def named(used, row):
    return {used.start[row], used.end[row]}


def pose_rows(readings):
    mark = [("/" in a) != ("/" in b) for a, b in zip(readings.start, readings.end, strict=True)]
    return np.flatnonzero(mark)


def test_w_of_clean_surveys_is_standard_normal():
    squares = [np.square(case(seed).solution.reliability.w) for seed in range(12)]
    n = sum(map(len, squares))
    mean = sum(map(np.sum, squares)) / n
    # w are correlated, mildly: the chi-squared interval of half as many values is wide enough.
    low, high = chi2.ppf([0.001, 0.999], n // 2) / (n // 2)
    assert low < mean < high


def test_unit_weight_of_clean_surveys_is_one():
    total = sum(case(seed).solution.adjustment.chi_squared for seed in range(12))
    freedom = sum(case(seed).solution.adjustment.degrees_of_freedom for seed in range(12))
    low, high = chi2.ppf([0.0005, 0.9995], freedom)
    assert low < total < high


def test_the_size_of_a_blunder_is_estimated_with_its_stated_sigma():
    room, survey = simulated(1)
    readings = survey.readings
    clean = solve_survey(room.vframe, survey.robot_frame, readings, room.world_names)
    row = int(pose_rows(readings)[40])
    distance = readings.distance.copy()
    distance[row] += 0.03
    bad = type(readings)(readings.start, readings.end, distance, readings.sigma)
    solved = solve_survey(room.vframe, survey.robot_frame, bad, room.world_names)
    # One and the same linear estimate before and after: it moves by the blunder itself.
    assert solved.reliability.blunder[row] - clean.reliability.blunder[row] == pytest.approx(
        0.03, abs=2e-5
    )
    assert named(solved.used, solved.suspicions[0].candidates[0]) == named(bad, row)


def test_a_blunder_of_the_minimal_detectable_size_is_found_in_four_of_five():
    found, tries = 0, 0
    for seed in range(8):
        solved = case(seed)
        adjustment = solved.solution.adjustment
        n = len(adjustment.network.distance)
        tests = reading_tests(adjustment)
        # Linear model: a blunder d moves w by d sqrt(r) / sigma.
        shift = (
            tests.minimal_detectable * np.sqrt(adjustment.redundancy[:n]) / adjustment.network.sigma
        )
        assert shift == pytest.approx(np.full(n, DETECTABLE))
        found += int((np.abs(tests.w + shift) > 3.29).sum())
        tries += n
    # Binomial with correlated trials: a tenth as many independent ones.
    assert abs(found / tries - 0.8) < 3.3 * np.sqrt(0.8 * 0.2 / (tries / 10))


def test_readings_that_only_check_one_another_are_both_candidates():
    solved = case(2)
    adjustment = solved.solution.adjustment
    n = len(adjustment.network.distance)
    keep = np.ones(n, dtype=bool)
    used = solved.solution.used
    # One point with three readings: whichever is wrong, the others look the same.
    name = solved.room.world_names[0]
    to_vframe = [
        i for i in range(n) if name in named(used, i) and "/" not in used.start[i] + used.end[i]
    ]
    to_marks = [i for i in range(n) if name in named(used, i) and i not in to_vframe]
    keep[to_marks] = False
    keep[to_vframe[3:]] = False
    readings = used.select(keep)
    distance = readings.distance.copy()
    row = next(i for i in range(len(readings)) if name in named(readings, i))
    distance[row] += 0.05
    bad = type(readings)(readings.start, readings.end, distance, readings.sigma)
    result = solve_survey(
        solved.room.vframe, solved.simulated.robot_frame, bad, solved.room.world_names
    )
    candidates = [named(result.used, i) for s in result.suspicions for i in s.candidates]
    assert named(bad, row) in candidates
    assert len(result.suspicions[0].candidates) >= 2


def test_two_blunders_are_found_one_after_the_other():
    room, survey = simulated(6)
    readings = survey.readings
    rows = pose_rows(readings)[[10, 100]]
    distance = readings.distance.copy()
    distance[rows] += [0.04, -0.05]
    bad = type(readings)(readings.start, readings.end, distance, readings.sigma)
    result = solve_survey(room.vframe, survey.robot_frame, bad, room.world_names)
    firsts = [named(result.used, s.candidates[0]) for s in result.suspicions]
    assert named(bad, rows[0]) in firsts
    assert named(bad, rows[1]) in firsts


def test_clean_surveys_are_rarely_accused():
    accused = sum(bool(suspected_blunders(case(seed).solution.adjustment)) for seed in range(12))
    # Each with 5 %; binomial, 99.9 %.
    assert accused <= 4


def test_critical_value_grows_with_the_number_of_readings():
    assert critical_w(1) == pytest.approx(3.29)
    assert critical_w(1300) == pytest.approx(4.12, abs=0.02)


def test_one_more_reading_helps_as_much_as_predicted():
    room, survey = simulated(5, 2)
    readings = survey.readings
    rows = pose_rows(readings)
    left_out = int(rows[17])
    fewer = readings.select(np.arange(len(readings)) != left_out)
    before = solve_survey(room.vframe, survey.robot_frame, fewer, room.world_names).adjustment
    after = solve_survey(room.vframe, survey.robot_frame, readings, room.world_names).adjustment
    place = {name: i for i, name in enumerate(before.network.points)}
    gain = added_reading_gain(
        before,
        np.array([place[readings.start[left_out]]]),
        np.array([place[readings.end[left_out]]]),
        readings.sigma[[left_out]],
    )[0]
    real = np.diag(before.covariance) - np.diag(after.covariance)
    assert gain == pytest.approx(real, abs=0.02 * real.max())


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("where", ["mark", "frame"])
def test_a_reading_that_is_metres_off_is_named_or_its_point_left_open(seed, where):
    room, survey = simulated(seed)
    rng = np.random.default_rng([4, seed])
    readings = survey.readings
    rows = pose_rows(readings)
    if where == "frame":
        ends = list(zip(readings.start, readings.end, strict=True))
        rows = [
            i
            for i, (a, b) in enumerate(ends)
            if "/" not in a + b and {a, b} & set(room.world_names)
        ]
    row = int(rng.choice(rows))
    distance = readings.distance.copy()
    distance[row] += 3.0
    bad = type(readings)(readings.start, readings.end, distance, readings.sigma)
    result = solve_survey(room.vframe, survey.robot_frame, bad, room.world_names)
    named_blunders = [named(result.used, i) for s in result.suspicions for i in s.candidates]
    reasons = [lost.reason for lost in (*result.world.missing, *result.not_posed)]
    told = any(f"{distance[row]:.3f} m" in reason for reason in reasons)
    assert told or named(bad, row) in named_blunders
