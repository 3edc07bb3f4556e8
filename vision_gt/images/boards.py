"""Boards in images: corners found by OpenCV, their order made the board's own."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from vision_gt.images.charuco import as_printed, charuco_corners
from vision_gt.images.chessboards import classic, dark_rim, is_another, sector, starts
from vision_gt.images.other_boards import as_named, what_instead
from vision_gt.images.saddles import refine_saddles
from vision_gt.patterns.boards import Board
from vision_gt.patterns.rejections import Rejection, hull, rejected

Image = npt.NDArray[np.uint8]
Ints = npt.NDArray[np.intp]
Detector = Literal["fitted", "classic", "sector"]

_LEAST_CORNERS = 8
"""A judgement: twice what a pose needs."""
_STOCK_WINDOW = 11
"""Half window of the sub-pixel refinement in OpenCV's own samples."""
STOCK_SIGMA = 1.0
"""Pixels; of a coordinate of OpenCV's corners where none could be fitted: boards that are far,
strongly blurred or noisy. Of 13 such boards, drawn with blur of 0.7 to 4 px and noise of 8 to 30
grey levels, the root mean square error was 0.3 to 2.6, in the middle 0.9."""
_LEAST_SIGMA = 0.004
"""Pixels; what the print and the model of the blur add to each fitted corner: a judgement, a tenth
of the usual noise of OpenCV's corners."""
_CLEAR, _CLEAR_OF_CORNERS = 0.64, 0.4
"""Radius of the fit over the difference of the sides of square and marker, and over the square's
side. On a ChArUco board the next marker's corner is 0.707 of that difference away, on a plain one
the next corner a whole side."""
_LEAST_SEEN = 4
"""Corners of a ChArUco board, which are known by their ids: so many give a pose."""
_WRONG, _WRONG_SHARE = 3.0, 0.08
"""Pixels, and sides of a square, that a corner may be from where its neighbours have it."""
_ROUGH = "it could not be fitted (glare, blur, something over it): 1 px is assumed"
_ELSEWHERE = "it is not where its neighbours on the board have it; not used"
_DARK_RIM = (
    "perhaps printed white on black, as its rim is dark: then state inverted = true, or it is read "
    "turned by half a turn"
)
_STOP = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-4)


@dataclass(frozen=True)
class FoundBoard:
    """Corners of a board in an image.

    Parameters
    ----------
    ids : (n,) array of int
        Which corners.
    pixels : (n, 2) array
        Where.
    sigmas : (n,) array, optional
        Standard deviation of each coordinate, pixels, where it is known.
    instead : str
        What the board is where it is not the stated one, though its corners are found.
    """

    ids: Ints
    pixels: Array
    sigmas: Array | None = None
    instead: str = ""


@dataclass(frozen=True)
class BoardLook:
    """What an image shows of some boards.

    Parameters
    ----------
    found : tuple of FoundBoard or None
        One for each board.
    rejected : tuple of Rejection
        Boards that are other ones, and corners that were not used or are rough.
    instead : str
        What the board is where it is not the stated one ('inverted', 'mirrored', ...), whether it
        could be read or not; '' where all is as stated.
    """

    found: tuple[FoundBoard | None, ...]
    rejected: tuple[Rejection, ...] = ()
    instead: str = ""


