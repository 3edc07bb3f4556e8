"""Markers located in an image."""

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import RigidTransform

from gtval.arguments import said_plainly
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.shown import Shown
from vision_gt.images.files import read_image
from vision_gt.images.markers import detect_markers
from vision_gt.optics.camera import Camera
from vision_gt.patterns.dictionaries import Family
from vision_gt.robot.marker_poses import marker_solutions

__all__ = ["Camera", "MarkerPlace", "locate_markers"]


@dataclass(frozen=True, repr=False)
class MarkerPlace(Shown):
    """A marker in one image.

    Parameters
    ----------
    number : int
        Its id.
    corners : (4, 2) array
        Pixels: top left, top right, bottom right, bottom left of the printed marker; the centre
        of the top-left pixel of the image is at (0, 0).
    covariances : (4, 2, 2) array
        Of the corners, square pixels.
    T_camera_marker : RigidTransform
        Stack of one or two poses from which a flat marker looks nearly the same, the better one
        first, metres. Camera: x right, y down, z forward. Marker: x right and y up on the print,
        z towards the viewer, the origin in its middle.
    errors : (k,) array
        Root mean square of the corners' residuals for each of these poses, pixels.
    """

    number: int
    corners: Array
    covariances: Array
    T_camera_marker: RigidTransform
    errors: Array


@said_plainly
def locate_markers(
    image: npt.NDArray[np.uint8] | str | PathLike[str],
    camera: Camera,
    sides: Mapping[int, float],
    family: str,
    *,
    border: int = 1,
) -> tuple[MarkerPlace, ...]:
    """The markers in an image, and where they are.

    Parameters
    ----------
    image : (h, w) array of uint8, or path
        Grey levels, or an image file.
    camera : Camera
        Its name, its size and nine intrinsic parameters.
    sides : mapping of int to float
        Side of the black square of each marker, metres; others are left out.
    family : str
        As OpenCV calls it without 'DICT_', such as '6X6_250' or 'APRILTAG_36H11', or
        'ARTOOLKITPLUS_SIMPLE'.
    border : int
        Cells of black border on each side.

    Returns
    -------
    tuple of MarkerPlace
        By their ids; a marker that is seen twice in the image is left out.

    Raises
    ------
    GtvalError
        If there is no such family, or the image is not of the camera's size.

    Notes
    -----
    Collins and Bartoli, "Infinitesimal plane-based pose estimation", IJCV 109 (2014).

    Examples
    --------
    >>> room = gtval.testing.make_images(seed=1)
    >>> found = gtval.locate_markers(room.images[0], room.camera, room.sides, room.family)
    >>> off = found[0].T_camera_marker[0].inv() * room.truth[0][found[0].number]
    >>> bool(abs(off.translation).max() < 0.02)
    True
    """
    for number, side in sides.items():
        if not side > 0:
            raise GtvalError(f"marker {number}: a side of {side} m; give metres above zero")
    grey = image if isinstance(image, np.ndarray) else read_image(Path(image))
    found = detect_markers(grey, Family(family, border), camera, sides)
    places = []
    for view in found.views:
        solved = marker_solutions(view, sides[view.number], camera)
        if solved is not None:
            where = (solved.T_camera_plane, solved.errors)
            places.append(MarkerPlace(view.number, view.corners, view.covariances, *where))
    return tuple(places)
