"""Cameras that moved are found out, cameras that did not are not accused."""

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation
from vision_scenes import board_view, camera

from data_samples.rendering.image import Optics, Scene, Sheet, render
from data_samples.rooms.cameras import CHESSBOARD, looking
from vision_gt.network.steadiness import Steadiness, _rigid_shift, board_move, image_move
from vision_gt.optics.transforms import perturbed

T_CAMERA = looking(np.array([0.0, -2.2, 2.2]), np.zeros(3))
BOARD = RigidTransform.from_components([-0.4, 0.2, 0], Rotation.from_rotvec([np.pi, 0, 0]))


def scene(cover: bool = False) -> Scene:
    """Paper strips on the floor, one of them covered by something that came later."""
    face_up = Rotation.from_rotvec([np.pi, 0, 0])
    sheets = [
        Sheet(
            np.array([[0.9, 0.1, 0.9]]),
            (0.2, 0.1),
            RigidTransform.from_components([x, y, 0.0], face_up),
        )
        for x, y in ((-1.5, -0.8), (0.8, -0.8), (-0.3, 0.2), (-1.2, 1.0), (0.9, 1.0))
    ]
    if cover:
        T = RigidTransform.from_components([0.6, 1.2, 0.01], face_up)
        sheets.append(Sheet(np.array([[0.8, 0.2], [0.2, 0.8]]), (0.4, 0.4), T))
    return Scene(sheets, texture=0.05)


def photographs(change, seed: int, *, cover: bool = False):
    rng = np.random.default_rng(seed)
    before = render(camera(), T_CAMERA, scene(), Optics(), rng)
    after = render(camera(), perturbed(T_CAMERA, np.array(change)), scene(cover), Optics(), rng)
    return before, after


def test_a_steady_camera_is_not_accused_even_if_something_was_put_down():
    for cover in (False, True):
        move = image_move(*photographs(np.zeros(6), 1, cover=cover))
        assert not move.moved
        assert np.linalg.norm(move.shift) < 0.1


def test_a_third_of_a_milliradian_is_found_out():
    move = image_move(*photographs([0, 0, 0, 0, 0, 0.0005], 2))
    # A turn about the vertical by 0.5 mrad shifts the image by some 0.35 px sideways.
    assert move.moved
    assert abs(move.shift[0]) == pytest.approx(0.35, abs=0.15)


def test_a_blank_image_does_not_tell():
    blank = np.full((960, 1280), 80, dtype=np.uint8)
    assert image_move(blank, blank) is None
    assert image_move(blank, blank[:100]) is None
    assert Steadiness("1", None, None, blank, blank).verdict == "not known"


def test_boards_put_back_are_accused_as_rarely_as_promised():
    accused = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        replaced = perturbed(BOARD, 0.001 * rng.standard_normal(6))
        views = [
            board_view(T_CAMERA, "1", CHESSBOARD, T, "b", 0, 0.05, rng) for T in (BOARD, replaced)
        ]
        second = views[1].turned() if seed % 2 else views[1]
        accused += board_move(views[0], second, camera()).moved
    # One in a thousand each: two or more among forty have a chance of one in a thousand.
    assert accused <= 1


def test_a_moved_camera_is_found_out_by_the_board():
    rng = np.random.default_rng(3)
    moved = perturbed(T_CAMERA, np.array([0.0, 0.0, 0.0, 0.004, 0.0, 0.004]))
    before = board_view(T_CAMERA, "1", CHESSBOARD, BOARD, "b", 0, 0.05, rng)
    after = board_view(moved, "1", CHESSBOARD, BOARD, "b", 0, 0.05, rng)
    assert board_move(before, after, camera()).moved


@pytest.mark.parametrize("tiles", [12, 30, 60])
def test_the_covariance_of_a_shift_is_that_of_its_errors(tiles):
    generator = np.random.default_rng(tiles)
    squares = []
    for _ in range(1000):
        places = generator.uniform(-600, 600, (tiles, 2))
        change, covariance = _rigid_shift(places, 3 * generator.normal(size=(tiles, 2)))
        squares.append(change @ np.linalg.solve(covariance, change))
    # Shifts far above the floor. Of what normal errors tell, Tukey's weights keep 98 % and say
    # that they keep 94.7 %.
    spread = np.sqrt(2 / 3000)
    assert 0.947 - 3 * spread < np.mean(squares) / 3 < 1 + 3 * spread
