"""ChArUco boards in images, and what boards that are not the stated ones are."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from vision_gt.images.reading import read_codes
from vision_gt.images.rejections import hull
from vision_gt.patterns.boards import Board
from vision_gt.patterns.dictionaries import Family

Image = npt.NDArray[np.uint8]
Ints = npt.NDArray[np.intp]

_LEAST_CORNERS = 4
"""Of a board that is partly seen: four places whose ids are known give a pose."""
_LEAST_MARKERS = 4
"""Markers that have to agree before a board is said to be another one. A mirrored board of 30
markers shows 3 ids of 4X4_50 by chance, and those do not agree on a place."""
_LEAST_SHARE = 0.25
"""Of the black quadrangles, which squares of a board are too, that have to be read as markers of a
family: 4 x 4 codes of 1,000 ids read one in 16 of any."""
_AGREES = 0.3
"""Sides of a marker that a corner of it may be from where the board has it: a board that is bent or
seen through a wide lens is off by a tenth, another layout by more than a half."""
_MOST_AGREE = 0.6
"""Share of the markers' corners that must agree with the stated board."""
_FAMILIES = (
    *(f"{n}X{n}_1000" for n in (4, 5, 6, 7)),
    "ARUCO_ORIGINAL",
    "ARUCO_MIP_36h12",
    *(f"APRILTAG_{one}" for one in ("16h5", "25h9", "36h10", "36h11")),
)
"""All of OpenCV's but those that are the first codes of a larger one."""
_SMALLER = (50, 100, 250, 1000)
"""Sizes of OpenCV's own families: the smallest that has all ids is named."""


@dataclass(frozen=True)
class CharucoCorners:
    """Corners as OpenCV has them: ids (n,) and pixels (n, 2)."""

    ids: Ints
    pixels: Array


@dataclass(frozen=True)
class OtherBoard:
    """What an image shows instead of the stated board.

    Parameters
    ----------
    name : str
        What it is: 'inverted', 'legacy layout', 'mirrored', 'rows and columns exchanged',
        '4X4_50 where 5X5_50 was stated'.
    board : Board or None
        How it can be read, with corners that mean the same; None where it is another thing.
    outline : (k, 2) array
        Where it is, pixels.
    """

    name: str
    board: Board | None
    outline: Array


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
    corners, ids, outlines, numbers = detector.detectBoard(as_printed(image, board))
    if ids is None or len(ids) < _LEAST_CORNERS:
        return None
    markers = _Markers.of(outlines, numbers).of_board(board)
    if _agreement(board, markers) < _MOST_AGREE * len(markers.numbers):
        return None
    return CharucoCorners(
        np.ravel(ids).astype(np.intp), np.array(corners, dtype=float).reshape(-1, 2)
    )


def as_printed(image: Image, board: Board) -> Image:
    """The image, black and white exchanged where the board's are."""
    return np.asarray(255 - image, dtype=np.uint8) if board.inverted else image


def other_board(image: Image, board: Board) -> OtherBoard | None:
    """What a ChArUco board is that is not found as stated; None if there is none.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    board : Board
        The stated one.
    """
    for turned, how in ((False, ""), (True, "inverted")):
        shown = replace(board, inverted=board.inverted != turned)
        seen = as_printed(image, shown)
        markers, quads = _markers(seen, board.family)
        found = _best_layout(markers, shown)
        if found is not None:
            words = ", ".join(word for word in (how, found.name) if word)
            return replace(found, name=words) if words else None
        flipped = _best_layout(_markers(seen[:, ::-1], board.family)[0], shown)
        if flipped is not None:
            outline = np.array([image.shape[1] - 1, 0]) + flipped.outline * [-1, 1]
            words = ", ".join(word for word in (how, "mirrored", flipped.name) if word)
            return OtherBoard(words, None, outline)
        strange = _other_family(seen, quads, shown)
        if strange is not None:
            words = ", ".join(word for word in (how, strange.name) if word)
            return replace(strange, name=words)
    return None


