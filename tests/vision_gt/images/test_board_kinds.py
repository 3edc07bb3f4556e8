"""Boards that are not the stated ones are read, or named for what they are."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from pydantic import ValidationError

from validation.errors import GtvalError
from vision_gt.images.boards import look_for_boards
from vision_gt.images.chessboards import grid_of_circles, without_rim
from vision_gt.images.jobs import BoardJob, detect_in
from vision_gt.images.kept import KeptDetections
from vision_gt.images.other_boards import named_for_all
from vision_gt.images.wrong_boards import boards_in
from vision_gt.patterns.boards import Board
from vision_gt.patterns.dictionaries import Family
from vision_gt.settings import BoardSettings

STATED = Board(8, 6, 0.05, Family("4X4_100"))
PIXELS = 56


def photograph(board, *, mirrored=False, cover=0.0, sharpen=0.0, rim=1):
    """A board seen a little from the side, its inner corners where they are."""
    cells, side = board.cells()
    times = round(PIXELS * side / board.square * 4)
    texture = np.kron(np.pad(cells, 3, constant_values=rim), np.ones((times, times))) * 165.0 + 40
    if mirrored:
        texture = texture[:, ::-1]
    if cover:
        texture[:, : int(cover * texture.shape[1])] = 110.0
    height, width = texture.shape
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=np.float32)
    seen = np.array([[60, 50], [600, 80], [580, 440], [90, 420]], dtype=np.float32) * 4
    H = cv2.getPerspectiveTransform(corners, seen)
    large = cv2.warpPerspective(texture.astype(np.float32), H, (640 * 4, 480 * 4), borderValue=110)
    image = cv2.GaussianBlur(
        cv2.resize(large, (640, 480), interpolation=cv2.INTER_AREA), (0, 0), 0.6
    )
    image += sharpen * (image - cv2.GaussianBlur(image, (0, 0), 1.0))
    image += 2 * np.random.default_rng(1).standard_normal(image.shape)
    points = (board.corners[:, :2] + board.square) / side + 3
    ahead = cv2.perspectiveTransform((points * times - 0.5)[None].astype(np.float64), H)[0]
    return np.clip(np.rint(image), 0, 255).astype(np.uint8), (ahead + 0.5) / 4 - 0.5


def missed(found, true):
    return np.linalg.norm(found.pixels - true[found.ids], axis=1)


@pytest.mark.parametrize(
    ("shown", "said"),
    [
        (STATED, ""),
        (replace(STATED, inverted=True), "inverted"),
        (replace(STATED, legacy=True), "legacy layout"),
        (replace(STATED, inverted=True, legacy=True), "inverted, legacy layout"),
    ],
)
def test_inverted_boards_and_those_of_the_older_layout_are_read(shown, said):
    image, true = photograph(shown)
    look = look_for_boards(image, [STATED])
    assert look.instead == said
    assert len(look.found[0].ids) == len(true)
    assert missed(look.found[0], true).max() < 0.2
    # Stated as it is there is nothing to say.
    assert look_for_boards(image, [shown]).instead == ""


@pytest.mark.parametrize("legacy", [False, True])
@pytest.mark.parametrize("columns", [5, 7])
def test_a_layout_that_is_the_stated_one_a_square_aside_is_told_from_it(columns, legacy):
    # With an odd number of columns and an even one of rows all markers but those of one column
    # lie in the other layout as they do in the stated one, a square to the side.
    stated = Board(columns, 6, 0.05, STATED.family, legacy=legacy)
    image, true = photograph(replace(stated, legacy=not legacy))
    look = look_for_boards(image, [stated])
    assert look.instead == ("the newer layout" if legacy else "legacy layout")
    assert missed(look.found[0], true).max() < 0.2


@pytest.mark.parametrize(
    ("shown", "mirrored", "said"),
    [
        (STATED, True, "mirrored"),
        (Board(6, 8, 0.05, STATED.family), False, "rows and columns exchanged"),
        (Board(8, 6, 0.05, Family("5X5_100")), False, "5X5_50 where 4X4_100 was stated"),
        (Board(8, 6, 0.05, Family("6X6_250")), False, "6X6_50 where 4X4_100 was stated"),
        (Board(8, 6, 0.05, Family("APRILTAG_36h11")), False, "APRILTAG_36H11 where"),
    ],
)
def test_other_boards_are_named_and_not_used(shown, mirrored, said):
    image, _ = photograph(shown, mirrored=mirrored)
    look = look_for_boards(image, [STATED])
    assert look.found == (None,)
    assert said in look.instead
    assert [one.kind for one in look.rejected] == ["board"]
    assert 0 < look.rejected[0].place[0] < 640


@pytest.mark.parametrize("family", ["5X5_250", "7X7_50", "ARUCO_MIP_36h12", "APRILTAG_25h9"])
def test_boards_of_any_family_are_read_as_stated(family):
    board = Board(6, 5, 0.06, Family(family), marker=0.045)
    image, true = photograph(board)
    look = look_for_boards(image, [board])
    assert look.instead == ""
    assert len(look.found[0].ids) == len(true)


def test_a_partly_covered_board_keeps_what_is_seen():
    image, true = photograph(STATED, cover=0.45)
    look = look_for_boards(image, [STATED])
    assert 10 <= len(look.found[0].ids) < len(true)
    assert missed(look.found[0], true).max() < 0.3


@pytest.mark.parametrize("amount", [0.5, 1.5])
def test_sharpened_corners_are_kept_with_sigmas_that_hold(amount):
    image, true = photograph(STATED, sharpen=amount)
    found = look_for_boards(image, [STATED]).found[0]
    assert len(found.ids) == len(true)
    off = missed(found, true)
    assert off.max() < 0.2
    # Length of two coordinates, each with its sigma: neither far too good nor far too bad.
    assert 0.1 < np.mean((off / found.sigmas) ** 2) / 2 < 3


def test_circles_are_named():
    image = np.full((480, 640), 210, dtype=np.uint8)
    for x in range(9):
        for y in range(6):
            cv2.circle(image, (100 + 50 * x, 90 + 50 * y), 15, 40, -1, cv2.LINE_AA)
    look = look_for_boards(image, [Board(10, 7, 0.05)])
    assert "circles" in look.instead
    assert look.rejected[0].kind == "board"


@pytest.mark.parametrize("stated", [STATED, Board(9, 8, 0.05)])
def test_circles_in_turned_rows_are_no_chessboard(stated):
    image = np.full((480, 640), 210, dtype=np.uint8)
    for y in range(9):
        for x in range(4):
            cv2.circle(image, (150 + 80 * x + 40 * (y % 2), 70 + 40 * y), 17, 40, -1, cv2.LINE_AA)
    look = look_for_boards(cv2.GaussianBlur(image, (0, 0), 0.8), [stated])
    assert look.found == (None,)
    assert look.instead.startswith("an asymmetric grid of 4 x 9 circles")


def marker_grid(family, *, squares):
    """Markers side by side, 90 pixels apart, with black squares between their corners or not."""
    image = np.full((480, 640), 210, dtype=np.uint8)
    for number in range(20):
        x, y = 90 + 90 * (number % 5), 70 + 90 * (number // 5)
        drawn = cv2.aruco.generateImageMarker(Family(family).dictionary, number, 64)
        image[y : y + 64, x : x + 64] = np.where(drawn > 0, 210, 40)
        if squares:
            image[y - 26 : y, x - 26 : x] = image[y + 64 : y + 90, x + 64 : x + 90] = 40
    return cv2.GaussianBlur(image, (0, 0), 0.8)


@pytest.mark.parametrize(("family", "squares"), [("4X4_50", False), ("APRILTAG_36h11", True)])
@pytest.mark.parametrize("stated", [STATED, Board(9, 6, 0.05)])
def test_a_grid_of_markers_is_no_charuco_board(family, squares, stated):
    look = look_for_boards(marker_grid(family, squares=squares), [stated])
    assert look.found == (None,)
    kind = "ChArUco board" if stated.family else "chessboard"
    assert look.instead == f"a grid of markers of {family.upper()}, not a {kind}"


def test_whatever_goes_wrong_in_an_image_is_its_note(monkeypatch, tmp_path):
    def fails(*_):
        raise cv2.error("more than 32,767 in a row")

    monkeypatch.setattr("vision_gt.images.jobs.look_for_boards", fails)
    job = BoardJob(tmp_path / "a.png", "1", "a", [(0, STATED)])
    image, _ = photograph(STATED)
    assert "32,767" in detect_in(image, job).note


def test_a_board_of_another_family_is_no_fault_of_one_that_is_there():
    image, _ = photograph(STATED)
    other = Board(8, 6, 0.05, Family("4X4_100"), first_id=50)
    look = look_for_boards(image, [STATED, other])
    assert look.instead == ""
    assert [one is not None for one in look.found] == [True, False]


def test_two_boards_of_one_family_in_an_image_are_both_read():
    other = Board(8, 6, 0.05, STATED.family, first_id=30)
    both = np.concatenate([photograph(STATED)[0], photograph(other)[0]], axis=1)
    look = look_for_boards(both, [STATED, other])
    assert [len(one.ids) for one in look.found] == [35, 35]
    mirrored = look_for_boards(np.ascontiguousarray(both[:, ::-1]), [STATED, other])
    assert (mirrored.instead, mirrored.found) == ("mirrored", (None, None))


CHESS = Board(10, 7, 0.05)


@pytest.mark.parametrize(
    ("shown", "stated", "said"),
    [
        (CHESS, Board(9, 6, 0.05), "a chessboard of 10 x 7 squares; 9 x 6 were stated"),
        (Board(9, 6, 0.05), CHESS, "of which 9 x 6 squares are seen; 10 x 7 were stated"),
        (Board(8, 6, 0.05), STATED, "a chessboard without markers of 4X4_100, 8 x 6 squares"),
        (Board(9, 7, 0.05, STATED.family), STATED, "a board of 9 squares along"),
        (Board(7, 5, 0.05, STATED.family), STATED, "a board of 7 squares along"),
        (replace(STATED, first_id=30), STATED, "ids begin at 30 or near, not at 0"),
    ],
    ids=["inner corners counted", "smaller", "no markers", "wider", "narrower", "other ids"],
)
def test_boards_of_other_squares_or_ids_are_named(shown, stated, said):
    look = look_for_boards(photograph(shown)[0], [stated])
    assert look.found == (None,)
    assert said in look.instead


@pytest.mark.parametrize(("begins", "stated"), [(16, 24), (32, 24), (8, 24), (0, 16)])
def test_ids_that_are_off_by_pairs_of_rows_are_named(begins, stated):
    """Two rows have as many markers as columns, so that two thirds of them seem to be right."""
    shown, wrong = replace(STATED, first_id=begins), replace(STATED, first_id=stated)
    look = look_for_boards(photograph(shown)[0], [replace(STATED, first_id=60), wrong])
    assert look.found == (None, None)
    assert f"ids begin at {begins} or near, not at {stated}; 8 x 6" in look.instead
    assert [one.kind for one in look.rejected] == ["board"]


def test_rows_beyond_the_stated_ones_do_no_harm():
    longer = replace(STATED, rows=10)
    image, true = photograph(longer)
    found = look_for_boards(image, [STATED])
    assert found.instead == ""
    assert len(found.found[0].ids) == 35
    assert missed(found.found[0], true).max() < 0.2


def test_an_image_with_too_little_to_tell_other_ids_is_not_used_either(tmp_path):
    paths = [tmp_path / f"{i}.png" for i in range(5)]
    shown, wrong = replace(STATED, first_id=16), replace(STATED, first_id=24)
    for i, path in enumerate(paths):
        image = photograph(shown)[0]
        if i == 4:
            image[:200] = 110  # the rows with the first ids
            assert look_for_boards(image, [wrong]).found[0] is not None
        cv2.imwrite(str(path), image)
    jobs = [BoardJob(path, "1", path.stem, [(0, wrong)]) for path in paths]
    found = boards_in(jobs, KeptDetections(tmp_path / "kept.jsonl"), 1)
    assert not any(one.boards for one in found)
    assert len({one.note for one in found}) == 1
    assert "ids begin at 16 or near, not at 24" in found[0].note


@pytest.mark.parametrize("turns", range(4))
def test_corners_on_the_rim_of_a_chessboard_are_none_of_its_own(turns):
    """OpenCV's detector of boards of any size takes them for corners now and then."""
    image, true = photograph(CHESS)
    nx, ny = CHESS.inner
    own = np.rot90(true.reshape(ny, nx, 2), turns)
    more = np.concatenate([own, 2 * own[:, -1:] - own[:, -2:-1]], axis=1)
    assert without_rim(image, more).shape == own.shape
    np.testing.assert_array_equal(without_rim(image, own), own)