def find_board(image: Image, board: Board, detector: Detector = "fitted") -> FoundBoard | None:
    """Corners of a board in an image; None if it is not found.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    board : Board
        What to look for. A plain chessboard is found whole or not at all, and one that looks
        the same after half a turn may come out either way round.
    detector : {"fitted", "classic", "sector"}
        For plain chessboards: this package's fit of each corner, OpenCV's first detector with
        its sub-pixel refinement, or OpenCV's sector-based one (Duda and Frese, 2018). The fit
        starts from the first, or where that finds nothing from the second. Where that is not
        enough, all that OpenCV's detectors offer is tried, and its corners are taken, with the
        standard deviation that they have, where no fit succeeds.
    """
    if board.family is not None:
        return _find_charuco(image, board)[0]
    numbers = np.arange(len(board.corners))
    if detector == "classic":
        pixels = classic(image, board)
        if pixels is not None:
            pixels = _in_board_order(image, _refined(image, pixels, _STOCK_WINDOW), board)
        return None if pixels is None else FoundBoard(numbers, pixels)
    if detector == "sector":
        pixels = sector(image, board)
        return (
            None if pixels is None else FoundBoard(numbers, _in_board_order(image, pixels, board))
        )
    stock = None
    for start in starts(image, board):
        pixels = _in_board_order(image, start, board)
        fitted = _fitted(image, numbers, pixels, board, _CLEAR_OF_CORNERS)
        if fitted is not None:
            return fitted
        stock = pixels
    if stock is None:
        return None
    half = _half_window(stock, board)
    return FoundBoard(numbers, _refined(image, stock, half), np.full(len(stock), STOCK_SIGMA))


def look_for_boards(
    image: Image, boards: Sequence[Board], detector: Detector = "fitted", perhaps: str = ""
) -> BoardLook:
    """The boards of an image, and what is there instead where none of them is.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    boards : sequence of Board
        Any of which may be there.
    detector : {"fitted", "classic", "sector"}
        As for `find_board`.
    perhaps : str
        What other images show where these boards were stated: then that alone is looked for, as
        the search for anything else takes seconds.
    """
    if perhaps and all(board.family is None for board in boards):
        likely = _as_others(image, boards, perhaps, [])
        if likely.instead:
            return likely
    found, left, strange = _stated(image, boards, detector)
    if strange or any(one is not None for one in found):
        said = strange or _perhaps_inverted(image, boards, found)
        return BoardLook(found, left, said)
    return _as_others(image, boards, perhaps, left) if perhaps else _instead(image, boards, left)


def _stated(
    image: Image, boards: Sequence[Board], detector: Detector
) -> tuple[tuple[FoundBoard | None, ...], tuple[Rejection, ...], str]:
    """The stated boards, what was left out, and what one of them is that is read but not right."""
    found: list[FoundBoard | None] = []
    left: list[Rejection] = []
    strange = ""
    for board in boards:
        if board.family is None:
            found.append(_plain(image, board, detector))
            continue
        one, rest = _find_charuco(image, board, boards)
        if one is not None and one.instead:
            strange, rest = one.instead, [rejected("board", one.instead, None, hull(one.pixels))]
            one = None
        found.append(one)
        left += rest
    return tuple(found), tuple(left), strange


def _instead(image: Image, boards: Sequence[Board], left: Sequence[Rejection]) -> BoardLook:
    """What an image shows that has none of the stated boards."""
    nothing = (None,) * len(boards)
    for place, board in enumerate(boards):
        instead = what_instead(image, board, boards)
        if instead is None:
            continue
        if instead.board is not None:
            one, rest = _find_charuco(image, instead.board)
            if one is not None:
                found = (*nothing[:place], one, *nothing[place + 1 :])
                return BoardLook(found, tuple(rest), instead.name)
        told = rejected("board", instead.name, None, instead.outline)
        return BoardLook(nothing, (*left, told), instead.name)
    return BoardLook(nothing, tuple(left))


def _plain(image: Image, board: Board, detector: Detector) -> FoundBoard | None:
    """A plain board; None if it is not found or is another one."""
    one = find_board(image, board, detector)
    if one is None or is_another(image, board, one.ids, one.pixels, one.sigmas):
        return None
    return one


def _as_others(
    image: Image, boards: Sequence[Board], name: str, left: Sequence[Rejection]
) -> BoardLook:
    """Whether an image without the stated boards shows what others show."""
    for board in boards:
        other = as_named(board, name)
        if other is None:
            continue
        plain = other.family is None
        seen = _plain(image, other, "fitted") if plain else _find_charuco(image, other)[0]
        if seen is not None:
            told = rejected("board", name, None, hull(seen.pixels))
            return BoardLook((None,) * len(boards), (*left, told), name)
    return BoardLook((None,) * len(boards), tuple(left))


