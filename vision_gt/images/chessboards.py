"""Plain chessboards and grids of circles: what OpenCV finds, and whether it is the stated board.

The sector-based detector searches with random numbers, which OpenCV draws from one source for all
that a thread does. Each search begins that source anew, so that what an image shows depends on
the image alone, and not on what was looked at before.
"""

from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from vision_gt.patterns.boards import Board

Image = npt.NDArray[np.uint8]
Ints = npt.NDArray[np.intp]

_SEED = 0
_ALTERNATE = 0.95
"""Share of the squares beyond a side that go on as the board's own: cells of markers do not."""
_CLEARLY, _LEAST_SIDE = 0.65, 4
"""Of the way from one colour to the other, and squares in a row: a white rim has half of them
wrong."""
_GOES_ON = 0.6
"""Of the contrast by turns just before a side's corners, what is just beyond them: 0.92 to 1.05 on
26 photographs; -0.09 and 0.27 where the corners were on the rim, and all is alike beyond."""
_ROUND = 0.82
"""Of a blob, 4 pi area over the square of its rim: a square has 0.785, an ellipse of 2 to 1
0.84."""
_FEW_CIRCLES, _MOST_CIRCLES = 12, 400
"""Fewer blobs of one size are no grid; and more than 20 x 20 are a floor or a cloth, on which the
search for a grid would take minutes."""
_BY_TURNS = 0.7
"""Share of a found board's squares that are dark and light by turns: half of them by chance, three
quarters where there are markers in the light ones."""
_BESIDE, _MEET, _LEFT = 0.1, 0.3, 0.25
"""Sides of a square from a corner; how far from the middle of dark and light the grey level of
corners may be; and how much of the difference of squares is left beside them. On a chessboard
corners are in the middle whatever the blur; where overexposure parts dark squares, they still show
beside corners but for squares of less than some 8 px. Between circles both are light."""
_STRETCHED, _UNSURE, _UNEVEN = 1.5, 6.0, 0.05
"""A side of a square over the next one's, sigmas of a corner that it is longer by, and the share of
such sides from which on corners were passed over. In 26 photographs of boards at up to 45 degrees
no side was more than 1.16 of the next one; where a corner is passed over it is twice that long, and
one row of nine that is passed over makes a share of 0.1."""


def begin_anew() -> None:
    """Begin OpenCV's random numbers of this thread anew."""
    cv2.setRNGSeed(_SEED)


def starts(image: Image, board: Board) -> Iterator[Array]:
    """Corners (n, 2) by one detector of OpenCV after another, the quick ones first, pixels."""
    for find in (classic, _half_size, sector, _exhaustive, _patient):
        pixels = find(image, board)
        if pixels is not None:
            yield pixels


def classic(image: Image, board: Board, flags: int = cv2.CALIB_CB_FAST_CHECK) -> Array | None:
    """Corners (n, 2) by OpenCV's first detector, pixels; None where it finds no board."""
    flags |= cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    found, corners = cv2.findChessboardCorners(image, board.inner, flags=flags)
    return np.array(corners, dtype=float).reshape(-1, 2) if found else None


def _patient(image: Image, board: Board) -> Array | None:
    """The first detector without its quick look, which takes dim or blurred boards for none."""
    return classic(image, board, 0)


def sector(
    image: Image,
    board: Board,
    flags: int = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY,
) -> Array | None:
    """Corners (n, 2) by the sector-based detector, pixels; None where it finds no board."""
    begin_anew()
    found, corners = cv2.findChessboardCornersSB(image, board.inner, flags=flags)
    return np.array(corners, dtype=float).reshape(-1, 2) if found else None


def _exhaustive(image: Image, board: Board) -> Array | None:
    """The sector-based detector with all it has, then with nothing done to the grey levels."""
    flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    pixels = sector(image, board, flags)
    return sector(image, board, 0) if pixels is None else pixels


def _half_size(image: Image, board: Board) -> Array | None:
    """A start for the fit: half the size takes a quarter of the time."""
    half = cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    pixels = sector(np.asarray(half, dtype=np.uint8), board, cv2.CALIB_CB_NORMALIZE_IMAGE)
    return None if pixels is None else np.asarray(2 * pixels + 0.5)


