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

CELLS_PER_SQUARE = 8
"""A ChArUco square is drawn as 8 x 8 cells, its marker (with 4 x 4 code) as 6 x 6 of them."""
MARKER_SHARE = 0.75
"""Side of a ChArUco marker over that of its square."""


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
        Of the markers of a ChArUco board, with 4 x 4 codes; None for a plain chessboard.
    first_id : int
        Id of the first marker; the others follow.

    Raises
    ------
    GtvalError
        For fewer than three squares a side.
    """

    columns: int
    rows: int
    square: float
    family: Family | None = None
    first_id: int = 0

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < 3 or self.square <= 0:
            raise GtvalError("a board needs at least 3 x 3 squares of a positive size")
        if self.family is not None and self.family.cells != int(CELLS_PER_SQUARE * MARKER_SHARE):
            raise GtvalError("ChArUco boards are made with families of 4 x 4 codes here")

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

    def charuco(self) -> "cv2.aruco.CharucoBoard":
        """The board as OpenCV has it, its origin being the outer corner."""
        import cv2  # noqa: PLC0415

        if self.family is None:
            raise GtvalError("a plain chessboard has no markers")
        ids = np.arange(self.first_id, self.first_id + self.marker_count)
        return cv2.aruco.CharucoBoard(
            (self.columns, self.rows),
            self.square,
            MARKER_SHARE * self.square,
            self.family.dictionary,
            ids,
        )

    def cells(self) -> tuple[npt.NDArray[np.uint8], float]:
        """The print as cells, 1 where white, without a margin; and the side of a cell, metres."""
        if self.family is None:
            x, y = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
            return ((x + y) % 2).astype(np.uint8), self.square
        size = (CELLS_PER_SQUARE * self.columns, CELLS_PER_SQUARE * self.rows)
        image = self.charuco().generateImage(size, marginSize=0, borderBits=1)
        return (np.asarray(image) > 127).astype(np.uint8), self.square / CELLS_PER_SQUARE
