"""What an image shows where it does not show the stated board."""

import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from vision_gt.images.charuco import (
    MOST_AGREE,
    STRANGERS,
    Markers,
    agreement,
    as_printed,
    best_size,
    of_size,
)
from vision_gt.images.chessboards import any_size, grid_of_circles, without_rim
from vision_gt.images.reading import read_codes
from vision_gt.patterns.boards import LEAST_PLAIN, Board
from vision_gt.patterns.dictionaries import Family
from vision_gt.patterns.rejections import hull

Image = npt.NDArray[np.uint8]
Ints = npt.NDArray[np.intp]

_LEAST_MARKERS = 4
"""Markers that have to agree before a board is said to be another one. A mirrored board of 30
markers shows 3 ids of 4X4_50 by chance, and those do not agree on a place."""
_LEAST_SHARE = 0.25
"""Of the black quadrangles, which squares of a board are too, that have to be read as markers of a
family: 4 x 4 codes of 1,000 ids read one in 16 of any."""
FAMILIES = (
    *(f"{n}X{n}_1000" for n in (4, 5, 6, 7)),
    "ARUCO_ORIGINAL",
    "ARUCO_MIP_36h12",
    *(f"APRILTAG_{one}" for one in ("16h5", "25h9", "36h10", "36h11")),
)
"""All of OpenCV's but those that are the first codes of a larger one."""
_SMALLER = (50, 100, 250, 1000)
"""Sizes of OpenCV's own families: the smallest that has all ids is named."""


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


EXCHANGED = "one with rows and columns exchanged"
_WHERE = " where "
_OF_SQUARES = re.compile(r"a chessboard of (\d+) x (\d+) squares; ")
_MARKER_SIDES = np.arange(0.4, 0.81, 0.05)
"""Of a marker over those of a square that are thought of where they are not as stated. OpenCV warns
of larger ones; those of 0.65 to 0.85 are read as 0.75."""
TWICE = "two boards with the same ids"
_AS_WELL = 0.6
"""Share of markers that agree on another size, that agree on the stated one: of a few markers of a
part of a board several sizes are right. A judgement."""
_ALTERNATE, _CONTRAST = 0.95, 15.0
"""Share of the squares between corners that are dark and light by turns, and grey levels between
them: cells of markers and gaps between circles are not."""
_NEAR_CORNER, _FAINT = 0.8, 0.25
"""Share of the way from a square's middle to its corner at which a chessboard still alternates by
more than this share: squares of 8 px under a blur of 0.7 px by half. Circles that do not touch
leave nothing there; nor do smaller squares under more blur, so circles are looked for."""
_ASIDE, _NEXT = 0.5, 2.0
"""Of the way to the nearest marker, the smaller part over the larger: 0 in a grid, 1 across a
corner of a ChArUco board. And its length in sides: gaps of grids are a fifth to a half of one."""
_FEW_CORNERS = 15
"""Fewer are no chessboard: cells of a marker are dark and light by turns, too."""
_QUICK = cv2.CALIB_CB_FAST_CHECK | cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE


def stated_wrongly(name: str) -> bool:
    """Whether a name is one of a board that was stated wrongly: one cause for all its images."""
    return name.endswith((" was stated", " were stated")) or EXCHANGED in name


def as_named(board: Board, name: str) -> Board | None:
    """The board that a name of `what_instead` stands for, where that can be looked for at once."""
    if name == EXCHANGED:
        return replace(board, columns=board.rows, rows=board.columns)
    squares = _OF_SQUARES.match(name)
    if board.family is None and squares:
        return replace(board, columns=int(squares[1]), rows=int(squares[2]))
    family, where, _ = name.partition(_WHERE)
    if not where or board.family is None or " " in family:
        return None
    return replace(board, family=Family(family))


def named_for_all(names: Collection[str]) -> str:
    """Of names of one board as several images have it, the one that explains all of them.

    Of families with the same codes it is the smallest that has all ids seen; of others the one
    that most images say; '' for none.
    """
    if not names:
        return ""
    most = Counter(name.partition("_")[0] for name in names).most_common(1)[0][0]
    alike = [name for name in names if name.partition("_")[0] == most]
    return max(alike, key=lambda name: (_size_of(name), alike.count(name)))


