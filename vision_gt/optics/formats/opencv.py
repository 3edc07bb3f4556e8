"""Camera files of OpenCV's samples and users, and those of ROS, which have the same fields."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from validation.poses.angles import Array
from vision_gt.optics.camera import Camera
from vision_gt.optics.formats.fields import (
    FISHEYE_LENSES,
    NO_LENS,
    PINHOLE_LENSES,
    RATIONAL_LENSES,
    Node,
    bad,
    brown_or_rational,
    fisheye_camera,
    made,
    numbers,
    refuse_other_lens,
    says_fisheye,
    whole,
)
from vision_gt.optics.formats.source import Source

_MATRIX = ("camera_matrix", "K", "M1", "mtx")
_LENS = ("distortion_coefficients", "dist_coeffs", "dist_coeff", "dist", "D", "D1")
_WIDTH, _HEIGHT = ("image_width", "width"), ("image_height", "height")
_SIZE = ("image_size", "img_size")
"""Names in files of OpenCV's samples and users, as `_plain` has them: 'cameraMatrix' and
'Camera_Matrix' are 'camera_matrix'."""
_FOUR = (
    "four numbers may be Brown's k1, k2, p1, p2 or the fisheye lens's k1 to k4, and the file does "
    "not say which. If they are Brown's add 0.0 as the fifth, k3; if they are those of "
    "cv2.fisheye add the field 'distortion_model: equidistant'"
)


def has_matrix(source: Source) -> bool:
    """Whether a file has a field that is named as camera matrices are."""
    return _field(source.root, _MATRIX) in source.root


def read_opencv(source: Source, _: str | None = None) -> list[Camera]:
    """The camera of a file of OpenCV, in YAML, XML, JSON or a numpy archive."""
    return [_camera(source.path, source.root)]


def is_ros(source: Source) -> bool:
    """Whether a file is one of ROS, or a message CameraInfo."""
    return isinstance(source.root.get("distortion_model"), str)


def read_ros(source: Source, _: str | None = None) -> list[Camera]:
    """The camera of a YAML file of ROS, or of a printed message CameraInfo."""
    path, root = source.path, _as_filed(source.path, source.root)
    refuse_other_lens(path, root)
    model = root["distortion_model"]
    if model not in PINHOLE_LENSES | FISHEYE_LENSES | RATIONAL_LENSES | NO_LENS:
        wanted = "expected 'plumb_bob', 'rational_polynomial' or 'equidistant'"
        raise bad(path, wanted, "distortion_model", model)
    if model in NO_LENS and any(_all_numbers(root.get(_field(root, _LENS)))):
        said = "it names no lens, and has distortion; write 'plumb_bob' if the lens is Brown's"
        raise bad(path, said, "distortion_model", model)
    if model in NO_LENS:
        root = {**root, _field(root, _LENS): [0.0] * 5}
    return [_camera(path, root)]


def is_ros_ini(source: Source) -> bool:
    """Whether a file is of ROS's camera_calibration_parsers, .ini, or its calibrator's ost.txt."""
    return re.search(r"(?m)^\s*\[image\]\s*$", source.text) is not None


def read_ros_ini(source: Source, _: str | None = None) -> list[Camera]:
    """The camera of an .ini or ost.txt of ROS.

    Its lines are values without a key, some of them alike, which no parser of .ini files keeps:
    they are taken as what they are, headings with numbers below.
    """
    path = source.path
    blocks, name = _blocks(source.text)
    if any(len(found) > 1 for found in blocks.values()):
        raise bad(path, "a file of two cameras; give each camera its own")
    fields = {
        "image_width": "width",
        "image_height": "height",
        "camera_matrix": "camera matrix",
        "distortion_coefficients": "distortion",
    }
    root: dict[str, Any] = {"camera_name": name or path.stem}
    for key, heading in fields.items():
        if heading in blocks:
            (values,) = blocks[heading]
            root[key] = values[0] if key.startswith("image") and len(values) == 1 else values
    return [_camera(path, root)]


def _blocks(text: str) -> tuple[dict[str, list[list[float]]], str]:
    """Numbers below each heading, once for each time it comes, and the name of the camera."""
    blocks: dict[str, list[list[float]]] = {}
    name = ""
    values: list[float] = []
    for line in (one.strip() for one in text.splitlines()):
        if line.startswith("["):
            name = name if line in {"[image]", "[externals]"} else line.strip("[] ")
        elif heading := re.match(r"[a-z][a-z ]*(?<! )", line):
            blocks.setdefault(heading[0], []).append([])
            values = blocks[heading[0]][-1]
            values += [_number(one) for one in line[heading.end() :].split()]
        elif line and line[0] not in "#;":
            values += [_number(one) for one in line.split()]
    return blocks, name


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return np.nan


def _field(root: Node, names: Sequence[str]) -> str:
    """The field of a file with the first of these names that it has; the first name if it has none.

    Where none is there as it is written here, capitals and underscores do not matter.
    """
    exact = next((name for name in names if name in root), None)
    if exact is not None:
        return exact
    there = {_plain(key): key for key in reversed(list(root))}
    return next((there[_plain(name)] for name in names if _plain(name) in there), names[0])


def _plain(name: str) -> str:
    return name.lower().replace("_", "")


def _all_numbers(value: Any) -> list[Any]:
    """The numbers of a matrix or list, whatever their form."""
    if isinstance(value, dict):
        return _all_numbers(value.get("data"))
    if isinstance(value, list):
        return [one for part in value for one in _all_numbers(part)]
    return [value]


def _camera(path: Path, root: Node) -> Camera:
    refuse_other_lens(path, root)
    if "M2" in root:
        raise bad(path, "a file of two cameras; give each camera its own", "M2")
    field, lens_field = _field(root, _MATRIX), _field(root, _LENS)
    K = numbers(path, root.get(field), field, (9,)).reshape(3, 3)
    _check_matrix(path, K, field)
    fisheye = says_fisheye(root)
    lens = numbers(path, root.get(lens_field), lens_field, (4,) if fisheye else (4, 5, 8, 12, 14))
    if len(lens) == 4 and not fisheye and not _says_pinhole(root):
        raise bad(path, _FOUR, lens_field)
    size = _image_size(path, root)
    name = root.get("camera_name")
    shown = name if isinstance(name, str) else path.stem
    focal = np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2]])
    if fisheye:
        camera = fisheye_camera(path, shown, size, focal, lens)
    else:
        camera = made(path, shown, size, brown_or_rational(path, focal, lens, lens_field))
    field = "parameter_covariance"
    if field not in root:
        return camera
    return replace(camera, covariance=numbers(path, root[field], field, (81,)).reshape(9, 9))


def _image_size(path: Path, root: Node) -> tuple[int, int]:
    """Width and height, by their names or as a pair in OpenCV's order.

    A pair in the order of numpy's shapes, height first, is told by the centre: see `check_pixels`.
    """
    pair = _field(root, _SIZE)
    width, height = _field(root, _WIDTH), _field(root, _HEIGHT)
    if pair in root and width not in root and height not in root:
        w, h = numbers(path, root[pair], pair, (2,))
        return whole(path, float(w), pair), whole(path, float(h), pair)
    return whole(path, root.get(width), width), whole(path, root.get(height), height)


def _says_pinhole(root: Node) -> bool:
    """Whether a file says that its lens is Brown's: by a word, or as no fisheye lens."""
    models = {str(root.get(key)).lower() for key in ("distortion_model", "model_type")}
    return bool(models & PINHOLE_LENSES) or any("fisheye" in key.lower() for key in root)


