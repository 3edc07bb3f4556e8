"""Markers in an image: found by OpenCV, their corners fitted here."""

from collections.abc import Collection
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from validation.errors import GtvalError
from validation.poses.angles import Array
from vision_gt.images.corners import refine_corners
from vision_gt.optics.camera import Camera
from vision_gt.patterns.dictionaries import Family

Image = npt.NDArray[np.uint8]

STOCK_SIGMA = 0.5
"""Pixels; what is assumed of corners that were not fitted here: OpenCV's are off by 0.3 to 0.8 on
rendered images, see benchmarks/vision_corners.py."""
_WINDOW = 11
"""Pixels of the window that the thresholding of the first look uses: the middle one of OpenCV's
three. Where it finds nothing, all are tried."""
LEAST_CELL = 1.6
"""Pixels of a cell's side below which no code can be read, on rendered images with usual blur."""


@dataclass(frozen=True)
class MarkerView:
    """A marker as one image shows it.

    Parameters
    ----------
    number : int
        Its id.
    corners : (4, 2) array
        Pixels: top left, top right, bottom right, bottom left of the printed marker.
    covariances : (4, 2, 2) array
        Of the corners, square pixels.
    """

    number: int
    corners: Array
    covariances: Array


@dataclass(frozen=True)
class Detection:
    """What was found in one image.

    Parameters
    ----------
    views : tuple of MarkerView
        Each id at most once.
    duplicates : tuple of int
        Ids that were seen more than once; none of their views is used.
    strangers : tuple of int
        Ids that no marker of the campaign has.
    """

    views: tuple[MarkerView, ...]
    duplicates: tuple[int, ...] = ()
    strangers: tuple[int, ...] = ()

    @property
    def numbers(self) -> tuple[int, ...]:
        """Ids of the views."""
        return tuple(view.number for view in self.views)


def detect_markers(
    image: Image,
    family: Family,
    camera: Camera | None = None,
    wanted: Collection[int] | None = None,
    *,
    fitted: bool = True,
) -> Detection:
    """The markers of a family in an image.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    family : Family
        Of the markers.
    camera : Camera, optional
        Its distortion bends the edges that are fitted.
    wanted : collection of int, optional
        Ids that the campaign has; others are named as strangers.
    fitted : bool
        Whether corners are fitted to the grey levels; otherwise they are OpenCV's, unrefined.

    Raises
    ------
    GtvalError
        If the image is not of the camera's size.
    """
    if camera is not None and image.shape != camera.size[::-1]:
        raise GtvalError(
            f"camera {camera.name}: the image has {image.shape[1]} x {image.shape[0]} pixels, "
            f"the camera was calibrated with {camera.size[0]} x {camera.size[1]}"
        )
    found, numbers = _candidates(image, family, fitted=fitted)
    counts = {number: numbers.count(number) for number in numbers}
    known = {number for number in counts if wanted is None or number in wanted}
    use = [i for i, number in enumerate(numbers) if number in known and counts[number] == 1]
    corners = found[use]
    covariances = np.broadcast_to(STOCK_SIGMA**2 * np.eye(2), (len(use), 4, 2, 2))
    if fitted:
        parameters = None if camera is None else camera.parameters
        bits = np.array([family.bits(numbers[i]) for i in use]).reshape(
            len(use), *2 * (family.cells,)
        )
        fit = refine_corners(image, corners, bits, parameters)
        corners, covariances = fit.corners, _with_stock(fit.covariances, fit.good)
    views = [MarkerView(numbers[i], corners[row], covariances[row]) for row, i in enumerate(use)]
    return Detection(
        tuple(sorted(views, key=lambda view: view.number)),
        tuple(sorted(number for number in known if counts[number] > 1)),
        tuple(sorted(set(counts) - known)),
    )


def _with_stock(covariances: Array, good: npt.NDArray[np.bool_]) -> Array:
    """Covariances, with four times the stock sigma for corners that could not be fitted."""
    return np.where(good[..., None, None], covariances, (4 * STOCK_SIGMA) ** 2 * np.eye(2))


def _candidates(image: Image, family: Family, *, fitted: bool) -> tuple[Array, list[int]]:
    """Corners (n, 4, 2) and ids as OpenCV finds them."""
    if not fitted:
        return _found(image, family, cv2.aruco.DetectorParameters())
    careful = _careful(family, max(image.shape))
    careful.adaptiveThreshWinSizeMin = careful.adaptiveThreshWinSizeMax = _WINDOW
    found, numbers = _found(image, family, careful)
    if numbers:
        return found, numbers
    return _found(image, family, _careful(family, max(image.shape)))


def _careful(family: Family, size: int) -> cv2.aruco.DetectorParameters:
    """OpenCV's parameters with bits that are read more carefully, for images of a size.

    Bits are read in the middle of cells of six pixels: the cells of a far marker are blurred
    into each other. Outlines may be as crooked as those of small, blurred quadrangles are, and
    those too small for any code to be read are not tried. So one thresholding window finds as
    many markers as OpenCV's defaults do with three.
    """
    parameters = cv2.aruco.DetectorParameters()
    parameters.perspectiveRemovePixelPerCell = 6
    parameters.perspectiveRemoveIgnoredMarginPerCell = 0.3
    parameters.polygonalApproxAccuracyRate = 0.05
    parameters.minMarkerPerimeterRate = min(4 * LEAST_CELL * family.cells / size, 0.1)
    return parameters


def _found(
    image: Image, family: Family, parameters: cv2.aruco.DetectorParameters
) -> tuple[Array, list[int]]:
    parameters.markerBorderBits = family.border
    detector = cv2.aruco.ArucoDetector(family.dictionary, parameters)
    corners, ids, _rejected = detector.detectMarkers(image)
    if ids is None or len(ids) == 0:
        return np.zeros((0, 4, 2)), []
    return np.array(corners, dtype=float).reshape(-1, 4, 2), [int(n) for n in np.ravel(ids)]
