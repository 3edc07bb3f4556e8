"""Grey levels between pixels, for any number of places."""

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array

_ROW = 8192
"""Places a row of what OpenCV is given: it takes no picture of more than 32,767 in a row."""
_OUTSIDE = -99.0

Levels = npt.NDArray[np.uint8] | npt.NDArray[np.float32]


def sampled(image: Levels, x: Array, y: Array) -> Array:
    """Linearly interpolated grey levels.

    Parameters
    ----------
    image : (h, w) or (h, w, c) array of uint8 or float32
        Grey levels; beyond its rim they are those of the rim.
    x, y : (...) arrays
        Places, pixels; where they are no numbers, the corner of the image is taken.

    Returns
    -------
    (...) or (..., c) array
        As many as places, however many.
    """
    count, shape = x.size, x.shape
    width = min(max(count, 1), _ROW)
    rows = -(-max(count, 1) // width)
    maps = []
    for places in (x, y):
        one = np.zeros(rows * width, dtype=np.float32)
        one[:count] = np.clip(np.nan_to_num(places.ravel(), nan=_OUTSIDE), -1e6, 1e6)
        maps.append(one.reshape(rows, width))
    source: Any = image
    grey = cv2.remap(source, maps[0], maps[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    own = image.shape[2:]
    return np.asarray(grey, dtype=float).reshape(rows * width, *own)[:count].reshape(*shape, *own)
