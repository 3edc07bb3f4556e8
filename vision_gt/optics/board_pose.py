"""Boards as images show them, and the poses that follow from single views."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import RigidTransform, Rotation

from validation.poses.angles import Array
from vision_gt.least_squares.setups import Views
from vision_gt.network.chain import BoardPose
from vision_gt.optics.camera import Camera
from vision_gt.optics.planar_pose import planar_arrays
from vision_gt.patterns.boards import Board

STATED_SIGMA = 0.1
"""Pixels; what is assumed of board corners that come without a standard deviation."""


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

    def turned(self) -> "BoardView":
        """The same image read with the board turned by half a turn."""
        last = len(self.board.corners) - 1
        return replace(self, ids=last - self.ids)

    def readings(self) -> tuple["BoardView", ...]:
        """The view by every reading that the print allows."""
        return (self, self.turned()) if self.board.looks_the_same_turned else (self,)


def camera_pose_of_board(view: BoardView, camera: Camera) -> RigidTransform | None:
    """T_camera_board from one view; None if it has too few corners."""
    if len(view.ids) < 6:
        return None
    found = planar_arrays(view.points, view.pixels, camera.parameters)
    if found is None:
        return None
    R, t, _ = found
    return RigidTransform.from_components(t[0], Rotation.from_matrix(R[0]))


def bar_poses(
    views: Sequence[BoardView], cameras: Sequence[Camera], T_bar_patterns: RigidTransform
) -> list[BoardPose]:
    """The bar as each view shows it, by all readings of the boards.

    Parameters
    ----------
    views : sequence of BoardView
        Of the network's snapshots.
    cameras : sequence of Camera
        With their intrinsic parameters.
    T_bar_patterns : RigidTransform
        Stack of two: where the patterns are on the bar.
    """
    by_name = {camera.name: camera for camera in cameras}
    poses = []
    for view in views:
        T = camera_pose_of_board(view, by_name[view.camera])
        if T is None:
            continue
        T_pattern_bar = T_bar_patterns[view.part].inv()
        readings = [T * T_pattern_bar]
        if view.board.looks_the_same_turned:
            readings.append(T * view.board.half_turn * T_pattern_bar)
        poses.append(BoardPose(view.camera, view.body, readings))
    return poses


def as_views(
    views: Sequence[BoardView],
    cameras: Sequence[str],
    bodies: Sequence[str],
    factor: float = 1.0,
) -> Views:
    """All corners of all views, for the adjustment.

    Parameters
    ----------
    views : sequence of BoardView
        At least one.
    cameras, bodies : sequence of str
        Names in the order of the adjustment's stacks.
    factor : float
        On the stated standard deviations.
    """
    counts = [len(view.ids) for view in views]
    camera = [cameras.index(view.camera) for view in views]
    number = {name: i for i, name in enumerate(bodies)}
    sigmas = factor * np.concatenate([view.stated_sigmas for view in views])
    return Views(
        camera=np.repeat(camera, counts),
        body=np.repeat([number[view.body] for view in views], counts),
        part=np.repeat([view.part for view in views], counts),
        point=np.concatenate([view.points for view in views]),
        pixel=np.concatenate([view.pixels for view in views]),
        covariance=np.square(sigmas)[:, None, None] * np.eye(2),
    )