def test_all_images_of_a_chessboard_of_other_squares_say_so(tmp_path):
    paths = [tmp_path / f"{i}.png" for i in range(6)]
    for path in paths:
        cv2.imwrite(str(path), photograph(CHESS)[0])
    jobs = [BoardJob(path, "1", path.stem, [(0, Board(9, 6, 0.05))]) for path in paths]
    found = boards_in(jobs, KeptDetections(tmp_path / "kept.jsonl"), 1)
    said = "the board is a chessboard of 10 x 7 squares; 9 x 6 were stated"
    assert {one.note for one in found} == {said}
    assert not any(one.boards for one in found)


def test_a_covered_chessboard_says_what_is_seen_of_it():
    look = look_for_boards(photograph(CHESS, cover=0.3)[0], [CHESS])
    assert "of which 9 x 7 squares are seen" in look.instead


def test_a_chessboard_in_white_on_black_is_told_by_its_rim():
    image, true = photograph(replace(CHESS, inverted=True), rim=0)
    look = look_for_boards(image, [CHESS])
    assert "printed white on black" in look.instead
    stated = look_for_boards(image, [replace(CHESS, inverted=True)])
    assert stated.instead == ""
    assert missed(stated.found[0], true).max() < 0.3
    assert look_for_boards(photograph(CHESS)[0], [CHESS]).instead == ""


