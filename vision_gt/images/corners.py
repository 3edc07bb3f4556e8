"""Corners of markers, fitted to the grey levels: from the whole print, or from its edges."""

from dataclasses import dataclass

import numpy as np

from validation.poses.angles import Array
from vision_gt.images.edges import HALF_WINDOW, LEAST_HALF_WINDOW, fit_edges, sought_corners
from vision_gt.prints.edge_samples import Flat, Image, Mask
from vision_gt.prints.grey_fits import SHARPENING_WIDTHS
from vision_gt.prints.print_fit import (
    ALL,
    SOME,
    PrintFits,
    fit_prints,
    fit_sharpened,
    fit_stretched,
)
from vision_gt.prints.signs import wider_shapes

_BLUR_OF_NEXT = 1.0
"""Pixels that windows keep off the edges of the next cells: about the width of a usual blur."""
_BLUR_BEHIND = 1.5
"""Pixels that a print's rim of one cell keeps off what lies behind it: two widths of usual blur."""
_LEAST_RIM = 0.2
"""Cells of rim that are always looked at, for without it the outer side of the border is unseen."""
_RIM = 4.0
"""Pixels of white around a marker that are looked at, at most: four widths of a usual blur."""
_SHARPENED = 0.08
"""Share of what blur leaves of the grey levels that looks like sharpening from which on it is
tried. In 240 rendered prints of 22 to 80 pixels that were sharpened (by 0.5 to 2 of copies blurred
by 1 to 5 pixels, some cut off at 0 and 255) the share was 0.1 to 0.9, in others below 0.05."""
_ASLANT = 0.25
"""Share of what round blur leaves that looks as if it were wider one way, in the middle of an
image's markers, from which on that is tried. Motion over 2 to 9 pixels gave 0.34 to 0.79 wherever
it left more than noise, on rendered markers of 36 to 160 pixels; noise, Bayer's pattern, JPEG and
sharpening at most 0.04, and a lens that is not known, which bends edges, at most 0.18."""
_ODDS = 12.0
"""Twice the logarithm of the likelihoods from which on it is taken: chance gives one unknown more
that much once in 2,000 prints, and five widths are tried."""
_PIXEL_AREA = 4.8e-4
"""Pixels of corner error that no fit sees, times the cube of the blur. Grey levels are means over
square pixels of variance 1/12 each way, the model has a bell curve instead. By Edgeworth's series
the step differs by up to 0.55 / 24 * 1.2 / 144 / blur^4 of the contrast, which is over the slope
0.4 / blur a shift of 4.8e-4 / blur^3, of either sign by where the pixels lie."""


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
    The whole print is fitted: which cells are next to which is known, as the marker has been
    read, and all their boundaries help. It is drawn to its sides first. Where too much of it is
    covered, corners are where its fitted sides cross.
    """
    m = len(start)
    if m == 0:
        nothing = np.zeros((0, 4), dtype=bool)
        return CornerFit(np.zeros((0, 4, 2)), np.zeros((0, 4, 2, 2)), nothing)
    flat = Flat(parameters)
    first = flat.from_image(np.asarray(start, dtype=float))
    cells = bits.shape[1]
    corners = sought_corners(image, first, windows(first, cells), flat)
    fits = _prints(image, corners, bits, flat)
    again = np.flatnonzero(~fits.good)
    if len(again):
        fits[again] = _prints(image, first[again], bits[again], flat)
    if not _stretch(image, fits, bits, flat):
        _sharpen(image, fits, bits, flat)
    corners, covariances = fits.corners, fits.covariances
    good = np.repeat(fits.good[:, None], 4, axis=1)
    lost = np.flatnonzero(~good[:, 0])
    if len(lost):
        half = windows(first[lost], cells)
        corners[lost], covariances[lost], good[lost], _ = fit_edges(image, first[lost], half, flat)
    unseen = (_PIXEL_AREA / fits.blur**3)[:, None, None, None]
    refined, scale = flat.to_image_with_slope(corners)
    covariances = scale @ covariances @ np.swapaxes(scale, -1, -2) + unseen**2 * np.eye(2)
    far = np.linalg.norm(refined - start, axis=-1) > 2 * HALF_WINDOW
    good &= ~far & np.isfinite(refined).all(-1)
    return CornerFit(
        np.where(good[..., None], refined, start),
        np.where(good[..., None, None], covariances, np.eye(2)),
        good,
    )


def _stretch(image: Image, fits: PrintFits, bits: Array, flat: Flat) -> bool:
    """Fit prints again with blur that is wider one way, as motion makes it; whether it is.

    Each print has its own: it tells how wide blur is across its boundaries, which go two ways,
    and no other matters. Prints that were not to be fitted begin with what the others have.
    """
    good = np.flatnonzero(fits.good)
    if not len(good) or np.median(fits.aslant[good]) < _ASLANT:
        return False
    stretch, blur = fits.stretch.copy(), fits.blur.copy()
    stretch[~fits.good], blur[~fits.good] = fits.stretch[good].mean(0), np.median(fits.blur[good])
    start, rims = fits.corners.copy(), _rims(fits.corners, bits.shape[1])
    shape = wider_shapes(blur, stretch)
    for most in (SOME, ALL):
        again = fit_stretched(image, start, bits, rims, flat, shape, most)
        start = again.corners
        if most == SOME:
            wider = wider_shapes(again.blur, again.stretch, shape)
            shape = np.where(again.good[:, None, None], wider, shape)
    left, before = (np.clip(one.misfit, 1e-6, 1.0) for one in (again, fits))
    better = again.good & (2 * again.pixels * np.log(before / left) > _ODDS)
    fits[np.flatnonzero(better)] = again.of(better)
    return bool(better.any())


def _sharpen(image: Image, fits: PrintFits, bits: Array, flat: Flat) -> None:
    """Fit prints again as those of a camera that sharpens, where that explains more.

    How wide the copy is that a camera leads its images away from is found on the marker with the
    largest cells, and is the same for all.
    """
    good = np.flatnonzero(fits.good)
    if not len(good) or np.median(fits.halo[good]) < _SHARPENED:
        return
    cells = bits.shape[1]
    sizes = _cells(fits.corners[good], cells).min(1)
    one = good[[int(np.argmax(sizes))]]
    tried = np.array([0.0, *SHARPENING_WIDTHS])
    start, rims, same = (
        np.repeat(part, len(tried), 0)
        for part in (fits.corners[one], _rims(fits.corners[one], cells), bits[one])
    )
    bends = fits.bend if fits.bend.any() else None
    bend = None if bends is None else np.repeat(bends[one], len(tried))
    found = fit_sharpened(image, start, same, rims, flat, tried, bend, SOME)
    best = 1 + int(np.argmin(found.misfit[1:]))
    if not (found.good[0] and found.good[best]):
        return  # nothing to compare: a fit that failed has a misfit without bound
    odds = 2 * found.pixels[0] * np.log(found.misfit[0] / max(found.misfit[best], 1e-6))
    if not odds > _ODDS:
        return
    start, radii = fits.corners[good], np.full(len(good), tried[best])
    bend = None if bends is None else bends[good]
    again = fit_sharpened(image, start, bits[good], _rims(start, cells), flat, radii, bend)
    fits[good[again.good]] = again.of(again.good)


def _prints(image: Image, start: Array, bits: Array, flat: Flat) -> PrintFits:
    """The fits of prints from a start (m, 4, 2)."""
    return fit_prints(image, start, bits, _rims(start, bits.shape[1]), flat)


def _rims(corners: Array, cells: int) -> Array:
    """(m, 2) cells of white around prints that are surely there, and up to which is looked."""
    cell = np.maximum(_cells(corners, cells).min(1), 1e-3)
    sure = np.maximum(np.minimum(1 - _BLUR_BEHIND / cell, _RIM / cell), _LEAST_RIM)
    return np.stack([sure, np.maximum(sure, _RIM / cell)], axis=1)


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
    return np.clip(half, LEAST_HALF_WINDOW, HALF_WINDOW).ravel()


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
