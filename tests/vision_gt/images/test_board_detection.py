"""Boards that any of OpenCV's detectors finds are found, and their corners' sigmas are honest."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from vision_gt.images.boards import STOCK_SIGMA, find_board
from vision_gt.images.chessboards import is_another
from vision_gt.optics.camera import project
from vision_gt.patterns.boards import Board

BOARD = Board(columns=10, rows=6, square=0.1)
FOCAL, WIDTH, HEIGHT, FINER = 600.0, 640, 480, 4
LENS = np.array([FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2, 0, 0, 0, 0, 0])
PIXELS = 16
"""Of a square in the texture."""
N, X, A = cv2.CALIB_CB_NORMALIZE_IMAGE, cv2.CALIB_CB_EXHAUSTIVE, cv2.CALIB_CB_ACCURACY


def photograph(T, blur, noise, rng):
    """A board through a pinhole, by a warp of its texture at four times the size."""
    bits, square = BOARD.cells()
    texture = np.kron(np.pad(bits, 1, constant_values=1), np.ones((PIXELS, PIXELS))) * 170.0 + 40
    step = square / PIXELS
    start = -2 * BOARD.square + 0.5 * step
    to_board = np.array([[step, 0, start], [0, step, start], [0, 0, 1]])
    R = T.rotation.as_matrix()
    middle = [FINER * WIDTH / 2 - 0.5, FINER * HEIGHT / 2 - 0.5]
    K = np.array([[FINER * FOCAL, 0, middle[0]], [0, FINER * FOCAL, middle[1]], [0, 0, 1]])
    H = K @ np.column_stack([R[:, 0], R[:, 1], T.translation]) @ to_board
    size = (FINER * WIDTH, FINER * HEIGHT)
    large = cv2.warpPerspective(texture.astype(np.float32), H, size, borderValue=120)
    image = cv2.resize(large, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    image = cv2.GaussianBlur(image, (0, 0), blur) + noise * rng.standard_normal(image.shape)
    return np.clip(image, 0, 255).astype(np.uint8)


def bad_boards(count, seed):
    """Images of far, dim, blurred and noisy boards, and their true corners."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        blur, noise = rng.choice([0.7, 1.5, 2.5, 4]), rng.choice([2, 8, 16, 30])
        distance, tilt = rng.uniform(1.6, 7), rng.uniform(0.1, 1.1)
        around = rng.uniform(-np.pi, np.pi)
        lean = Rotation.from_rotvec(tilt * np.array([np.cos(around), np.sin(around), 0]))
        turn = Rotation.from_rotvec([0, 0, rng.uniform(-1, 1)])
        T = RigidTransform.from_components([0, 0, distance], lean * turn)
        T = T * RigidTransform.from_translation(-BOARD.corners.mean(0))
        yield photograph(T, blur, noise, rng), project(T.apply(BOARD.corners), LENS)


def found_by_opencv(image):
    """Whether any of OpenCV's detectors finds the board, with any of its usual flags."""
    for flags in (0, N, N | X | A):
        if cv2.findChessboardCornersSB(image, BOARD.inner, flags=flags)[0]:
            return True
    return cv2.findChessboardCorners(image, BOARD.inner)[0]


def check(count, seed):
    errors, missed, stock = [], 0, 0
    for image, true in bad_boards(count, seed):
        if not found_by_opencv(image):
            continue
        found = find_board(image, BOARD)
        missed += found is None
        if found is None or found.sigmas[0] != STOCK_SIGMA:
            continue
        stock += 1
        off = (found.pixels - both[found.ids] for both in (true, true[::-1]))
        errors.append(min(float(np.sqrt((one**2).mean())) for one in off))
    assert missed == 0
    assert stock > 0
    # One sigma stands for all bad boards: right in the middle, and for none less than a third.
    assert 0.3 * STOCK_SIGMA < np.median(errors) < 2 * STOCK_SIGMA
    assert max(errors) < 4 * STOCK_SIGMA


def test_bad_boards_that_opencv_finds_are_found():
    check(6, 3)


@pytest.mark.full
def test_many_bad_boards_that_opencv_finds_are_found():
    check(80, 4)


def test_nothing_is_found_where_nothing_is():
    rng = np.random.default_rng(1)
    image = np.clip(120 + 8 * rng.standard_normal((HEIGHT, WIDTH)), 0, 255).astype(np.uint8)
    assert find_board(image, BOARD) is None


@pytest.mark.parametrize("detector", ["fitted", "sector"])
def test_an_image_shows_the_same_after_others(detector):
    images = [image for image, _ in bad_boards(6, 11)]
    first = [find_board(image, BOARD, detector) for image in images]
    backwards = [find_board(image, BOARD, detector) for image in images[::-1]][::-1]
    assert any(one is not None for one in first)
    for one, other in zip(first, backwards, strict=True):
        assert (one is None) == (other is None)
        if one is not None and other is not None:
            assert one.pixels.tobytes() == other.pixels.tobytes()


def test_corners_of_which_some_were_passed_over_are_another_board():
    nx, ny = BOARD.inner
    x, y = np.meshgrid(np.arange(nx), np.arange(ny))
    image = np.full((HEIGHT, WIDTH), 210, dtype=np.uint8)
    squares = np.kron((np.indices((ny + 1, nx + 1)).sum(0) % 2) * 170 + 40, np.ones((30, 30)))
    image[50:, 30:][: squares.shape[0], : squares.shape[1]] = squares

    def another(columns, sigma):
        pixels = np.stack([60 + 30.0 * columns[x], 80 + 30.0 * y], -1).reshape(-1, 2)
        sigmas = np.full(nx * ny, sigma)
        return is_another(image, BOARD, np.arange(nx * ny), pixels, sigmas)

    whole = np.arange(nx)
    leap = whole + (whole > 4)
    assert not another(whole, 0.1)
    assert another(leap, 0.1)
    # Corners as rough as that tell nothing of the sort.
    rough = whole + 0.6 * (whole > 4)
    assert another(rough, 0.1)
    assert not another(rough, 3.0)