def _perhaps_inverted(
    image: Image, boards: Sequence[Board], found: Sequence[FoundBoard | None]
) -> str:
    """What is said of a plain board with a dark rim, whose first corner hangs on its colours."""
    for board, one in zip(boards, found, strict=True):
        plain = one is not None and board.family is None and not board.inverted
        if not plain or one is None or board.looks_the_same_turned:
            continue
        if dark_rim(image, board, one.ids, one.pixels):
            return _DARK_RIM
    return ""


def _half_window(pixels: Array, board: Board) -> int:
    """Half window of a refinement that keeps clear of the neighbouring corners."""
    nx, ny = board.inner
    grid = pixels.reshape(ny, nx, 2)
    sides = (np.linalg.norm(np.diff(grid, axis=k), axis=-1).min() for k in (0, 1))
    return int(np.clip(_CLEAR_OF_CORNERS * min(sides), 2, _STOCK_WINDOW))


def _fitted(
    image: Image, numbers: Ints, pixels: Array, board: Board, radius: float
) -> FoundBoard | None:
    """The corners that can be fitted; None if they are too few."""
    axes = _square_sides(board.corners[numbers, :2] / board.square, pixels)
    if axes is None:
        return None
    fit = refine_saddles(image, pixels, axes, radius)
    if fit.good.sum() < _LEAST_CORNERS:
        return None
    sigmas = np.hypot(fit.sigmas, _LEAST_SIGMA)
    return FoundBoard(numbers[fit.good], fit.pixels[fit.good], sigmas[fit.good])


def _refined(image: Image, corners: Array, half: int) -> Array:
    """OpenCV's sub-pixel corners, with windows of 2 half + 1 pixels."""
    start = corners.astype(np.float32).reshape(-1, 1, 2)
    refined = cv2.cornerSubPix(image, start, (half, half), (-1, -1), _STOP)
    return np.array(refined, dtype=float).reshape(-1, 2)


def _in_board_order(image: Image, pixels: Array, board: Board) -> Array:
    """Corners in the order of a board seen from its printed side, black square first.

    Detectors may start at any of a board's ends and may run the other way round.
    """
    nx, ny = board.inner
    grid = pixels.reshape(ny, nx, 2)
    along, down = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
    if along[0] * down[1] - along[1] * down[0] < 0:
        grid = grid[::-1]
    if not board.looks_the_same_turned and not _starts_black(image, grid, board):
        grid = grid[::-1, ::-1]
    return grid.reshape(-1, 2)


def _starts_black(image: Image, grid: Array, board: Board) -> bool:
    """Whether the squares of the colour of the first inner one are black.

    The square between the first four inner corners has the colour of the outer corner square,
    which is black at the first corner of the board.
    """
    middles = (grid[:-1, :-1] + grid[1:, :-1] + grid[:-1, 1:] + grid[1:, 1:]) / 4
    column, row = np.rint(middles).astype(int).reshape(-1, 2).T
    inside = (column >= 0) & (column < image.shape[1]) & (row >= 0) & (row < image.shape[0])
    y, x = np.mgrid[: middles.shape[0], : middles.shape[1]]
    like_first = ((x + y) % 2 == 0).ravel()[inside]
    grey = image[row[inside], column[inside]].astype(float)
    return bool((grey[like_first].mean() < grey[~like_first].mean()) != board.inverted)


