"""Codes of markers, read from quadrangles that might be some.

OpenCV reads a code from a picture of the quadrangle that it has made black and white. Here cells
are compared with what black and white are at their place, as the border and the rim around it
show them, so uneven light, little contrast and small cells do less harm.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import comb

import cv2
import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from vision_gt.patterns.dictionaries import Family
from vision_gt.prints.edge_samples import sampled
from vision_gt.prints.pixels import homographies

Image = npt.NDArray[np.uint8]
Ints = npt.NDArray[np.intp]
Mask = npt.NDArray[np.bool_]

_CHANCE = 2e-5
"""That a quadrangle with a black border, in a white rim, but any cells, is read as some marker of
the family. A judgement: such a thing stands in one image of ten, so one of 500,000 errs."""
_MOST_WRONG = 3
"""Cells that may be read wrongly: more are no sign of blur but of another code."""
_LEAST_CONTRAST = 10.0
"""Grey levels between rim and border: five times a usual noise."""
_BORDER_AGREES = 0.85
"""Share of the border's cells that must be black, and of the rim's that must be white."""
_HALF_AGREES = 0.55
"""The same where corners are off by a cell: more than chance has."""
_SHARPER = 0.6
"""How much of a cell's difference from its neighbours is added to it where cells have two pixels:
blur of 0.8 pixels leaves a cell of that width 0.79 of its own level in each direction."""
_SHARPEN_BELOW = 4.0
"""Pixels: larger cells show their own level in their middle."""
_IN_A_CELL = 5
"""Places at which each cell is looked at."""
_EVERY, _ENDS = 4, 0.003
"""Rows and columns that tell the grey levels of an image, and the share left out at each end."""
_NARROW, _LEAST_RANGE = 128, 16
"""Grey levels that most of an image has, below which they are drawn apart: of a usual exposure they
have more. And those that are drawn to the whole range at most: noise of 2 is then as 32. Of 120
markers of 13 to 60 pixels exposed to 18 % (white at 36), 100 were found as they are, 105 by OpenCV,
and all once drawn apart."""


@dataclass(frozen=True)
class Reading:
    """What quadrangles say.

    Parameters
    ----------
    rows : (k,) array of int
        Which of the quadrangles are markers.
    numbers : (k,) array of int
        Their ids.
    turns : (k,) array of int
        Corner of the quadrangle that is the top left one of the print.
    wrong : (k,) array of int
        Cells that are not as the code has them.
    bordered : (b,) array of int
        Which quadrangles have a black border and a white rim, whatever their code.
    """

    rows: Ints
    numbers: Ints
    turns: Ints
    wrong: Ints
    bordered: Ints


def might_be_markers(image: Image, quads: Array, family: Family) -> Mask:
    """(n,) whether quadrangles (n, 4, 2) are darker just inside than just outside of their sides.

    Parameters
    ----------
    image, quads, family
        As for `read_codes`; the corners may be off by a cell.
    """
    if not len(quads):
        return np.zeros(0, dtype=bool)
    grey = _cell_levels(image, quads, family.cells)
    white, black = (grey[:, _ring(family.cells, depth)] for depth in (0, 1))
    outside, inside = white.mean(1), black.mean(1)
    middle = ((outside + inside) / 2)[:, None]
    return np.asarray(
        (outside - inside > _LEAST_CONTRAST / 2)
        & ((white > middle).mean(1) > _HALF_AGREES)
        & ((black < middle).mean(1) > _HALF_AGREES)
    )


def read_codes(image: Image, quads: Array, family: Family, wrong: int | None = None) -> Reading:
    """The ids of those quadrangles that are markers of a family.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    quads : (n, 4, 2) array
        Corners, clockwise in the image, pixels.
    family : Family
        Whose codes are sought.
    wrong : int, optional
        Cells that may be wrong; by default so many that chance makes hardly any marker.
    """
    nothing = np.zeros(0, dtype=np.intp)
    allowed = wrong_cells_allowed(family) if wrong is None else wrong
    if not len(quads) or allowed < 0:
        return Reading(*5 * (nothing,))
    cells = family.cells
    grey = _cell_levels(image, quads, cells)
    white = grey[:, _rim(cells)]
    black = grey[:, _ring(cells, 1)]
    level, contrast = _plane(white, cells, 0), white.mean(1) - black.mean(1)
    dark = _plane(black, cells, 1)
    middle = (level + dark) / 2
    usable = contrast > _LEAST_CONTRAST
    usable &= (white > middle[:, _rim(cells)]).mean(1) >= _BORDER_AGREES
    usable &= (black < middle[:, _ring(cells, 1)]).mean(1) >= _BORDER_AGREES
    for extra in range(2, family.border + 1):
        ring = _ring(cells, extra)
        usable &= (grey[:, ring] < middle[:, ring]).mean(1) >= _BORDER_AGREES
    rows = np.flatnonzero(usable)
    if not len(rows):
        return Reading(*5 * (nothing,))
    bits = np.where(_sharper((grey - middle)[rows], quads[rows], family) > 0, 1.0, -1.0)
    codes = _codes(family)
    agree = bits.astype(np.float32) @ codes.T
    best = agree.argmax(1)
    off = np.rint((bits.shape[1] - agree[np.arange(len(rows)), best]) / 2).astype(np.intp)
    fine = off <= allowed
    turned, number = np.divmod(best[fine], len(codes) // 4)
    return Reading(rows[fine], number.astype(np.intp), turned.astype(np.intp), off[fine], rows)


def code_margins(image: Image, quads: Array, numbers: Ints, family: Family) -> Array:
    """By how many cells (n,) markers look more like their ids than like any other one.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    quads : (n, 4, 2) array
        Corners, from the top left of the print clockwise, pixels.
    numbers : (n,) array of int
        What they were read as.
    family : Family
        Of the markers.

    Notes
    -----
    Each cell counts as far as it is from the middle between black and white, at most 1. Two codes
    that differ in d cells are 2 d apart, and a wrong id is below 0.
    """
    cells = family.cells
    grey = _cell_levels(image, quads, cells)
    white, black = grey[:, _rim(cells)], grey[:, _ring(cells, 1)]
    middle = (_plane(white, cells, 0) + _plane(black, cells, 1)) / 2
    half = np.maximum((white.mean(1) - black.mean(1)) / 2, 1.0)[:, None]
    says = np.clip(_sharper((grey - middle) / half, quads, family), -1, 1)
    codes = _codes(family)
    agree = says.astype(np.float32) @ codes.T
    own = np.arange(len(quads)), numbers  # those that are not turned come first
    said = agree[own]
    agree[own] = -np.inf
    return np.asarray(said - agree.max(1), dtype=float)


def _sharper(ahead: Array, quads: Array, family: Family) -> Array:
    """(n, bits) how far cells are from the middle grey level, with less of what blur mixes in.

    ``ahead`` (n, (cells + 2)^2) of all cells, those of the rim included.
    """
    side = family.cells + 2
    inner = slice(family.border, side - 2 - family.border)
    own = ahead.reshape(-1, side, side)
    size = np.linalg.norm(quads - np.roll(quads, 1, axis=1), axis=-1).min(1) / family.cells
    strength = _SHARPER * np.clip((_SHARPEN_BELOW - size) / (_SHARPEN_BELOW - 2), 0, 1)
    around = own[:, :-2, 1:-1] + own[:, 2:, 1:-1] + own[:, 1:-1, :-2] + own[:, 1:-1, 2:]
    middle = own[:, 1:-1, 1:-1]
    sharp = middle + strength[:, None, None] * (middle - around / 4)
    return np.asarray(sharp[:, inner, inner].reshape(len(own), -1))


def wrong_cells_allowed(family: Family) -> int:
    """Cells that may be wrong so that chance makes hardly any marker; -1 where none may be read."""
    bits = int(family.dictionary.markerSize) ** 2
    ways, codes = 0.0, 4.0 * len(family.dictionary.bytesList)
    for wrong in range(_MOST_WRONG + 1):
        ways += comb(bits, wrong)
        if codes * ways / 2.0**bits > _CHANCE:
            return wrong - 1
    return _MOST_WRONG


def turned_corners(quads: Array, reading: Reading) -> Array:
    """(k, 4, 2) the corners of the markers, the top left one of the print first."""
    order = (np.arange(4) + reading.turns[:, None]) % 4
    return np.asarray(np.take_along_axis(quads[reading.rows], order[..., None], axis=1))


@lru_cache
def _codes(family: Family) -> npt.NDArray[np.float32]:
    """(4 n, bits) codes, 1 where white and -1 where black, as they are read after each turn."""
    count = len(family.dictionary.bytesList)
    edge = slice(family.border, family.cells - family.border)
    bits = np.stack([family.bits(n)[edge, edge] for n in range(count)]).astype(np.float32)
    # A print whose top left corner is corner k of the quadrangle is turned k quarters clockwise.
    turned = [np.rot90(bits, -k, axes=(1, 2)) for k in range(4)]
    return np.asarray(2 * np.concatenate(turned).reshape(4 * count, -1) - 1)


def _cell_levels(image: Image, quads: Array, cells: int) -> Array:
    """(n, (cells + 2)^2) mean grey levels in the middles of cells, those of the rim included."""
    ahead = homographies(quads) @ _places_in_cells(cells)
    with np.errstate(divide="ignore", invalid="ignore"):
        seen = ahead[:, :2] / ahead[:, 2:]
    grey = sampled(image, seen[:, 0], seen[:, 1])
    return np.asarray(grey.reshape(len(quads), _IN_A_CELL, -1).mean(1))


@lru_cache
def _places_in_cells(cells: int) -> Array:
    """(3, k) where the cells, those of the rim included, are looked at: first in all middles."""
    middles = (np.arange(cells + 2) - 0.5) / cells
    x, y = np.meshgrid(middles, middles)
    # The rim is looked at near the border: a narrow rim is enough.
    near = 0.22 / cells
    x, y = (np.where(v < 0, -0.5 / cells + near, np.where(v > 1, 1 + near, v)) for v in (x, y))
    off = 0.18 / cells * np.array([[0, 1, 1, -1, -1], [0, 1, -1, 1, -1]])
    places = np.stack([x.ravel(), y.ravel()])[:, None] + off[..., None]
    return np.concatenate([places.reshape(2, -1), np.ones((1, _IN_A_CELL * x.size))])


@lru_cache
def _ring(cells: int, depth: int) -> Ints:
    """Which of the (cells + 2)^2 cells are the rim (0), or the border's outer ring (1), ..."""
    side = cells + 2
    y, x = np.mgrid[:side, :side]
    away = np.minimum.reduce([x, y, side - 1 - x, side - 1 - y])
    return np.flatnonzero(away.ravel() == depth)


