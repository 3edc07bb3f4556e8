"""What fields of camera files hold: numbers, sizes, lenses, and errors that name them."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array
from vision_gt.optics.camera import Camera
from vision_gt.optics.formats.pixels import check_pixels
from vision_gt.optics.lenses import fisheye_parameters, rational_parameters

Node = Mapping[str, Any]
"""A part of a file with names: dicts, lists, strings and floats."""

FOCAL = ("fx", "fy", "cx", "cy")
"""Names of a camera matrix's numbers, where they are written one by one."""
PINHOLE_LENSES = {"plumb_bob", "radtan", "radial-tangential"}
FISHEYE_LENSES = {"equidistant", "fisheye", "kannala_brandt", "kannala_brandt4", "equi"}
RATIONAL_LENSES = {"rational_polynomial"}
NO_LENS = {"none", ""}
OURS = "here lenses are Brown's (plumb_bob, radtan), rational, or Kannala-Brandt's fisheye"
"""What the camera model has, for errors about another lens."""

_OTHER_LENSES = {
    "thin_prism_fisheye": "a fisheye lens with a thin prism",
    "fov": "the field-of-view lens",
    "omnidirectional": "an omnidirectional camera",
    "omni": "an omnidirectional camera (Mei's)",
    "mei": "an omnidirectional camera (Mei's)",
    "scaramuzza": "an omnidirectional camera (Scaramuzza's)",
    "eucm": "the extended unified camera",
    "ucm": "the unified camera",
    "ds": "the double-sphere camera",
}
_TELLS_LENS = re.compile(r"model|lens|flags|distortion_type|camera_type|projection")
"""Of the keys whose value may name a lens."""


def bad(
    path: Path, expected: str, field: str | None = None, value: str | None = None
) -> InputError:
    """An error about a file, or a field of it."""
    return InputError([Problem(path, expected, None, field, value)])


def numbers(path: Path, value: Any, field: str, counts: Sequence[int]) -> Array:
    """The numbers of a matrix or a list, of one of the allowed lengths.

    Raises
    ------
    InputError
        If it is missing, of another length or another shape than it states, or not finite.
    """
    shape = (value.get("rows"), value.get("cols")) if isinstance(value, dict) else (None, None)
    if isinstance(value, dict):
        value = value.get("data")
    if not isinstance(value, list):
        raise bad(path, "the camera file lacks this", field)
    if any(isinstance(row, list) for row in value):
        value = [one for row in value for one in (row if isinstance(row, list) else [row])]
    found = np.array([one if isinstance(one, float) else np.nan for one in value])
    if len(found) not in counts or not np.isfinite(found).all():
        if tuple(counts) == (1,):
            raise bad(path, "expected a finite number", field)
        wanted = " or ".join(str(n) for n in counts)
        lost = np.flatnonzero(~np.isfinite(found))
        got = f"number {lost[0] + 1} is none" if len(lost) else f"got {len(found)}"
        raise bad(path, f"expected {wanted} finite numbers, {got}", field)
    if isinstance(shape[0], float) and isinstance(shape[1], float):
        rows, columns = int(shape[0]), int(shape[1])
        if rows * columns != len(found):
            said = f"{rows} rows and {columns} columns are stated, and there are {len(found)}"
            raise bad(path, f"{said} numbers", field)
    return found


def named_numbers(path: Path, node: Node, names: Sequence[str], within: str = "") -> Array:
    """One number under each of these names; ``within`` stands before them in errors."""
    found = [numbers(path, [node[n]] if n in node else None, within + n, (1,)) for n in names]
    return np.concatenate(found)


def whole(path: Path, value: Any, field: str) -> int:
    """A number of pixels.

    Raises
    ------
    InputError
        If it is missing, or none.
    """
    if value is None:
        raise bad(path, "the camera file lacks this; add it, in pixels", field)
    if not isinstance(value, float) or value <= 0 or not value.is_integer():
        raise bad(path, "expected a positive whole number", field)
    return int(value)


def brown_or_rational(path: Path, focal: Array, values: Array, field: str) -> Array:
    """(13,) parameters of four, and of 4 to 14 coefficients in OpenCV's order.

    Raises
    ------
    InputError
        If one is not zero that our lenses do not have.
    """
    padded = np.zeros(max(14, len(values)))
    padded[: len(values)] = values
    for first, last, what in (
        (8, 12, "a lens with a thin prism"),
        (12, 14, "a lens with a tilted sensor"),
    ):
        if padded[first:last].any():
            raise bad(path, f"coefficients of {what}; {OURS}", field)
    return rational_parameters(focal, padded[:8])


def says_fisheye(node: Node) -> bool:
    """Whether a file says that its lens is Kannala and Brandt's."""
    said = [value.lower() for _, value in _words(node)]
    flags = [value for key, value in node.items() if "fisheye" in key.lower()]
    return any(one in FISHEYE_LENSES for one in said) or any(
        one not in (None, 0.0, "", "false", "False") for one in flags
    )


def refuse_other_lens(path: Path, node: Node, where: str = "") -> None:
    """Raise where a file says that its lens, or camera, is one that the model has not."""
    for key, model in _words(node):
        # Cameras that are sold have names that begin like these: DS-2CD2143.
        plain = re.sub(r"[-_ ](none|radtan|equi|equidistant|fov)$", "", model.lower())
        what = _OTHER_LENSES.get(plain)
        if what is not None:
            raise bad(path, f"the coefficients of {what}; {OURS}", where + key, model)
    if node.get("xi") not in (None, 0.0, ""):
        said = f"the coefficients of an omnidirectional camera; {OURS}"
        raise bad(path, said, where + "xi", str(node["xi"]))


def _words(node: Node) -> list[tuple[str, str]]:
    """Keys and words of a file that may name its lens."""
    return [
        (key, value)
        for key, value in node.items()
        if isinstance(value, str) and _TELLS_LENS.search(key.lower())
    ]


def fisheye_camera(
    path: Path, name: str, size: tuple[int, int], focal: Array, coefficients: Array
) -> Camera:
    """A camera of fx, fy, cx, cy and k1 to k4 of Kannala and Brandt's lens."""
    return made(path, name, size, fisheye_parameters(focal, coefficients))


def made(
    path: Path,
    name: str,
    size: tuple[int, int],
    parameters: Array,
    covariance: Array | None = None,
) -> Camera:
    """A camera whose parameters can be those of one, in pixels.

    Raises
    ------
    InputError
        If no camera has such parameters.
    """
    if not np.any(parameters[:2]):
        said = "the focal length is 0, which ROS writes of a camera that nobody calibrated"
        raise bad(path, f"{said}; calibrate it: gtval vision calibrate")
    try:
        camera = Camera(
            name, size, parameters, np.zeros((9, 9)) if covariance is None else covariance
        )
    except GtvalError as error:
        raise bad(path, str(error)) from None
    check_pixels(path, size, camera.parameters[:4])
    return camera
