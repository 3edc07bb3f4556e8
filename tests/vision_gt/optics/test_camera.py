"""The camera model agrees with OpenCV's, has the derivatives it claims, and inverts."""

import cv2
import numpy as np
import pytest
from vision_scenes import LENS, SIZE

from validation.errors import GtvalError
from vision_gt.optics.camera import Camera, inside_image, project, project_with_jacobians, undistort

FULL = np.array([1000.0, 1010.0, 640.0, 480.0, -0.25, 0.1, 0.001, -0.002, -0.02])


@pytest.fixture(scope="module")
def points() -> np.ndarray:
    return np.random.default_rng(0).uniform([-1.2, -0.9, 2], [1.2, 0.9, 5], (500, 3))


def test_pixels_are_those_of_opencv(points):
    K = np.array([[FULL[0], 0, FULL[2]], [0, FULL[1], FULL[3]], [0, 0, 1]])
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, FULL[4:])[0][:, 0]
    np.testing.assert_allclose(project(points, FULL), expected, atol=1e-9)


def test_derivatives_are_those_of_differences(points):
    _, by_point, by_parameters = project_with_jacobians(points, FULL)
    step = 1e-6
    for axis in np.eye(3):
        numeric = (project(points + step * axis, FULL) - project(points - step * axis, FULL)) / (
            2 * step
        )
        np.testing.assert_allclose(by_point @ axis, numeric, atol=2e-6)
    for axis in np.eye(9):
        numeric = (project(points, FULL + step * axis) - project(points, FULL - step * axis)) / (
            2 * step
        )
        np.testing.assert_allclose(by_parameters @ axis, numeric, atol=2e-6)


def test_undistorting_inverts_distorting(points):
    inside = inside_image(project(points, FULL), SIZE)
    found = undistort(project(points, FULL), FULL)[inside]
    np.testing.assert_allclose(found, (points[:, :2] / points[:, 2:])[inside], atol=1e-9)


def test_points_behind_the_camera_have_no_pixel():
    assert np.isnan(project(np.array([0.1, 0.2, -1.0]), LENS)).all()


def test_pixels_beyond_the_lens_model_have_no_direction():
    folded = LENS.copy()
    folded[4:] = [-0.3, 0.0, 0.0, 0.0, 0.0]
    # With k1 alone the image ends at r = sqrt(1 / 0.9), x' = 2 r / 3 = 0.703.
    assert np.isfinite(undistort(np.array([639.5 + 690.0, 479.5]), folded)).all()
    assert np.isnan(undistort(np.array([639.5 + 720.0, 479.5]), folded)).all()


@pytest.mark.parametrize(
    "parameters", [np.zeros(9), np.full(9, np.nan), np.ones(8)], ids=["zeros", "nan", "eight"]
)
def test_parameters_that_no_camera_has_are_refused(parameters):
    with pytest.raises(GtvalError):
        Camera("1", SIZE, parameters)