def _size_of(name: str) -> int:
    """Of the family that a name begins with; 0 where it has none."""
    size = name.partition(_WHERE)[0].rpartition("_")[2]
    return int(size) if size.isdigit() else 0


def what_instead(image: Image, board: Board, beside: Sequence[Board] = ()) -> OtherBoard | None:
    """What an image shows where the stated board is not found; None if nothing is known.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    board : Board
        The stated one.
    beside : sequence of Board
        Others that may be there as well; a part of one of them is nothing else.
    """
    size = partial(_other_size, beside=beside)
    marked = (other_board, _marker_grid, size) if board.family is not None else (_markers_instead,)
    tries = (*marked, _plain, circles)
    return next((found for look in tries if (found := look(image, board)) is not None), None)


def _markers_instead(image: Image, board: Board) -> OtherBoard | None:
    """A board of markers where a plain chessboard was stated."""
    return _other_family(image, _markers(image, None)[1], board)


def _marker_grid(image: Image, board: Board) -> OtherBoard | None:
    """A grid of markers of the stated family, without a chessboard around them."""
    for shown in (image, np.asarray(255 - image, dtype=np.uint8)):
        markers, _ = _markers(shown, board.family)
        if board.family and len(markers.numbers) >= _LEAST_MARKERS and _lined_up(markers.outlines):
            return OtherBoard(_grid_name(board.family.name, board), None, _outline(markers))
    return None


def _grid_name(family: str, board: Board) -> str:
    return f"a grid of markers of {family}, not a {_kind(board)}"


def _kind(board: Board) -> str:
    return "ChArUco board" if board.family else "chessboard"


def _lined_up(outlines: Array) -> bool:
    """Whether markers (n, 4, 2) stand side by side, as those of a ChArUco board do not.

    In a ChArUco board the nearest is the one across a corner, and the next of the same row two
    squares away, which is more than two sides of a marker.
    """
    middles = outlines.mean(1)
    square = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]], dtype=np.float32)
    nearest = []
    for number, outline in enumerate(outlines):
        flat = cv2.getPerspectiveTransform(outline.astype(np.float32), square)
        others = np.delete(middles, number, axis=0)
        away = cv2.perspectiveTransform(others[None], flat)[0]
        nearest.append(away[np.argmin(np.linalg.norm(away, axis=1))])
    size = np.sort(np.abs(nearest), axis=1)
    aside = float(np.median(size[:, 0] / np.maximum(size[:, 1], 1e-9)))
    return aside < _ASIDE and float(np.median(size[:, 1])) < _NEXT


def _plain(image: Image, board: Board) -> OtherBoard | None:
    """A plain chessboard of another size, or one of which a part is seen."""
    grid = _chessboard(image, board)
    if grid is None or grid[..., 0].size < _FEW_CORNERS or not _alternates(image, grid):
        return None
    if _faint(image, grid) and (round_ones := circles(image, board)) is not None:
        return round_ones
    seen, wanted = sorted(grid.shape[:2]), sorted(board.inner)
    if seen[0] > wanted[0] or seen[1] > wanted[1]:
        grid = without_rim(image, grid)
    down, across = sorted((grid.shape[0] + 1, grid.shape[1] + 1))
    stated = f"{board.columns} x {board.rows}"
    if board.family is not None:
        name = f"a chessboard without markers of {board.family.name}, {across} x {down} squares"
    elif (across, down) == (max(board.columns, board.rows), min(board.columns, board.rows)):
        return None
    elif across <= max(board.columns, board.rows) and down <= min(board.columns, board.rows):
        name = f"a chessboard of which {across} x {down} squares are seen; {stated} were stated"
    else:
        name = f"a chessboard of {across} x {down} squares; {stated} were stated"
    return OtherBoard(name, None, hull(grid.reshape(-1, 2)))


def _chessboard(image: Image, board: Board) -> Array | None:
    """(r, c, 2) inner corners of a chessboard of the stated size, or else of any."""
    if board.family is not None and min(board.inner) >= LEAST_PLAIN - 1:
        seen, corners = cv2.findChessboardCorners(image, board.inner, flags=_QUICK)
        if seen:
            return np.asarray(corners, dtype=float).reshape(*board.inner[::-1], 2)
    return any_size(image)


