import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from laser_gt.scans.planar import (
    between,
    compose,
    compose_jacobians,
    inverse,
    inverse_jacobian,
    transform,
)
from validation.poses.angles import wrap

numbers = st.floats(-20, 20)
poses = st.tuples(numbers, numbers, st.floats(-3.1, 3.1)).map(np.array)


@given(poses, poses)
def test_a_pose_followed_by_the_way_to_another_is_the_other(a, b):
    found = compose(a, between(a, b))
    assert np.allclose(found[:2], b[:2], atol=1e-9)
    assert abs(wrap(found[2] - b[2])) < 1e-9


@given(poses, poses)
def test_composed_poses_move_points_one_after_the_other(a, b):
    points = np.array([[1.0, 2.0], [-3.0, 0.5]])
    assert np.allclose(transform(compose(a, b), points), transform(a, transform(b, points)))


@given(poses, poses)
def test_derivatives_are_those_of_small_differences(a, b):
    by_a, by_b = compose_jacobians(a, b)
    by_inverse = inverse_jacobian(a)
    for column, step in enumerate(np.eye(3) * 1e-6):
        for jacobian, moved, fixed in (
            (by_a, compose(a + step, b), compose(a - step, b)),
            (by_b, compose(a, b + step), compose(a, b - step)),
            (by_inverse, inverse(a + step), inverse(a - step)),
        ):
            difference = moved - fixed
            difference[2] = wrap(difference[2])
            assert np.allclose(difference / 2e-6, jacobian[:, column], atol=1e-6)
