"""Families of square markers: which black and white cells stand for which id."""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from validation.errors import GtvalError

if TYPE_CHECKING:
    import cv2

Bits = npt.NDArray[np.uint8]

ARTOOLKITPLUS = "ARTOOLKITPLUS_SIMPLE"
"""The simple 9-bit ids of ARToolKitPlus, the markers of AD2.3."""

_SIMPLE_IDS = 512
_SIMPLE_SIDE = 6
_SIMPLE_MASKS = (0x0DB, 0x109, 0x14E, 0x027)
"""What each of the four copies of the id is combined with (exclusive or), first copy first."""


@dataclass(frozen=True)
class Family:
    """A marker family.

    Parameters
    ----------
    name : str
        As OpenCV calls it without 'DICT_', such as '6X6_250' or 'APRILTAG_36H11', or
        'ARTOOLKITPLUS_SIMPLE'.
    border : int
        Cells of black border on each side.
    """

    name: str
    border: int = 1

    @property
    def dictionary(self) -> "cv2.aruco.Dictionary":
        """The codes, in the form that OpenCV detects.

        Raises
        ------
        GtvalError
            If there is no such family.
        """
        return _dictionary(self.name)

    @property
    def cells(self) -> int:
        """Cells along a side, border included."""
        return int(self.dictionary.markerSize) + 2 * self.border

    def bits(self, number: int) -> Bits:
        """(cells, cells) 1 where the marker is white, the first row at its top.

        Raises
        ------
        GtvalError
            If the family has no such id.
        """
        return _bits(self, number)


def artoolkitplus_bits(number: int) -> Bits:
    """(6, 6) inner cells of a simple id-encoded marker of ARToolKitPlus, 1 where white.

    Parameters
    ----------
    number : int
        0 to 511.

    Notes
    -----
    The nine bits of the id are written four times, the most significant first, row by row from
    the top left; each copy is combined with a fixed mask so that no id looks like itself turned
    (Wagner and Schmalstieg, "ARToolKitPlus for pose tracking on mobile devices", 2007).
    """
    word = 0
    for mask in _SIMPLE_MASKS:
        word = (word << 9) | (number ^ mask)
    count = _SIMPLE_SIDE**2
    bits = [(word >> (count - 1 - place)) & 1 for place in range(count)]
    return np.array(bits, dtype=np.uint8).reshape(_SIMPLE_SIDE, _SIMPLE_SIDE)


@lru_cache
def _dictionary(name: str) -> "cv2.aruco.Dictionary":
    import cv2  # noqa: PLC0415

    if name == ARTOOLKITPLUS:
        codes = [
            cv2.aruco.Dictionary.getByteListFromBits(artoolkitplus_bits(number))
            for number in range(_SIMPLE_IDS)
        ]
        return cv2.aruco.Dictionary(np.concatenate(codes), _SIMPLE_SIDE, 0)
    constant = getattr(cv2.aruco, f"DICT_{name}", None)
    if constant is None:
        raise GtvalError(
            f"there is no marker family '{name}'; OpenCV has 4X4_50 to 7X7_1000, "
            f"APRILTAG_16H5, 25H9, 36H10 and 36H11, and here is also {ARTOOLKITPLUS}"
        )
    return cv2.aruco.getPredefinedDictionary(constant)


@lru_cache(maxsize=1024)
def _bits(family: Family, number: int) -> Bits:
    import cv2  # noqa: PLC0415

    dictionary = family.dictionary
    count = len(dictionary.bytesList)
    if not 0 <= number < count:
        raise GtvalError(f"marker {number}: the family {family.name} has ids 0 to {count - 1}")
    side = family.cells
    image = cv2.aruco.generateImageMarker(dictionary, number, side, borderBits=family.border)
    bits = (np.asarray(image) > 127).astype(np.uint8)
    bits.setflags(write=False)
    return bits
