"""How blurred prints of black and white cells look: the share of white of each pixel.

Along either axis of the print a cell is as white as a blurred step up less the step down behind
it, so only the few boundaries that blur reaches from a pixel are looked at.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from vision_gt.prints.grey_fits import Floats

Ints = npt.NDArray[np.intp]

REACH = 2.8
"""Widths of the blur to which a boundary is seen: beyond it a step is done to 0.3 %."""
_MOST_BOUNDARIES = 9
"""A judgement: blur that reaches over more cells leaves no print to be seen."""
PADDING = _MOST_BOUNDARIES + 1
"""Cells of white around a print, so that all that blur reaches is in the table."""
_STRAIGHT, _DARKEST = 1e-6, 1e-2
"""A bend for which the curve is straight to rounding; the least that a logarithm is taken of."""
_ROOT = float(1 / np.sqrt(2 * np.pi))
_TAIL = (0.2316419, (0.319381530, -0.356563782, 1.781477937, -1.821255978, 1.330274429))
"""Of the normal distribution beside its density: Abramowitz and Stegun 26.2.17, to 8e-8."""


@dataclass(frozen=True)
class Whiteness:
    """The share of white (m, n) at points of m prints, and its derivatives.

    ``by_x`` and ``by_y`` are by the prints' axes, ``by_blur`` by the blur's width in the image.
    """

    white: Floats
    by_x: Floats
    by_y: Floats
    by_blur: Floats


@dataclass(frozen=True)
class Places:
    """Points of m prints (m, n), and how these are spread out in the image there.

    ``x`` and ``y`` are from -1 to 1 over a print. ``along_x`` and ``along_y`` are how many of
    these units a pixel has, ``slant`` the scalar product of the two gradients.
    """

    x: Floats
    y: Floats
    along_x: Floats
    along_y: Floats
    slant: Floats


def boundaries_in_reach(blur: Array, along: Floats, cells: int) -> Ints:
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


def boundaries(at: Places, blur: Array, cells: Floats) -> tuple[int, int]:
    """How many boundaries blur (m,) reaches along x and y of any of some prints (m, s, s)."""
    count = cells.shape[-1] - 2 * PADDING
    x, y = (
        int(boundaries_in_reach(blur, along.mean(-1), count).max())
        for along in (at.along_x, at.along_y)
    )
    return x, y


def whiteness(cells: Floats, at: Places, blur: Array, boundaries: tuple[int, int]) -> Whiteness:
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
    kind = at.x.dtype
    stride = cells.shape[-1]
    half = stride / 2 - PADDING
    columns, rows = boundaries
    blur = blur[:, None].astype(kind)
    first_x, steps_x = _steps(at.x, blur * at.along_x, half, columns)
    first_y, steps_y = _steps(at.y, blur * at.along_y, half, rows)
    corner = (first_y + PADDING) * stride + first_x + PADDING
    corner += stride * stride * np.arange(len(cells))[:, None]
    table = np.arange(rows + 1)[:, None] * stride + np.arange(columns + 1)
    level = cells.astype(kind).ravel().take(corner + table[:, :, None, None])
    # From one boundary to the next along x, and then along y: with the steps along x, and their
    # derivatives by place and width, what rises along y (3, rows + 1, m, n).
    first, rise = level[:, 0], np.diff(level, axis=1)
    rise[1:] = np.diff(rise, axis=0)
    up = steps_x[:, None, 0] * rise[:, 0]
    for k in range(1, columns):
        up += steps_x[:, None, k] * rise[:, k]
    up[0, 0] += first[0]
    up[0, 1:] += np.diff(first, axis=0)
    white, by_x, wider_x = _summed(steps_y[0], up) + up[:, 0]
    by_y, both = _summed(steps_y[1], up[:2])
    wider_y, bent = _summed(steps_y[2], up[::2])
    aslant = blur * blur * at.slant
    squeeze = at.slant / (at.along_x * at.along_y)
    white += aslant * both + 0.5 * squeeze * aslant * bent
    by_blur = wider_x * at.along_x + wider_y * at.along_y + 2 * blur * at.slant * both
    return Whiteness(white, by_x, by_y, by_blur)


def toned(look: Whiteness, bend: Array) -> tuple[Whiteness, Floats]:
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
    share = look.white.astype(float)  # small bends are what is left of differences
    inside = np.maximum(1 + more * share, _DARKEST)
    white = np.log(inside) / g
    by_bend = ((more + 1) * share / inside - white) / g
    kind = look.white.dtype
    slope = (more / (g * inside)).astype(kind)
    by = look.by_x * slope, look.by_y * slope, look.by_blur * slope
    return Whiteness(white.astype(kind), *by), by_bend.astype(kind)


def _steps(place: Floats, width: Floats, half: float, count: int) -> tuple[Ints, Floats]:
    """The boundaries next to places (m, n): the cell before them, and each one's blurred step.

    Steps (3, count, m, n), and their derivatives by place and by width, in the print's units.
    """
    cell = (place + 1) * half
    nearest = np.minimum(np.maximum(np.rint(cell), -1), 2 * half + 1)
    first = nearest.astype(np.intp) - (count + 1) // 2
    boundary = np.arange(-(count // 2), count // 2 + 1, dtype=cell.dtype)[:, None, None]
    narrow = 1 / (half * width)
    z = (cell - nearest - boundary) * narrow
    steps = np.empty((3, *z.shape), dtype=cell.dtype)
    bell = np.exp(-0.5 * z * z)
    _fill_share_below(z, bell, steps[0])
    np.multiply(bell, narrow * (half * _ROOT), out=steps[1])
    np.multiply(steps[1], z, out=steps[2])
    np.negative(steps[2], out=steps[2])
    return first, steps


def _summed(steps: Floats, up: Floats) -> Floats:
    """What rises (q, rows + 1, m, n), from the second row on, times steps (rows, m, n)."""
    found = steps[0] * up[:, 1]
    for k in range(1, len(steps)):
        found += steps[k] * up[:, k + 1]
    return np.asarray(found)


def _fill_share_below(z: Floats, bell: Floats, share: Floats) -> None:
    """Fill in the normal distribution's share below z, given its density there (not normed)."""
    scale, factors = _TAIL
    t = np.abs(z)
    t *= scale
    t += 1
    np.divide(1, t, out=t)
    tail = t * factors[-1]
    for factor in factors[-2::-1]:
        tail += factor
        tail *= t
    tail *= bell
    tail *= -_ROOT
    tail += 0.5
    np.copysign(tail, z, out=share)
    share += 0.5


