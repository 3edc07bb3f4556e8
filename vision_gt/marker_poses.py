"""What markers say about where they are, and where the robot is that carries them."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial.transform import RigidTransform

from validation.angles import Array
from vision_gt.camera import Camera, project
from vision_gt.markers import MarkerView
from vision_gt.planar_pose import PlanarSolutions, planar_solutions
from vision_gt.setups import Views

_ENOUGH, _GOOD = 2, 25.0
"""After so many markers, the largest first, a guess with this mean square is good enough."""


def marker_corners(side: float) -> Array:
    """(4, 3) corners of a marker in its own frame, metres, in the order of detection.

    The frame is in the middle of the marker, x to the right of the print, y up, z towards the
    viewer, as in AD2.3, where the dima-marker lies on its back with z upwards.
    """
    h = side / 2
    return np.array([[-h, h, 0], [h, h, 0], [h, -h, 0], [-h, -h, 0]])


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


def robot_candidates(
    views: Sequence[MarkerView],
    camera: Camera,
    sides: Mapping[int, float],
    numbers: Sequence[int],
    T_robot_marker: RigidTransform,
) -> list[tuple[float, RigidTransform]]:
    """T_camera_robot by either solution of each marker, with how badly all corners fit.

    Parameters
    ----------
    views : sequence of MarkerView
        Of one image.
    camera : Camera
        That took it.
    sides : mapping of int to float
        Of the markers, metres.
    numbers : sequence of int
        Ids in the order of the stack.
    T_robot_marker : RigidTransform
        Where the markers are on the robot.

    Returns
    -------
    list of (float, RigidTransform)
        Best first; the mean over all corners of the squared residual length, capped, so that a
        wrong marker does not decide.
    """
    found: list[tuple[float, RigidTransform]] = []
    points = np.concatenate(
        [
            T_robot_marker[numbers.index(v.number)].apply(marker_corners(sides[v.number]))
            for v in views
        ]
    )
    pixels = np.concatenate([view.corners for view in views])
    largest_first = sorted(views, key=lambda view: -float(np.ptp(view.corners, axis=0).prod()))
    for count, view in enumerate(largest_first):
        if count >= _ENOUGH and found and min(found, key=_first)[0] < _GOOD:
            break
        solutions = planar_solutions(
            marker_corners(sides[view.number]),
            view.corners,
            camera.parameters,
            refine=len(views) < 2,
        )
        if solutions is None:
            continue
        T_marker_robot = T_robot_marker[numbers.index(view.number)].inv()
        for T in solutions.T_camera_plane:
            T_camera_robot = T * T_marker_robot
            found.append((_misfit(T_camera_robot, points, pixels, camera), T_camera_robot))
    return sorted(found, key=_first)


def _first(pair: tuple[float, RigidTransform]) -> float:
    return pair[0]


def _misfit(T: RigidTransform, points: Array, pixels: Array, camera: Camera) -> float:
    miss = project(T.apply(points), camera.parameters) - pixels
    squares = np.nan_to_num((miss**2).sum(1), nan=np.inf)
    return float(np.minimum(squares, 40.0**2).mean())


def best_start(
    views: Sequence[MarkerView],
    camera: Camera,
    sides: Mapping[int, float],
    numbers: Sequence[int],
    T_robot_marker: RigidTransform,
) -> RigidTransform | None:
    """The best of `robot_candidates`, if there is any."""
    found = robot_candidates(views, camera, sides, numbers, T_robot_marker)
    return found[0][1] if found else None
