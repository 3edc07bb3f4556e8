"""Camera files of other programs, written: OpenCV, ROS, Kalibr and Bouguet's toolbox."""

import io
from collections.abc import Callable, Mapping
from typing import Any

import cv2
import numpy as np

from validation.errors import GtvalError
from validation.poses.angles import Array
from vision_gt.optics.camera import Camera

FORMATS = ("opencv", "ros", "kalibr", "bouguet")
_SUFFIXES = {
    "opencv": (".yaml", ".yml", ".xml"),
    "ros": (".yaml", ".yml"),
    "kalibr": (".yaml", ".yml"),
    "bouguet": (".mat",),
}
"""What files are named for: a file of Bouguet's toolbox is binary, and .m would be a program."""
_ROS_NAMES = {
    "brown": "plumb_bob",
    "rational": "rational_polynomial",
    "fisheye": "equidistant",
}


def write_camera(path_suffix: str, file_format: str, camera: Camera) -> bytes:
    """The bytes of a camera file.

    Parameters
    ----------
    path_suffix : str
        Ending of the file: .yaml or .yml, .mat for Bouguet's toolbox; '.xml' makes OpenCV's XML
        instead of YAML.
    file_format : {"opencv", "ros", "kalibr", "bouguet"}
        Whose file.
    camera : Camera
        What to write.

    Raises
    ------
    GtvalError
        For another format, a file that would be named as one of another format, or if the
        format cannot hold the camera.
    """
    writers: Mapping[str, Callable[[Camera], bytes]] = {
        "opencv": lambda c: _write_opencv(c, xml=path_suffix.lower() == ".xml"),
        "ros": _write_ros,
        "kalibr": _write_kalibr,
        "bouguet": _write_bouguet,
    }
    if file_format not in writers:
        raise GtvalError(f"camera files are written as {', '.join(FORMATS)}, not {file_format!r}")
    check_suffix(path_suffix, file_format)
    return writers[file_format](camera)


def check_suffix(path_suffix: str, file_format: str) -> None:
    """Raise where a file would be named as one of another format than it has.

    Raises
    ------
    GtvalError
        With the endings that files of this format have.
    """
    if path_suffix.lower() not in _SUFFIXES[file_format]:
        wanted = " or ".join(_SUFFIXES[file_format])
        given = path_suffix or "without an ending"
        raise GtvalError(
            f"a camera file of the format {file_format} is named {wanted}, not {given}"
        )


def _coefficients(camera: Camera) -> Array:
    """Of its lens, as OpenCV and ROS order them: five, eight, or four."""
    if camera.lens == "fisheye":
        return camera.distortion[:4]
    if camera.lens == "rational":
        return np.concatenate([camera.distortion, camera.parameters[10:]])
    return camera.distortion


def _write_opencv(camera: Camera, *, xml: bool) -> bytes:
    flags = cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY
    storage = cv2.FileStorage(".xml" if xml else ".yml", flags)
    storage.write("camera_name", camera.name)
    storage.write("image_width", camera.size[0])
    storage.write("image_height", camera.size[1])
    storage.write("camera_matrix", camera.matrix)
    storage.write("distortion_model", _ROS_NAMES[camera.lens])
    storage.write("distortion_coefficients", _coefficients(camera)[:, None])
    if camera.covariance.any():
        storage.write("parameter_covariance", camera.covariance)
    return str(storage.releaseAndGetString()).encode()


def _listed(values: Array) -> str:
    return "[" + ", ".join(repr(float(v)) for v in np.ravel(values)) + "]"


def _write_ros(camera: Camera) -> bytes:
    K = camera.matrix
    P = np.column_stack([K, np.zeros(3)])
    blocks = (
        ("camera_matrix", 3, 3, K),
        ("distortion_coefficients", 1, len(_coefficients(camera)), _coefficients(camera)),
        ("rectification_matrix", 3, 3, np.eye(3)),
        ("projection_matrix", 3, 4, P),
    )
    lines = [
        f"image_width: {camera.size[0]}",
        f"image_height: {camera.size[1]}",
        f'camera_name: "{camera.name}"',
        f"distortion_model: {_ROS_NAMES[camera.lens]}",
    ]
    for name, rows, columns, values in blocks:
        lines += [f"{name}:", f"  rows: {rows}", f"  cols: {columns}", f"  data: {_listed(values)}"]
    return ("\n".join(lines) + "\n").encode()


def _write_kalibr(camera: Camera) -> bytes:
    if camera.lens == "rational":
        raise GtvalError(f"camera {camera.name}: Kalibr has no rational lens")
    if abs(camera.parameters[8]) > 1e-12:
        raise GtvalError(
            f"camera {camera.name}: Kalibr's radtan lens has no k3 ({camera.parameters[8]:g} here)"
        )
    lines = [
        "cam0:",
        "  camera_model: pinhole",
        f"  intrinsics: {_listed(camera.parameters[:4])}",
        f"  distortion_model: {'radtan' if camera.lens == 'brown' else 'equidistant'}",
        f"  distortion_coeffs: {_listed(camera.parameters[4:8])}",
        f"  resolution: [{camera.size[0]}, {camera.size[1]}]",
        f"  rostopic: /{camera.name}",
    ]
    return ("\n".join(lines) + "\n").encode()


def _write_bouguet(camera: Camera) -> bytes:
    from scipy.io import savemat  # noqa: PLC0415

    if camera.lens != "brown":
        said = f"Bouguet's toolbox has no {camera.lens} lens in this file"
        raise GtvalError(f"camera {camera.name}: {said}")
    column = {
        "fc": camera.parameters[:2],
        "cc": camera.parameters[2:4],
        "kc": camera.distortion,
    }
    contents = {key: np.reshape(value, (-1, 1)) for key, value in column.items()}
    contents["alpha_c"] = np.zeros((1, 1))
    contents["nx"], contents["ny"] = (np.array([[float(n)]]) for n in camera.size)
    if camera.covariance.any():
        errors = 3 * camera.sigmas
        for key, part in (("fc", errors[:2]), ("cc", errors[2:4]), ("kc", errors[4:])):
            contents[f"{key}_error"] = np.reshape(part, (-1, 1))
    stream: Any = io.BytesIO()
    savemat(stream, contents)
    return bytes(stream.getvalue())