def any_size(image: Image) -> Array | None:
    """(r, c, 2) corners of the largest chessboard that the sector-based detector finds, pixels."""
    flags = cv2.CALIB_CB_LARGER | cv2.CALIB_CB_NORMALIZE_IMAGE
    begin_anew()
    try:
        seen, corners, meta = cv2.findChessboardCornersSBWithMeta(image, (3, 3), flags)
    except cv2.error:
        return None
    if not seen:
        return None
    return np.asarray(corners, dtype=float).reshape(*np.asarray(meta).shape[:2], 2)


def grid_of_circles(image: Image) -> tuple[str, Array] | None:
    """What a grid of circles in an image is, in words, and its circles (n, 2); None for none."""
    for shown in (image, np.asarray(255 - image, dtype=np.uint8)):
        count = _alike_blobs(shown)
        if not _FEW_CIRCLES <= count <= _MOST_CIRCLES:
            continue
        sizes = [(n, count // n) for n in range(3, count // 3 + 1) if count % n == 0]
        for flag, name in (
            (cv2.CALIB_CB_SYMMETRIC_GRID, "a symmetric"),
            (cv2.CALIB_CB_ASYMMETRIC_GRID, "an asymmetric"),
        ):
            for across, down in sizes:
                begin_anew()
                seen, places = cv2.findCirclesGrid(shown, (across, down), flags=flag)
                if seen:
                    found = np.asarray(places, dtype=float).reshape(-1, 2)
                    return f"{name} grid of {across} x {down} circles", found
    return None


def _alike_blobs(image: Image) -> int:
    """How many dark blobs of about one size an image shows."""
    wanted = cv2.SimpleBlobDetector.Params()
    wanted.filterByCircularity, wanted.minCircularity = True, _ROUND
    found = cv2.SimpleBlobDetector.create(wanted).detect(image)
    sizes = np.array([one.size for one in found])
    if not len(sizes):
        return 0
    middle = np.median(sizes)
    return int(((sizes > middle / 2) & (sizes < 2 * middle)).sum())


def without_rim(image: Image, grid: Array) -> Array:
    """Corners (r, c, 2) without those on the rim of a board, beyond which no squares go on."""
    for _ in range(4):
        grid = np.rot90(grid)
        middle = (grid[:-1, -1] + grid[1:, -1]) / 2
        # A quarter of a square aside: the outermost squares of many prints are cut.
        aside = (middle - (grid[:-1, -2] + grid[1:, -2]) / 2) / 4
        column, row = np.rint(np.stack([middle - aside, middle + aside])).astype(int).T
        if min(column.min(), row.min()) < 0 or grid.shape[1] < _LEAST_SIDE:
            continue
        if column.max() >= image.shape[1] or row.max() >= image.shape[0]:
            continue
        steps = np.diff(image[row, column].astype(float), axis=0)
        inside, outside = (steps * (-1.0) ** np.arange(len(steps))[:, None]).mean(0)
        if -outside < _GOES_ON * inside if inside > 0 else -outside > _GOES_ON * inside:
            grid = grid[:, :-1]
    return grid


def is_another(
    image: Image, board: Board, numbers: Ints, pixels: Array, sigmas: Array | None = None
) -> bool:
    """Whether corners that were found are those of another plain board than the stated one.

    Its squares are not dark and light by turns, as where every second corner was passed over; or
    some are twice as long as the next, as where some corners were; or they go on beyond its rim:
    then it is a part of a larger board.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    board : Board
        The stated one.
    numbers : (n,) array of int
        Which of its corners were found.
    pixels : (n, 2) array
        Where.
    sigmas : (n,) array, optional
        Standard deviation of each coordinate, pixels, where it is known.
    """
    if _passed_over(board, numbers, pixels, sigmas):
        return True
    H, _ = cv2.findHomography(board.corners[numbers, :2] / board.square, pixels, cv2.RANSAC, 3.0)
    if H is None:
        return False
    nx, ny = board.inner
    inside = np.stack(np.meshgrid(np.arange(nx - 1), np.arange(ny - 1)), -1).reshape(-1, 2)
    level, seen = _levels(image, H, inside)
    even = inside.sum(1) % 2 == 0
    if not (seen & even).any() or not (seen & ~even).any():
        return False
    first, other = level[seen & even].mean(), level[seen & ~even].mean()
    lighter = level > (first + other) / 2
    by_turns = max((lighter == even)[seen].mean(), (lighter != even)[seen].mean()) >= _BY_TURNS
    if not by_turns or _apart(image, H, inside, (first, other)):
        return True
    along, down = np.arange(-1, nx), np.arange(-1, ny)
    sides = [np.column_stack([along, np.full(nx + 1, y)]) for y in (-2, ny)]
    sides += [np.column_stack([np.full(ny + 1, x), down]) for x in (-2, nx)]
    for side in sides:
        level, seen = _levels(image, H, side)
        share = (level - other) / (first - other)  # 1 where it is as the first square, 0 as others
        right = np.where(side.sum(1) % 2 == 0, share > _CLEARLY, share < 1 - _CLEARLY)
        if seen.sum() >= _LEAST_SIDE and right[seen].mean() >= _ALTERNATE:
            return True
    return False


def _apart(image: Image, H: Any, squares: Ints, levels: tuple[float, float]) -> bool:
    """Whether dark fields (n, 2) do not meet at their corners, as circles in turned rows do not.

    Parameters
    ----------
    image, H, squares
        As for `_levels`.
    levels : (float, float)
        Of the even and the odd squares.
    """
    first, other = levels
    at, seen = _levels(image, H, squares - 0.5)
    beside, _ = _levels(image, H, squares - 0.5 + _BESIDE)
    even = squares.sum(1) % 2 == 0
    if not (seen & even).any() or not (seen & ~even).any():
        return False
    share = abs((at[seen].mean() - other) / (first - other) - 0.5)
    left = (beside[seen & even].mean() - beside[seen & ~even].mean()) / (first - other)
    return bool(share > _MEET and left < _LEFT)


def _passed_over(board: Board, numbers: Ints, pixels: Array, sigmas: Array | None) -> bool:
    """Whether sides of squares are much longer than the next ones in their row."""
    nx, ny = board.inner
    grid = np.full((ny * nx, 3), np.nan)
    grid[numbers] = np.column_stack([pixels, np.zeros(len(pixels)) if sigmas is None else sigmas])
    uneven: list[Array] = []
    for rows in (grid.reshape(ny, nx, 3), grid.reshape(ny, nx, 3).swapaxes(0, 1)):
        sides = np.linalg.norm(np.diff(rows[..., :2], axis=1), axis=-1)
        shorter = np.minimum(sides[:, 1:], sides[:, :-1])
        longer = np.maximum(sides[:, 1:], sides[:, :-1])
        sigma = np.maximum(np.maximum(rows[:, 2:, 2], rows[:, 1:-1, 2]), rows[:, :-2, 2])
        seen = np.isfinite(shorter)
        uneven.append((longer > _STRETCHED * shorter + _UNSURE * sigma)[seen])
    every = np.concatenate(uneven)
    return bool(every.size and every.mean() > _UNEVEN)


def dark_rim(image: Image, board: Board, numbers: Ints, pixels: Array) -> bool:
    """Whether the rim around a plain board's squares is dark, as of a print in white on black.

    Parameters
    ----------
    image, board, numbers, pixels
        As for `is_another`.
    """
    H, _ = cv2.findHomography(board.corners[numbers, :2] / board.square, pixels, cv2.RANSAC, 3.0)
    if H is None:
        return False
    nx, ny = board.inner
    inside, _ = _levels(image, H, np.mgrid[: nx - 1, : ny - 1].reshape(2, -1).T)
    along, down = np.arange(-1, nx), np.arange(-1, ny)
    # A fifth of a square outside of the outer squares.
    rim = [np.column_stack([along, np.full(nx + 1, y)]) for y in (-1.7, ny - 0.3)]
    rim += [np.column_stack([np.full(ny + 1, x), down]) for x in (-1.7, nx - 0.3)]
    level, seen = _levels(image, H, np.concatenate(rim))
    low, high = np.quantile(inside, [0.1, 0.9])
    dark = level < low + (1 - _CLEARLY) * (high - low)
    return bool(seen.any() and dark[seen].mean() >= _ALTERNATE)


def _levels(image: Image, H: Any, squares: npt.NDArray[Any]) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Grey levels (n,) in the middles of squares (n, 2), and whether these are in the image."""
    ahead = np.column_stack([squares + 0.5, np.ones(len(squares))]) @ np.asarray(H).T
    column, row = np.rint(ahead[:, :2] / ahead[:, 2:]).astype(int).T
    height, width = image.shape
    seen = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    grey = image[row.clip(0, height - 1), column.clip(0, width - 1)]
    return grey.astype(float), seen
