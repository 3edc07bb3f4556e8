"""Lists of cameras of COLMAP, cameras.txt.

COLMAP puts the centre of the top-left pixel at (0.5, 0.5) (its models.h says so), and gtval at
(0, 0): half a pixel is taken off the centre.
"""

import re

import numpy as np

from validation.errors import InputError, Problem
from validation.poses.angles import Array
from vision_gt.optics.camera import Camera
from vision_gt.optics.formats.fields import OURS, bad, made
from vision_gt.optics.formats.source import Source
from vision_gt.optics.lenses import fisheye_parameters, rational_parameters

_LINE = re.compile(
    r"(?m)^[ \t]*(\d+)[ \t]+([A-Z_]{3,})[ \t]+(\d+)[ \t]+(\d+)((?:[ \t]+[-+.\deEnaif]+)+)[ \t\r]*$"
)
_PIXEL = 0.5
_MODELS = {
    "SIMPLE_PINHOLE": ("f cx cy", ""),
    "PINHOLE": ("fx fy cx cy", ""),
    "SIMPLE_RADIAL": ("f cx cy", "k1"),
    "RADIAL": ("f cx cy", "k1 k2"),
    "OPENCV": ("fx fy cx cy", "k1 k2 p1 p2"),
    "FULL_OPENCV": ("fx fy cx cy", "k1 k2 p1 p2 k3 k4 k5 k6"),
    "SIMPLE_FISHEYE": ("f cx cy", "-"),
    "FISHEYE": ("fx fy cx cy", "-"),
    "SIMPLE_RADIAL_FISHEYE": ("f cx cy", "k1"),
    "RADIAL_FISHEYE": ("f cx cy", "k1 k2"),
    "OPENCV_FISHEYE": ("fx fy cx cy", "k1 k2 k3 k4"),
}
"""Parameters of each model in the order of a line; the first with one focal length or two."""


def is_colmap(source: Source) -> bool:
    """Whether a text has a line of COLMAP's list of cameras."""
    return _LINE.search(source.text) is not None


def read_colmap(source: Source, name: str | None = None) -> list[Camera]:
    """The cameras of a list, named by their numbers, or the named one."""
    found = {line[1]: line for line in _LINE.finditer(source.text)}
    wanted = [one for one in found if one == name] or list(found)
    return [_camera(source, found[one]) for one in wanted]


def _camera(source: Source, line: re.Match[str]) -> Camera:
    at = source.text.count("\n", 0, line.start(2)) + 1
    name, model, width, height = line.groups()[:4]
    if model not in _MODELS:
        said = f"expected {', '.join(_MODELS)}; {OURS}"
        raise InputError([Problem(source.path, said, at, "MODEL", model)])
    first, lens = (part.split() for part in _MODELS[model])
    lens = [one for one in lens if one != "-"]
    values = _numbers(line[5])
    if len(values) != len(first) + len(lens) or not np.isfinite(values).all():
        said = f"expected {len(first) + len(lens)} numbers: {' '.join([*first, *lens])}"
        raise InputError([Problem(source.path, said, at, "PARAMS", line[5].strip())])
    focal = values[[0, *range(len(first))]] if len(first) == 3 else values[:4]
    focal = focal - np.array([0.0, 0.0, _PIXEL, _PIXEL])
    padded = np.zeros(8)
    padded[: len(lens)] = values[len(first) :]
    fisheye = "FISHEYE" in model
    parameters = (
        fisheye_parameters(focal, padded[:4]) if fisheye else rational_parameters(focal, padded)
    )
    return made(source.path, name, (int(width), int(height)), parameters)


def _numbers(text: str) -> Array:
    found = []
    for word in text.split():
        try:
            found.append(float(word))
        except ValueError:
            found.append(np.nan)
    return np.array(found)


def is_binary_colmap(source: Source) -> bool:
    """Whether a file has the name of COLMAP's binary list."""
    return source.path.name == "cameras.bin"


def refuse_binary_colmap(source: Source, _: str | None = None) -> list[Camera]:
    """Raise, and say how it becomes a text."""
    said = "a binary list of COLMAP; write it as text: colmap model_converter --output_type TXT"
    raise bad(source.path, said)
