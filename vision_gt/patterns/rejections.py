"""What was seen in an image and not used, where, and why."""

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from validation.poses.angles import Array

Kind = Literal["board", "marker", "corner", "image"]
_NOWHERE = np.zeros((0, 2))


@dataclass(frozen=True)
class Rejection:
    """One thing that was seen and not used.

    Parameters
    ----------
    kind : {"board", "marker", "corner", "image"}
        What it is.
    reason : str
        Why it is not used, or used with less weight.
    number : int or None
        Id of the marker, or number of the board's corner.
    place : (2,) array
        Its middle, pixels; NaN for the whole image.
    outline : (k, 2) array
        Its outline, pixels; of one place for a corner, of none for an image.
    """

    kind: Kind
    reason: str
    number: int | None
    place: Array
    outline: Array


def hull(places: Array) -> Array:
    """(k, 2) the corners of what holds all places (n, 2)."""
    found = cv2.convexHull(np.asarray(places, dtype=np.float32))
    return np.asarray(found, dtype=float).reshape(-1, 2)


def rejected(
    kind: Kind, reason: str, number: int | None = None, outline: Array = _NOWHERE
) -> Rejection:
    """A rejection with its place: the middle of an outline (k, 2)."""
    outline = np.asarray(outline, dtype=float).reshape(-1, 2)
    place = outline.mean(0) if len(outline) else np.full(2, np.nan)
    return Rejection(kind, reason, number, place, outline)
