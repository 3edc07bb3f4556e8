"""Coordinates in another unit than metres are told, and nothing else is."""

import numpy as np
import pytest

import gtval
from validation.statistics.conclusions import conclusions
from validation.statistics.evaluation import evaluate
from validation.statistics.units import PER_METRE, unit_of_points, unit_of_ratio

METRES = {"millimetres": 0.001, "centimetres": 0.01, "inches": 0.0254, "feet": 0.3048}


def room(rng, n=12):
    return rng.uniform(-4, 4, (n, 2))


def test_the_units_are_those_of_the_standard():
    assert METRES.keys() == PER_METRE.keys()
    for unit, metres in METRES.items():
        assert PER_METRE[unit] * metres == pytest.approx(1, rel=1e-12)
        assert unit_of_ratio(1 / metres) == unit


@pytest.mark.parametrize("unit", METRES)
def test_a_unit_is_found_in_a_turned_and_shifted_frame_with_noise(unit):
    for seed in range(50):
        rng = np.random.default_rng(seed)
        true, angle = room(rng), rng.uniform(-np.pi, np.pi)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        seen = true @ turn.T + rng.uniform(-3, 3, 2) + rng.normal(0, 0.1, true.shape)
        assert unit_of_points(seen / METRES[unit], true) == unit
        assert unit_of_points(true, seen / METRES[unit]) == ""


def test_metres_and_points_that_have_nothing_in_common_are_no_unit():
    for seed in range(200):
        rng = np.random.default_rng(seed)
        true = room(rng)
        assert unit_of_points(1.03 * true + rng.normal(0, 0.2, true.shape), true) == ""
        assert unit_of_points(room(rng) * rng.uniform(2, 5) * [1, 0.2], true) == ""
    assert unit_of_points(true[:2] * 1000, true[:2]) == ""
    assert unit_of_points(true * 1000, np.zeros_like(true)) == ""


@pytest.mark.parametrize(("a", "b"), [(1.0, 1000.0), (1000.0, 1.0), (1.0, 3.28084)])
def test_a_comparison_of_two_units_is_an_error(a, b):
    rng = np.random.default_rng(1)
    poses = np.column_stack([room(rng), rng.uniform(-1, 1, 12)])
    survey, rig = (
        gtval.pose_table(
            name, poses * [factor, factor, 1] + 0.01 * factor * rng.normal(size=(12, 3))
        )
        for name, factor in (("survey", a), ("rig", b))
    )
    told = [one for one in conclusions(evaluate(survey, rig)) if one.code == "unit"]
    assert [one.severity for one in told] == ["error"]
    assert ("validation" if a > b else "this system") in told[0].text
    same = gtval.pose_table("rig", survey.poses + 0.01)
    assert "unit" not in {one.code for one in conclusions(evaluate(survey, same))}
