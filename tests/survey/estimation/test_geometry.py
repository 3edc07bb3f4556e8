import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from survey.estimation.geometry import (
    circle_intersections,
    mirror_in_line,
    multilaterate,
    rigid_alignment,
    rotate,
)

coordinate = st.floats(-20, 20)
point = st.tuples(coordinate, coordinate).map(np.array)


@given(point, point, point)
def test_a_point_is_one_of_the_two_places_at_its_distances(a, b, p):
    assume(np.linalg.norm(a - b) > 0.1)
    u, v = b - a, p - a
    line = abs(u[0] * v[1] - u[1] * v[0]) / np.linalg.norm(u)
    assume(line > 0.1)
    centres = np.array([a, b])
    both = circle_intersections(centres, np.linalg.norm(centres - p, axis=1))
    assert np.linalg.norm(both - p, axis=1).min() < 1e-9
    assert np.allclose(both[0] + both[1] - 2 * p, 2 * (both.mean(0) - p), atol=1e-9)
    assert (both.mean(0) - a) @ (both[0] - both[1]) == pytest.approx(0, abs=1e-6)


def test_circles_that_do_not_reach_one_another_give_the_point_between_them():
    both = circle_intersections(np.array([[0.0, 0.0], [10.0, 0.0]]), np.array([4.0, 5.0]))
    # 4.55 is where the two power lines meet: (100 + 16 - 25) / 20.
    assert both == pytest.approx(np.array([[4.55, 0.0], [4.55, 0.0]]))


def test_concentric_circles_are_refused():
    with pytest.raises(ValueError, match="coincide"):
        circle_intersections(np.zeros((2, 2)), np.ones(2))


@given(st.lists(point, min_size=3, max_size=8), point)
def test_exact_distances_give_the_exact_place(centres, p):
    centres = np.array(centres)
    spread = np.linalg.svd(centres - centres.mean(0), compute_uv=False)
    assume(spread[1] > 0.5)
    found = multilaterate(centres, np.linalg.norm(centres - p, axis=1))
    assert found == pytest.approx(p, abs=1e-7)


@given(point, st.floats(-np.pi, np.pi))
def test_alignment_undoes_a_motion_and_keeps_handedness(shift, theta):
    rig = np.array([[0.0, 0.0], [0.6, 0.0], [0.0, 0.4]])
    moved = rotate(np.array(theta), rig) + shift
    x, y, angle = rigid_alignment(rig, moved)
    assert [x, y] == pytest.approx(shift, abs=1e-9)
    assert np.cos(angle - theta) == pytest.approx(1)
    mirrored = rig * [1, -1]
    x, y, angle = rigid_alignment(rig, mirrored)
    fitted = rotate(np.array(angle), rig) + np.array([x, y])
    assert np.abs(fitted - mirrored).max() > 0.1


def test_a_mirror_image_has_the_same_distances_to_the_line():
    line = np.array([[0.0, 0.0], [1.0, 1.0], [3.0, 3.0]])
    assert mirror_in_line(np.array([2.0, 0.0]), line) == pytest.approx([0.0, 2.0])