@pytest.mark.parametrize("white_on_black", [False, True])
@pytest.mark.parametrize("stated", [CHESS, STATED], ids=["chessboard", "charuco"])
def test_grids_of_circles_are_named_whatever_was_stated(stated, white_on_black):
    image = np.full((480, 640), 210, dtype=np.uint8)
    for row in range(11):
        for column in range(4):
            place = (110 + 100 * column + 50 * (row % 2), 60 + 36 * row)
            cv2.circle(image, place, 13, 40, -1, cv2.LINE_AA)
    look = look_for_boards(255 - image if white_on_black else image, [stated])
    assert "an asymmetric grid of 4 x 11 circles" in look.instead


def test_markers_where_a_chessboard_was_stated_are_named():
    family = Family("APRILTAG_36h11")
    image = np.full((480, 640), 255, dtype=np.uint8)
    for row in range(4):
        for column in range(6):
            tag = cv2.aruco.generateImageMarker(family.dictionary, 6 * row + column, 70, None, 1)
            y, x = 40 + 105 * row, 30 + 98 * column
            image[y : y + 70, x : x + 70] = tag
    look = look_for_boards(image, [CHESS])
    assert "APRILTAG_36H11" in look.instead


@pytest.mark.parametrize("rows", [3, 4])
def test_small_boards_of_markers_are_read_and_missed_without_a_word_of_opencv(rows, tmp_path):
    small = Board(5, rows, 0.05, STATED.family)
    image, true = photograph(small)
    assert len(look_for_boards(image, [small]).found[0].ids) == len(true)
    nothing = np.random.default_rng(2).integers(60, 200, (480, 640)).astype(np.uint8)
    found = detect_in(nothing, BoardJob(tmp_path / "a.png", "1", "1", [(0, small)]))
    assert (found.boards, found.note) == ((), "")


