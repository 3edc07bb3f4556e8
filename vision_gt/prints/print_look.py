"""How a blurred print of black and white cells looks: the share of white of each pixel.

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
_ROOT = 1 / np.sqrt(2 * np.pi)


@dataclass(frozen=True)
class Whiteness:
    """The share of white (n,) at points of a print, and its derivatives.

    ``by_x`` and ``by_y`` are by the print's axes, ``by_blur`` by the blur's width in the image.
    """

    white: Array
    by_x: Array
    by_y: Array
    by_blur: Array


@dataclass(frozen=True)
class Places:
    """Points of a print (n,), and how it is spread out in the image there.

    ``x`` and ``y`` are from -1 to 1 over the print. ``along_x`` and ``along_y`` are how many of
    these units a pixel has, ``slant`` the scalar product of the two gradients.
    """

    x: Array
    y: Array
    along_x: Array
    along_y: Array
    slant: Array


def boundaries_in_reach(blur: float, along: float, cells: int) -> int:
    """How many boundaries of cells blur reaches from a pixel along one axis: 1, 3 or 5.

    Parameters
    ----------
    blur : float
        Width, pixels.
    along : float
        Units of the print (-1 to 1) a pixel.
    cells : int
        Along the print.
    """
    reached = 2 * REACH * blur * along * cells / 2
    return int(min(2 * np.ceil((reached - 1) / 2) + 1, _MOST_BOUNDARIES))


def boundaries(at: Places, blur: float, cells: Array) -> tuple[int, int]:
    """How many boundaries blur reaches along x and y of a print (c + 12, c + 12)."""
    count = len(cells) - 2 * PADDING
    along_x, along_y = (float(along.mean()) for along in (at.along_x, at.along_y))
    return (
        boundaries_in_reach(blur, along_x, count),
        boundaries_in_reach(blur, along_y, count),
    )


def whiteness(cells: Array, at: Places, blur: float, boundaries: tuple[int, int]) -> Whiteness:
    """The share of white at points of a print that is blurred evenly in the image.

    Parameters
    ----------
    cells : (c + 12, c + 12) array
        1 where white, the first row at the print's top, with six white cells on each side.
    at : Places
        Where.
    blur : float
        Its standard deviation, pixels.
    boundaries : (int, int)
        Along x and y, from `boundaries_in_reach`.

    Notes
    -----
    Blur is round in the image and an ellipse in the print. How far the ellipse is aslant is taken
    into account to second order, as heat would spread (Mehler's series).
    """
    half = len(cells) / 2 - PADDING
    columns, rows = boundaries
    first_x, step_x, slope_x, wide_x = _steps(at.x, blur * at.along_x, half, columns)
    first_y, step_y, slope_y, wide_y = _steps(at.y, blur * at.along_y, half, rows)
    stride = cells.shape[1]
    corner = (first_y + PADDING) * stride + first_x + PADDING
    flat = cells.ravel()
    white, by_x, by_y, wider_x, wider_y, both, bent = (np.zeros(len(at.x)) for _ in range(7))
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
    second = 0.5 * squeeze * (blur * blur * at.slant) * bent
    white += aslant * both + second
    by_blur = wider_x * at.along_x + wider_y * at.along_y + 2 * blur * at.slant * both
    return Whiteness(white, by_x, by_y, by_blur)


def _steps(place: Array, width: Array, half: float, count: int) -> tuple[Ints, Array, Array, Array]:
    """The boundaries next to places: the cell before them, and each one's blurred step.

    Steps (count, n), and their derivatives by place and by width, in the print's units.
    """
    cell = (place + 1) * half
    nearest = np.clip(np.rint(cell), -1, 2 * half + 1)
    first = nearest.astype(np.intp) - (count + 1) // 2
    boundary = nearest + np.arange(-(count // 2), count // 2 + 1)[:, None]
    z = (cell - boundary) / (half * width)
    slope = np.exp(-0.5 * z * z) * (_ROOT / width)
    return first, ndtr(z), slope, -z * slope


def _row(flat: Array, start: Ints, steps: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
    """A row of cells, blurred along x, and its derivatives by place and width."""
    before = flat[start]
    level, slope, wide = before.copy(), np.zeros(len(start)), np.zeros(len(start))
    for k in range(len(steps[0])):
        after = flat[start + k + 1]
        rise = after - before
        level += steps[0][k] * rise
        slope += steps[1][k] * rise
        wide += steps[2][k] * rise
        before = after
    return level, slope, wide


def places_in_print(H: Array, places: Array) -> tuple[Places, Array]:
    """Points of the print that pixels (3, n) show, with how it is spread there; and 1, x, y."""
    to_print = np.asarray(np.linalg.inv(H), dtype=float)
    x, y, nearness = to_print @ places
    nearness = 1 / nearness
    x, y = x * nearness, y * nearness
    (x_right, x_down), (y_right, y_down) = (
        [(row[k] - place * to_print[2, k]) * nearness for k in (0, 1)]
        for row, place in ((to_print[0], x), (to_print[1], y))
    )
    along_x = np.sqrt(x_right * x_right + x_down * x_down)
    along_y = np.sqrt(y_right * y_right + y_down * y_down)
    at = Places(x, y, along_x, along_y, x_right * y_right + x_down * y_down)
    return at, np.stack([np.ones_like(x), x, y])


def fill_by_light(lit: Array, white: Array, full: Array) -> None:
    """Fill in the derivative (6 or 9, n) of the grey levels by the light."""
    np.multiply(lit, white, out=full[3:6])
    np.subtract(lit, full[3:6], out=full[:3])
    if len(full) > 6:
        _, x, y = lit
        np.multiply(x, full[4], out=full[6])
        np.multiply(x, full[5], out=full[7])
        np.multiply(y, full[5], out=full[8])


def levels_of_light(light: Array, lit: Array) -> tuple[Array, Array]:
    """Grey levels (n,) of black and of white."""
    black, white = light[:3] @ lit, light[3:6] @ lit
    if len(light) > 6:
        _, x, y = lit
        white = white + light[6] * x * x + light[7] * x * y + light[8] * y * y
    return black, white
