"""Stated sigmas of corners are as large as their errors, under blur that no model has, too."""

import cv2
import numpy as np
import pytest
from vision_scenes import (
    APRIL,
    camera,
    laid_out,
    marker_image,
    over_pixels,
    random_marker,
)

from data_samples.rendering.image import Optics
from vision_gt.images.boards import find_board
from vision_gt.images.markers import detect_markers
from vision_gt.patterns.boards import Board
from vision_gt.prints.signs import wider_shapes


def spoilt(light, rng, *, blur=0.0, motion=0, sharpen=0.0):
    """An image with blur (pixels), motion over some pixels, sharpening, and noise of 2 levels."""
    if motion:
        light = cv2.filter2D(light, -1, np.full((1, motion), 1 / motion))
    if blur:
        light = cv2.GaussianBlur(light, (0, 0), blur)
    light = light + rng.normal(0, 2, light.shape)
    if sharpen:
        light = light + sharpen * (light - cv2.GaussianBlur(light, (0, 0), 1.5))
    return np.clip(np.rint(light), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def rendered():
    """Markers of 30 to 60 pixels without noise, and their corners."""
    rng = np.random.default_rng(23)
    found = []
    for _ in range(10):
        number = int(rng.integers(200))
        optics = Optics(rays=64, noise=0.0, blur=0.5)
        image, true = marker_image(rng, random_marker(rng, rng.uniform(2.5, 5.0)), number, optics)
        low = np.maximum(true.min(0).astype(int) - 40, 0)
        x, y = np.minimum(true.max(0).astype(int) + 41, image.shape[::-1])
        found.append((number, image, (slice(low[1], y), slice(low[0], x)), true))
    return found


@pytest.mark.parametrize(
    "how",
    [{"blur": 0.5}, {"blur": 1.4}, {"motion": 5, "blur": 0.5}, {"sharpen": 1.5, "blur": 0.5}],
)
def test_errors_of_corners_are_as_large_as_stated(rendered, how):
    rng = np.random.default_rng(3)
    squares, errors, stated = [], [], []
    for number, image, part, true in rendered:
        # Only what is around a marker is spoilt, which is quicker.
        photograph = image.copy()
        photograph[part] = spoilt(image[part].astype(float), rng, **how)
        views = detect_markers(photograph, APRIL, camera(), [number]).views
        for view in views:
            off = view.corners - true
            inverse = np.linalg.inv(view.covariances)
            squares.append(np.einsum("ki,kij,kj->k", off, inverse, off) / 2)
            errors.append(np.square(off).mean())
            stated.append(np.trace(view.covariances, axis1=1, axis2=2).mean() / 2)
    assert len(squares) >= 8
    # Of each marker two of eight errors are independent, more or less: 16 to 20 in all, whose mean
    # square has a standard deviation of a third; two of it beside the 0.7 to 1.4 that are asked.
    assert 0.4 < np.mean(squares) < 2.0
    assert 0.6 < np.sqrt(np.mean(stated) / np.mean(errors)) < 1.7


@pytest.mark.parametrize(("noise", "smooth"), [(2.0, 0.0), (8.0, 0.0), (4.0, 1.0)])
def test_errors_of_board_corners_are_as_large_as_stated(noise, smooth):
    """White noise, and noise that a camera smoothed: 45 corners in two images each.

    Their mean square has a standard deviation of a tenth; sigmas are the larger one of two
    coordinates', to which 0.004 pixels are added, and smoothed noise is seen a third too small.
    """
    board = Board(10, 6, 0.1)
    squares = []
    for seed in range(2):
        rng = np.random.default_rng(seed)
        cells = np.pad(np.indices((6, 10)).sum(0) % 2, 1, constant_values=1)
        own = np.array([[0, 0], [480, 0], [480, 320], [0, 320]]) - 0.5
        seen = np.array([[60, 50], [580, 80], [560, 420], [90, 400]]) + rng.uniform(-20, 20, (4, 2))
        large, H = laid_out(np.kron(cells, np.ones((40, 40))), own, seen, (640, 480), outside=0.5)
        image = over_pixels(cv2.GaussianBlur(large, (0, 0), 5.6))
        grain = rng.standard_normal(image.shape)
        if smooth:
            grain = cv2.GaussianBlur(grain, (0, 0), smooth)
        image = 40 + 165 * image + noise * grain / grain.std()
        found = find_board(np.clip(np.rint(image), 0, 255).astype(np.uint8), board)
        inner = np.stack(np.meshgrid(np.arange(1, 10), np.arange(1, 6)), -1).reshape(-1, 1, 2)
        inner = 40.0 * (inner + 1) - 0.5
        true = (cv2.perspectiveTransform(inner, H)[:, 0] - 3.5) / 8
        if np.linalg.norm(found.pixels[0] - true[found.ids[0]]) > 5:
            true = true[::-1]
        off = (found.pixels - true[found.ids]) / found.sigmas[:, None]
        squares.append(np.square(off).mean())
    assert 0.35 < np.mean(squares) < 1.8


def test_a_stretched_blur_is_an_ellipse_as_wide_as_its_variances():
    """Blur of 1 pixel with 0.6 square pixels more along 30 degrees than across."""
    angle = np.deg2rad(30)
    stretch = 0.6 * np.array([[np.cos(2 * angle), np.sin(2 * angle)]])
    (shape,) = wider_shapes(np.ones(1), stretch)
    along, across = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    np.testing.assert_allclose(shape @ across, across, atol=1e-12)
    np.testing.assert_allclose(shape @ along, np.sqrt(1.3 / 0.7) * along, atol=1e-12)
    again = wider_shapes(np.ones(1), np.zeros((1, 2)), shape[None])
    np.testing.assert_allclose(again[0], shape, atol=1e-12)


def test_corners_of_overexposed_markers_under_a_gamma_are_where_they_are():
    """White is cut off everywhere at 2.5 times the light: its level is known from slopes alone."""
    for number in range(6):
        rng = np.random.default_rng(number)
        bits = np.pad(APRIL.bits(number), 2, constant_values=1)
        low, high = 79.5, 40.0 * len(bits) - 80.5
        own = [[low, low], [high, low], [high, high], [low, high]]
        seen = np.array([[60, 52], [138, 60], [132, 130], [54, 134]]) + rng.uniform(-9, 9, (4, 2))
        large, _ = laid_out(np.kron(bits, np.ones((40, 40))), own, seen, (200, 190), outside=1.0)
        light = 0.04 + 0.78 * over_pixels(cv2.GaussianBlur(large, (0, 0), 5.6))
        light = np.clip(2.5 * light + rng.normal(0, 2 / 255, light.shape), 0, 1)
        image = np.rint(255 * light ** (1 / 2.2)).astype(np.uint8)
        (view,) = detect_markers(image, APRIL).views
        assert np.abs(view.corners - seen).max() < 0.15
        assert np.sqrt(np.trace(view.covariances, axis1=1, axis2=2) / 2).max() < 0.1
