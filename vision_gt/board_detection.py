"""Boards in images: corners found by OpenCV, their order made the board's own."""

from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt

from validation.angles import Array
from vision_gt.board_views import BoardView
from vision_gt.boards import Board

Image = npt.NDArray[np.uint8]
Ints = npt.NDArray[np.intp]
Detector = Literal["sector", "classic"]

_LEAST_CORNERS = 8
_STOP = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-4)


def find_board(
    image: Image, board: Board, detector: Detector = "classic"
) -> tuple[Ints, Array] | None:
    """Corners of a board in an image: their numbers (n,) and pixels (n, 2); None if not found.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    board : Board
        What to look for. A plain chessboard is found whole or not at all, and one that looks
        the same after half a turn may come out either way round.
    detector : {"classic", "sector"}
        For plain chessboards: OpenCV's first one with sub-pixel refinement, or the sector-based
        one (Duda and Frese, 2018), which takes a hundred times as long and is half as good on
        sharp images. Where the first finds nothing the second is tried.
    """
    if board.family is not None:
        return _find_charuco(image, board)
    pixels = _find_chessboard(image, board, detector)
    if pixels is None:
        return None
    return np.arange(len(board.corners)), _in_board_order(image, pixels, board)


def view_of_board(
    image: Image,
    board: Board,
    camera: str,
    body: str,
    *,
    part: int = 0,
    source: str = "",
    detector: Detector = "classic",
) -> BoardView | None:
    """The board as a view for the adjustments; None if it is not found.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    board : Board
        What to look for.
    camera, body, part, source
        As in `BoardView`.
    detector : {"classic", "sector"}
        For plain chessboards.
    """
    found = find_board(image, board, detector)
    return None if found is None else BoardView(camera, body, part, board, *found, source)


def _find_chessboard(image: Image, board: Board, detector: Detector) -> Array | None:
    size = board.inner
    if detector == "classic":
        flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
        flags |= cv2.CALIB_CB_FAST_CHECK
        found, corners = cv2.findChessboardCorners(image, size, flags=flags)
        if found:
            return _refined(image, np.array(corners, dtype=np.float32).reshape(-1, 2), board)
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
    found, corners = cv2.findChessboardCornersSB(image, size, flags=flags)
    return np.array(corners, dtype=float).reshape(-1, 2) if found else None


def _refined(image: Image, corners: npt.NDArray[np.float32], board: Board) -> Array:
    """Sub-pixel corners; the window keeps clear of the next corner."""
    grid = corners.reshape(board.inner[1], board.inner[0], 2)
    steps = [np.linalg.norm(np.diff(grid, axis=axis), axis=-1).min() for axis in (0, 1)]
    half = int(np.clip(0.4 * min(steps), 2, 11))
    refined = cv2.cornerSubPix(image, corners.copy(), (half, half), (-1, -1), _STOP)
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
    if not board.looks_the_same_turned and not _starts_black(image, grid):
        grid = grid[::-1, ::-1]
    return grid.reshape(-1, 2)


def _starts_black(image: Image, grid: Array) -> bool:
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
    return bool(grey[like_first].mean() < grey[~like_first].mean())


def _find_charuco(image: Image, board: Board) -> tuple[Ints, Array] | None:
    detector = cv2.aruco.CharucoDetector(board.charuco())
    corners, ids, _markers, _marker_ids = detector.detectBoard(image)
    if ids is None or len(ids) < _LEAST_CORNERS:
        return None
    start = np.array(corners, dtype=float).reshape(-1, 2)
    numbers = np.ravel(ids).astype(np.intp)
    half = int(np.clip(_CLEAR_OF_MARKERS * _spacing(start, numbers, board), 2, 8))
    refined = cv2.cornerSubPix(image, start.astype(np.float32), (half, half), (-1, -1), _STOP)
    return numbers, np.array(refined, dtype=float).reshape(-1, 2)


_CLEAR_OF_MARKERS = 0.11
"""Half window over the square's side: the next marker is 0.125 of it away."""


def _spacing(pixels: Array, numbers: Ints, board: Board) -> float:
    """Typical distance of neighbouring corners, pixels: the smaller of the two directions."""
    where = {int(n): p for n, p in zip(numbers, pixels, strict=True)}
    nx = board.inner[0]
    pairs = [
        [np.linalg.norm(where[n] - where[n + s]) for n in where if n + s in where] for s in (1, nx)
    ]
    known = [float(np.median(p)) for p in pairs if p]
    return min(known) if known else 20.0