def to_prints(H: Array, origin: Array) -> Array:
    """(m, 3, 3) from undistorted pixels, as seen from an origin (m, 2) each, to prints."""
    found = np.asarray(np.linalg.inv(H), dtype=float)
    found[:, :, 2] += (found[:, :, :2] @ origin[:, :, None])[..., 0]
    return found


def places_in_print(
    H: Array, places: Floats, origin: Array, shape: Array | None = None
) -> tuple[Places, Floats]:
    """Points of prints that pixels (m, 3, n) show, how they are spread there; and 1, x, y.

    Parameters
    ----------
    H : (m, 3, 3) array
        From the prints to undistorted pixels.
    places : (m, 3, n) array
        Undistorted pixels from an origin each, homogeneous.
    origin : (m, 2) array
        The origins, undistorted pixels.
    shape : (m, 2, 2) array, optional
        What makes the blur's ellipse of a circle: a pixel is then as wide as that.

    Returns
    -------
    at : Places
        Where the pixels are in the prints.
    lit : (m, 3, n) array
        1, x and y.
    """
    to_print = to_prints(H, origin).astype(places.dtype)
    ahead = to_print @ places
    nearness = 1 / ahead[:, 2]
    lit = np.ones((len(H), 3, places.shape[-1]), dtype=places.dtype)
    x, y = np.multiply(ahead[:, 0], nearness, out=lit[:, 1]), lit[:, 2]
    np.multiply(ahead[:, 1], nearness, out=y)
    part = to_print[:, :, :2, None]
    (x_right, x_down), (y_right, y_down) = (
        [(part[:, row, k] - place * part[:, 2, k]) * nearness for k in (0, 1)]
        for row, place in ((0, x), (1, y))
    )
    if shape is not None:
        (a, b), (c, d) = shape.astype(places.dtype).transpose(1, 2, 0)[..., None]
        x_right, x_down = x_right * a + x_down * c, x_right * b + x_down * d
        y_right, y_down = y_right * a + y_down * c, y_right * b + y_down * d
    along_x = np.sqrt(x_right * x_right + x_down * x_down)
    along_y = np.sqrt(y_right * y_right + y_down * y_down)
    return Places(x, y, along_x, along_y, x_right * y_right + x_down * y_down), lit


def fill_by_light(lit: Floats, white: Floats, full: Floats) -> None:
    """Fill in the derivative (m, 6 or 9, n) of the grey levels by the light."""
    np.multiply(lit, white[:, None], out=full[:, 3:6])
    np.subtract(lit, full[:, 3:6], out=full[:, :3])
    if full.shape[1] > 6:
        np.multiply(lit[:, 1:], full[:, 4:5], out=full[:, 6:8])
        np.multiply(lit[:, 2], full[:, 5], out=full[:, 8])


def contrast_of_light(light: Array, lit: Floats) -> Floats:
    """Grey levels (m, n) between black and white."""
    light = light.astype(lit.dtype)
    contrast = ((light[:, 3:6] - light[:, :3])[:, None] @ lit)[:, 0]
    if light.shape[1] > 6:
        x, y = lit[:, 1], lit[:, 2]
        by_xx, by_xy, by_yy = light[:, 6:, None].transpose(1, 0, 2)
        contrast = contrast + (by_xx * x + by_xy * y) * x + by_yy * y * y
    return np.asarray(contrast)
