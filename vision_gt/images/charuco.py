"""ChArUco boards in images, and what boards that are not the stated ones are."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from vision_gt.images.reading import drawn_apart
from vision_gt.patterns.boards import Board

Image = npt.NDArray[np.uint8]
Ints = npt.NDArray[np.intp]

_LEAST_CORNERS = 4
"""Of a board that is partly seen: four places whose ids are known give a pose."""
_ENOUGH_MARKERS, _BORDER = 4, 3.0
"""Markers whose sixteen corners tell where a corner beside one of them is; and pixels that it is at
least from the image's border."""
STRANGERS = 4
"""Markers in line that are where another board has them, and not the stated one: a code is read by
chance once in some images, and not in line."""
_SIZES = range(3, 25)
"""Squares along a board that are thought of where it is not the stated one."""
_AGREES = 0.3
"""Sides of a marker that a corner of it may be from where the board has it: a board that is bent or
seen through a wide lens is off by a tenth, another layout by more than a half."""
_MOST_TRIED = 300
"""Fours of corners: where two in five are right, one of them is with a probability of 0.9996."""
MOST_AGREE = 0.6
"""Share of the markers' corners that must agree with the stated board."""


@dataclass(frozen=True)
class CharucoCorners:
    """Corners as OpenCV has them: ids (n,) and pixels (n, 2); some only ``foretold`` (n,).

    Those are where the markers around say that a corner is, to a pixel or two: OpenCV names a
    corner only where it has read both markers beside it. ``instead`` says what the board is where
    its markers have the places of others.
    """

    ids: Ints
    pixels: Array
    foretold: npt.NDArray[np.bool_]
    instead: str = ""


def charuco_corners(
    image: Image, board: Board, beside: Sequence[Board] = ()
) -> CharucoCorners | None:
    """Where a ChArUco board has its corners; None for too few, or for another board.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    board : Board
        As printed: inverted, or of the older layout.
    beside : sequence of Board
        Others that may be there as well.
    """
    detector = cv2.aruco.CharucoDetector(board.charuco())
    corners, found, outlines, numbers = detector.detectBoard(as_printed(drawn_apart(image), board))
    every = Markers.of(outlines, numbers)
    markers = every.of_board(board)
    agrees = _agreeing(board, markers)
    if not agrees.sum() >= max(MOST_AGREE * len(agrees), 1):
        return None
    # Of the other layout with an odd number of columns all but one in a row agree, a square aside.
    other = replace(board, legacy=not board.legacy)
    if not agrees.all() and agreement(other, markers) > agrees.sum():
        return None
    named = np.zeros(0, dtype=np.intp) if found is None else np.ravel(found).astype(np.intp)
    own = np.array(corners if len(named) else [], dtype=float).reshape(-1, 2)
    others, more = _foretold(board, markers.only(agrees), named, image.shape)
    if len(named) + len(others) < _LEAST_CORNERS:
        return None
    ids, pixels = np.concatenate([named, others]), np.concatenate([own, more])
    order = np.argsort(ids)
    instead = _elsewhere(board, every, beside)
    return CharucoCorners(ids[order], pixels[order], order >= len(named), instead)


