"""Poses of flat things from one image of them: both solutions, best first."""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from validation.angles import Array
from vision_gt.camera import project, undistort

_SIGMA = 0.5


@dataclass(frozen=True)
class PlanarSolutions:
    """The two poses from which a flat thing looks nearly the same.

    Parameters
    ----------
    T_camera_plane : RigidTransform
        A stack of one or two, best first.
    errors : (k,) array
        Root mean square of the reprojection residuals' lengths, pixels.
    """

    T_camera_plane: RigidTransform
    errors: Array

    @property
    def best(self) -> RigidTransform:
        """The one that fits better."""
        return self.T_camera_plane[0]


def planar_solutions(
    points: Array, pixels: Array, parameters: Array, *, refine: bool = True
) -> PlanarSolutions | None:
    """Both poses of a flat thing; None if there is none in front of the camera.

    Parameters
    ----------
    points : (n, 3) array
        Points of the thing's plane z = 0, at least four, metres.
    pixels : (n, 2) array
        Where they are seen.
    parameters : (9,) array
        Intrinsic parameters.
    refine : bool
        Whether to refine each solution by least squares on the pixels.

    Notes
    -----
    Collins and Bartoli, "Infinitesimal plane-based pose estimation", IJCV 109 (2014). Refined,
    each solution is a local minimum of the reprojection error if it is one at all.
    """
    directions = undistort(pixels, parameters)
    if not np.isfinite(directions).all():
        return None
    centre = points.mean(0)
    # IPPE wants the plane through its origin, and is steadiest about the middle of the points.
    try:
        found, rotations, translations, _errors = cv2.solvePnPGeneric(
            points - centre, directions, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
        )
    except cv2.error:
        return None
    if not found:
        return None
    K = np.array([[parameters[0], 0, parameters[2]], [0, parameters[1], parameters[3]], [0, 0, 1]])
    solutions = []
    for rotvec, t in zip(rotations, translations, strict=True):
        if not (np.isfinite(rotvec).all() and np.isfinite(t).all()) or t[2] <= 0:
            continue
        refined, moved = rotvec, t
        if refine:
            refined, moved = cv2.solvePnPRefineLM(
                points - centre, np.asarray(pixels, dtype=float), K, parameters[4:], rotvec, t
            )
        R = Rotation.from_rotvec(np.ravel(refined))
        T = RigidTransform.from_components(np.ravel(moved) - R.apply(centre), R)
        miss = project(T.apply(points), parameters) - pixels
        error = float(np.sqrt((miss**2).sum(-1).mean()))
        if np.isfinite(error):
            solutions.append((error, T))
    if not solutions:
        return None
    solutions.sort(key=lambda pair: pair[0])
    errors = np.array([error for error, _ in solutions])
    return PlanarSolutions(RigidTransform.concatenate([T for _, T in solutions]), errors)
