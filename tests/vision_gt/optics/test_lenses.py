"""Fisheye and rational lenses: by a formula of their own, over 120 to 175 degrees."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation
from scipy.stats import chi2

from vision_gt.images.markers import MarkerView
from vision_gt.network.intrinsics import calibrate
from vision_gt.optics.camera import Camera, project, project_with_jacobians, undistort
from vision_gt.optics.lenses import fisheye_parameters, rational_parameters
from vision_gt.optics.planar_pose import planar_solutions
from vision_gt.patterns.board_views import BoardView
from vision_gt.patterns.boards import Board
from vision_gt.robot.alone import marker_in_camera
from vision_gt.robot.marker_poses import marker_corners

SIZE = (1280, 1024)
FOCAL = np.array([430.0, 432.0, 641.0, 508.0])
K_FISH = np.array([0.03, -0.012, 0.006, -0.0015])
K_RATIONAL = np.array([0.9, 0.25, 4e-4, -3e-4, 0.01, 1.2, 0.5, 0.06])
LENSES = {
    "fisheye": fisheye_parameters(FOCAL, K_FISH),
    "rational": rational_parameters(FOCAL, K_RATIONAL),
}


def seen_by(lens, points):
    """Pixels by angles (fisheye), or by the quotient written out; scalar, from the papers."""
    pixels = []
    for x, y, z in points:
        if lens == "fisheye":
            theta, around = np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)
            k1, k2, k3, k4 = K_FISH
            far = theta + k1 * theta**3 + k2 * theta**5 + k3 * theta**7 + k4 * theta**9
            u, v = far * np.cos(around), far * np.sin(around)
        else:
            a, b = x / z, y / z
            r = np.sqrt(a**2 + b**2)
            k1, k2, p1, p2, k3, k4, k5, k6 = K_RATIONAL
            q = (1 + k1 * r**2 + k2 * r**4 + k3 * r**6) / (1 + k4 * r**2 + k5 * r**4 + k6 * r**6)
            u = a * q + 2 * p1 * a * b + p2 * (r**2 + 2 * a**2)
            v = b * q + p1 * (r**2 + 2 * b**2) + 2 * p2 * a * b
        pixels.append([FOCAL[0] * u + FOCAL[2], FOCAL[1] * v + FOCAL[3]])
    return np.array(pixels)


def rays(degrees, count=300):
    """Points in a cone so wide, the axis among them."""
    rng = np.random.default_rng(2)
    angle, around = np.deg2rad(degrees / 2) * np.sqrt(rng.random(count)), rng.uniform(0, 7, count)
    angle[0] = 0.0
    axis = np.column_stack([np.sin(angle) * np.cos(around), np.sin(angle) * np.sin(around)])
    return np.column_stack([axis, np.cos(angle)]) * rng.uniform(0.5, 5, (count, 1))


@pytest.mark.parametrize(("lens", "degrees"), [("fisheye", 175), ("rational", 120)])
def test_pixels_derivatives_and_the_way_back(lens, degrees):
    points, parameters = rays(degrees), LENSES[lens]
    pixels, by_point, by_parameters = project_with_jacobians(points, parameters)
    np.testing.assert_allclose(pixels, seen_by(lens, points), atol=1e-9)
    np.testing.assert_allclose(project(points, parameters), pixels, atol=1e-12)
    back = undistort(pixels, parameters)
    straight = points[:, :2] / points[:, 2:]
    # Of the angle: at 87 degrees the plane of undistorted points is stretched 400 times.
    np.testing.assert_allclose(np.arctan(back), np.arctan(straight), atol=1e-8)
    step = 1e-6
    for k, axis in enumerate(np.eye(3)):
        off = step * axis * points[:, 2:]
        numeric = (seen_by(lens, points + off) - seen_by(lens, points - off)) / 2 / step
        scale = np.maximum(np.abs(numeric), 100.0)
        assert (np.abs(by_point[:, :, k] * points[:, 2:] - numeric) < 1e-5 * scale).all()
    for k in range(9):
        change = np.zeros(13)
        change[k] = step
        numeric = project(points, parameters + change) - project(points, parameters - change)
        scale = np.maximum(np.abs(numeric / 2 / step), 1.0)
        assert (np.abs(by_parameters[..., k] - numeric / 2 / step) < 1e-4 * scale).all()


def test_ninety_degrees_and_more_have_no_place_in_the_plane():
    theta = np.deg2rad(95)
    far = theta + K_FISH @ [theta**3, theta**5, theta**7, theta**9]
    assert np.isnan(undistort(FOCAL[2:] + np.array([far * FOCAL[0], 0]), LENSES["fisheye"])).all()
    assert np.isnan(project(np.array([1.0, 0.0, -0.1]), LENSES["fisheye"])).all()


def boards(lens, noise, count=14):
    """Views of a board all over the image of a lens."""
    rng, board, views = np.random.default_rng(8), Board(9, 7, 0.06), []
    while len(views) < count:
        aim = rays(130 if lens == "fisheye" else 100, 40)[rng.integers(40)]
        aim = 0.45 * aim / np.linalg.norm(aim)
        turn = Rotation.from_rotvec(rng.uniform(-0.6, 0.6, 3))
        points = (board.corners - board.corners.mean(0)) @ turn.as_matrix().T + aim
        if (points[:, 2] < 0.05).any():
            continue
        pixels = seen_by(lens, points)
        if ((pixels < 5) | (pixels > np.array(SIZE) - 5)).any():
            continue
        pixels += noise * rng.standard_normal(pixels.shape)
        ids, sigmas = np.arange(len(pixels)), np.full(len(pixels), noise)
        body = str(len(views))
        views.append(BoardView("1", body, 0, board, ids, pixels, body, sigmas))
    return views


@pytest.mark.parametrize("lens", ["fisheye", "rational"])
def test_the_lens_that_foretells_best_is_taken_and_said(lens):
    found = calibrate("1", SIZE, boards(lens, 0.1))
    assert found.camera.lens == lens
    assert found.held_out[lens] == min(found.held_out.values())
    assert found.held_out.get("brown", np.inf) > found.held_out[lens] / 0.9
    # Residuals of two coordinates with a standard deviation of 0.1 pixels each.
    assert 0.09 * np.sqrt(2) < found.rms < 0.115 * np.sqrt(2)
    if lens == "fisheye":
        off = (found.camera.parameters - LENSES[lens])[:8]
        covariance = found.camera.covariance[:8, :8]
        assert off @ np.linalg.solve(covariance, off) < chi2.ppf(0.999, 8)


def test_a_marker_at_the_rim_of_a_fisheye_image_has_its_pose_and_covariance():
    camera = Camera("1", SIZE, LENSES["fisheye"], np.diag([0.1] * 4 + [1e-4] * 4 + [0.0]) ** 2)
    T = RigidTransform.from_components([0.9, 0.5, 0.45], Rotation.from_rotvec([0.3, -0.9, 0.2]))
    corners = seen_by("fisheye", T.apply(marker_corners(0.2)))
    exact = planar_solutions(marker_corners(0.2), corners, camera.parameters)
    assert np.linalg.norm(exact.best.translation - T.translation) < 1e-6
    rng, normalised = np.random.default_rng(3), []
    for _ in range(60):
        noisy = corners + 0.05 * rng.standard_normal((4, 2))
        lens = rng.multivariate_normal(camera.parameters[:9], camera.covariance)
        own = replace(camera, parameters=np.append(lens, camera.parameters[9:]))
        view = MarkerView(3, noisy, 0.05**2 * np.tile(np.eye(2), (4, 1, 1)))
        pose = marker_in_camera(own, view, 0.2)
        off = pose.T_gtv_robot.translation - T.translation
        normalised.append(off @ np.linalg.solve(pose.covariance[:3, :3], off))
    low, high = chi2.ppf([1e-3, 1 - 1e-3], 3 * len(normalised)) / len(normalised)
    assert low < np.mean(normalised) < high
