"""Board corners where black and white squares meet, fitted to the grey levels around them.

Two blurred steps cross at a corner; their place, directions, width and levels are fitted to
whole pixels, and where a camera has sharpened its images, how much. The part of the image that
is used is given on the board, so it keeps clear of a ChArUco board's markers however it is tilted.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from validation.poses.angles import Array
from vision_gt.prints.grey_fits import (
    AMOUNT_INFORMATION,
    BLUR_INFORMATION,
    LEAST_VARIANCE,
    MOST_AMOUNT,
    MOST_BLUR,
    SATURATED,
    SHARPENING_WIDTHS,
    START_BLUR,
)

Image = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]

_REACH = 7
"""Most pixels from a corner in each direction."""
_LEAST_PIXELS, _UNKNOWNS = 20, 10
"""Pixels that a fit needs: twice its unknowns and more."""
_STEPS = 7
"""Gauss-Newton steps. A judgement: none moves a corner by more than a pixel, and it starts two
off."""
_LEAST_BLUR = 0.35
"""Pixels; narrower steps are seen as no slope at all between whole pixels."""
_MOST_SHIFT = 2.5
"""Pixels that a corner may be from its start, which is known to about two."""
_WORST_FIT, _LEAST_CONTRAST, _MOST_SIGMA = 0.25, 15.0, 0.3
"""Residuals over contrast from which on a corner is not one; grey levels between black and white
that it needs; pixels that it may be uncertain by. Judgements: noise of 2 grey levels on a contrast
of 100 is 0.02, and a marker's corner or a shadow's end leaves a third of the contrast."""
_SHARPENED = 0.04
"""Median of the residuals over contrast from which on sharpening is tried, twice what noise of two
grey levels leaves."""
_NEAR, _MOST_ALIKE = 3, 9.0
"""Pixels to which grey levels may be off alike: what JPEG, Bayer's pattern, noise that a camera
smoothed, a bent tone curve and wider blur leave is alike over two or three. And by how much
variances are larger for that at most: smoothed noise needs 4, and what a tone curve or motion
leaves goes to 36 but moves no corner, as it is the same on both sides."""


@dataclass(frozen=True)
class SaddleFit:
    """Refined corners.

    Parameters
    ----------
    pixels : (n, 2) array
        Where the squares meet.
    sigmas : (n,) array
        Standard deviation of each coordinate, pixels, the larger of the two.
    good : (n,) array of bool
        Whether there is such a corner at all.
    """

    pixels: Array
    sigmas: Array
    good: Mask

    def of(self, rows: Mask) -> "SaddleFit":
        """Some of them."""
        return SaddleFit(self.pixels[rows], self.sigmas[rows], self.good[rows])


def refine_saddles(image: Image, start: Array, axes: Array, radius: float) -> SaddleFit:
    """Corners of squares from the grey levels around them.

    Parameters
    ----------
    image : (h, w) array of uint8
        Grey levels.
    start : (n, 2) array
        Corners to about two pixels.
    axes : (n, 2, 2) array
        Sides of a square at each corner, in pixels: columns along the board's x and y.
    radius : float
        Share of a square's side within which pixels are used.

    Notes
    -----
    Cameras that sharpen leave a bright and a dark line beside every edge. Where steps that are
    blurred alone leave too much, the image is taken as led away from a blurred copy of itself, by
    an amount that each corner finds and the width, of some, that explains most corners best.
    """
    seen = _patches(image, start, axes, radius)
    first = _start_values(seen[1], seen[2], axes, seen[0])
    fit = _fitted(seen, first, 0.0)
    usable = fit.enough & (fit.contrast > _LEAST_CONTRAST)
    if usable.any() and float(np.median(fit.misfit[usable])) > _SHARPENED:
        sharpened = (_fitted(seen, first, width) for width in SHARPENING_WIDTHS)
        fit = min([fit, *sharpened], key=lambda one: float(np.median(one.misfit[usable])))
    good = (
        fit.enough
        & (np.linalg.norm(fit.values[:, :2], axis=1) < _MOST_SHIFT)
        & (fit.misfit < _WORST_FIT)
        & (fit.contrast > _LEAST_CONTRAST)
        & (fit.alone < _MOST_SIGMA)
    )
    return SaddleFit(start + fit.values[:, :2], fit.sigmas, good)


@dataclass(frozen=True)
class _Saddles:
    """Where the fits ended: unknowns (n, 10), and what is left of the grey levels (n,) each.

    Standard deviations (n,) also ``alone``, as noise of single pixels makes them.
    """

    values: Array
    sigmas: Array
    alone: Array
    misfit: Array
    contrast: Array
    enough: Mask


def _fitted(seen: tuple[Array, Array, Array], values: Array, width: float) -> _Saddles:
    """Gauss-Newton steps from values (n, 10)."""
    offsets, grey, patch = seen
    enough = patch.sum(1) >= _LEAST_PIXELS
    weight = patch
    for step in range(_STEPS + 1):
        residual, jacobian = _model(values, offsets, grey, width)
        weight = patch * ~((grey >= SATURATED) & (residual < 0))
        weight = weight * ~((grey <= 255 - SATURATED) & (residual > 0))
        change, normal = _solve(residual, jacobian, weight, values)
        if step == _STEPS:
            break
        change[:, :2] = np.clip(change[:, :2], -1.0, 1.0)
        change[:, 2:4] = np.clip(change[:, 2:4], -0.2, 0.2)
        values = values + np.where(enough[:, None], change, 0.0)
        values[:, 4] = np.clip(values[:, 4], _LEAST_BLUR, MOST_BLUR)
        values[:, 9] = np.clip(values[:, 9], 0.0, MOST_AMOUNT if width > 0 else 0.0)
    count = np.maximum(weight.sum(1) - _UNKNOWNS, 1.0)
    variance = np.maximum((weight * residual**2).sum(1) / count, LEAST_VARIANCE)
    inverse = np.linalg.inv(normal)
    single = variance[:, None] * np.diagonal(inverse[:, :2, :2], axis1=1, axis2=2)
    moves = weight[..., None] * (jacobian @ inverse[:, :, :2])
    alike = _of_neighbours(weight * residual / np.sqrt(variance)[:, None], moves, enough)
    sigmas = np.sqrt((single * np.minimum(alike, _MOST_ALIKE)).max(1))
    alone = np.sqrt(single.max(1))
    contrast = 2 * np.abs(values[:, 8])
    misfit = np.sqrt(variance) / np.maximum(contrast, 1e-3)
    return _Saddles(values, sigmas, alone, misfit, contrast, enough)


def _of_neighbours(left: Array, moves: Array, enough: Mask) -> Array:
    """(n, 2) by how much variances are larger as pixels side by side are off alike.

    By what is left (n, p), in standard deviations, and by how much each grey level moves the
    corner (n, p, 2). How alike pixels are at each distance is taken from all corners together:
    one has too few pixels to tell.
    """
    side = 2 * _REACH + 1
    field, pull = left.reshape(-1, side, side), moves.reshape(-1, side, side, 2)
    own = np.square(pull).sum((1, 2))
    total = np.zeros_like(own)
    size = max(float(np.square(field[enough]).sum()), 1e-12)
    for dy in range(_NEAR + 1):
        for dx in range(-_NEAR if dy else 1, _NEAR + 1):
            rows, others = np.s_[: side - dy], np.s_[dy:]
            here, there = (
                np.s_[max(-dx, 0) : side - max(dx, 0)],
                np.s_[max(dx, 0) : side + min(dx, 0)],
            )
            alike = (field[enough, rows, here] * field[enough, others, there]).sum() / size
            total += 2 * alike * (pull[:, rows, here] * pull[:, others, there]).sum((1, 2))
    return np.asarray(np.maximum(1 + total / np.maximum(own, 1e-30), 1.0))


def _patches(image: Image, start: Array, axes: Array, radius: float) -> tuple[Array, Array, Array]:
    """Offsets (n, p, 2) of whole pixels from the start, grey levels (n, p), weights (n, p)."""
    height, width = image.shape
    steps = np.arange(-_REACH, _REACH + 1)
    grid = np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2)
    pixels = np.rint(start).astype(np.intp)[:, None] + grid
    inside = ((pixels >= 0) & (pixels < [width, height])).all(-1)
    offsets = pixels - start[:, None]
    on_board = np.einsum("nij,npj->npi", np.linalg.inv(axes), offsets)
    used = inside & (np.linalg.norm(on_board, axis=-1) < radius)
    column = np.clip(pixels[..., 0], 0, width - 1)
    row = np.clip(pixels[..., 1], 0, height - 1)
    return offsets, image[row, column].astype(float), used.astype(float)


def _start_values(grey: Array, weight: Array, axes: Array, offsets: Array) -> Array:
    """Unknowns (n, 10): shift, normals' angles, width, mean, its slopes, half contrast, sharpness.

    The normal of the line along the board's x axis, and that of the one along y.
    """
    along_x, along_y = axes[..., 0], axes[..., 1]
    angles = [np.arctan2(side[:, 0], -side[:, 1]) for side in (along_x, along_y)]
    total = np.maximum(weight.sum(1), 1.0)
    mean = (weight * grey).sum(1) / total
    signs = [
        np.sign(np.cos(a)[:, None] * offsets[..., 0] + np.sin(a)[:, None] * offsets[..., 1])
        for a in angles
    ]
    half = (weight * signs[0] * signs[1] * (grey - mean[:, None])).sum(1) / total
    none = np.zeros(len(grey))
    blur = np.full(len(grey), START_BLUR)
    return np.column_stack([none, none, *angles, blur, mean, none, none, half, none])


def _step(distance: Array, blur: Array, amount: Array, width: float) -> tuple[Array, ...]:
    """A sharpened, blurred step from -1 to 1; its derivatives by distance, blur and amount."""
    z = distance / blur
    plain = 2 * ndtr(z) - 1
    slope = np.exp(-0.5 * z * z) * (np.sqrt(2 / np.pi) / blur)
    if width <= 0:
        return plain, slope, -slope * z, np.zeros_like(z)
    wide = np.hypot(blur, width)
    far = distance / wide
    soft = 2 * ndtr(far) - 1
    gentle = np.exp(-0.5 * far * far) * (np.sqrt(2 / np.pi) / wide)
    return (
        plain + amount * (plain - soft),
        slope + amount * (slope - gentle),
        -(1 + amount) * slope * z + amount * gentle * far * blur / wide,
        plain - soft,
    )


def _model(values: Array, offsets: Array, grey: Array, width: float) -> tuple[Array, Array]:
    """Grey minus model (n, p), and the model's derivative (n, p, 10)."""
    x, y, first, second, blur, mean, gx, gy, half, amount = (v[:, None] for v in values.T)
    dx, dy = offsets[..., 0] - x, offsets[..., 1] - y
    sides = []
    for angle in (first, second):
        c, s = np.cos(angle), np.sin(angle)
        sides.append((_step(c * dx + s * dy, blur, amount, width), c, s, -s * dx + c * dy))
    ((one, d1, b1, a1), c1, s1, along1), ((two, d2, b2, a2), c2, s2, along2) = sides
    jacobian = np.stack(
        [
            -half * (d1 * c1 * two + d2 * c2 * one),
            -half * (d1 * s1 * two + d2 * s2 * one),
            half * d1 * along1 * two,
            half * d2 * along2 * one,
            half * (b1 * two + b2 * one),
            np.ones_like(dx),
            offsets[..., 0],
            offsets[..., 1],
            one * two,
            half * (a1 * two + a2 * one),
        ],
        -1,
    )
    model = mean + gx * offsets[..., 0] + gy * offsets[..., 1] + half * one * two
    return np.asarray(grey - model), jacobian


def _solve(residual: Array, jacobian: Array, weight: Array, values: Array) -> tuple[Array, Array]:
    """Gauss-Newton steps (n, 10) and normal matrices (n, 10, 10), for noise of one grey level."""
    weighted = np.swapaxes(jacobian * weight[..., None], 1, 2)
    normal = weighted @ jacobian
    diagonal = np.arange(_UNKNOWNS)
    normal[:, diagonal, diagonal] += 1e-6 + 1e-6 * normal[:, diagonal, diagonal]
    normal[:, 4, 4] += BLUR_INFORMATION
    normal[:, 9, 9] += AMOUNT_INFORMATION
    right = (weighted @ residual[..., None])[..., 0]
    right[:, 9] -= AMOUNT_INFORMATION * values[:, 9]
    change = np.linalg.solve(normal, right[..., None])[..., 0]
    return np.asarray(change), np.asarray(normal)
