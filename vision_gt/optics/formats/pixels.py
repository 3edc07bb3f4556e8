"""Whether the parameters of a camera file can be in pixels.

Other programs state focal lengths in millimetres or as shares of the image's size, and centres from
the middle of the image. Such numbers are those of no lens, and what they look like is said.
"""

from pathlib import Path

import numpy as np

from validation.errors import InputError, Problem
from validation.poses.angles import Array

_WIDEST = np.deg2rad(85.0)
"""Half of the field of view across the image that a pinhole has at most: a lens of 170 degrees has
a focal length of 0.044 image widths, 28 pixels of 640. Lenses of 120 degrees have 0.29, and fisheye
lenses that see 180 degrees 0.32; millimetres and shares of an image are hundredths of that."""
_CORNER = 0.05
"""Share of an image's size from its corner within which no lens has its axis: assembly puts it
within some hundredths of the middle. A part cut out of an image at random has it there once in 400
times if it has it at all."""
_SCALED, _ALIKE = 0.3, 0.1
"""An axis off the middle by more than 0.15 of the image both ways, where it would be in the middle
of larger or smaller images of the same shape: they may have axes 0.03 off the middle, 0.06 of half
of an image, which makes 0.1 of the two ways' quotient."""
_BEYOND = 1.0
"""Image sizes outside of which no axis is: such an image would be less than a third as wide as the
one with the axis in the middle that it is cut from. A judgement."""
_EXCHANGED, _NEARER = 0.08, 4.0
"""An axis this share of the image off the middle both ways, and four times nearer to it once width
and height are exchanged: at 5:4, the squarest of the usual images, an exchange makes 0.10."""
_NEAR_HALF = 0.15
"""Share of the image that a normalised centre is off the middle at most, for what is told of it."""


def check_pixels(path: Path, size: tuple[int, int], four: Array) -> None:
    """Raise where fx, fy, cx, cy cannot be those of a camera in pixels.

    Parameters
    ----------
    path : Path
        For the error.
    size : (int, int)
        Width and height of the images, pixels.
    four : (4,) array
        fx, fy, cx, cy as the file has them.

    Raises
    ------
    InputError
        If the focal length is that of no lens, if its axis is at the first corner of the image or
        far outside of it, or if the numbers seem to be those of images of another size, or with
        width and height exchanged.
    """
    extent = np.array(size, dtype=float)
    focal, centre = four[:2], four[2:]
    if (focal < extent / 2 / np.tan(_WIDEST)).any():
        across = np.rad2deg(2 * np.arctan(extent / 2 / focal)).max()
        said = (
            f"the focal length has to be in pixels; in images of {_by(size)} pixels this one would "
            f"see {across:.0f} degrees. {_looks(extent, four)}"
        )
        raise _error(path, said, "focal length", focal)
    _check_centre(path, size, centre)


def _check_centre(path: Path, size: tuple[int, int], centre: Array) -> None:
    """Raise where cx, cy (2,) are those of no axis of a lens in images of this size."""
    extent = np.array(size, dtype=float)
    if (np.abs(centre) < _CORNER * extent).all():
        said = (
            "the centre has to be in pixels from the top left one; it looks normalised, in "
            "millimetres, or measured from the middle of the image"
        )
        raise _error(path, said, "centre", centre)
    times = 2 * (centre + 0.5) / extent
    if (np.abs(times - 1) > _SCALED).all() and abs(times[0] / times[1] - 1) < _ALIKE:
        whole = tuple(int(one) for one in np.rint(2 * centre + 1))
        said = (
            f"in images of {_by(size)} pixels it is far from the middle; it is that of images of "
            f"about {_by(whole)} pixels, for which the camera matrix seems to be made"
        )
        raise _error(path, said, "centre", centre)
    if (centre < -_BEYOND * extent).any() or (centre > (1 + _BEYOND) * extent).any():
        said = f"it is far outside of images of {_by(size)} pixels"
        raise _error(path, said, "centre", centre)
    off, exchanged = (np.abs(centre - (one - 1) / 2) / one for one in (extent, extent[::-1]))
    if off.min() > _EXCHANGED and exchanged.max() * _NEARER < off.min():
        said = (
            f"width and height seem to be exchanged: the centre, {_both(centre)}, is the middle of "
            f"images of {_by(size[::-1])} pixels"
        )
        raise _error(path, said, "image size", extent)


def _looks(extent: Array, four: Array) -> str:
    """What a focal length is that is too short for pixels, and what it may be in pixels."""
    focal, centre = four[:2], four[2:]
    across = np.ravel([extent, extent])
    if (np.abs(centre - 0.5) < _NEAR_HALF).all():
        pixels = four * across
        if abs(pixels[0] / pixels[1] - 1) > 0.1:
            pixels = four * np.ravel([[extent.max()] * 2, extent])
        told = ", ".join(f"{one:.0f}" for one in pixels)
        return (
            f"It looks normalised by the image's size; in pixels it is about {told} "
            "(or like millimetres, if the sensor is but 1 mm wide)"
        )
    if (np.abs(centre) < 0.2).all():
        return "It looks normalised, and the centre measured from the middle of the image"
    if (centre > 0.2 * focal).all() and (centre < 0.1 * extent).all():
        side = 2 * centre / extent
        told = ", ".join(f"{one:.0f}" for one in four / np.ravel([side, side]))
        return (
            "It looks like millimetres; with the centre in the middle of the image a pixel has "
            f"{side.mean():.2g} mm, and in pixels it is about {told}"
        )
    return "It looks like millimetres; divide it by the side of a pixel in millimetres"


def _by(size: tuple[int, ...]) -> str:
    return f"{size[0]} x {size[1]}"


def _both(values: Array) -> str:
    return ", ".join(f"{one:g}" for one in values)


def _error(path: Path, said: str, field: str, values: Array) -> InputError:
    return InputError([Problem(path, said, None, field, _both(values))])
