"""Codes are read where OpenCV gives up, and none is where there is none."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from vision_scenes import APRIL, opencv_markers

from vision_gt.images.boards import look_for_boards
from vision_gt.images.files import read_image
from vision_gt.images.markers import detect_markers
from vision_gt.images.reading import code_margins, read_codes, turned_corners, wrong_cells_allowed
from vision_gt.patterns.boards import Board
from vision_gt.patterns.dictionaries import Family
from vision_gt.prints.edge_samples import Flat, sampled
from vision_gt.prints.print_fit import fit_prints

REAL = Path(
    os.environ.get("GTVAL_REAL_DATA", Path(__file__).resolve().parents[4] / "shared" / "real")
)
PHOTOS = sorted((REAL / "vision" / "apriltag_photos").glob("*.png"))
WEBCAMS = REAL / "vision" / "webcam_charuco"
needs_photos = pytest.mark.skipif(not PHOTOS, reason=f"no photographs in {REAL}")
needs_webcams = pytest.mark.skipif(not WEBCAMS.is_dir(), reason=f"no webcams in {REAL}")
TAGS = {22, 24, 58, 85, 144, 198}


def drawn(family, number, cell, size):
    """A marker in white, and its corners."""
    bits = np.kron(np.pad(family.bits(number), 1, constant_values=1), np.ones((cell, cell)))
    image = np.full((size, size), 200, dtype=np.uint8)
    start = (size - len(bits)) // 2
    image[start : start + len(bits), start : start + len(bits)] = 40 + 160 * bits
    image = cv2.GaussianBlur(image, (0, 0), 0.8)
    low, high = start + cell - 0.5, start + len(bits) - cell - 0.5
    return image, np.array([[low, low], [high, low], [high, high], [low, high]])


@pytest.mark.parametrize("turn", range(4))
def test_a_code_is_read_at_any_turn(turn):
    image, corners = drawn(APRIL, 17, 5, 120)
    quad = np.roll(corners, -turn, axis=0)[None]
    reading = read_codes(image, quad, APRIL)
    assert reading.numbers.tolist() == [17]
    np.testing.assert_allclose(turned_corners(quad, reading)[0], corners)


def test_chance_reads_no_codes():
    """10,000 quadrangles with a border and any cells: at 2e-5 each, more than three are none."""
    rng = np.random.default_rng(2)
    cells = np.pad(np.zeros((8, 8)), 1, constant_values=1.0)
    wrong = 0
    for _ in range(25):
        page = np.tile(cells, (20, 20))
        inner = rng.integers(0, 2, (20, 6, 20, 6))
        page.reshape(20, 10, 20, 10)[:, 2:8, :, 2:8] = inner
        image = np.kron(40 + 160 * page, np.ones((3, 3))).astype(np.uint8)
        y, x = np.mgrid[:20, :20] * 30
        low = np.stack([x.ravel(), y.ravel()], -1)[:, None] + 2.5
        quads = low + 24.0 * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
        wrong += len(read_codes(image, quads, APRIL).rows)
    assert wrong <= 3
    assert wrong_cells_allowed(Family("4X4_50")) < 0


def test_any_number_of_places_is_sampled():
    ramp = np.tile(np.arange(200, dtype=np.uint8), (150, 1))
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0, 199, 70_000), rng.uniform(0, 149, 70_000)
    # Places are rounded to 1 / 32, levels to whole ones.
    np.testing.assert_allclose(sampled(ramp, x, y), x, atol=0.5 + 1 / 32)


def test_a_print_of_more_than_32767_pixels_is_fitted():
    image, corners = drawn(APRIL, 3, 40, 460)
    bits = APRIL.bits(3).reshape(1, APRIL.cells, APRIL.cells)
    fit = fit_prints(image, corners[None] + 0.4, bits, np.full((1, 2), 0.5), Flat(None))
    assert fit.good.all()
    np.testing.assert_allclose(fit.corners[0], corners, atol=0.05)


@needs_photos
def test_tags_in_photographs_are_found_as_often_as_by_opencv_and_no_other():
    for path in PHOTOS:
        plain = read_image(path)
        dim = np.rint(255 * (plain / 255.0) ** 1.6).astype(np.uint8)
        for image in (plain, dim, cv2.GaussianBlur(plain, (0, 0), 0.6)):
            own = detect_markers(image, APRIL).numbers
            assert len(own) >= len(opencv_markers(image, APRIL, "none"))
            assert set(own) <= TAGS


@needs_webcams
@pytest.mark.parametrize("camera", ["cam2", "cam3"])
def test_corners_of_webcams_that_sharpen_are_kept(camera):
    board = Board(4, 5, 0.054, Family("4X4_50"))
    detector = cv2.aruco.CharucoDetector(board.charuco())
    theirs = own = 0
    for path in sorted((WEBCAMS / camera).glob("*.png"))[6:]:
        image = read_image(path)
        corners, ids, _, _ = detector.detectBoard(255 - image)
        look = look_for_boards(image, [board])
        assert look.instead == "inverted"
        found = dict(zip(look.found[0].ids.tolist(), look.found[0].pixels, strict=True))
        theirs, own = theirs + len(ids), own + len(found)
        for number, corner in zip(np.ravel(ids).tolist(), corners.reshape(-1, 2), strict=True):
            if number in found:
                assert np.linalg.norm(found[number] - corner) < 3
    assert own >= 0.95 * theirs


def test_a_marker_that_looks_as_well_like_another_one_is_not_read():
    """ARUCO_ORIGINAL's ids 14 and 15 differ in few cells; those half way, nobody can tell."""
    family = Family("ARUCO_ORIGINAL")
    one, corners = drawn(family, 14, 8, 120)
    other, _ = drawn(family, 15, 8, 120)
    numbers = np.array([14])
    assert code_margins(one, corners[None], numbers, family)[0] > 3
    assert code_margins(other, corners[None], numbers, family)[0] < -3
    for share in (0.45, 0.5, 0.55):
        mixed = np.rint((1 - share) * one + share * other).astype(np.uint8)
        assert detect_markers(mixed, family).numbers == ()
