"""Markers in an image: found by OpenCV, their corners fitted here."""

from collections.abc import Collection
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from validation.errors import GtvalError
from validation.poses.angles import Array
from vision_gt.images.corners import refine_corners, windows
from vision_gt.images.edges import sought_corners
from vision_gt.images.reading import (
    Reading,
    code_margins,
    drawn_apart,
    might_be_markers,
    read_codes,
    turned_corners,
)
from vision_gt.optics.camera import Camera
from vision_gt.patterns.dictionaries import Family
from vision_gt.patterns.rejections import Rejection, rejected
from vision_gt.prints.edge_samples import Flat

Image = npt.NDArray[np.uint8]

STOCK_SIGMA = 0.5
"""Pixels; what is assumed of corners that were not fitted here: OpenCV's are off by 0.3 to 0.8 on
rendered images, see benchmarks/vision_corners.py."""
_WINDOWS = (3, 13, 23)
"""Pixels of the windows that the thresholding uses, which are OpenCV's. Of 651 markers that OpenCV
reads in 23 images (20 to 40 pixels; blurred, sharpened, overexposed, compressed, with Bayer's
pattern), each of which has one that the first two windows lose, these find 650, and 144 more; 3 and
13 alone 633, 5 and 21 636."""
_NEAR_ANOTHER, _OF_A_GROUP = 0.08, 0.1
"""Perimeters that outlines may be from each other: of nearer ones OpenCV makes groups, and tries
those of a group that are a little apart. With its own 0.125 and 0.21, outlines of the rim stand for
small markers, with 0.05 and less for large ones: 7 of those 651 are lost, and 12 of 210 in eleven
other images; with these, 1 and 1."""
LEAST_CELL = 1.6
"""Pixels of a cell's side below which no code can be read, on rendered images with usual blur."""
FACING = float(np.cos(np.deg2rad(75)))
"""Cosine between a marker's normal and the ray to it. Markers are not read from flatter than that:
a cell is then a quarter as high as wide. A judgement."""
_LEAST_SEEN = 1.3
"""Pixels of a cell below which no outline is tried: those of blurred markers are drawn small. With
1.4 four markers of 20 pixels and nine cells are lost that OpenCV reads, with 1.3 none."""
_DRAWINGS = 2
"""A judgement: each draws the sides of a quadrangle by up to four pixels."""
_TWICE = "seen more than once; none of them is used"
_STRANGER = "no marker of the campaign has this id"
_UNREAD = "a black border in a white rim, but its cells are no code of {}"
_AS_WELL = "its cells are as well those of another id: too small or too blurred to tell"
_LEAST_MARGIN = 1.0
"""Cells by which a marker has to look more like its own id than like any other: of 863 rendered
markers that were read rightly none had less than 3.3, and one read as its neighbour had -3.4."""
_ROUGH = "its sides could not be fitted (covered, blurred, too little contrast): 2 px are assumed"


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
    rejected : tuple of Rejection
        What looks like a marker and is not used, and corners that could not be fitted.
    """

    views: tuple[MarkerView, ...]
    duplicates: tuple[int, ...] = ()
    strangers: tuple[int, ...] = ()
    rejected: tuple[Rejection, ...] = ()

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
    found, numbers, unread = _candidates(image, family, fitted=fitted)
    counts = {number: numbers.count(number) for number in numbers}
    known = {number for number in counts if wanted is None or number in wanted}
    use = [i for i, number in enumerate(numbers) if number in known and counts[number] == 1]
    left = [
        rejected("marker", _TWICE if number in known else _STRANGER, number, found[i])
        for i, number in enumerate(numbers)
        if i not in use
    ]
    left += [rejected("marker", _UNREAD.format(family.name), None, quad) for quad in unread]
    corners, read = found[use], [numbers[i] for i in use]
    if fitted:
        views, more = _fitted(image, corners, read, family, camera)
        left += more
    else:
        stock = np.broadcast_to(STOCK_SIGMA**2 * np.eye(2), (len(use), 4, 2, 2))
        views = [MarkerView(*one) for one in zip(read, corners, stock, strict=True)]
    return Detection(
        tuple(sorted(views, key=lambda view: view.number)),
        tuple(sorted(number for number in known if counts[number] > 1)),
        tuple(sorted(set(counts) - known)),
        tuple(left),
    )


def _fitted(
    image: Image, start: Array, numbers: list[int], family: Family, camera: Camera | None
) -> tuple[list[MarkerView], list[Rejection]]:
    """Markers with corners fitted to the grey levels; and what could not be fitted or told."""
    if not numbers:
        return [], []
    parameters = None if camera is None else camera.parameters
    bits = np.array([family.bits(number) for number in numbers])
    fit = refine_corners(image, start, bits.reshape(-1, family.cells, family.cells), parameters)
    left = [
        rejected("corner", _ROUGH, numbers[row], fit.corners[row, corner])
        for row, corner in zip(*np.nonzero(~fit.good), strict=True)
    ]
    margins = code_margins(image, fit.corners, np.array(numbers, dtype=np.intp), family)
    told = ~fit.good.all(1) | (margins > _LEAST_MARGIN)
    left += [
        rejected("marker", _AS_WELL, numbers[row], fit.corners[row])
        for row in np.flatnonzero(~told)
    ]
    covariances = _with_stock(fit.covariances, fit.good)
    views = [
        MarkerView(numbers[row], fit.corners[row], covariances[row]) for row in np.flatnonzero(told)
    ]
    return views, left


def shortest_widths(pixels: Array) -> Array:
    """Shortest widths (...) of quadrangles (..., 4, 2): area over the longest side; NaN if cut."""
    x, y = pixels[..., 0], pixels[..., 1]
    twice = (x * np.roll(y, -1, -1) - y * np.roll(x, -1, -1)).sum(-1)
    longest = np.linalg.norm(pixels - np.roll(pixels, -1, -2), axis=-1).max(-1)
    return np.asarray(0.5 * np.abs(twice) / longest)


def _with_stock(covariances: Array, good: npt.NDArray[np.bool_]) -> Array:
    """Covariances, with four times the stock sigma for corners that could not be fitted."""
    return np.where(good[..., None, None], covariances, (4 * STOCK_SIGMA) ** 2 * np.eye(2))


def _candidates(image: Image, family: Family, *, fitted: bool) -> tuple[Array, list[int], Array]:
    """Corners (n, 4, 2) and ids of markers; and quadrangles (k, 4, 2) that look like some."""
    if not fitted:
        found, numbers, _ = _found(image, family, cv2.aruco.DetectorParameters())
        return found, numbers, np.zeros((0, 4, 2))
    image = drawn_apart(image)
    found, numbers, others = _found(image, family, _quick(family, max(image.shape)))
    reading, quads, unread = _read_again(image, others, family)
    own = turned_corners(quads, reading)
    # OpenCV names the outline of the rim, or of a hole, of a marker that it has read, too.
    new = [
        i
        for i, number in enumerate(reading.numbers.tolist())
        if not _among(own[i].mean(0), number, found, numbers)
    ]
    numbers = [*numbers, *reading.numbers[new].tolist()]
    return np.concatenate([found, own[new]]), numbers, unread


def _among(middle: Array, number: int, found: Array, numbers: list[int]) -> bool:
    """Whether a marker of this number has been found where another one of it would be."""
    for i in (i for i, n in enumerate(numbers) if n == number):
        if (
            np.linalg.norm(found[i].mean(0) - middle)
            < np.linalg.norm(found[i][0] - found[i][2]) / 2
        ):
            return True
    return False


def _read_again(image: Image, quads: Array, family: Family) -> tuple[Reading, Array, Array]:
    """Codes that OpenCV could not read, the quadrangles made better, and those that have no code.

    Outlines of small and blurred markers are off by up to four pixels. So those that are darker
    inside than outside are drawn to where grey levels drop most, and read then.
    """
    quads = quads[might_be_markers(image, quads, family)]
    if len(quads):
        flat = Flat(None)
        for _ in range(_DRAWINGS):
            half = windows(quads, family.cells)
            quads = sought_corners(image, quads, half, flat)
    reading = read_codes(image, quads, family)
    others = np.setdiff1d(reading.bordered, reading.rows)
    return reading, quads, quads[others]


def _quick(family: Family, size: int) -> cv2.aruco.DetectorParameters:
    """OpenCV's parameters for images of a size: quadrangles too small to be read are not tried."""
    parameters = cv2.aruco.DetectorParameters()
    first, second, last = _WINDOWS
    parameters.adaptiveThreshWinSizeMin, parameters.adaptiveThreshWinSizeMax = first, last
    parameters.adaptiveThreshWinSizeStep = second - first
    parameters.minMarkerDistanceRate = _NEAR_ANOTHER
    parameters.minGroupDistance = _OF_A_GROUP
    parameters.minMarkerPerimeterRate = min(4 * _LEAST_SEEN * family.cells / size, 0.1)
    return parameters


def _found(
    image: Image, family: Family, parameters: cv2.aruco.DetectorParameters
) -> tuple[Array, list[int], Array]:
    """Corners (n, 4, 2) and ids of markers as OpenCV finds them; and its other quadrangles."""
    parameters.markerBorderBits = family.border
    detector = cv2.aruco.ArucoDetector(family.dictionary, parameters)
    corners, ids, others = detector.detectMarkers(image)
    unread = np.array(others, dtype=float).reshape(-1, 4, 2)
    if ids is None or len(ids) == 0:
        return np.zeros((0, 4, 2)), [], unread
    numbers = [int(n) for n in np.ravel(ids)]
    return np.array(corners, dtype=float).reshape(-1, 4, 2), numbers, unread
