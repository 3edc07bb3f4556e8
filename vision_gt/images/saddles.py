"""Board corners where black and white squares meet, fitted to the grey levels around them.

Two blurred steps cross at a corner; their place, directions, width and levels are fitted to
whole pixels. The part of the image that is used is given on the board, so it keeps clear of a
ChArUco board's markers however the board is tilted.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from validation.poses.angles import Array
from vision_gt.images.grey_fits import BLUR_INFORMATION, LEAST_VARIANCE, MOST_BLUR, START_BLUR

Image = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]

_REACH = 7
"""Most pixels from a corner in each direction."""
_LEAST_PIXELS, _UNKNOWNS = 20, 9
"""Pixels that a fit needs: twice its unknowns and more."""
_STEPS = 7
"""Gauss-Newton steps. A judgement: none moves a corner by more than a pixel, and it starts two
off."""
_LEAST_BLUR = 0.35
"""Pixels; narrower steps are seen as no slope at all between whole pixels."""
_MOST_SHIFT = 2.5
"""Pixels that a corner may be from its start, which is known to about two."""
_WORST_FIT, _LEAST_CONTRAST, _MOST_SIGMA = 0.12, 15.0, 0.3
"""Residuals over contrast from which on a corner is not one; grey levels between black and white
that it needs; pixels that it may be uncertain by. Judgements: noise of 2 grey levels on a contrast
of 100 is 0.02, and a marker's corner or a shadow's end leaves a third of the contrast."""


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
    """
    offsets, grey, weight = _patches(image, start, axes, radius)
    values = _start_values(grey, weight, axes, offsets)
    enough = weight.sum(1) >= _LEAST_PIXELS
    for _ in range(_STEPS):
        residual, jacobian = _model(values, offsets, grey)
        change, _normal = _solve(residual, jacobian, weight)
        change[:, :2] = np.clip(change[:, :2], -1.0, 1.0)
        change[:, 2:4] = np.clip(change[:, 2:4], -0.2, 0.2)
        values = values + np.where(enough[:, None], change, 0.0)
        values[:, 4] = np.clip(values[:, 4], _LEAST_BLUR, MOST_BLUR)
    residual, jacobian = _model(values, offsets, grey)
    _change, normal = _solve(residual, jacobian, weight)
    count = np.maximum(weight.sum(1) - _UNKNOWNS, 1.0)
    variance = np.maximum((weight * residual**2).sum(1) / count, LEAST_VARIANCE)
    inverse = np.linalg.inv(normal)
    sigmas = np.sqrt(variance * np.maximum(inverse[:, 0, 0], inverse[:, 1, 1]))
    contrast = 2 * np.abs(values[:, 8])
    good = (
        enough
        & (np.linalg.norm(values[:, :2], axis=1) < _MOST_SHIFT)
        & (np.sqrt(variance) < _WORST_FIT * contrast)
        & (contrast > _LEAST_CONTRAST)
        & (sigmas < _MOST_SIGMA)
    )
    return SaddleFit(start + values[:, :2], sigmas, good)


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
    """Unknowns (n, 9): shift, normals' angles, width, mean and its slopes, half the contrast.

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
    return np.column_stack([none, none, *angles, blur, mean, none, none, half])


def _model(values: Array, offsets: Array, grey: Array) -> tuple[Array, Array]:
    """Grey minus model (n, p), and the model's derivative (n, p, 9)."""
    x, y, first, second, blur, mean, gx, gy, half = (v[:, None] for v in values.T)
    dx, dy = offsets[..., 0] - x, offsets[..., 1] - y
    steps, slopes, alongs = [], [], []
    for angle in (first, second):
        c, s = np.cos(angle), np.sin(angle)
        z = (c * dx + s * dy) / blur
        steps.append(2 * ndtr(z) - 1)
        density = 2 * np.exp(-0.5 * z * z) / (np.sqrt(2 * np.pi) * blur)
        slopes.append((density, c, s, z))
        alongs.append(-s * dx + c * dy)
    (d1, c1, s1, z1), (d2, c2, s2, z2) = slopes
    one, two = steps
    jacobian = np.stack(
        [
            -half * (d1 * c1 * two + d2 * c2 * one),
            -half * (d1 * s1 * two + d2 * s2 * one),
            half * d1 * alongs[0] * two,
            half * d2 * alongs[1] * one,
            -half * (d1 * z1 * two + d2 * z2 * one),
            np.ones_like(dx),
            offsets[..., 0],
            offsets[..., 1],
            one * two,
        ],
        -1,
    )
    model = mean + gx * offsets[..., 0] + gy * offsets[..., 1] + half * one * two
    return np.asarray(grey - model), jacobian


def _solve(residual: Array, jacobian: Array, weight: Array) -> tuple[Array, Array]:
    """Gauss-Newton steps (n, 9) and normal matrices (n, 9, 9), for noise of one grey level."""
    weighted = np.swapaxes(jacobian * weight[..., None], 1, 2)
    normal = weighted @ jacobian
    diagonal = np.arange(_UNKNOWNS)
    normal[:, diagonal, diagonal] += 1e-6 + 1e-6 * normal[:, diagonal, diagonal]
    normal[:, 4, 4] += BLUR_INFORMATION
    change = np.linalg.solve(normal, (weighted @ residual[..., None]))[..., 0]
    return np.asarray(change), np.asarray(normal)
