"""Which pixels around a print say where it is, and which of them are white paper around it."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from validation.statistics.robust import SIGMA_OF_MEDIAN
from vision_gt.prints.edge_samples import Flat, Image, Patches
from vision_gt.prints.grey_fits import Floats
from vision_gt.prints.print_look import PADDING, to_prints

Ints = npt.NDArray[np.intp]
Mask = npt.NDArray[np.bool_]

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
class Chosen:
    """Which pixels around m prints are looked at.

    Parameters
    ----------
    index : tuple of m arrays of int
        Places in the image, row by row.
    sure, reach : (m,) array
        How far the rim surely reaches and how far is looked, in half sides of the print.
    patches : Patches
        The lens there.
    """

    index: tuple[Ints, ...]
    sure: Array
    reach: Array
    patches: Patches

    @property
    def counts(self) -> Ints:
        """(m,) how many pixels."""
        return np.array([len(one) for one in self.index], dtype=np.intp)

    def of(self, rows: Ints) -> "Chosen":
        """Those of some prints."""
        index = tuple(self.index[i] for i in rows)
        return Chosen(index, self.sure[rows], self.reach[rows], self.patches.of(rows))


@dataclass(frozen=True)
class Seen:
    """The cells (m, c + 20, c + 20) of m prints with all the white around them, and pixels there.

    ``places`` (m, 3, n) are undistorted pixels from ``origin`` (m, 2), homogeneous, ``grey`` (m, n)
    their levels. ``zone`` (m, n) is 0 on the print and its rim; further out it numbers the four
    sides and how far it is. ``counts`` (m, n) is False for what only fills a row.
    """

    cells: Floats
    places: Floats
    origin: Array
    grey: Floats
    zone: Ints
    counts: Mask

    def of(self, rows: Mask) -> "Seen":
        """Those of some prints."""
        cells, places, grey = self.cells[rows], self.places[rows], self.grey[rows]
        return Seen(cells, places, self.origin[rows], grey, self.zone[rows], self.counts[rows])


def choose_pixels(
    image: Image,
    H: Array,
    bits: Array,
    rim: Array,
    flat: Flat,
    told: Ints,
    most: int = 10**9,
    patches: Patches | None = None,
) -> Chosen:
    """The pixels of prints and their rims that say where they are, and some for how bright.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    H : (m, 3, 3) array
        From the prints to undistorted pixels, to a pixel or two.
    bits : (m, c, c) array
        1 where a print is white.
    rim : (m, 2) array
        Cells of white around each that are surely there, and up to which more is looked for.
    flat : Flat
        The lens.
    told : (m,) array of int
        Pixels from a boundary within which pixels of a large print are used.
    most : int
        So many of them at most, spread over the print.
    patches : Patches, optional
        The lens around the prints where it is known from an earlier choice.
    """
    sure, reach = (1 + 2 * cells / bits.shape[1] for cells in rim.T)
    both = np.stack([np.broadcast_to(SQUARE, (len(H), 4, 2)), reach[:, None, None] * SQUARE], 1)
    seen = flat.to_image(mapped(H[:, None], both))
    outline = np.nan_to_num(seen[:, 1])
    height, width = image.shape
    low = np.maximum(np.floor(outline.min(1)), 0).astype(np.intp)
    high = np.minimum(np.ceil(outline.max(1)) + 1, [width, height]).astype(np.intp)
    index = []
    for i, (x, y) in enumerate(low):
        shape = max(high[i, 1] - y, 0), max(high[i, 0] - x, 0)
        if min(shape) == 0:
            index.append(np.zeros(0, dtype=np.intp))
            continue
        near = np.zeros(shape, dtype=np.uint8)
        corners = np.rint(8 * (outline[i] - low[i])).astype(np.int32)
        cv2.fillConvexPoly(near, corners, 1, shift=3)
        if shape[0] * shape[1] > ALL_LOOKED_AT:
            near &= _beside_boundaries(bits[i], seen[i, 0] - low[i], shape, int(told[i]))
        places = np.flatnonzero(near)
        if len(places) > most:
            places = places[_spread(len(places), most)]
        row, column = np.divmod(places, shape[1])
        index.append((row + y) * width + (column + x))
    if patches is None:
        last = np.array([width, height]) - 1.0
        patches = flat.patches(*(np.clip(end, 0.0, last) for end in (low, high - 1)))
    return Chosen(tuple(index), sure, reach, patches)


def pixels_around(image: Image, H: Array, bits: Array, chosen: Chosen) -> Seen:
    """Chosen pixels with their grey levels, and where they are around prints.

    Parameters
    ----------
    image, H, bits
        As for `choose_pixels`.
    chosen : Chosen
        Which.
    """
    counts = chosen.counts
    n = max(int(counts.max()), 1)
    # Rows are filled with their own pixels again, so that medians stay what they are.
    index = np.zeros((len(H), n), dtype=np.intp)
    for row, one in zip(index, chosen.index, strict=True):
        for first in range(0, n, max(len(one), 1)) if len(one) else ():
            row[first : first + len(one)] = one[: n - first]
    grey = image.ravel().take(index).astype(np.float32)
    pixels = np.empty((len(H), 2, n))
    rows = np.floor(index * (1 / image.shape[1]) + 1e-9, out=pixels[:, 1])
    np.subtract(index, rows * image.shape[1], out=pixels[:, 0])
    places, origin = chosen.patches.undistorted(pixels)
    u, v, nearness = (to_prints(H, origin).astype(np.float32) @ places).transpose(1, 0, 2)
    far_x, far_y = np.abs(u), np.abs(v)
    with np.errstate(divide="ignore", invalid="ignore"):
        out = np.maximum(far_x, far_y) / nearness
    sure, reach = (one[:, None].astype(np.float32) for one in (chosen.sure, chosen.reach))
    use = (out < reach) & (nearness > 0) & (np.arange(n) < counts[:, None])
    beyond = use & (out > sure)
    zone = np.zeros((len(H), n), dtype=np.intp)
    at = np.nonzero(beyond)
    if len(at[0]):
        across = far_x[at] > far_y[at]
        side = np.where(across, 0, 2) + (np.where(across, u[at], v[at]) > 0)
        wide = np.maximum(reach - sure, 1e-9)[at[0], 0]
        far = np.minimum((out[at] - sure[at[0], 0]) / wide * _ZONES, _ZONES - 1)
        zone[at] = 1 + side * _ZONES + far.astype(np.intp)
    cells = np.pad(bits, ((0, 0), *2 * ((PADDING, PADDING),)), constant_values=1.0)
    return Seen(cells.astype(np.float32), places, origin, grey, zone, use)


def _spread(count: int, most: int) -> Ints:
    """(most,) of so many in order: one of each stretch, not at the same place in all of them."""
    steps = np.arange(most)
    return np.asarray(((steps + (steps * _GOLDEN) % 1.0) * (count / most)).astype(np.intp))


def _beside_boundaries(bits: Array, corners: Array, shape: tuple[int, int], told: int) -> Image:
    """Pixels (h, w) near boundaries between black and white, and a few of the others."""
    side = len(bits) + 2
    table = np.array([[0.5, 0.5], [side - 1.5, 0.5], [side - 1.5, side - 1.5], [0.5, side - 1.5]])
    M = cv2.getPerspectiveTransform(table.astype(np.float32), corners.astype(np.float32))
    cells = np.ones((side, side), dtype=np.uint8)
    cells[1:-1, 1:-1] = bits
    drawn = cv2.warpPerspective(
        cells,
        M,
        (shape[1], shape[0]),
        flags=cv2.INTER_NEAREST,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=1,
    )
    window = np.ones((2 * told + 1, 2 * told + 1), dtype=np.uint8)
    near = cv2.morphologyEx(drawn, cv2.MORPH_GRADIENT, window)
    near[::_FLAT_ONES, ::_FLAT_ONES] = 1
    return np.asarray(near, dtype=np.uint8)


def white_rims(zone: Ints, residual: Floats, used: Mask) -> Mask:
    """Pixels (m, n) of the prints and of as much around them as is as white as their rims.

    From a side outwards, up to where the mean of a zone is not the rim's.
    """
    white = used.copy()
    for i in np.flatnonzero(zone.any(1)):
        white[i] &= _white_rim(zone[i], residual[i], used[i])
    return white


def _white_rim(zone: Ints, residual: Floats, used: Mask) -> Mask:
    """`white_rims` of one print."""
    own = np.abs(residual[(zone == 0) & used])
    noise = max(SIGMA_OF_MEDIAN * float(np.median(own)) if len(own) else 0.0, _LEAST_NOISE)
    beyond = np.flatnonzero(used & (zone > 0))
    far, rest = zone[beyond], residual[beyond].astype(float)
    count, total, squares = (
        np.bincount(far, weights, minlength=4 * _ZONES + 1)[1:].reshape(4, _ZONES)
        for weights in (None, rest, rest**2)
    )
    white = np.abs(total) <= _ALIKE * noise * np.sqrt(count)
    white &= (squares <= _NOISIER * noise**2 * count) & (count > 0)
    white = np.logical_and.accumulate(white, axis=1)
    return np.asarray(np.append(True, white.ravel())[zone])


def mapped(H: Array, points: Array) -> Array:
    """Points (..., k, 2) through homographies (..., 3, 3)."""
    ahead = points @ np.swapaxes(H[..., :2], -1, -2) + H[..., None, :, 2]
    return np.asarray(ahead[..., :2] / ahead[..., 2:])


def homographies(quads: Array) -> Array:
    """(n, 3, 3) homographies from the unit square to quadrangles (n, 4, 2).

    Notes
    -----
    Heckbert, "Fundamentals of texture mapping and image warping", 1989, section 2.2.3.
    """
    a, b, c, d = (quads[:, k] for k in range(4))
    one, two, three = b - c, d - c, a - b + c - d
    determinant = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    determinant = np.where(np.abs(determinant) > 1e-9, determinant, 1e-9)
    g = (three[:, 0] * two[:, 1] - three[:, 1] * two[:, 0]) / determinant
    h = (one[:, 0] * three[:, 1] - one[:, 1] * three[:, 0]) / determinant
    H = np.empty((len(quads), 3, 3))
    H[:, :2, 0] = b - a + g[:, None] * b
    H[:, :2, 1] = d - a + h[:, None] * d
    H[:, :2, 2] = a
    H[:, 2, 0], H[:, 2, 1], H[:, 2, 2] = g, h, 1.0
    return H