def _find_charuco(
    image: Image, board: Board, beside: Sequence[Board] = ()
) -> tuple[FoundBoard | None, list[Rejection]]:
    """A ChArUco board: fitted corners; those of OpenCV's that no fit explains are kept, rougher."""
    start = charuco_corners(image, board, beside)
    if start is None:
        return None, []
    ids, stock = start.ids, start.pixels
    axes = _square_sides(board.corners[ids, :2] / board.square, stock)
    if axes is None:
        return None, []
    # A marker's corner is nearest along the diagonal of a square.
    radius = min(_CLEAR * (board.square - board.marker_side) / board.square, _CLEAR_OF_CORNERS)
    fit = refine_saddles(as_printed(image, board), stock, axes, radius)
    # What is only foretold, and not there, is covered.
    seen = fit.good | ~start.foretold
    fit, ids, stock, axes = fit.of(seen), ids[seen], stock[seen], axes[seen]
    if len(ids) < _LEAST_SEEN:
        return None, []
    foretold = start.foretold[seen]
    pixels = np.where(fit.good[:, None], fit.pixels, stock)
    sigmas = np.where(fit.good, np.hypot(fit.sigmas, _LEAST_SIGMA), STOCK_SIGMA)
    side = float(np.linalg.norm(axes, axis=1).min())
    off = _off_neighbours(board.corners[ids, :2] / board.square, pixels)
    limit = max(_WRONG, _WRONG_SHARE * side)
    again = _off_neighbours(board.corners[ids, :2] / board.square, stock)
    # A fit that ran to something else: OpenCV's own corner may still be right.
    back = (off > limit) & (again <= limit) & ~foretold
    pixels[back], sigmas[back] = stock[back], STOCK_SIGMA
    wrong = (off > limit) & ~back
    left = [
        rejected("corner", _ROUGH, int(ids[i]), pixels[i]) for i in np.flatnonzero(~fit.good | back)
    ]
    left += [rejected("corner", _ELSEWHERE, int(ids[i]), pixels[i]) for i in np.flatnonzero(wrong)]
    kept = ~wrong
    if kept.sum() < _LEAST_SEEN:
        return None, left
    return FoundBoard(ids[kept], pixels[kept], sigmas[kept], start.instead), left


def _off_neighbours(squares: Array, pixels: Array) -> Array:
    """(n,) pixels of corners from where their nearest neighbours on the board have them.

    As even boards and lenses over a few squares are as good as a homography with a bend of the
    second degree would be, the nearest twelve corners are enough; 0 where there are too few.
    """
    off = np.zeros(len(pixels))
    if len(pixels) <= _LEAST_SEEN:
        return off
    H, _ = cv2.findHomography(squares, pixels, cv2.RANSAC, _WRONG)
    if H is None:
        return off
    off = np.asarray(np.linalg.norm(_mapped(np.asarray(H, dtype=float), squares) - pixels, axis=1))
    for i in np.flatnonzero(off > _WRONG / 2):
        near = np.argsort(np.linalg.norm(squares - squares[i], axis=1))[1:13]
        local, _ = cv2.findHomography(squares[near], pixels[near], cv2.LMEDS)
        if local is not None:
            off[i] = float(
                np.linalg.norm(_mapped(np.asarray(local, dtype=float), squares[[i]]) - pixels[[i]])
            )
    return off


def _mapped(H: Array, points: Array) -> Array:
    """Points (n, 2) through a homography."""
    ahead = points @ H[:, :2].T + H[:, 2]
    return np.asarray(ahead[:, :2] / ahead[:, 2:], dtype=float)


def _square_sides(squares: Array, pixels: Array) -> Array | None:
    """(n, 2, 2) sides of a square at each corner, pixels, from a homography; None without one."""
    H, _inliers = cv2.findHomography(squares, pixels, cv2.RANSAC, 5.0)
    if H is None:
        return None
    points = np.column_stack([squares, np.ones(len(squares))]) @ H.T
    image, depth = points[:, :2], points[:, 2:]
    # d (u / w) = (du - (u / w) dw) / w
    sides = (H[:2, :2] - (image / depth)[:, :, None] * H[2, :2]) / depth[:, :, None]
    return np.asarray(sides)
