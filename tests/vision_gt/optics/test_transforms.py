"""Small changes of transforms: inverse, composition, and what they mean in the plane."""

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from vision_gt.optics.transforms import (
    change_between,
    composition_jacobians,
    mean_transform,
    perturbed,
    planar_jacobian,
    planar_pose,
    planar_transform,
    rotation_matrices,
    rotation_vectors,
)

RNG = np.random.default_rng(1)


def a_transform() -> RigidTransform:
    return RigidTransform.from_components(RNG.normal(size=3), Rotation.random(random_state=RNG))


def numeric(function, size=6):
    """Derivative by a small change, by differences."""
    step = 1e-6
    columns = [(function(step * e) - function(-step * e)) / (2 * step) for e in np.eye(size)]
    return np.stack(columns, -1)


def test_a_change_and_its_finding_are_inverse():
    T, change = a_transform(), 0.3 * RNG.normal(size=6)
    np.testing.assert_allclose(change_between(perturbed(T, change), T), change, atol=1e-12)


def test_rotations_are_those_of_scipy():
    vectors = RNG.normal(size=(50, 3))
    vectors = np.concatenate([vectors, 1e-9 * vectors, np.zeros((1, 3))])
    matrices = rotation_matrices(vectors)
    np.testing.assert_allclose(matrices, Rotation.from_rotvec(vectors).as_matrix(), atol=1e-14)
    short = (
        vectors * np.minimum(1, 3 / np.maximum(np.linalg.norm(vectors, axis=1), 1e-300))[:, None]
    )
    np.testing.assert_allclose(rotation_vectors(rotation_matrices(short)), short, atol=1e-7)


def test_a_composition_has_the_derivatives_it_claims():
    A, B = a_transform(), a_transform()
    first, second = composition_jacobians(A, B)
    np.testing.assert_allclose(
        first, numeric(lambda d: change_between(perturbed(A, d) * B, A * B)), atol=1e-8
    )
    np.testing.assert_allclose(
        second, numeric(lambda d: change_between(A * perturbed(B, d), A * B)), atol=1e-8
    )


def test_planar_pose_of_an_upright_body_and_its_derivative():
    pose = np.array([1.0, -2.0, 2.5])
    np.testing.assert_allclose(planar_pose(planar_transform(pose)), pose, atol=1e-15)
    T = perturbed(planar_transform(pose), np.array([0, 0, 0.1, 0.02, -0.03, 0.01]))
    found = numeric(lambda d: planar_pose(perturbed(T, d)))
    np.testing.assert_allclose(planar_jacobian(T.rotation.as_matrix()), found, atol=1e-8)
    np.testing.assert_allclose(
        planar_jacobian(planar_transform(pose).rotation.as_matrix())[2], [0, 0, 0, 0, 0, 1]
    )


def test_the_mean_of_equal_transforms_is_the_transform_and_of_opposite_changes_nearly_so():
    T = a_transform()
    same = mean_transform(RigidTransform.concatenate([T, T, T]))
    np.testing.assert_allclose(same.as_matrix(), T.as_matrix(), atol=1e-12)
    change = 1e-3 * RNG.normal(size=6)
    pair = RigidTransform.concatenate([perturbed(T, change), perturbed(T, -change)])
    # The error of averaging elements is of second order in the rotation.
    np.testing.assert_allclose(mean_transform(pair).as_matrix(), T.as_matrix(), atol=1e-5)