def _rim(cells: int) -> Ints:
    return _ring(cells, 0)


@lru_cache
def _plane_of(cells: int, depth: int) -> Array:
    """((cells + 2)^2, r) what makes a plane, at all cells, of the levels of a ring."""
    side = cells + 2
    y, x = np.mgrid[:side, :side] / (side - 1) - 0.5
    full = np.column_stack([np.ones(side * side), x.ravel(), y.ravel()])
    return np.asarray(full @ np.linalg.pinv(full[_ring(cells, depth)]))


def _plane(levels: Array, cells: int, depth: int) -> Array:
    """(n, (cells + 2)^2) a plane through the levels (n, r) of a ring."""
    return np.asarray(levels @ _plane_of(cells, depth).T)


def drawn_apart(image: Image) -> Image:
    """A dark or pale image with grey levels drawn apart, to be looked through; others as they are.

    OpenCV's threshold is off the local mean by so many grey levels, whatever the exposure.
    """
    some = np.ascontiguousarray(image[::_EVERY, ::_EVERY])
    levels = cv2.calcHist([some], [0], None, [256], [0, 256]).ravel().cumsum(dtype=float)
    low, high = np.searchsorted(levels, [_ENDS * levels[-1], (1 - _ENDS) * levels[-1]])
    if high - low > _NARROW:
        return image
    drawn = (np.arange(256) - low) * (255 / max(high - low, _LEAST_RANGE))
    return np.asarray(np.rint(np.clip(drawn, 0, 255)).astype(np.uint8)[image])
