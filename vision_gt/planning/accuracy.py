"""How well cameras will know the robot's pose: the covariance that the corners of its markers give.

The pose follows from the corners by least squares, so its covariance is the inverse of J^T J over
the variance of a corner, J being the derivative of the pixels by a small change of the pose. What
cameras, lens and markers themselves are uncertain by comes on top, and is the same for all of the
floor; a campaign has it from its calibration.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from vision_gt.images.markers import FACING, LEAST_CELL, shortest_widths
from vision_gt.optics.camera import project_with_jacobians
from vision_gt.optics.planar_pose import planar_solutions
from vision_gt.optics.transforms import cross_matrix, planar_jacobian
from vision_gt.planning.floor import pixels_of
from vision_gt.planning.mounting import MountedCamera
from vision_gt.robot.marker_poses import Layout, marker_corners
from vision_gt.robot.robot_pose import AMBIGUOUS_EXCESS

_LEAST_INFORMATION = 1e-9
"""Smallest over largest eigenvalue of the information: less is none."""


@dataclass(frozen=True)
class Views:
    """What one camera has of the robot at many poses.

    Parameters
    ----------
    information : (p, 6, 6) array
        Of the robot's pose in space, from the corners of all readable markers; zeros where there
        is none.
    readable : (p, m) array of bool
        Which markers are in the image, face the camera and are large enough to be read.
    sides : (p, m) array
        Shortest width of each marker in the image, pixels; NaN where it is not readable.
    ambiguous : (p,) array of bool
        Whether only one marker is readable and another pose fits it nearly as well.
    """

    information: Array
    readable: npt.NDArray[np.bool_]
    sides: Array
    ambiguous: npt.NDArray[np.bool_]

    @property
    def gives_pose(self) -> npt.NDArray[np.bool_]:
        """(p,) whether the camera gives a sure pose."""
        return self.readable.any(1) & ~self.ambiguous


def views_of(
    mount: MountedCamera,
    layout: Layout,
    poses: Array,
    corner_sigma: float,
    cells: int,
    *,
    on_floor: bool = False,
) -> Views:
    """What a camera will have of a robot that stands at poses (p, 3).

    Parameters
    ----------
    mount : MountedCamera
        The camera.
    layout : Layout
        The robot's markers.
    poses : (p, 3) array
        x, y, theta.
    corner_sigma : float
        Standard deviation of a corner's coordinate, pixels.
    cells : int
        Along a marker's side.
    on_floor : bool
        Whether the robot is held to the floor, which decides between two poses of one marker.
    """
    R_robot, t_robot = _standing(poses)
    points = np.einsum("pij,mcj->pmci", R_robot, layout.corners_on_robot) + t_robot[:, None, None]
    R = mount.T_gtv_camera.rotation.as_matrix()
    _, by_point, _ = project_with_jacobians((points - mount.eye) @ R, mount.camera.parameters)
    pixels = pixels_of(points, mount)
    sides = shortest_widths(pixels)
    middles = points.mean(2)
    normals = R_robot[:, None] @ layout.placed[0][None, :, :, 2, None]
    to_eye = mount.eye - middles
    cosine = (normals[..., 0] * to_eye).sum(-1) / np.linalg.norm(to_eye, axis=-1)
    with np.errstate(invalid="ignore"):
        readable = (sides >= LEAST_CELL * cells) & (cosine > FACING)
    by_change = np.zeros((*points.shape, 6))
    by_change[..., :3] = np.eye(3)
    by_change[..., 3:] = -cross_matrix(points - t_robot[:, None, None])
    J = by_point @ R.T @ by_change / corner_sigma
    J = np.where(readable[..., None, None, None], J, 0.0)
    information = np.einsum("pmcai,pmcaj->pij", J, J)
    single = (readable.sum(1) == 1) & (not on_floor)
    ambiguous = np.zeros(len(poses), dtype=bool)
    for p in np.flatnonzero(single):
        m = int(np.argmax(readable[p]))
        ambiguous[p] = _looks_like_another(pixels[p, m], layout.sides[m], mount, corner_sigma)
    return Views(information, readable, np.where(readable, sides, np.nan), ambiguous)


def _standing(poses: Array) -> tuple[Array, Array]:
    """Rotations (p, 3, 3) and places (p, 3) of a robot that stands upright."""
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    R = np.zeros((len(poses), 3, 3))
    R[:, 0, 0] = R[:, 1, 1] = c
    R[:, 0, 1], R[:, 1, 0], R[:, 2, 2] = -s, s, 1.0
    return R, np.column_stack([poses[:, :2], np.zeros(len(poses))])


def _looks_like_another(
    pixels: Array, side: float, mount: MountedCamera, corner_sigma: float
) -> bool:
    """Whether a second pose fits the exact corners (4, 2) of a marker nearly as well."""
    found = planar_solutions(marker_corners(float(side)), pixels, mount.camera.parameters)
    if found is None or len(found.errors) < 2:
        return False
    return bool(4 * (found.errors[1] / corner_sigma) ** 2 < AMBIGUOUS_EXCESS)


def planar_covariances(information: Array, headings: Array, floor: Array | None = None) -> Array:
    """Covariances (p, 3, 3) of x, y, theta from information (p, 6, 6) of poses in space.

    Parameters
    ----------
    information : (p, 6, 6) array
        Of small changes of the robot's pose.
    headings : (p,) array
        Of the robot, radians.
    floor : (6, 6) array, optional
        Information of a robot that stands on the floor.

    Returns
    -------
    (p, 3, 3) array
        NaN where the information leaves the pose open.
    """
    whole = information if floor is None else information + floor
    # Lengths and angles are of like size in metres and radians, so eigenvalues compare.
    least, most = np.linalg.eigvalsh(whole)[:, [0, -1]].T
    known = (least > _LEAST_INFORMATION * np.maximum(most, 1e-300)) & information.any((1, 2))
    inverse = np.linalg.inv(np.where(known[:, None, None], whole, np.eye(6)))
    poses = np.column_stack([np.zeros((len(headings), 2)), headings])
    J = np.array([planar_jacobian(R) for R in _standing(poses)[0]]).reshape(-1, 3, 6)
    covariance = J @ inverse @ np.swapaxes(J, 1, 2)
    return np.where(known[:, None, None], covariance, np.nan)


def best_and_merged(
    views: Sequence[Views], headings: Array, floor: Array | None = None
) -> tuple[Array, Array, Array]:
    """Covariances from each camera (c, p, 3, 3), the best of them (p, ...), all together (p, ...).

    A camera whose only marker looks alike from two poses gives none by itself; together with
    others it takes part.
    """
    single = np.array(
        [
            np.where(
                one.gives_pose[:, None, None],
                planar_covariances(one.information, headings, floor),
                np.nan,
            )
            for one in views
        ]
    )
    spread = np.nan_to_num(single[..., 0, 0] + single[..., 1, 1], nan=np.inf)
    best = np.take_along_axis(single, np.argmin(spread, 0)[None, :, None, None], 0)[0]
    summed = np.sum([one.information for one in views], axis=0)
    merged = planar_covariances(summed, headings, floor)
    seen = sum(one.readable.any(1).astype(int) for one in views)
    sure = np.any([one.gives_pose for one in views], axis=0) | (np.asarray(seen) > 1)
    return single, best, np.where(sure[:, None, None], merged, np.nan)
