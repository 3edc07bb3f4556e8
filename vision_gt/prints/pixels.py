"""Which pixels around a print say where it is, and which of them are white paper around it."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from validation.statistics.robust import SIGMA_OF_MEDIAN
from vision_gt.prints.edge_samples import Flat, Image
from vision_gt.prints.print_look import PADDING

Ints = npt.NDArray[np.intp]
Mask = npt.NDArray[np.bool_]
Rim = tuple[float, float]

SQUARE = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
"""Corners in the frame of the print: x to the right, y down, half a side long."""
ALL_LOOKED_AT = 2000
"""Pixels up to which all are used; of more, those at the cells' boundaries are, for between them
nothing says where the print is."""
_FLAT_ONES = 3
"""Of the rows and columns between boundaries every so many: they say how bright the light is."""
_ZONES = 4
"""Into which what lies beyond the rim of each side is divided: of half a pixel or more each."""
_ALIKE, _NOISIER, _LEAST_NOISE = 3.5, 4.0, 0.5
"""Standard deviations that the mean of a zone may be off, and times that it may be more variable
than the print: more is another thing behind the rim. With less noise (grey levels) than the third
nothing would pass, as grey levels are whole numbers."""
_GOLDEN = (np.sqrt(5) - 1) / 2


@dataclass(frozen=True)
class Seen:
    """A print's cells (c + 20, c + 20) with all the white around it, and the pixels there.

    ``places`` (3, n) are undistorted pixels, homogeneous, ``grey`` (n,) their levels. ``zone`` (n,)
    is 0 on the print and its rim; further out it numbers the four sides and how far it is. ``some``
    says that they are a part of those that tell.
    """

    cells: Array
    places: Array
    grey: Array
    zone: Ints
    some: bool

    def without_zones(self) -> "Seen":
        """The print and its rim alone."""
        own = self.zone == 0
        return Seen(self.cells, self.places[:, own], self.grey[own], self.zone[own], self.some)


def pixels_around(
    image: Image, H: Array, bits: Array, rim: Rim, flat: Flat, told: int, most: int | None = None
) -> Seen:
    """The pixels of a print and its rim that say where it is, and some that say how bright.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    H : (3, 3) array
        From the print to undistorted pixels, to a pixel or two.
    bits : (c, c) array
        1 where the print is white.
    rim : (float, float)
        Cells of white around it that are surely there, and up to which more is looked for.
    flat : Flat
        The lens.
    told : int
        Pixels from a boundary within which pixels of a large print are used.
    most : int, optional
        So many of them at most, spread over the print.
    """
    sure, reach = (1 + 2 * cells / len(bits) for cells in rim)
    outline = flat.to_image(mapped(H, reach * SQUARE))
    height, width = image.shape
    low = np.maximum(np.floor(np.nan_to_num(outline.min(0))).astype(int), 0)
    high = np.minimum(np.ceil(np.nan_to_num(outline.max(0))).astype(int) + 1, [width, height])
    high = np.maximum(high, low)
    cells = np.pad(np.asarray(bits, dtype=float), PADDING, constant_values=1.0)
    part = image[low[1] : high[1], low[0] : high[0]]
    columns = max(part.shape[1], 1)
    if part.size > ALL_LOOKED_AT:
        corners = flat.to_image(mapped(H, SQUARE)) - low
        index = np.flatnonzero(_beside_boundaries(cells, corners, part.shape, told))
    else:
        index = np.arange(part.size)
    some = most is not None and len(index) > most
    if most is not None and some:
        index = index[_spread(len(index), most)]
    y, x = np.divmod(index, columns)
    grey = part[y, x]
    places = np.ones((3, len(x)))
    places[:2] = flat.from_patch(np.stack([x, y], axis=1) + low.astype(float)).T
    u, v, nearness = np.linalg.inv(H) @ places
    far_x, far_y = np.abs(u), np.abs(v)
    with np.errstate(divide="ignore", invalid="ignore"):
        out = np.maximum(far_x, far_y) / nearness
    used = np.flatnonzero((out < reach) & (nearness > 0))
    zone = np.zeros(len(used), dtype=np.intp)
    if reach > sure:
        across = (far_x > far_y)[used]
        side = np.where(across, 0, 2) + (np.where(across, u[used], v[used]) > 0)
        far = ((out[used] - sure) / (reach - sure) * _ZONES).astype(np.intp)
        zone = np.where(out[used] > sure, 1 + side * _ZONES + far, 0)
    return Seen(cells, places[:, used], grey[used].astype(float), zone, some)


def _spread(count: int, most: int) -> Ints:
    """(most,) of so many in order: one of each stretch, not at the same place in all of them."""
    steps = np.arange(most)
    return np.asarray(((steps + (steps * _GOLDEN) % 1.0) * (count / most)).astype(np.intp))


def _beside_boundaries(cells: Array, corners: Array, shape: tuple[int, ...], told: int) -> Mask:
    """Pixels (h, w) near boundaries between black and white, and a few of the others."""
    side = len(cells) - 2 * PADDING
    first, last = PADDING - 0.5, PADDING - 0.5 + side
    table = np.array([[first, first], [last, first], [last, last], [first, last]])
    M = cv2.getPerspectiveTransform(table.astype(np.float32), corners.astype(np.float32))
    drawn = cv2.warpPerspective(
        cells.astype(np.uint8),
        M,
        (shape[1], shape[0]),
        flags=cv2.INTER_NEAREST,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=1,
    )
    window = np.ones((2 * told + 1, 2 * told + 1), dtype=np.uint8)
    near = np.asarray(cv2.morphologyEx(drawn, cv2.MORPH_GRADIENT, window) > 0)
    near[::_FLAT_ONES, ::_FLAT_ONES] = True
    return near


def white_rim(zone: Ints, residual: Array, used: Mask) -> Mask:
    """Pixels (n,) of the print and of as much around it as is as white as the rim.

    From a side outwards, up to where the mean of a zone is not the rim's.
    """
    noise = max(SIGMA_OF_MEDIAN * float(np.median(np.abs(residual[zone == 0]))), _LEAST_NOISE)
    count, total, squares = (
        np.bincount(zone, weights, minlength=4 * _ZONES + 1)[1:].reshape(4, _ZONES)
        for weights in (used.astype(float), residual * used, residual**2 * used)
    )
    white = np.abs(total) <= _ALIKE * noise * np.sqrt(count)
    white &= (squares <= _NOISIER * noise**2 * count) & (count > 0)
    white = np.logical_and.accumulate(white, axis=1)
    return np.asarray(np.append(True, white.ravel())[zone])


def mapped(H: Array, points: Array) -> Array:
    """Points (n, 2) through a homography."""
    ahead = points @ H[:, :2].T + H[:, 2]
    return np.asarray(ahead[:, :2] / ahead[:, 2:])
