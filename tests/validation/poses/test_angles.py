"""Angles on the circle."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation.poses.angles import circular_mean, mean_angle, wrap

finite_angles = st.floats(-1e3, 1e3)


@given(finite_angles)
def test_wrapping_keeps_the_direction(angle):
    wrapped = float(wrap(angle))
    assert -math.pi < wrapped <= math.pi
    # Angles up to 1e3 are known to 1e-13; a few operations follow.
    assert abs(math.remainder(wrapped - angle, 2 * math.pi)) < 1e-12


def test_a_half_turn_is_plus_pi():
    assert wrap(-math.pi) == math.pi
    assert wrap(math.pi) == math.pi
    assert wrap(3 * math.pi) == pytest.approx(math.pi)


@given(st.lists(st.floats(-1, 1), min_size=1, max_size=9), finite_angles)
def test_the_circular_mean_turns_with_the_angles(angles, turn):
    moved = circular_mean(np.array(angles) + turn)
    assert abs(wrap(moved - circular_mean(angles) - turn)) < 1e-11


@given(st.lists(st.floats(-1.5, 1.5), min_size=1, max_size=9), st.integers(-3, 3))
def test_whole_turns_change_no_mean(angles, turns):
    moved = np.array(angles) + 2 * math.pi * turns
    assert abs(wrap(circular_mean(moved) - circular_mean(angles))) < 1e-12
    assert abs(wrap(mean_angle(moved) - mean_angle(angles))) < 1e-12


@given(st.lists(st.floats(-1.5, 1.5), min_size=1, max_size=9))
def test_the_mean_angle_of_a_half_circle_is_the_arithmetic_mean(angles):
    assert float(mean_angle(angles)) == pytest.approx(np.mean(angles), abs=1e-12)


@pytest.mark.parametrize("angles", [[0.0, math.pi], [0.0, 2 * math.pi / 3, -2 * math.pi / 3]])
def test_vectors_that_cancel_have_no_mean(angles):
    assert math.isnan(circular_mean(angles))
    assert math.isnan(mean_angle(angles))


def test_means_are_taken_along_an_axis():
    angles = np.array([[3.1, -3.1], [0.1, 0.3]])
    assert circular_mean(angles) == pytest.approx([math.pi, 0.2])
    assert mean_angle(angles, axis=0).shape == (2,)
