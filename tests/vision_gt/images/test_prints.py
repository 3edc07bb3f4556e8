"""Corners of small markers, from the whole print: what covers a part of it does no harm."""

import cv2
import numpy as np
import pytest
from scipy.stats import chi2
from vision_scenes import APRIL, SIDE, close_up, marker_image, random_marker

from data_samples.rendering.image import Optics
from vision_gt.images import corners
from vision_gt.images.markers import detect_markers
from vision_gt.patterns.dictionaries import ARTOOLKITPLUS, Family
from vision_gt.prints.edge_samples import Flat
from vision_gt.prints.print_fit import _unfitted, fit_prints
from vision_gt.prints.print_look import PADDING, Places, boundaries_in_reach, whiteness


def fitted(image, camera, true, number, start_off, family=APRIL):
    flat = Flat(camera.parameters)
    start = flat.from_image(true) + start_off
    bits = family.bits(number).reshape(1, family.cells, family.cells)
    fit = fit_prints(image, start[None], bits, np.full((1, 2), 0.5), flat)
    return flat.to_image(fit.corners[0]) - true, fit.covariances[0], fit.good[0]


@pytest.mark.parametrize("distance", [4.0, 5.0])
def test_the_fit_comes_home_from_a_pixel_off_and_says_how_good_it_is(distance):
    rng = np.random.default_rng(int(distance))
    normalised = []
    for _ in range(12):
        number = int(rng.integers(200))
        camera, image, true = close_up(rng, random_marker(rng, distance), number)
        off = rng.uniform(-0.7, 0.7, 2) + rng.uniform(-0.3, 0.3, (4, 2))
        error, covariances, good = fitted(image, camera, true, number, off)
        assert good
        assert np.linalg.norm(error, axis=1).max() < 0.15
        # The floor of the corners is there for what no fit sees, such as the renderer's rays.
        stated = covariances + 0.015**2 * np.eye(2)
        normalised.append(np.einsum("ki,kij,kj->", error, np.linalg.inv(stated), error) / 8)
    # A marker's eight numbers err together: it counts for no more than two of them.
    low, high = chi2.ppf([1e-3, 1 - 1e-3], 2 * len(normalised)) / (2 * len(normalised))
    assert low < np.mean(normalised) < high


def test_a_covered_part_does_not_move_the_corners():
    rng = np.random.default_rng(3)
    for _ in range(6):
        camera, image, true = close_up(rng, random_marker(rng, 4.0), 11)
        half = image.shape[0] // 2
        spoiled = image.copy()
        # A grey sheet over the corner of the marker, and a fifth of its area.
        corner = np.rint(true[int(rng.integers(4))]).astype(int)
        inner = np.rint(corner + 0.45 * (np.array([half, half]) - corner)).astype(int)
        low, high = np.minimum(corner, inner) - 8 * (corner < inner), np.maximum(corner, inner)
        high = high + 8 * (corner > inner)
        spoiled[max(low[1], 0) : high[1], max(low[0], 0) : high[0]] = 130
        whole, _, sure = fitted(image, camera, true, 11, 0.2)
        error, covariances, good = fitted(spoiled, camera, true, 11, 0.2)
        assert sure
        assert good
        assert np.linalg.norm(error - whole, axis=1).max() < 6 * np.sqrt(covariances.max()) + 0.02


@pytest.mark.parametrize("seed", [1, 2, 6, 7])
def test_a_marker_that_is_half_covered_spoils_no_other(seed):
    rng = np.random.default_rng(seed)
    camera, image, true = close_up(rng, random_marker(rng, 4.0), 7)
    flat = Flat(camera.parameters)
    start, half = flat.from_image(true), image.shape[0] // 2
    side, off = rng.integers(4), int(rng.integers(-6, 7))
    parts = np.s_[:, : half + off], np.s_[:, half + off :], np.s_[: half + off], np.s_[half + off :]
    covered = image.copy()
    shade = rng.integers(60, 200) + rng.normal(0, 3, covered[parts[side]].shape)
    covered[parts[side]] = np.clip(shade, 0, 255)
    both = np.concatenate([image, covered], axis=1)
    starts = np.stack([start + 0.2, start + np.array([image.shape[1], 0]) + 0.3])
    bits = np.repeat(APRIL.bits(7).reshape(1, APRIL.cells, APRIL.cells), 2, axis=0)
    fits = fit_prints(both, starts, bits, np.full((2, 2), 0.5), flat)
    # Steps of the covered one go on and on: all that was fitted beside it was lost with it.
    assert fits.good[0]
    assert np.linalg.norm(flat.to_image(fits.corners[0]) - true, axis=1).max() < 0.15