def test_chessboards_too_small_for_any_detector_are_refused():
    with pytest.raises(GtvalError, match="10 x 3 squares is too small"):
        Board(10, 3, 0.1)
    with pytest.raises(ValidationError, match="10 x 3 squares is too small"):
        BoardSettings(columns=10, rows=3, square=0.1)


def test_a_little_of_the_bar_s_other_board_is_no_wrong_board():
    """Of which too few corners are seen for a pose: both boards of a bar are stated."""
    shown, other = STATED, replace(STATED, first_id=24)
    image, _ = photograph(shown, cover=0.62)
    kept = look_for_boards(image, [shown, other])
    assert kept.instead == ""


def test_one_name_explains_all_images_of_a_board_stated_wrongly(tmp_path):
    """Also where an image shows too little of it to be named by itself, and ids are misread."""
    paths = [tmp_path / f"{i}.png" for i in range(6)]
    for i, path in enumerate(paths):
        board = replace(STATED, first_id=30 * (i % 2))
        cv2.imwrite(str(path), photograph(board, cover=0.5 * (i == 5))[0])
    wrong = [(k, replace(STATED, family=Family("5X5_100"), first_id=30 * k)) for k in (0, 1)]
    jobs = [BoardJob(path, "1", path.stem, wrong) for path in paths]
    found = boards_in(jobs, KeptDetections(tmp_path / "kept.jsonl"), 1)
    assert {one.note for one in found} == {"the board is 4X4_100 where 5X5_100 was stated"}
    assert not any(one.boards for one in found)


