"""Corners of markers, fitted to the grey levels: from their edges, or from the whole print."""

from dataclasses import dataclass

import numpy as np

from validation.poses.angles import Array
from vision_gt.images.edge_samples import Flat, Image, Mask
from vision_gt.images.edges import HALF_WINDOW, fit_edges
from vision_gt.images.prints import fit_print

_LEAST_HALF_WINDOW = 1.5
"""Pixels: a step of usual blur is seen over three of them."""
_BLUR_OF_NEXT = 1.0
"""Pixels that windows keep off the edges of the next cells: about the width of a usual blur."""
_PLATEAU = 2.5
"""Pixels, three widths of a usual blur: narrower windows see no plateau beside an edge."""
_FLOOR = 0.015
"""Pixels of corner error that no fit sees: the model of the blur, the print. A judgement: on
rendered images corners are off by 0.02 pixels, see benchmarks/vision_corners.py."""
_LARGEST_CELL = 12.0
"""Pixels of cells up to which a print can be read in short time. A judgement: the time goes with
the square of the size."""


@dataclass(frozen=True)
class CornerFit:
    """Refined corners of m markers.

    Parameters
    ----------
    corners : (m, 4, 2) array
        Pixels in the image; where a corner could not be fitted, the start.
    covariances : (m, 4, 2, 2) array
        Of each corner, square pixels.
    good : (m, 4) array of bool
        Whether the corner could be fitted.
    """

    corners: Array
    covariances: Array
    good: Mask


def refine_corners(
    image: Image, start: Array, bits: Array, parameters: Array | None = None
) -> CornerFit:
    """Corners of markers, fitted to the grey levels.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    start : (m, 4, 2) array
        Corners to about 2 pixels: top left, top right, bottom right, bottom left of the print.
    bits : (m, c, c) array
        Of each marker's cells, 1 where white, with its black border.
    parameters : (9,) array, optional
        Intrinsic parameters, so that edges are straight; without them they are taken as
        straight in the image.

    Notes
    -----
    Corners are where fitted edges cross. Where the cells are so small that an edge is not seen
    apart from the next ones, the whole print is fitted instead: which cells are next is known,
    as the marker has been read. So it is where edges would do, but no marker of the image is
    large, and where something lies over an edge: what is left of the print still places it.
    """
    m = len(start)
    if m == 0:
        nothing = np.zeros((0, 4), dtype=bool)
        return CornerFit(np.zeros((0, 4, 2)), np.zeros((0, 4, 2, 2)), nothing)
    flat = Flat(parameters)
    corners = flat.from_image(np.asarray(start, dtype=float))
    cell = _cells(corners, bits.shape[1])
    half = windows(corners, bits.shape[1])
    corners, covariances, good, disturbed = fit_edges(image, corners, half, flat)
    least = cell.min(1)
    # The print tells more, but takes longer: it is read where nothing larger is in the image.
    alone = least.max() < HALF_WINDOW + _BLUR_OF_NEXT
    small = least < (HALF_WINDOW if alone else _PLATEAU) + _BLUR_OF_NEXT
    disturbed &= least < _LARGEST_CELL
    for i in np.flatnonzero(small | disturbed):
        rim = max(1 - _BLUR_OF_NEXT / least[i], 0.0)
        found = fit_print(image, corners[i], bits[i], rim, flat)
        if found[2] or small[i]:
            corners[i], covariances[i], good[i] = found
    refined, scale = flat.to_image_with_slope(corners)
    covariances = scale @ covariances @ np.swapaxes(scale, -1, -2) + _FLOOR**2 * np.eye(2)
    far = np.linalg.norm(refined - start, axis=-1) > 2 * HALF_WINDOW
    good &= ~far & np.isfinite(refined).all(-1)
    return CornerFit(
        np.where(good[..., None], refined, start),
        np.where(good[..., None, None], covariances, np.eye(2)),
        good,
    )


def windows(corners: Array, cells: int) -> Array:
    """(4 m,) pixels to either side of the sides of markers that nothing but the side reaches.

    Parameters
    ----------
    corners : (m, 4, 2) array
        Of the markers, pixels.
    cells : int
        Along a side.
    """
    half = _cells(corners, cells) - _BLUR_OF_NEXT
    return np.clip(half, _LEAST_HALF_WINDOW, HALF_WINDOW).ravel()


def _cells(corners: Array, cells: int) -> Array:
    """(m, 4) widths of the cells along each side, pixels across the side."""
    after, before = np.roll(corners, -1, axis=1), np.roll(corners, 1, axis=1)
    opposite = np.roll(corners, -2, axis=1)
    along = after - corners
    length = np.maximum(np.linalg.norm(along, axis=-1), 1e-9)
    heights = [
        np.abs(along[..., 0] * (p - corners)[..., 1] - along[..., 1] * (p - corners)[..., 0])
        / length
        for p in (before, opposite)
    ]
    return np.asarray(np.minimum(*heights) / cells)
