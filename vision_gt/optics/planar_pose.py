"""Poses of flat things from one image of them: both solutions, best first."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import RigidTransform

from validation.poses.angles import Array
from vision_gt.optics.camera import project, project_with_jacobians, undistort
from vision_gt.optics.transforms import cross_matrix, rotation_matrices, stacked

_BROWN = 9
"""Parameters of the lens that OpenCV refines poses with."""
_STEPS, _REST = 20, 1e-10
"""Of steps that shrink quadratically, and how small the last is: radians and metres."""


@dataclass(frozen=True)
class PlanarSolutions:
    """The two poses from which a flat thing looks nearly the same.

    Parameters
    ----------
    R, t : (k, 3, 3) and (k, 3) arrays
        T_camera_plane of one or two, best first.
    errors : (k,) array
        Root mean square of the reprojection residuals' lengths, pixels.
    """

    R: Array
    t: Array
    errors: Array

    @property
    def T_camera_plane(self) -> RigidTransform:
        """Both as a stack."""
        return stacked(self.R, self.t)

    @property
    def best(self) -> RigidTransform:
        """The one that fits better."""
        return stacked(self.R[0], self.t[0])


def planar_solutions(points: Array, pixels: Array, parameters: Array) -> PlanarSolutions | None:
    """Both poses of a flat thing; None if there is none in front of the camera.

    Parameters
    ----------
    points : (n, 3) array
        Points of the thing's plane z = 0, at least four, metres.
    pixels : (n, 2) array
        Where they are seen.
    parameters : (9,) or (13,) array
        Intrinsic parameters.

    Notes
    -----
    Collins and Bartoli, "Infinitesimal plane-based pose estimation", IJCV 109 (2014). Refined,
    each solution is a local minimum of the reprojection error if it is one at all.
    """
    pixels = np.asarray(pixels, dtype=float)
    guesses = planar_guesses(points, undistort(pixels, parameters))
    if guesses is None:
        return None
    K = np.array([[parameters[0], 0, parameters[2]], [0, parameters[1], parameters[3]], [0, 0, 1]])
    centre = points.mean(0)
    turned, moved = [], []
    found: Sequence[npt.NDArray[Any]]
    for R, t in zip(*guesses, strict=True):
        about_centre = (t + R @ centre)[:, None]
        if len(parameters) > _BROWN:
            found = _refined(points - centre, pixels, parameters, R, about_centre)
        else:
            found = cv2.solvePnPRefineLM(
                points - centre, pixels, K, parameters[4:], cv2.Rodrigues(R)[0], about_centre
            )
        turned.append(np.ravel(found[0]))
        moved.append(np.ravel(found[1]))
    R = rotation_matrices(np.array(turned))
    t = np.array(moved) - R @ centre
    seen = points @ np.swapaxes(R, 1, 2) + t[:, None]
    errors = np.sqrt(((project(seen, parameters) - pixels) ** 2).sum(-1).mean(-1))
    order = np.argsort(errors)[: int(np.isfinite(errors).sum())]
    if not len(order):
        return None
    return PlanarSolutions(R[order], t[order], errors[order])


def _refined(
    points: Array, pixels: Array, parameters: Array, R: Array, t: Array
) -> tuple[Array, Array]:
    """A rotation vector and a translation (3, 1) that fit better; for lenses OpenCV has not."""
    t = t[:, 0]
    for _ in range(_STEPS):
        turned = points @ R.T
        seen, by_point, _ = project_with_jacobians(turned + t, parameters)
        if not np.isfinite(seen).all():
            break
        J = np.concatenate([-by_point @ cross_matrix(turned), by_point], axis=2).reshape(-1, 6)
        change = np.linalg.lstsq(J, (pixels - seen).ravel(), rcond=None)[0]
        R, t = rotation_matrices(change[None, :3])[0] @ R, t + change[3:]
        if np.abs(change).max() < _REST:
            break
    return np.asarray(cv2.Rodrigues(R)[0], dtype=float), t[:, None]


def planar_guesses(points: Array, directions: Array) -> tuple[Array, Array] | None:
    """Both poses in closed form: rotations (k, 3, 3) and translations (k, 3).

    Parameters
    ----------
    points : (n, 3) array
        Points of the thing's plane z = 0, at least four, metres.
    directions : (n, 2) array
        Undistorted image coordinates at which they are seen.
    """
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
    turned = np.array(rotations, dtype=float).reshape(-1, 3)
    moved = np.array(translations, dtype=float).reshape(-1, 3)
    fine = np.isfinite(turned).all(1) & np.isfinite(moved).all(1)
    fine[fine] &= moved[fine, 2] > 0
    if not fine.any():
        return None
    R = rotation_matrices(turned[fine])
    return R, moved[fine] - R @ centre
