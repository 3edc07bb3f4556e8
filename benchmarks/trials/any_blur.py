"""A judge of corners that knows no model of a camera: the print at them, under any blur.

The print is drawn at the corners, and what blurs it is left free: a kernel of 9 x 9 weights, none
below zero, and a slope of the light. What is left of the image tells which of two sets of corners
lies better, whoever found them.
"""

import cv2
import numpy as np
import numpy.typing as npt
from scipy.optimize import lsq_linear

from validation.poses.angles import Array

_REACH, _FINE, _CELL = 4, 8, 16
"""Pixels of the kernel to each side; samples a pixel along a side; samples of a print's cell."""
_LEAST = 150
"""Pixels to judge by: twice as many as unknowns."""


def left_under_any_blur(image: npt.NDArray[np.uint8], corners: Array, bits: Array) -> float:
    """Rms of what is left of an image, grey levels.

    Parameters
    ----------
    image : (h, w) array of uint8
    corners : (4, 2) array
        Of the print's black border, pixels, from the top left one clockwise.
    bits : (n, n) array
        Cells of the print with its border, 1 for white.

    Returns
    -------
    float
        NaN where there are too few pixels.
    """
    low = np.floor(corners.min(0)).astype(int) - 2 * _REACH
    wide, high = np.ceil(corners.max(0)).astype(int) + 2 * _REACH - low
    if low.min() < 0 or low[0] + wide > image.shape[1] or low[1] + high > image.shape[0]:
        return np.nan
    drawn, inside = _drawn(corners - low, bits, (int(wide), int(high)))
    kernel = np.ones((2 * _REACH + 1, 2 * _REACH + 1), dtype=np.uint8)
    used = cv2.erode(inside, kernel, borderValue=0) > 0.999
    if used.sum() < _LEAST:
        return np.nan
    steps = range(-_REACH, _REACH + 1)
    moved = [np.roll(drawn, (dy, dx), (0, 1))[used] for dy in steps for dx in steps]
    y, x = np.nonzero(used)
    columns = np.stack([*moved, np.ones(len(x)), x / wide, y / high], axis=1)
    grey = image[low[1] :, low[0] :][:high, :wide][used].astype(float)
    least = np.r_[np.zeros(len(moved)), np.full(3, -np.inf)]
    fitted = lsq_linear(columns, grey, bounds=(least, np.inf)).x
    return float(np.std(grey - columns @ fitted))


def _drawn(corners: Array, bits: Array, size: tuple[int, int]) -> tuple[Array, Array]:
    """A print with a white rim of one cell over the areas of pixels, and where it is."""
    print_ = np.kron(np.pad(bits, 1, constant_values=1), np.ones((_CELL, _CELL))).astype(np.float32)
    low, high = _CELL - 0.5, len(print_) - _CELL - 0.5
    own = np.array([[low, low], [high, low], [high, high], [low, high]], dtype=np.float32)
    there = (corners * _FINE + (_FINE - 1) / 2).astype(np.float32)
    change, fine = cv2.getPerspectiveTransform(own, there), (size[0] * _FINE, size[1] * _FINE)
    drawn, inside = (
        cv2.warpPerspective(one, change, fine).reshape(size[1], _FINE, size[0], _FINE).mean((1, 3))
        for one in (print_, np.ones_like(print_))
    )
    return np.asarray(drawn), np.asarray(inside)