@dataclass(frozen=True)
class _Markers:
    """Markers as OpenCV finds them: outlines (n, 4, 2) and ids (n,)."""

    outlines: Array
    numbers: Ints

    @classmethod
    def of(cls, outlines: object, numbers: object) -> "_Markers":
        """From OpenCV's lists."""
        if numbers is None:
            return cls(np.zeros((0, 4, 2)), np.zeros(0, dtype=np.intp))
        ids = np.ravel(np.asarray(numbers)).astype(np.intp)
        return cls(np.array(outlines, dtype=float).reshape(-1, 4, 2), ids)

    def of_board(self, board: Board) -> "_Markers":
        """Those with ids of a board: another one may be in the image."""
        own = np.isin(self.numbers, board.first_id + np.arange(board.marker_count))
        return _Markers(self.outlines[own], self.numbers[own])


def _markers(image: Image, family: Family | None) -> tuple[_Markers, Array]:
    """Markers of a family, and all quadrangles (n, 4, 2) that might be some of any."""
    if family is None:
        family = Family(_FAMILIES[0])
    detector = cv2.aruco.ArucoDetector(family.dictionary)
    outlines, numbers, others = detector.detectMarkers(np.ascontiguousarray(image))
    markers = _Markers.of(outlines, numbers)
    quads = np.array(others, dtype=float).reshape(-1, 4, 2)
    return markers, np.concatenate([markers.outlines, quads])


def _agreement(board: Board, markers: _Markers) -> int:
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


def _layouts(board: Board) -> Iterator[tuple[str, Board, bool]]:
    """Layouts of the same markers, what they are called, and whether corners mean the same."""
    older = replace(board, legacy=not board.legacy)
    yield "", board, True
    yield ("the newer layout" if board.legacy else "legacy layout"), older, True
    if board.columns != board.rows:
        turned = replace(board, columns=board.rows, rows=board.columns)
        yield "rows and columns exchanged", turned, False
        both = replace(turned, legacy=not board.legacy)
        yield "rows and columns exchanged, legacy layout", both, False


def _best_layout(markers: _Markers, board: Board) -> OtherBoard | None:
    """The layout that most of the board's markers agree with; None if too few do."""
    markers = markers.of_board(board)
    if len(markers.numbers) < _LEAST_MARKERS:
        return None
    ranked = [
        (_agreement(one, markers), -place, name, one, same)
        for place, (name, one, same) in enumerate(_layouts(board))
    ]
    count, _, name, chosen, same = max(ranked, key=lambda row: row[:2])
    if count < max(_LEAST_MARKERS, _MOST_AGREE * len(markers.numbers)):
        return None
    return OtherBoard(name, chosen if same else None, _outline(markers))


def _outline(markers: _Markers) -> Array:
    return hull(markers.outlines.reshape(-1, 2))


def _smallest(name: str, highest: int) -> str:
    """The smallest of the families with the same codes that has an id so high."""
    kind, _, size = name.partition("_")
    if size != str(_SMALLER[-1]):
        return name.upper()
    return f"{kind}_{next(count for count in _SMALLER if highest < count)}"


def _other_family(image: Image, quads: Array, board: Board) -> OtherBoard | None:
    """Markers of another family than the stated one, among quadrangles (n, 4, 2)."""
    if len(quads) < _LEAST_MARKERS:
        return None
    read = [(name, read_codes(image, quads, Family(name), 0)) for name in _FAMILIES]
    name, most = max(read, key=lambda one: len(set(one[1].numbers.tolist())))
    least = max(_LEAST_MARKERS, _LEAST_SHARE * len(most.bordered))
    if len(set(most.numbers.tolist())) < least:
        return None
    outline = _outline(_Markers(quads[most.rows], most.numbers))
    if board.family is None:
        return OtherBoard(f"a ChArUco board of {name.upper()}", None, outline)
    named, stated = _smallest(name, int(most.numbers.max())), board.family.name
    if named.partition("_")[0] == stated.upper().partition("_")[0] and "X" in named:
        return None
    return OtherBoard(f"{named} where {stated} was stated", None, outline)