@pytest.mark.parametrize(
    ("names", "name"),
    [
        (["4X4_50 where 5X5_50 was stated", "4X4_100 where 5X5_50 was stated"], 1),
        (["mirrored"], 0),
    ],
)
def test_the_name_for_all_is_the_smallest_that_has_all_ids(names, name):
    assert named_for_all(names) == names[name]


def test_corners_beside_a_marker_that_cannot_be_read_are_found_from_the_others():
    board = Board(7, 5, 0.08, Family("4X4_100"), 0, 0.06)
    drawn = board.charuco().generateImage((700, 500))
    image = np.pad(np.array(drawn), 60, constant_values=255)
    image = cv2.GaussianBlur(image, (0, 0), 1.0)
    x, y = 60 + 100 * 3 + 50, 60 + 100 * 2 + 50
    # The middle of a square with a marker, and what is printed on it, covered.
    whole = look_for_boards(image, [board]).found[0]
    covered = image.copy()
    covered[y - 40 : y + 40, x - 40 : x + 40] = 255
    (found,) = look_for_boards(covered, [board]).found
    assert whole is not None
    assert found is not None
    assert len(found.ids) == len(whole.ids) == 24
    assert np.abs(found.pixels - whole.pixels).max() < 0.05


@pytest.mark.parametrize("first", [1, 2, 5, 7, 10, 11, 20])
def test_a_board_whose_ids_begin_elsewhere_is_not_read_squares_aside(first):
    """Ten squares along, so five markers a row: shifts within a row agree for most of them."""
    image, _ = photograph(Board(10, 6, 0.1, Family("4X4_100"), first_id=first))
    look = look_for_boards(image, [Board(10, 6, 0.1, Family("4X4_100"))])
    assert look.found == (None,)
    assert f"ids begin at {first} or near, not at 0" in look.instead


@pytest.mark.parametrize("share", [0.45, 0.5])
def test_a_board_with_smaller_markers_than_stated_is_read_and_named(share):
    family = Family("4X4_100")
    image, true = photograph(Board(10, 6, 0.1, family, marker=share * 0.1))
    look = look_for_boards(image, [Board(10, 6, 0.1, family)])
    assert "of a square, not 0.75" in look.instead
    found = look.found[0]
    assert len(found.ids) > 0.9 * len(true)
    assert np.abs(found.pixels - true[found.ids]).max() < 0.5


def test_two_boards_with_the_same_ids_are_named():
    image, _ = photograph(STATED)
    look = look_for_boards(np.hstack([image, image]), [STATED])
    assert look.found == (None,)
    assert look.instead == "two boards with the same ids"


def test_a_floor_of_tiles_is_no_grid_of_circles():
    """More than 1,000 squares of a usual size, on which a search for circles took minutes."""
    tiles = np.kron(np.indices((40, 52)).sum(0) % 2, np.ones((24, 24)))
    noise = 2 * np.random.default_rng(0).standard_normal(tiles.shape)
    image = np.clip(cv2.GaussianBlur(50 + 150 * tiles, (0, 0), 0.8) + noise, 0, 255)
    assert grid_of_circles(image.astype(np.uint8)) is None
