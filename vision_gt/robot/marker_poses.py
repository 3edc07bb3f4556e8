"""What markers say about where they are, and where the robot is that carries them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.spatial.transform import RigidTransform

from validation.poses.angles import Array
from vision_gt.images.markers import MarkerView
from vision_gt.least_squares.setups import Views
from vision_gt.optics.camera import Camera, project, undistort
from vision_gt.optics.planar_pose import (
    PlanarSolutions,
    planar_guesses,
    planar_solutions,
)
from vision_gt.optics.transforms import stacked

_ENOUGH, _GOOD, _CAP = 1, 25.0, 40.0
"""After so many markers, the largest first, a guess with this mean square (square pixels) is good
enough to start from; no corner counts for more pixels than the cap. A judgement: a guess from a
small marker misses the corners of others by a few pixels, one of the wrong solution by dozens."""


@lru_cache(maxsize=64)
def marker_corners(side: float) -> Array:
    """(4, 3) corners of a marker in its own frame, metres, in the order of detection.

    The frame is in the middle of the marker, x to the right of the print, y up, z towards the
    viewer, as in AD2.3, where the dima-marker lies on its back with z upwards.
    """
    h = side / 2
    corners = np.array([[-h, h, 0], [h, h, 0], [h, -h, 0], [-h, -h, 0]])
    corners.setflags(write=False)
    return corners


def marker_solutions(view: MarkerView, side: float, camera: Camera) -> PlanarSolutions | None:
    """Both poses T_camera_marker of a single marker, best first."""
    return planar_solutions(marker_corners(side), view.corners, camera.parameters)


def marker_views(
    seen: Sequence[tuple[int, int, Sequence[MarkerView]]],
    numbers: Sequence[int],
    sides: Mapping[int, float],
) -> Views:
    """Corners of markers for the adjustment.

    Parameters
    ----------
    seen : sequence of (camera, body, views)
        Which camera saw which robot pose, and the markers it saw.
    numbers : sequence of int
        Ids in the order of the adjustment's parts.
    sides : mapping of int to float
        Metres.
    """
    listed = [(camera, body, view) for camera, body, views in seen for view in views]
    return Views(
        camera=np.repeat([camera for camera, _, _ in listed], 4).astype(np.intp),
        body=np.repeat([body for _, body, _ in listed], 4).astype(np.intp),
        part=np.repeat([numbers.index(v.number) for _, _, v in listed], 4).astype(np.intp),
        point=np.concatenate([marker_corners(sides[v.number]) for _, _, v in listed]),
        pixel=np.concatenate([v.corners for _, _, v in listed]),
        covariance=np.concatenate([v.covariances for _, _, v in listed]),
    )


@dataclass(frozen=True)
class Layout:
    """The markers on the robot.

    Parameters
    ----------
    numbers : tuple of int
        Ids.
    sides : (m,) array
        Lengths of their sides, metres.
    T_robot_marker : RigidTransform
        Stack of m.
    covariance : (6 m, 6 m) array
        Of all of them together.
    """

    numbers: tuple[int, ...]
    sides: Array
    T_robot_marker: RigidTransform
    covariance: Array

    @cached_property
    def placed(self) -> tuple[Array, Array]:
        """Rotations (m, 3, 3) and translations (m, 3) of T_robot_marker."""
        T = self.T_robot_marker
        return T.rotation.as_matrix(), np.asarray(T.translation)

    @cached_property
    def corners_on_robot(self) -> Array:
        """(m, 4, 3) corners of all markers in the robot frame, metres."""
        R, t = self.placed
        own = np.array([marker_corners(float(side)) for side in self.sides])
        return np.asarray(own @ np.swapaxes(R, 1, 2) + t[:, None])

    def index(self, number: int) -> int:
        """Place of a marker in the stacks."""
        return self.numbers.index(number)

    def sigmas(self) -> Array:
        """(m, 6) standard deviations: metres, then radians."""
        return np.sqrt(np.diagonal(self.covariance)).reshape(-1, 6)

    def corners(self, number: int) -> Array:
        """(4, 3) corners of a marker in its own frame."""
        return marker_corners(float(self.sides[self.index(number)]))


def robot_candidates(
    views: Sequence[MarkerView], camera: Camera, layout: Layout
) -> tuple[Array, Array, Array]:
    """T_camera_robot by either solution of each marker, with how badly all corners fit.

    Parameters
    ----------
    views : sequence of MarkerView
        Of one image.
    camera : Camera
        That took it.
    layout : Layout
        Where the markers are on the robot.

    Returns
    -------
    misfits : (k,) array
        Ascending; the mean over all corners of the squared residual length, capped, so that a
        wrong marker does not decide.
    R, t : (k, 3, 3) and (k, 3) arrays
        The candidates.
    """
    rows = [layout.index(view.number) for view in views]
    R_marker, t_marker = layout.placed
    pixels = np.array([view.corners for view in views], dtype=float)
    directions = undistort(pixels, camera.parameters)
    points = layout.corners_on_robot[rows].reshape(-1, 3)
    largest_first = np.argsort(-np.prod(np.ptp(pixels, axis=1), axis=1), kind="stable")
    found: list[tuple[Array, Array, Array]] = []
    least = np.inf
    for count, one in enumerate(largest_first):
        if count >= _ENOUGH and least < _GOOD:
            break
        marker = marker_corners(float(layout.sides[rows[one]]))
        if len(views) > 1:
            guesses = planar_guesses(marker, directions[one])
        else:  # its two solutions are judged by their fit, so they are refined
            refined = planar_solutions(marker, pixels[one], camera.parameters)
            guesses = None if refined is None else (refined.R, refined.t)
        if guesses is None:
            continue
        R = guesses[0] @ R_marker[rows[one]].T
        t = guesses[1] - R @ t_marker[rows[one]]
        seen = points @ np.swapaxes(R, 1, 2) + t[:, None]
        miss = project(seen, camera.parameters) - pixels.reshape(-1, 2)
        squares = np.nan_to_num((miss**2).sum(-1), nan=np.inf)
        misfits = np.minimum(squares, _CAP**2).mean(-1)
        found.append((misfits, R, t))
        least = min(least, float(misfits.min()))
    if not found:
        return np.zeros(0), np.zeros((0, 3, 3)), np.zeros((0, 3))
    misfits, R, t = (np.concatenate([one[i] for one in found]) for i in range(3))
    order = np.argsort(misfits, kind="stable")
    return misfits[order], R[order], t[order]


def best_start(
    views: Sequence[MarkerView], camera: Camera, layout: Layout
) -> RigidTransform | None:
    """The best of `robot_candidates`, if there is any."""
    _, R, t = robot_candidates(views, camera, layout)
    return stacked(R[0], t[0]) if len(R) else None
