"""Corners of a marker from its whole print.

The cells of a small marker blur into each other, so that no edge is seen alone. But its print is
known once its id has been read: a pattern of white and black cells with a white rim, a homography
away from the image without its distortion. Homography, blur and light are fitted to all of its
grey levels, and every edge between two cells helps to place the corners.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from vision_gt.prints.edge_samples import Flat, Image, Patches
from vision_gt.prints.grey_fits import (
    LEAST_VARIANCE,
    START_BLUR,
    believable,
)
from vision_gt.prints.pixels import choose_pixels, homographies, pixels_around
from vision_gt.prints.print_look import boundaries_in_reach, places_in_print
from vision_gt.prints.print_steps import (
    BLUR,
    Rest,
    State,
    corners_of,
    steps_to_rest,
    variances,
)
from vision_gt.prints.signs import bend_of, haloes, stretches
from vision_gt.prints.tiles import excess_of_tiles

Ints = npt.NDArray[np.intp]
Mask = npt.NDArray[np.bool_]

_UNKNOWNS = 15
"""Of a usual fit: see `vision_gt.prints.print_steps`."""
_BENT_LIGHT = 800
"""Pixels of a print from which on its light may bend: a lens that darkens to the image's corners
by a third bends it by 4 % where a marker fills half of it, which moves corners by 0.03 pixels."""
_TOLD, _SLOPE_ENDS = 3, 2.0
"""Pixels from a boundary within which pixels tell where it is, as long as it is known to a pixel or
two; and widths of the blur within which they do, once it is known: what they say goes with the
square of the slope, of which two widths and half a pixel leave out 1e-4."""
SOME = 500
"""Pixels of a print that first steps look at, at most: they place its corners to 0.06 pixels."""
ALL = 10**9
_FLAT = 1e-9
"""Determinant of a homography (square pixels) below which a quadrangle has no area."""
_WORST_SHARE = 0.1
"""Of the contrast, that one pixel may count as left over: more is as well a thing in front."""
_FROM_MIDDLE = np.array([[0.5, 0, 0.5], [0, 0.5, 0.5], [0, 0, 1.0]])
"""From a print, -1 to 1, to the unit square."""


@dataclass(frozen=True)
class PrintFits:
    """m fitted prints.

    Parameters
    ----------
    corners : (m, 4, 2) array
        Undistorted pixels; the start if there is no fit.
    covariances : (m, 4, 2, 2) array
        Of the fit alone.
    good : (m,) array of bool
        Whether the fit came to an end and explains the grey levels.
    blur : (m,) array
        Its width, pixels.
    misfit : (m,) array
        What is left of the grey levels of the print without its rim, root mean square over the
        contrast, each at most a tenth.
    pixels : (m,) array of int
        How many were fitted.
    halo : (m,) array
        Which share of what is left looks as if the image had been sharpened.
    amount : (m,) array
        How much it was sharpened: the share that was added of the difference to a blurred copy.
    bend : (m,) array
        How bent the tone curve is; 0 where grey levels go with the light.
    aslant : (m,) array
        Which share of what is left looks as if the blur were wider one way, as motion makes it.
    stretch : (m, 2) array
        By how much its variance then is larger, see `vision_gt.prints.signs.stretches`.
    """

    corners: Array
    covariances: Array
    good: Mask
    blur: Array
    misfit: Array
    pixels: Ints
    halo: Array
    amount: Array
    bend: Array
    aslant: Array
    stretch: Array

    def of(self, rows: Mask) -> "PrintFits":
        """Those of some prints."""
        return PrintFits(*(getattr(self, one.name)[rows] for one in fields(self)))

    def __setitem__(self, rows: Ints, others: "PrintFits") -> None:
        """Put other fits in the place of some."""
        for one in fields(self):
            getattr(self, one.name)[rows] = getattr(others, one.name)


def fit_prints(image: Image, start: Array, bits: Array, rim: Array, flat: Flat) -> PrintFits:
    """The corners of the markers of an image.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    start : (m, 4, 2) array
        Corners to about a pixel, from the top left of a print clockwise, undistorted pixels.
    bits : (m, c, c) array
        1 where a print is white, the first row at its top.
    rim : (m, 2) array
        Cells of white around each that are surely there, and up to which more is looked for.
    flat : Flat
        The lens.

    Notes
    -----
    Gauss-Newton steps with Tukey's weights, so that what covers a part of the print does no
    harm. The homography changes as H (1 + D), so its derivatives are those of the point of the
    print that a pixel shows: Baker and Matthews, "Lucas-Kanade 20 years on", IJCV 56 (2004).

    Prints are first fitted to some of their pixels, and then to all near their boundaries: the
    first steps need not be exact, and once it is known where the boundaries are, they are few.
    """
    fits = _unfitted(start)
    sound, state = _begin(start)
    if not len(sound):
        return fits
    bits, rim = np.asarray(bits, dtype=float)[sound], rim[sound]
    told = np.full(len(sound), _TOLD)
    chosen = choose_pixels(image, state.H, bits, rim, flat, told, SOME)
    seen = pixels_around(image, state.H, bits, chosen)
    seen = replace(seen, counts=seen.counts & (seen.zone == 0), zone=np.zeros_like(seen.zone))
    for near in steps_to_rest(seen, state, together=True):
        at, fine = sound[near.rows], near.state
        halo, (aslant, stretch) = haloes(near, seen.cells[near.rows]), stretches(near)
        bent, each = bend_of(near)
        if bent:
            fine = replace(fine, bend=each)
        told = np.maximum(np.rint(_SLOPE_ENDS * fine.blur), 1).astype(np.intp)
        own = bits[near.rows], rim[near.rows]
        lens = chosen.patches.of(near.rows)
        for rows, found in _fitted(image, fine, *own, flat, told, ALL, lens):
            fits[at[rows]] = replace(
                found, halo=halo[rows], aslant=aslant[rows], stretch=stretch[rows]
            )
    _keep_start(fits, start)
    return fits


def fit_sharpened(
    image: Image,
    start: Array,
    bits: Array,
    rim: Array,
    flat: Flat,
    radius: Array,
    bend: Array | None = None,
    most: int = ALL,
) -> PrintFits:
    """The corners of markers in an image that a camera sharpened.

    Parameters
    ----------
    image, start, bits, rim, flat
        As for `fit_prints`.
    radius : (m,) array
        Pixels: the standard deviation of the blurred copy from which the image was led away, whose
        amount is sought. With 0 it is fitted as one that was not sharpened, to the same pixels.
    bend : (m,) array, optional
        Of the tone curve, to begin with; without it the curve is straight.
    most : int
        So many pixels of each print at most.
    """
    fits = _unfitted(start)
    sound, state = _begin(start)
    if len(sound):
        state = replace(state, radius=radius[sound], bend=None if bend is None else bend[sound])
        bits, rim = np.asarray(bits, dtype=float)[sound], rim[sound]
        told = np.full(len(sound), _TOLD)
        for rows, found in _fitted(image, state, bits, rim, flat, told, most):
            fits[sound[rows]] = found
    _keep_start(fits, start)
    return fits


def fit_stretched(
    image: Image,
    start: Array,
    bits: Array,
    rim: Array,
    flat: Flat,
    shape: Array,
    most: int = ALL,
) -> PrintFits:
    """The corners of markers in an image whose blur is wider one way than the other.

    Parameters
    ----------
    image, start, bits, rim, flat, most
        As for `fit_sharpened`.
    shape : (m, 2, 2) array
        What makes the blur's ellipse of a circle; its size is sought.
    """
    fits = _unfitted(start)
    sound, state = _begin(start)
    if len(sound):
        state = replace(state, shape=shape[sound])
        bits, rim = np.asarray(bits, dtype=float)[sound], rim[sound]
        longest = np.linalg.norm(shape[sound], axis=(1, 2), ord=2)
        told = np.maximum(np.rint(_SLOPE_ENDS * longest), _TOLD).astype(np.intp)
        for rows, found in _fitted(image, state, bits, rim, flat, told, most):
            fits[sound[rows]] = found
    _keep_start(fits, start)
    return fits


def _unfitted(start: Array) -> PrintFits:
    """Nothing fitted yet."""
    m = len(start)
    none = np.zeros(m)
    return PrintFits(
        np.array(start, dtype=float),
        np.tile(np.eye(2), (m, 4, 1, 1)),
        none > 0,
        none + START_BLUR,
        none + np.inf,
        none.astype(np.intp),
        none.copy(),
        none.copy(),
        none.copy(),
        none.copy(),
        np.zeros((m, 2)),
    )


def _keep_start(fits: PrintFits, start: Array) -> None:
    """Leave nothing of fits that are not to be believed."""
    bad = np.flatnonzero(~fits.good)
    fits[bad] = _unfitted(start[bad])


def _begin(start: Array) -> tuple[Ints, State]:
    """Which quadrangles (m, 4, 2) have an area, and the first state of these."""
    with np.errstate(all="ignore"):
        H = homographies(start) @ _FROM_MIDDLE
        sound = np.flatnonzero(np.isfinite(H).all((1, 2)) & (np.abs(np.linalg.det(H)) > _FLAT))
    none = np.zeros(len(sound))
    return sound, State(H[sound], none + START_BLUR, np.zeros((len(sound), 6)), none, None)


def _fitted(
    image: Image,
    state: State,
    bits: Array,
    rim: Array,
    flat: Flat,
    told: Ints,
    most: int,
    lens: Patches | None = None,
) -> Iterator[tuple[Ints, PrintFits]]:
    """Fits from states, with the rows that they are of.

    With the ``lens`` around prints that have been fitted to some of their pixels.
    """
    chosen = choose_pixels(image, state.H, bits, rim, flat, told, most, lens)
    for group in _alike(chosen.counts, _boundaries(state, bits.shape[1])):
        begun, own = state.of(group), chosen.of(group)
        if own.counts.min() > _BENT_LIGHT:
            more = np.zeros((len(group), 3))
            begun = replace(begun, light=np.concatenate([begun.light, more], axis=1))
        seen = pixels_around(image, begun.H, bits[group], own)
        for rest in steps_to_rest(seen, begun, rims_judged=lens is not None):
            yield group[rest.rows], _ended(rest, own.counts[rest.rows], bits.shape[1])


def _boundaries(state: State, cells: int) -> Ints:
    """(m,) how many boundaries blur reaches in the middles of prints, along the narrower axis."""
    middle = state.H[:, :, 2:] / state.H[:, 2:, 2:]
    at, _ = places_in_print(state.H, middle, np.zeros((len(middle), 2)), state.shape)
    narrow = np.maximum(at.along_x, at.along_y)[:, 0]
    blur = state.blur if state.radius is None else np.hypot(state.blur, state.radius)
    return boundaries_in_reach(blur, narrow, cells)


def _alike(counts: Ints, boundaries: Ints) -> list[Ints]:
    """Prints with more than too few pixels, in groups that have about as many.

    And whose pixels blur reaches from as many ``boundaries``.
    """
    size = np.floor(np.log2(np.maximum(counts, 1) / _BENT_LIGHT) / 2)
    key = np.where(counts >= 3 * _UNKNOWNS, 100 * boundaries + size, -1).astype(np.intp)
    return [np.flatnonzero(key == one) for one in np.unique(key[key >= 0])]


def _ended(rest: Rest, counts: Ints, cells: int) -> PrintFits:
    """What fits say, once a step has moved them no more."""
    state, left, weights = rest.state, rest.left, rest.weights
    contrast, variance = state.contrast, variances(rest)
    spread = rest.inverse[:, :BLUR, :BLUR] * np.maximum(variance, LEAST_VARIANCE)[:, None, None]
    corners, slopes = corners_of(state.H)
    excess = excess_of_tiles(rest, slopes, np.maximum(variance, LEAST_VARIANCE), cells)
    covariances = slopes @ spread[:, None] @ np.swapaxes(slopes, -1, -2)
    sigma = np.sqrt(np.diagonal(covariances, axis1=-2, axis2=-1).max((1, 2)))
    kept = weights.sum(1) / np.maximum(rest.told.sum(1), 1)
    # Weights would hide what a fit does not explain. The rim may have a halo of what is behind it.
    inside = rest.told & (np.abs(rest.lit[:, 1:]).max(1) < 1)
    share = np.minimum(np.abs(left) / contrast[:, None], _WORST_SHARE)
    held = inside.sum(1)
    misfit = np.sqrt((share**2 * inside).sum(1) / np.maximum(held, 1))
    good = believable(contrast, kept, sigma, np.sqrt(variance)) & (held > 0)
    covariances = covariances * excess[:, None, None, None]
    none = np.zeros(len(good))
    aslant, stretch = (none, np.zeros((len(good), 2))) if state.shape is None else stretches(rest)
    bend = none if state.bend is None else state.bend
    return PrintFits(
        corners,
        covariances,
        good,
        state.blur,
        misfit,
        counts,
        none,
        state.amount,
        bend,
        aslant,
        stretch,
    )
