"""Pictures of a calibration: boards where the camera saw them, corners and axes on the images.

AD2.3, "Single camera calibration", shows both, as Bouguet's toolbox draws them.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from validation.figures.errors import COLOURS, GREY
from validation.poses.angles import Array
from vision_gt.images.files import Image
from vision_gt.network.intrinsics import Calibration
from vision_gt.optics.camera import Camera, project
from vision_gt.patterns.board_views import BoardView, camera_pose_of_board
from vision_gt.patterns.boards import Board

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH = 5.6
_AXIS = 3
"""Squares that an axis is drawn long."""
_SHRINK = 2
"""Every second pixel is enough for a picture two inches wide."""


def rim_of(board: Board) -> Array:
    """(5, 3) the outer corners of a board's print in its frame, the first one again at the end."""
    q = board.square
    x, y = (board.columns - 1) * q, (board.rows - 1) * q
    return np.array([[-q, -q, 0], [x, -q, 0], [x, y, 0], [-q, y, 0], [-q, -q, 0]])


def extrinsics(calibrations: Mapping[str, Calibration]) -> Figure:
    """Boards of the calibration images in the frame of their camera: from above, and from the side.

    The axes are those of the camera: x right, y down, z ahead, metres. A dot marks the first inner
    corner.
    """
    count = len(calibrations)
    figure = Figure(figsize=(WIDTH, 2.3 * count), layout="constrained")
    grid = figure.subplots(count, 2, squeeze=False)
    for row, (name, found) in zip(grid, calibrations.items(), strict=True):
        poses = [camera_pose_of_board(view, found.camera) for view in found.views]
        for axes, across, label in ((row[0], 0, "x"), (row[1], 1, "y")):
            for number, (view, T) in enumerate(zip(found.views, poses, strict=True)):
                if T is None:
                    continue
                rim = T.apply(rim_of(view.board))
                colour = COLOURS[number % len(COLOURS)]
                axes.plot(rim[:, 2], rim[:, across], color=colour, linewidth=0.9)
                axes.plot(T.translation[2], T.translation[across], ".", color=colour, markersize=3)
            _field_lines(axes, found.camera, across)
            axes.plot(0, 0, ">", color="black", markersize=6)
            axes.invert_yaxis()
            axes.set_aspect("equal", adjustable="datalim")
            axes.set_xlabel("z ahead [m]", fontsize=7)
            axes.set_ylabel(f"{label} [m]", fontsize=7)
            axes.tick_params(labelsize=6)
        row[0].set_title(f"camera {name}, from above", fontsize=8)
        row[1].set_title("from the side", fontsize=8)
    return figure


def _field_lines(axes: "Axes", camera: Camera, across: int) -> None:
    """The rays along the rim of the image, without distortion."""
    size, focal, centre = (
        v[across] for v in (camera.size, camera.parameters, camera.parameters[2:])
    )
    for pixel in (-0.5, size - 0.5):
        slope = (pixel - centre) / focal
        axes.plot([0, 3], [0, 3 * slope], ":", color=GREY, linewidth=0.8)


def drawn_corners(shown: Mapping[str, tuple[Image, BoardView, Camera]]) -> Figure:
    """Images with the corners that were found and the axes of the board drawn on them.

    Parameters
    ----------
    shown : mapping of str to (Image, BoardView, Camera)
        By a title: an image, the board in it, and the camera that took it.
    """
    columns = min(len(shown), 2)
    rows = -(-len(shown) // max(columns, 1))
    figure = Figure(figsize=(WIDTH, 2.2 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, (title, one) in zip(grid, shown.items(), strict=False):
        draw_board(axes, *one)
        axes.set_title(title, fontsize=8)
    for axes in grid[len(shown) :]:
        axes.set_axis_off()
    return figure


def draw_board(axes: "Axes", image: Image, view: BoardView, camera: Camera) -> None:
    """One image with corners as crosses and the board's axes: x solid, y dashed, z dotted."""
    height, width = image.shape
    extent = (-0.5, width - 0.5, height - 0.5, -0.5)
    axes.imshow(image[::_SHRINK, ::_SHRINK], cmap="gray", vmin=0, vmax=255, extent=extent)
    axes.plot(*view.pixels.T, "+", color=COLOURS[1], markersize=3, markeredgewidth=0.6)
    T = camera_pose_of_board(view, camera)
    if T is not None:
        length = _AXIS * view.board.square
        for k, line in enumerate(("-", "--", ":")):
            # z points into the board, so that its axis is drawn the other way, towards the viewer.
            tip = np.eye(3)[k] * (-length if k == 2 else length)
            ends = project(T.apply(np.array([np.zeros(3), tip])), camera.parameters)
            axes.plot(*ends.T, line, color=COLOURS[(0, 2, 4)[k]], linewidth=1.6)
            axes.annotate(("x", "y", "-z")[k], ends[1], fontsize=7, color=COLOURS[(0, 2, 4)[k]])
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    axes.set_axis_off()