def test_another_print_is_not_taken_for_this_one():
    rng = np.random.default_rng(5)
    camera, image, true = close_up(rng, random_marker(rng, 5.0), 7)
    _, _, good = fitted(image, camera, true, 7, 0.1)
    assert good
    for other in (8, 9, 10):
        _, _, good = fitted(image, camera, true, other, 0.1)
        assert not good


def test_nothing_to_fit_is_no_fit():
    rng = np.random.default_rng(6)
    camera, image, true = close_up(rng, random_marker(rng, 5.0), 7)
    for nothing in (np.full_like(image, 120), rng.integers(0, 255, image.shape, dtype=np.uint8)):
        start_kept, _, good = fitted(nothing, camera, true, 7, 0.0)
        assert not good
        np.testing.assert_allclose(start_kept, 0.0, atol=1e-6)
    _, _, good = fitted(image, camera, true + 1e5, 7, 0.0)
    assert not good
    _, _, good = fitted(image, camera, np.full((4, 2), np.nan), 7, 0.0)
    assert not good


@pytest.mark.parametrize("family", [Family(ARTOOLKITPLUS), Family("4X4_50", 2), Family("7X7_50")])
def test_every_family_is_fitted(family):
    rng = np.random.default_rng(9)
    for number in (3, 40):
        T = random_marker(rng, 4.0 * SIDE * 8 / family.cells / 0.156)
        image, true = marker_image(rng, T, number, Optics(rays=64), family)
        views = detect_markers(image, family, None, [number]).views
        assert [view.number for view in views] == [number]
        assert np.linalg.norm(views[0].corners - true, axis=1).max() < 0.15


@pytest.mark.parametrize("cell", [1.7, 2.5, 3.4, 4.2, 6.0])
def test_boundaries_out_of_reach_change_nothing(cell):
    # A step is done to ndtr(-2.8) = 0.26 % where blur no longer reaches it, from either side.
    cells = np.pad(np.random.default_rng(3).integers(0, 2, (8, 8)).astype(float), PADDING)[None]
    x, y = np.meshgrid(*2 * [np.linspace(-1.1, 1.1, 60)])
    along, blur = np.full((1, x.size), 2 / (8 * cell)), np.array([0.76])
    at = Places(x.reshape(1, -1), y.reshape(1, -1), along, along, np.zeros((1, x.size)))
    count = int(boundaries_in_reach(blur, along[:, 0], 8)[0])
    near = whiteness(cells, at, blur, (count, count)).white
    all_of_them = whiteness(cells, at, blur, (9, 9)).white
    # Two axes, and two boundaries at the worst place between them.
    assert np.abs(near - all_of_them).max() < 4 * 0.0026


@pytest.mark.parametrize(("amount", "radius"), [(1.0, 1.0), (0.5, 3.0), (1.0, 5.0), (1.0, 2.0)])
def test_corners_of_prints_that_were_sharpened_are_right(amount, radius):
    # Rims of one cell, so that the halo of what is behind them lies on them, too.
    rng = np.random.default_rng(17)
    errors, stated = [], []
    for _ in range(6):
        number = int(rng.integers(200))
        camera, image, true = close_up(rng, random_marker(rng, 4.0), number)
        light = image.astype(float)
        light += amount * (light - cv2.GaussianBlur(light, (0, 0), radius))
        sharpened = np.clip(np.rint(light), 0, 255).astype(np.uint8)
        (view,) = detect_markers(sharpened, APRIL, camera, [number]).views
        errors.append(view.corners - true)
        stated.append(np.trace(view.covariances, axis1=1, axis2=2).sum())
    rms = np.sqrt(np.mean(np.square(errors)))
    assert rms < 0.06
    # Eight numbers a marker, of which two are independent: 12 in all. That the halo of what is
    # behind the rim is in no sigma makes them too small, by up to a third: not more.
    assert np.sqrt(np.mean(stated) / 8) > rms / np.sqrt(chi2.ppf(1 - 1e-3, 12) / 12) / 1.5


def test_where_no_fit_of_a_sharpened_image_holds_the_plain_one_stays(monkeypatch):
    """A fit that failed has a misfit without bound: nothing is compared, and nobody is warned."""
    rng = np.random.default_rng(5)
    camera, image, true = close_up(rng, random_marker(rng, 3.0), 11)
    bits = APRIL.bits(11).reshape(1, APRIL.cells, APRIL.cells)
    plain = corners.refine_corners(image, true[None], bits, camera.parameters)
    fit = corners.fit_sharpened

    def without_sharpened(image, start, *others):
        found = fit(image, start, *others)
        found[np.arange(1, len(start))] = _unfitted(start[1:])
        return found

    monkeypatch.setattr(corners, "_SHARPENED", -np.inf)
    monkeypatch.setattr(corners, "fit_sharpened", without_sharpened)
    found = corners.refine_corners(image, true[None], bits, camera.parameters)
    np.testing.assert_array_equal(found.corners, plain.corners)
