import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from survey.estimation.geometry import rotate
from survey.estimation.measurement import independent_variance, linearise

number = st.floats(-5, 5)


def implicit(state, known, body, distance):
    p = state[:2] + rotate(state[2], body)
    return ((known - p) ** 2).sum(-1) - distance**2


@given(st.lists(number, min_size=8, max_size=8))
def test_derivatives_are_those_of_finite_differences(v):
    state, known, body = np.array(v[:3]), np.array([v[3:5]]), np.array([v[5:7]])
    distance = np.array([v[7]])
    at = linearise(state, known, body, distance)
    assert at.h == pytest.approx(implicit(state, known, body, distance), abs=1e-9)
    step = 1e-6

    def slope(change):
        ahead = implicit(
            *(a + step * b for a, b in zip((state, known, body, distance), change, strict=True))
        )
        back = implicit(
            *(a - step * b for a, b in zip((state, known, body, distance), change, strict=True))
        )
        return (ahead - back) / (2 * step)

    zero = [np.zeros(3), np.zeros((1, 2)), np.zeros((1, 2)), np.zeros(1)]

    def along(which, unit):
        change = list(zero)
        change[which] = unit
        return slope(change)

    # Central differences of a quadratic are exact but for rounding: 1e-16 * h / step.
    close = {"abs": 1e-6, "rel": 1e-6}
    e = np.eye(3)
    assert at.H_position[0, 0] == pytest.approx(along(0, e[0])[0], **close)
    assert at.H_position[0, 1] == pytest.approx(along(0, e[1])[0], **close)
    assert at.H_heading[0] == pytest.approx(along(0, e[2])[0], **close)
    for axis in range(2):
        unit = np.eye(2)[axis][None]
        assert at.W_known[0, axis] == pytest.approx(along(1, unit)[0], **close)
        assert at.W_body[0, axis] == pytest.approx(along(2, unit)[0], **close)
    assert at.W_distance[0] == pytest.approx(along(3, np.ones(1))[0], **close)


def test_variance_of_h_is_w_r_w_transposed():
    at = linearise(
        np.array([0.1, 0.2, 0.3]), np.array([[3.0, 1.0]]), np.array([[0.6, 0.0]]), np.array([3.0])
    )
    W = np.array([at.W_distance[0], *at.W_known[0], *at.W_body[0]])
    R = np.diag(np.square([0.008, 0.002, 0.002, 0.001, 0.001]))
    assert independent_variance(at, np.array([0.008]), 0.002, 0.001)[0] == pytest.approx(W @ R @ W)