def _check_matrix(path: Path, K: Array, field: str) -> None:
    """Raise for a camera matrix that is none, or is one of slanted pixels."""
    if not K.any():
        return  # told as a camera that nobody calibrated, which ROS writes so
    if abs(K[0, 1]) > 1e-9 * abs(K[0, 0]):
        raise bad(path, "a skew is not supported", field, f"{K[0, 1]:g}")
    if np.abs(K[[1, 2, 2], [0, 0, 1]]).max() <= 1e-9 and abs(K[2, 2] - 1) <= 1e-9:
        return
    said = "expected a camera matrix: fx 0 cx, 0 fy cy, 0 0 1"
    if K[2, 0] and K[2, 1] and not np.abs(K[[0, 0, 1, 1], [1, 2, 0, 2]]).any():
        said += "; this is the transposed one, as MATLAB and Open3D write it"
    raise bad(path, said, field)


def _as_filed(path: Path, root: Node) -> dict[str, Any]:
    """A message of ROS (CameraInfo) with the names that camera files have; these as they are."""
    for key in ("binning_x", "binning_y"):
        if root.get(key) not in (None, 0.0, 1.0):
            said = "the images are binned, and the camera matrix is that of the whole sensor"
            raise bad(path, said, key, f"{root[key]:g}" if isinstance(root[key], float) else "")
    roi = root.get("roi")
    part = [roi.get(key) for key in ("width", "height")] if isinstance(roi, dict) else []
    if any(part) and part != [root.get("width"), root.get("height")]:
        said = (
            "the images are a part of the sensor, and the camera matrix is that of the whole one: "
            "take x_offset and y_offset off the centre, state the part's width and height, and "
            "leave roi out"
        )
        raise bad(path, said, "roi")
    names = {"image_width": "width", "image_height": "height", "K": "k", "D": "d"}
    more = {name: root[key] for name, key in names.items() if name not in root and key in root}
    return {**root, **more}
