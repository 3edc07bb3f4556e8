"""ChArUco boards in images, and what boards that are not the stated ones are."""

from dataclasses import dataclass

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
_AGREES = 0.3
"""Sides of a marker that a corner of it may be from where the board has it: a board that is bent or
seen through a wide lens is off by a tenth, another layout by more than a half."""
MOST_AGREE = 0.6
"""Share of the markers' corners that must agree with the stated board."""


@dataclass(frozen=True)
class CharucoCorners:
    """Corners as OpenCV has them: ids (n,) and pixels (n, 2)."""

    ids: Ints
    pixels: Array


def charuco_corners(image: Image, board: Board) -> CharucoCorners | None:
    """Corners of a ChArUco board as OpenCV finds them; None for too few, or for another board.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    board : Board
        As printed: inverted, or of the older layout.
    """
    detector = cv2.aruco.CharucoDetector(board.charuco())
    corners, ids, outlines, numbers = detector.detectBoard(as_printed(drawn_apart(image), board))
    if ids is None or len(ids) < _LEAST_CORNERS:
        return None
    markers = Markers.of(outlines, numbers).of_board(board)
    if agreement(board, markers) < MOST_AGREE * len(markers.numbers):
        return None
    return CharucoCorners(
        np.ravel(ids).astype(np.intp), np.array(corners, dtype=float).reshape(-1, 2)
    )


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
        own = np.isin(self.numbers, board.first_id + np.arange(board.marker_count))
        return Markers(self.outlines[own], self.numbers[own])


def agreement(board: Board, markers: Markers) -> int:
    """How many of the markers lie where the board has them: of those that agree on a homography."""
    own = board.charuco()
    places = dict(zip(np.ravel(own.getIds()).tolist(), own.getObjPoints(), strict=True))
    known = [i for i, number in enumerate(markers.numbers.tolist()) if number in places]
    if not known:
        return 0
    printed = np.array([places[int(markers.numbers[i])] for i in known], dtype=float)[..., :2]
    seen = markers.outlines[known]
    side = float(np.median(np.linalg.norm(seen - np.roll(seen, 1, axis=1), axis=-1)))
    H, _ = cv2.findHomography(
        printed.reshape(-1, 2), seen.reshape(-1, 2), cv2.RANSAC, _AGREES * side
    )
    if H is None:
        return 0
    ahead = printed @ H[:, :2].T + H[:, 2]
    off = np.linalg.norm(ahead[..., :2] / ahead[..., 2:] - seen, axis=-1)
    return int((off < _AGREES * side).all(1).sum())
