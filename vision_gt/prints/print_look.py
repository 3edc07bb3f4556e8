"""How blurred prints of black and white cells look: the share of white of each pixel.

Along either axis of the print a cell is as white as a blurred step up less the step down behind
it, so only the few boundaries that blur reaches from a pixel are looked at.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from validation.poses.angles import Array

Ints = npt.NDArray[np.intp]

REACH = 2.8
"""Widths of the blur to which a boundary is seen: beyond it a step is done to 0.3 %."""
_MOST_BOUNDARIES = 9
"""A judgement: blur that reaches over more cells leaves no print to be seen."""
PADDING = _MOST_BOUNDARIES + 1
"""Cells of white around a print, so that all that blur reaches is in the table."""
_STRAIGHT, _DARKEST = 1e-6, 1e-2
"""A bend for which the curve is straight to rounding; the least that a logarithm is taken of."""
_ROOT = 1 / np.sqrt(2 * np.pi)


@dataclass(frozen=True)
class Whiteness:
    """The share of white (m, n) at points of m prints, and its derivatives.

    ``by_x`` and ``by_y`` are by the prints' axes, ``by_blur`` by the blur's width in the image.
    """

    white: Array
    by_x: Array
    by_y: Array
    by_blur: Array


@dataclass(frozen=True)
class Places:
    """Points of m prints (m, n), and how these are spread out in the image there.

    ``x`` and ``y`` are from -1 to 1 over a print. ``along_x`` and ``along_y`` are how many of
    these units a pixel has, ``slant`` the scalar product of the two gradients.
    """

    x: Array
    y: Array
    along_x: Array
    along_y: Array
    slant: Array


def boundaries_in_reach(blur: Array, along: Array, cells: int) -> Ints:
    """How many boundaries of cells blur reaches from a pixel along one axis: 1, 3 or 5.

    Parameters
    ----------
    blur : (...) array
        Width, pixels.
    along : (...) array
        Units of the print (-1 to 1) a pixel.
    cells : int
        Along the print.
    """
    reached = 2 * REACH * blur * along * cells / 2
    most = np.minimum(2 * np.ceil((reached - 1) / 2) + 1, _MOST_BOUNDARIES)
    return np.asarray(np.maximum(most, 1)).astype(np.intp)


def boundaries(at: Places, blur: Array, cells: Array) -> tuple[int, int]:
    """How many boundaries blur (m,) reaches along x and y of any of some prints (m, s, s)."""
    count = cells.shape[-1] - 2 * PADDING
    x, y = (
        int(boundaries_in_reach(blur, along.mean(-1), count).max())
        for along in (at.along_x, at.along_y)
    )
    return x, y


def whiteness(cells: Array, at: Places, blur: Array, boundaries: tuple[int, int]) -> Whiteness:
    """The share of white at points of prints that are blurred evenly in the image.

    Parameters
    ----------
    cells : (m, c + 20, c + 20) array
        1 where white, the first row at a print's top, with ten white cells on each side.
    at : Places
        Where.
    blur : (m,) array
        Its standard deviation, pixels.
    boundaries : (int, int)
        Along x and y, from `boundaries_in_reach`.

    Notes
    -----
    Blur is round in the image and an ellipse in the print. How far the ellipse is aslant is taken
    into account to second order, as heat would spread (Mehler's series).
    """
    stride = cells.shape[-1]
    half = stride / 2 - PADDING
    columns, rows = boundaries
    blur = blur[:, None]
    first_x, step_x, slope_x, wide_x = _steps(at.x, blur * at.along_x, half, columns)
    first_y, step_y, slope_y, wide_y = _steps(at.y, blur * at.along_y, half, rows)
    corner = (first_y + PADDING) * stride + first_x + PADDING
    corner += stride * stride * np.arange(len(cells))[:, None]
    flat = cells.ravel()
    white, by_x, by_y, wider_x, wider_y, both, bent = (np.zeros(at.x.shape) for _ in range(7))
    above: tuple[Array, Array, Array] | None = None
    for j in range(rows + 1):
        row = _row(flat, corner + j * stride, (step_x, slope_x, wide_x))
        if above is None:
            white, by_x, wider_x = (row[0].copy(), row[1].copy(), row[2].copy())
        else:
            level, slope, wide = (b - a for a, b in zip(above, row, strict=True))
            k = j - 1
            white += step_y[k] * level
            by_x += step_y[k] * slope
            wider_x += step_y[k] * wide
            by_y += slope_y[k] * level
            wider_y += wide_y[k] * level
            both += slope_y[k] * slope
            bent += wide_y[k] * wide
        above = row
    aslant = blur * blur * at.slant
    squeeze = at.slant / (at.along_x * at.along_y)
    second = 0.5 * squeeze * aslant * bent
    white += aslant * both + second
    by_blur = wider_x * at.along_x + wider_y * at.along_y + 2 * blur * at.slant * both
    return Whiteness(white, by_x, by_y, by_blur)


def toned(look: Whiteness, bend: Array) -> tuple[Whiteness, Array]:
    """How prints look through a bent tone curve, and the derivative (m, n) by the bend.

    Parameters
    ----------
    look : Whiteness
        The share of white in the light.
    bend : (m,) array
        0 of a camera whose grey levels go with the light.

    Notes
    -----
    Grey levels go as the logarithm of 1 + (e^g - 1) w. With g = 1.5 it is that of a gamma of 2.2
    between 3 and 73 % of the light to 3 % of the contrast, and -g is the same curve turned over.
    """
    g = np.where(np.abs(bend) < _STRAIGHT, _STRAIGHT, bend)[:, None]
    more = np.expm1(g)
    inside = np.maximum(1 + more * look.white, _DARKEST)
    white = np.log(inside) / g
    slope = more / (g * inside)
    by_bend = ((more + 1) * look.white / inside - white) / g
    seen = Whiteness(white, look.by_x * slope, look.by_y * slope, look.by_blur * slope)
    return seen, by_bend


def _steps(place: Array, width: Array, half: float, count: int) -> tuple[Ints, Array, Array, Array]:
    """The boundaries next to places (m, n): the cell before them, and each one's blurred step.

    Steps (count, m, n), and their derivatives by place and by width, in the print's units.
    """
    cell = (place + 1) * half
    nearest = np.minimum(np.maximum(np.rint(cell), -1), 2 * half + 1)
    first = nearest.astype(np.intp) - (count + 1) // 2
    boundary = nearest + np.arange(-(count // 2), count // 2 + 1)[:, None, None]
    z = (cell - boundary) / (half * width)
    slope = np.exp(-0.5 * z * z) * (_ROOT / width)
    return first, ndtr(z), slope, -z * slope


def _row(flat: Array, start: Ints, steps: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
    """A row of cells, blurred along x, and its derivatives by place and width."""
    before = flat[start]
    level, slope, wide = before.copy(), np.zeros(start.shape), np.zeros(start.shape)
    for k in range(len(steps[0])):
        after = flat[start + k + 1]
        rise = after - before
        level += steps[0][k] * rise
        slope += steps[1][k] * rise
        wide += steps[2][k] * rise
        before = after
    return level, slope, wide


def places_in_print(H: Array, places: Array) -> tuple[Places, Array]:
    """Points of prints that pixels (m, 3, n) show, how they are spread there; and 1, x, y.

    Parameters
    ----------
    H : (m, 3, 3) array
        From the prints to undistorted pixels.
    places : (m, 3, n) array
        Undistorted pixels, homogeneous.

    Returns
    -------
    at : Places
        Where the pixels are in the prints.
    lit : (m, 3, n) array
        1, x and y.
    """
    to_print = np.asarray(np.linalg.inv(H), dtype=float)
    ahead = to_print @ places
    nearness = 1 / ahead[:, 2]
    lit = np.ones((len(H), 3, places.shape[-1]))
    x, y = np.multiply(ahead[:, 0], nearness, out=lit[:, 1]), lit[:, 2]
    np.multiply(ahead[:, 1], nearness, out=y)
    part = to_print[:, :, :2, None]
    (x_right, x_down), (y_right, y_down) = (
        [(part[:, row, k] - place * part[:, 2, k]) * nearness for k in (0, 1)]
        for row, place in ((0, x), (1, y))
    )
    along_x = np.sqrt(x_right * x_right + x_down * x_down)
    along_y = np.sqrt(y_right * y_right + y_down * y_down)
    return Places(x, y, along_x, along_y, x_right * y_right + x_down * y_down), lit


def fill_by_light(lit: Array, white: Array, full: Array) -> None:
    """Fill in the derivative (m, 6 or 9, n) of the grey levels by the light."""
    np.multiply(lit, white[:, None], out=full[:, 3:6])
    np.subtract(lit, full[:, 3:6], out=full[:, :3])
    if full.shape[1] > 6:
        np.multiply(lit[:, 1:], full[:, 4:5], out=full[:, 6:8])
        np.multiply(lit[:, 2], full[:, 5], out=full[:, 8])


def contrast_of_light(light: Array, lit: Array) -> Array:
    """Grey levels (m, n) between black and white."""
    contrast = ((light[:, 3:6] - light[:, :3])[:, None] @ lit)[:, 0]
    if light.shape[1] > 6:
        x, y = lit[:, 1], lit[:, 2]
        by_xx, by_xy, by_yy = light[:, 6:, None].transpose(1, 0, 2)
        contrast = contrast + (by_xx * x + by_xy * y) * x + by_yy * y * y
    return np.asarray(contrast)
