"""Boards as images show them, and the poses that follow from single views."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import RigidTransform

from validation.poses.angles import Array
from vision_gt.optics.camera import Camera
from vision_gt.optics.planar_pose import planar_solutions
from vision_gt.patterns.boards import Board

STATED_SIGMA = 0.1
"""Pixels; what is assumed of board corners that come without a standard deviation. Only the weights
of views against each other depend on it: the adjustments take the noise from their residuals."""
_LEAST_CORNERS = 6
"""Of a pose: a judgement. Four corners give one; two more to spare tell a wrong one."""


@dataclass(frozen=True)
class BoardView:
    """One board in one image.

    Parameters
    ----------
    camera : str
        Who took it.
    body : str
        The rigid thing that the board is part of, at one moment: a snapshot.
    part : int
        0 for the first pattern of the bar, or a board by itself; 1 for the second pattern.
    board : Board
        Its geometry.
    ids : (n,) array of int
        Which of the board's corners were found.
    pixels : (n, 2) array
        Where.
    source : str
        The image, for messages.
    sigmas : (n,) array, optional
        Standard deviation of each coordinate of each corner, pixels.
    """

    camera: str
    body: str
    part: int
    board: Board
    ids: npt.NDArray[np.intp]
    pixels: Array
    source: str = ""
    sigmas: Array | None = None

    @property
    def stated_sigmas(self) -> Array:
        """(n,) standard deviations of the corners' coordinates, pixels."""
        if self.sigmas is not None:
            return self.sigmas
        return np.full(len(self.ids), STATED_SIGMA)

    @property
    def points(self) -> Array:
        """(n, 3) the corners in the board's frame, metres."""
        return self.board.corners[self.ids]

    @property
    def ends(self) -> Array:
        """(3, 2) pixels of the first corner found, and of the last ones in its row and column."""
        rows, columns = np.divmod(self.ids, self.board.inner[0])
        first = int(np.argmin(self.ids))
        row, column = rows == rows[first], columns == columns[first]
        in_row = self.pixels[row][int(np.argmax(columns[row]))]
        in_column = self.pixels[column][int(np.argmax(rows[column]))]
        return np.array([self.pixels[first], in_row, in_column])

    def turned(self) -> "BoardView":
        """The same image read with the board turned by half a turn."""
        last = len(self.board.corners) - 1
        return replace(self, ids=last - self.ids)

    def readings(self) -> tuple["BoardView", ...]:
        """The view by every reading that the print allows."""
        return (self, self.turned()) if self.board.looks_the_same_turned else (self,)


def camera_pose_of_board(view: BoardView, camera: Camera) -> RigidTransform | None:
    """T_camera_board from one view; None if it has too few corners."""
    if len(view.ids) < _LEAST_CORNERS:
        return None
    found = planar_solutions(view.points, view.pixels, camera.parameters)
    return None if found is None else found.best