def _alternates(image: Image, grid: Array) -> bool:
    """Whether the squares between corners (r, c, 2) are dark and light by turns."""
    grey, even = _by_turns(image, grid, 0.0)
    middle = (grey[even].mean() + grey[~even].mean()) / 2
    darker = grey < middle
    right = (darker == even) if grey[even].mean() < grey[~even].mean() else (darker != even)
    apart = abs(float(grey[even].mean() - grey[~even].mean()))
    return bool(right.mean() >= _ALTERNATE and apart > _CONTRAST)


def _by_turns(image: Image, grid: Array, out: float) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Grey levels of all squares, a share of the way from the middle to a corner; every other."""
    middles = (grid[:-1, :-1] + grid[1:, :-1] + grid[:-1, 1:] + grid[1:, 1:]) / 4
    places = (1 - out) * middles + out * grid[:-1, :-1]
    column, row = np.rint(places).astype(int).reshape(-1, 2).T
    grey = image[row.clip(0, image.shape[0] - 1), column.clip(0, image.shape[1] - 1)].astype(float)
    y, x = np.mgrid[: middles.shape[0], : middles.shape[1]]
    return grey, ((x + y) % 2 == 0).ravel()


def _faint(image: Image, grid: Array) -> bool:
    """Whether what alternates does not reach the corners (r, c, 2): circles between them do not."""
    apart = [
        float(grey[even].mean() - grey[~even].mean())
        for grey, even in (_by_turns(image, grid, out) for out in (0.0, _NEAR_CORNER))
    ]
    return apart[1] / apart[0] < _FAINT


def _other_size(image: Image, board: Board, beside: Sequence[Board] = ()) -> OtherBoard | None:
    """A ChArUco board of the stated family, but of other squares, or from another id on."""
    for turned, how in ((False, ""), (True, "inverted, ")):
        shown = replace(board, inverted=board.inverted != turned)
        markers, _ = _markers(as_printed(image, shown), board.family)
        count = len(set(markers.numbers.tolist()))
        if count < _LEAST_MARKERS:
            continue
        most, best = best_size(markers, shown)
        if most < max(_LEAST_MARKERS, MOST_AGREE * len(markers.numbers)):
            continue
        both = [replace(one, inverted=shown.inverted) for one in (board, *beside)]
        agreed = max(agreement(one, markers.of_board(one)) for one in both)
        if agreed >= _AS_WELL * most and most - agreed < STRANGERS:
            return None  # a little of a stated board, as which they agree nearly as well
        if (best.columns, best.first_id) in {(one.columns, one.first_id) for one in both}:
            return None  # it is the stated one, of which too little is seen
        if abs(best.first_id - board.first_id) > min(abs(best.first_id - b.first_id) for b in both):
            return None  # it is more likely another one of the stated boards
        if best.columns == board.rows and best.first_id == board.first_id:
            return OtherBoard(f"{how}{EXCHANGED}", None, _outline(markers))
        return OtherBoard(f"{how}{of_size(best, board)}", None, _outline(markers))
    return None


def circles(image: Image, board: Board) -> OtherBoard | None:
    """A grid of circles where a board was stated; None if there is none."""
    found = grid_of_circles(image)
    if found is None:
        return None
    name, places = found
    return OtherBoard(f"{name}, not a {_kind(board)}", None, hull(places))


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
        if _doubled(markers):
            return OtherBoard(TWICE, None, _outline(markers))
        found = _best_layout(markers, shown) or _other_markers(markers, shown)
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


def _markers(image: Image, family: Family | None) -> tuple[Markers, Array]:
    """Markers of a family, and all quadrangles (n, 4, 2) that might be some of any."""
    if family is None:
        family = Family(FAMILIES[0])
    detector = cv2.aruco.ArucoDetector(family.dictionary)
    outlines, numbers, others = detector.detectMarkers(np.ascontiguousarray(image))
    markers = Markers.of(outlines, numbers)
    quads = np.array(others, dtype=float).reshape(-1, 4, 2)
    return markers, np.concatenate([markers.outlines, quads])


def _layouts(board: Board) -> Iterator[tuple[str, Board, bool]]:
    """Layouts of the same markers, what they are called, and whether corners mean the same."""
    older = replace(board, legacy=not board.legacy)
    yield "", board, True
    yield ("the newer layout" if board.legacy else "legacy layout"), older, True
    if board.columns != board.rows:
        turned = replace(board, columns=board.rows, rows=board.columns)
        yield EXCHANGED, turned, False
        both = replace(turned, legacy=not board.legacy)
        yield f"{EXCHANGED}, legacy layout", both, False


def _best_layout(markers: Markers, board: Board) -> OtherBoard | None:
    """The layout that most of the board's markers agree with; None if too few do."""
    every, markers = markers, markers.of_board(board)
    if len(markers.numbers) < _LEAST_MARKERS:
        return None
    ranked = [
        (agreement(one, markers), -place, name, one, same)
        for place, (name, one, same) in enumerate(_layouts(board))
    ]
    count, _, name, chosen, same = max(ranked, key=lambda row: row[:2])
    if count < max(_LEAST_MARKERS, MOST_AGREE * len(markers.numbers)):
        return None
    if _more_elsewhere(every, board, count):
        return None
    return OtherBoard(name, chosen if same else None, _outline(markers))