def _elsewhere(board: Board, every: "Markers", beside: Sequence[Board]) -> str:
    """What a board is of which more markers agree with another size or first id; '' if none.

    Two rows have as many markers as there are columns. A first id that is wrong by so many, or by
    a multiple, gives markers the places of others, where all that are seen agree; and one that is
    wrong by one, to most of them. But where the board has them, more are in line.
    """
    stated = (board, *beside)
    agrees = [_agreeing(one, every) for one in stated]
    if (~np.any(agrees, axis=0)).sum() < STRANGERS:
        return ""
    agreed = int(np.sum(agrees, axis=1).max())
    most, best = best_size(every, board)
    if most - agreed < STRANGERS:
        return ""
    if (best.columns, best.first_id) == (board.columns, board.first_id):
        # More rows than stated, of which what is read is right; but not where all begins later.
        seen = every.numbers[_agreeing(best, every)]
        too_many = int(seen.max()) - (board.first_id + board.marker_count - 1)
        if int(seen.min()) < board.first_id + board.columns:
            return ""
        later = board.first_id + board.columns * -(-too_many // board.columns)
        return of_size(replace(board, first_id=later), board)
    same = (best.columns, best.first_id) in {(one.columns, one.first_id) for one in beside}
    return "" if same else of_size(best, board)


def best_size(markers: "Markers", board: Board) -> tuple[int, Board]:
    """How many markers agree with the size and first id that most agree with; and that board."""
    low, high = int(markers.numbers.min()), int(markers.numbers.max())
    ranked = [
        (agreement(one, markers), one.first_id == board.first_id, one.first_id, one)
        for one in _of_sizes(board, low, high)
    ]
    most, _, _, best = max(ranked, key=lambda row: row[:3], default=(0, False, 0, board))
    if most and best.first_id != board.first_id:
        # Ids before those in line are another board's, or none of any board.
        first = int(markers.numbers[_agreeing(best, markers)].min()) - best.first_id
        best = replace(best, first_id=best.first_id + first // best.columns * best.columns)
    return most, best


def _of_sizes(board: Board, low: int, high: int) -> Iterator[Board]:
    """Boards of other sizes whose ids reach from one to another."""
    most = len(board.family.dictionary.bytesList) if board.family else 0
    for first in dict.fromkeys((board.first_id, *range(max(low - board.columns, 0), low + 1))):
        for columns in _SIZES if first in {board.first_id, low} else (board.columns,):
            rows = max(3, -(-2 * (high - first + 1) // columns))
            one = replace(board, columns=columns, rows=rows, first_id=first)
            if rows <= _SIZES[-1] and first <= low and first + one.marker_count <= most:
                yield one


def of_size(seen: Board, board: Board) -> str:
    """A board of another size than stated, or from another id on, in words."""
    wanted = f"{board.columns} x {board.rows} were stated"
    if seen.columns == board.columns:
        return f"a board whose ids begin at {seen.first_id} or near{not_at(board)}; {wanted}"
    across = f", {seen.rows} or more across" if seen.first_id == board.first_id else ""
    return f"a board of {seen.columns} squares along{across}; {wanted}"


def not_at(board: Board) -> str:
    """What tells which stated board `of_size` is about."""
    return f", not at {board.first_id}"


def _foretold(
    board: Board, markers: "Markers", named: Ints, shape: tuple[int, ...]
) -> tuple[Ints, Array]:
    """Ids (k,) and pixels (k, 2) of corners beside markers that are read, but for those named."""
    if len(markers.numbers) < _ENOUGH_MARKERS:
        return np.zeros(0, dtype=np.intp), np.zeros((0, 2))
    printed, corners = _printed(board), np.asarray(board.charuco().getChessboardCorners())
    places = np.array([printed[number] for number in markers.numbers.tolist()])
    middles = places.mean(1)
    ids, pixels = [], []
    for corner in np.setdiff1d(np.arange(len(board.corners)), named).tolist():
        at = corners[corner, :2].astype(float)
        far = np.linalg.norm(middles - at, axis=1)
        near = np.argsort(far)[:_ENOUGH_MARKERS]
        if far[near[0]] > board.square:
            continue
        H, _ = cv2.findHomography(
            places[near].reshape(-1, 2), markers.outlines[near].reshape(-1, 2), 0
        )
        if H is None:
            continue
        ahead = H @ np.append(at, 1.0)
        pixel = ahead[:2] / ahead[2]
        if (pixel > _BORDER).all() and (pixel < np.array(shape[1::-1]) - _BORDER).all():
            ids.append(corner)
            pixels.append(pixel)
    return np.array(ids, dtype=np.intp), np.array(pixels, dtype=float).reshape(-1, 2)


def as_printed(image: Image, board: Board) -> Image:
    """The image, black and white exchanged where the board's are."""
    return np.asarray(255 - image, dtype=np.uint8) if board.inverted else image


@dataclass(frozen=True)
class Markers:
    """Markers as OpenCV finds them: outlines (n, 4, 2) and ids (n,)."""

    outlines: Array
    numbers: Ints

    @classmethod
    def of(cls, outlines: object, numbers: object) -> "Markers":
        """From OpenCV's lists."""
        if numbers is None:
            return cls(np.zeros((0, 4, 2)), np.zeros(0, dtype=np.intp))
        ids = np.ravel(np.asarray(numbers)).astype(np.intp)
        return cls(np.array(outlines, dtype=float).reshape(-1, 4, 2), ids)

    def of_board(self, board: Board) -> "Markers":
        """Those with ids of a board: another one may be in the image."""
        return self.only(np.isin(self.numbers, board.first_id + np.arange(board.marker_count)))

    def only(self, which: npt.NDArray[np.bool_]) -> "Markers":
        """Some of them."""
        return Markers(self.outlines[which], self.numbers[which])


def agreement(board: Board, markers: Markers) -> int:
    """How many of the markers lie where the board has them: of those that agree on a homography."""
    return int(_agreeing(board, markers).sum())


def _printed(board: Board) -> dict[int, Array]:
    """The corners (4, 2) of each marker on a board."""
    own = board.charuco()
    places = zip(np.ravel(own.getIds()).tolist(), own.getObjPoints(), strict=True)
    return {number: np.asarray(place, dtype=float)[:, :2] for number, place in places}


def _agreeing(board: Board, markers: Markers) -> npt.NDArray[np.bool_]:
    """Which (n,) of the markers lie where the board has them; see `agreement`."""
    places = _printed(board)
    agrees = np.zeros(len(markers.numbers), dtype=bool)
    known = [i for i, number in enumerate(markers.numbers.tolist()) if number in places]
    if not known:
        return agrees
    printed = np.array([places[int(markers.numbers[i])] for i in known])
    seen = markers.outlines[known]
    side = float(np.median(np.linalg.norm(seen - np.roll(seen, 1, axis=1), axis=-1)))
    H, _ = cv2.findHomography(
        printed.reshape(-1, 2),
        seen.reshape(-1, 2),
        cv2.RANSAC,
        _AGREES * side,
        maxIters=_MOST_TRIED,
    )
    if H is None:
        return agrees
    ahead = printed @ H[:, :2].T + H[:, 2]
    off = np.linalg.norm(ahead[..., :2] / ahead[..., 2:] - seen, axis=-1)
    agrees[known] = (off < _AGREES * side).all(1)
    return agrees
