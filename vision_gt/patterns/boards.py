"""Calibration patterns: chessboards and ChArUco boards.

A board's frame has its origin at the first inner corner, x along the rows of squares, y along
the columns, and z into the board, away from who looks at the print: as OpenCV has it.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import RigidTransform, Rotation

from validation.errors import GtvalError
from validation.poses.angles import Array
from vision_gt.patterns.dictionaries import Family

if TYPE_CHECKING:
    import cv2

Ints = npt.NDArray[np.intp]

MARKER_SHARE = 0.75
"""Side of a ChArUco marker over that of its square, where nothing else is stated."""
LEAST_PLAIN = 4
"""Squares along each side of a board without markers: OpenCV's detectors look for 3 x 3 inner
corners and more."""
_MOST_CELLS = 400
"""Into which a square is divided, to draw a marker of any size in it."""


def few_squares(columns: int, rows: int) -> str:
    """What is said of a board without markers that no detector finds."""
    return (
        f"a chessboard of {columns} x {rows} squares is too small to be found: {LEAST_PLAIN} x "
        f"{LEAST_PLAIN} squares are needed, or 3 x 3 with markers (family)"
    )


@dataclass(frozen=True)
class Board:
    """A chessboard, with or without markers in its white squares.

    Parameters
    ----------
    columns, rows : int
        Squares along x and along y.
    square : float
        Side of a square, metres.
    family : Family, optional
        Of the markers of a ChArUco board; None for a plain chessboard.
    first_id : int
        Id of the first marker; the others follow.
    marker : float
        Side of a marker, metres; 0 for three quarters of a square's.
    inverted : bool
        Whether it is printed white on black.
    legacy : bool
        Whether it is laid out as by OpenCV before 4.6: with an even number of rows it starts with
        a white square.

    Raises
    ------
    GtvalError
        For fewer than three squares a side, four without markers, or markers that are no smaller
        than the squares.
    """

    columns: int
    rows: int
    square: float
    family: Family | None = None
    first_id: int = 0
    marker: float = 0.0
    inverted: bool = False
    legacy: bool = False

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < 3 or self.square <= 0:
            raise GtvalError("a board needs at least 3 x 3 squares of a positive size")
        if self.family is None and min(self.columns, self.rows) < LEAST_PLAIN:
            raise GtvalError(few_squares(self.columns, self.rows))
        if not 0 <= self.marker < self.square:
            raise GtvalError("the markers of a board must be smaller than its squares")

    @property
    def inner(self) -> tuple[int, int]:
        """Inner corners along x and y."""
        return self.columns - 1, self.rows - 1

    @cached_property
    def corners(self) -> Array:
        """(n, 3) inner corners, row by row, in the board's frame, metres."""
        nx, ny = self.inner
        x, y = np.meshgrid(np.arange(nx), np.arange(ny))
        flat = np.column_stack([x.ravel(), y.ravel(), np.zeros(nx * ny)])
        return np.asarray(flat * self.square, dtype=float)

    @property
    def looks_the_same_turned(self) -> bool:
        """Whether half a turn maps the print onto itself, so that corners cannot be told apart."""
        return self.family is None and (self.columns + self.rows) % 2 == 0

    @property
    def half_turn(self) -> RigidTransform:
        """T_board_turned: the frame as it looks after half a turn about the board's middle."""
        middle = self.corners.mean(0)
        return RigidTransform.from_components(2 * middle, Rotation.from_rotvec([0, 0, np.pi]))

    @property
    def marker_count(self) -> int:
        """Markers of a ChArUco board: its white squares."""
        return self.columns * self.rows // 2 if self.family else 0

    @property
    def marker_side(self) -> float:
        """Side of a ChArUco marker, metres."""
        return self.marker or MARKER_SHARE * self.square

    def charuco(self) -> "cv2.aruco.CharucoBoard":
        """The board as OpenCV has it, its origin being the outer corner."""
        import cv2  # noqa: PLC0415

        if self.family is None:
            raise GtvalError("a plain chessboard has no markers")
        ids = np.arange(self.first_id, self.first_id + self.marker_count)
        board = cv2.aruco.CharucoBoard(
            (self.columns, self.rows),
            self.square,
            self.marker_side,
            self.family.dictionary,
            ids,
        )
        board.setLegacyPattern(self.legacy)
        return board

    def cells(self) -> tuple[npt.NDArray[np.uint8], float]:
        """The print as cells, 1 where white, without a margin; and the side of a cell, metres."""
        if self.family is None:
            x, y = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
            return ((x + y + self.inverted) % 2).astype(np.uint8), self.square
        a_square = self._cells_a_square()
        size = (a_square * self.columns, a_square * self.rows)
        image = self.charuco().generateImage(size, marginSize=0, borderBits=1)
        white = np.asarray(image) > 127
        return (white != self.inverted).astype(np.uint8), self.square / a_square

    def _cells_a_square(self) -> int:
        """The fewest cells of a square that whole cells of a marker fit into, in its middle."""
        if self.family is None:
            return 1
        of_marker, share = self.family.cells, self.marker_side / self.square
        for times in range(1, _MOST_CELLS // of_marker):
            cells = times * of_marker / share
            if abs(cells - round(cells)) < 1e-6 and (round(cells) - times * of_marker) % 2 == 0:
                return round(cells)
        raise GtvalError("a marker of this side cannot be drawn in the squares; change it slightly")