def _other_markers(markers: Markers, board: Board) -> OtherBoard | None:
    """The stated board with markers of another size; None if too few agree with any."""
    every, markers = markers, markers.of_board(board)
    if len(markers.numbers) < _LEAST_MARKERS:
        return None
    sizes = [replace(board, marker=share * board.square) for share in _MARKER_SIDES]
    ranked = [(agreement(one, markers), -place, one) for place, one in enumerate(sizes)]
    count = max(ranked, key=lambda row: row[:2])[0]
    least = max(_LEAST_MARKERS, _AS_WELL * len(markers.numbers))
    if count < least or _more_elsewhere(every, board, count):
        return None
    alike = [one.marker for most, _, one in ranked if most == count]
    share = float(np.median(alike)) / board.square
    stated = (board.marker or 0.75 * board.square) / board.square
    name = f"one with markers of about {share:.2f} of a square, not {stated:.2f}"
    return OtherBoard(name, replace(board, marker=share * board.square), _outline(markers))


def _more_elsewhere(every: Markers, board: Board, count: int) -> bool:
    """Whether clearly more than so many markers agree with another size or first id.

    From another id on, rows of the other layout come to lie where those of the stated one are.
    """
    if len(every.numbers) - count < STRANGERS:
        return False
    return best_size(every, board)[0] - count >= STRANGERS


def _doubled(markers: Markers) -> bool:
    """Whether most ids are seen twice."""
    numbers, counts = np.unique(markers.numbers, return_counts=True)
    twice = int((counts > 1).sum())
    return twice >= _LEAST_MARKERS and twice > len(numbers) / 2


def _outline(markers: Markers) -> Array:
    return hull(markers.outlines.reshape(-1, 2))


def smallest_family(name: str, highest: int) -> str:
    """The smallest of the families with the same codes that has an id so high."""
    kind, _, size = name.partition("_")
    if size != str(_SMALLER[-1]):
        return name.upper()
    return f"{kind}_{next(count for count in _SMALLER if highest < count)}"


def _highest(numbers: Ints, apart: int) -> int:
    """The highest id of a board, whose ids follow each other; one far above them is misread."""
    ids = np.unique(numbers)
    gaps = np.flatnonzero((np.diff(ids) > apart) & (ids[1:] > np.median(ids)))
    return int(ids[gaps[0]] if len(gaps) else ids[-1])


def _other_family(image: Image, quads: Array, board: Board) -> OtherBoard | None:
    """Markers of another family than the stated one, among quadrangles (n, 4, 2)."""
    if len(quads) < _LEAST_MARKERS:
        return None
    read = [(name, read_codes(image, quads, Family(name), 0)) for name in FAMILIES]
    name, most = max(read, key=lambda one: len(set(one[1].numbers.tolist())))
    least = max(_LEAST_MARKERS, _LEAST_SHARE * len(most.bordered))
    if len(set(most.numbers.tolist())) < least:
        return None
    outline = _outline(Markers(quads[most.rows], most.numbers))
    grid = _lined_up(quads[most.rows])
    named = smallest_family(name, _highest(most.numbers, board.columns * board.rows // 2))
    if grid:
        return OtherBoard(_grid_name(named, board), None, outline)
    if board.family is None:
        return OtherBoard(f"a ChArUco board of {named}", None, outline)
    stated = board.family.name
    if named.partition("_")[0] == stated.upper().partition("_")[0] and "X" in named:
        return None
    return OtherBoard(f"{named}{_WHERE}{stated} was stated", None, outline)
