"""Camera files of other programs: OpenCV, ROS, Kalibr and Bouguet's toolbox.

All four put the centre of the top-left pixel at (0, 0) and share Brown's lens of
`vision_gt.optics.camera`; Kalibr's 'radtan' ends after p2. The lenses of `vision_gt.optics.lenses`
are read where a file names them; others are refused by their names.
"""

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array
from vision_gt.optics.camera import Camera
from vision_gt.optics.lenses import fisheye_parameters, rational_parameters

MAX_BYTES = 20_000_000
"""A judgement: camera files have some kilobytes, images and videos megabytes."""
_PINHOLE_LENSES = {"plumb_bob", "radtan", "radial-tangential"}
_NO_LENS = {"none", ""}
_FISHEYE_LENSES = {"equidistant", "fisheye", "kannala_brandt", "kannala_brandt4", "equi"}
_RATIONAL_LENSES = {"rational_polynomial"}
_OTHER_LENSES = {
    "thin_prism_fisheye": "a fisheye lens with a thin prism",
    "fov": "the field-of-view lens",
    "omni": "an omnidirectional camera (Mei's)",
    "mei": "an omnidirectional camera (Mei's)",
    "scaramuzza": "an omnidirectional camera (Scaramuzza's)",
    "eucm": "the extended unified camera",
    "ds": "the double-sphere camera",
}
_TELLS_LENS = re.compile(r"model|lens|flags|distortion_type|projection")
"""Of the keys whose value may name a lens."""
_COLMAP = re.compile(r"(?m)^\d+ [A-Z_]{6,} \d+ \d+( [-+.\de]+){3,}\s*$")
_FOUR = (
    "four numbers may be Brown's k1, k2, p1, p2 or the fisheye lens's k1 to k4, and the file does "
    "not say which. If they are Brown's add 0.0 as the fifth, k3"
)
_BROWN = "here lenses are Brown's (plumb_bob, radtan), rational, or Kannala-Brandt's fisheye"
_KEYS = (
    ("camera_matrix", "cameraMatrix", "K", "M1"),
    ("distortion_coefficients", "distCoeffs", "dist_coeffs", "dist_coeff", "dist", "D", "D1"),
)
"""Names of the camera matrix and of the lens in files of OpenCV's samples and users."""


def read_cameras(path: Path, name: str | None = None) -> list[Camera]:
    """The cameras of a file; its contents tell the format.

    Parameters
    ----------
    path : Path
        .yaml, .yml or .xml of OpenCV, .yaml of ROS or Kalibr, or a Calib_Results.mat.
    name : str, optional
        The only one wanted of a chain of Kalibr: others may have lenses that are not read.

    Raises
    ------
    InputError
        If the file is missing, cannot be parsed, or lacks something.
    """
    data = _bytes_of(path)
    if path.suffix.lower() == ".m" and b"ocam" in data.lower():
        raise _bad(path, "a model of the omnidirectional toolbox (OCamCalib), which is not read")
    if path.suffix.lower() == ".m":
        raise _bad(path, "a program of Bouguet's toolbox; give the Calib_Results.mat beside it")
    if path.suffix.lower() == ".mat":
        return [_read_bouguet(path, data)]
    text = data.decode("utf-8-sig", errors="replace")
    if _COLMAP.search(text):
        raise _bad(path, "a list of cameras of COLMAP, which is not read")
    root = _parsed(path, text)
    if any(re.fullmatch(r"cam\d+", str(key)) and isinstance(root[key], dict) for key in root):
        return _read_kalibr(path, root, name)
    if "intrinsics" in root and "resolution" in root:
        return [_kalibr_camera(path, "", root)]
    if isinstance(root.get("projection_parameters"), dict):
        return [_read_camodocal(path, root)]
    if isinstance(root.get("distortion_model"), str):
        return [_read_ros(path, _as_filed(path, root))]
    return [_read_opencv(path, root)]


def camera_of(path: Path, name: str | None = None) -> Camera:
    """The camera of a file, or the one of this name where there are several.

    Raises
    ------
    GtvalError
        If there are several or none, with their names.
    """
    found = read_cameras(path, name)
    chosen = [one for one in found if name is None or one.name == name]
    if len(chosen) != 1:
        names = ", ".join(one.name for one in found)
        raise GtvalError(f"{path} has the cameras {names}; choose one with --camera")
    return chosen[0]


def _bad(
    path: Path, expected: str, field: str | None = None, value: str | None = None
) -> InputError:
    return InputError([Problem(path, expected, None, field, value)])


def _bytes_of(path: Path) -> bytes:
    try:
        if path.stat().st_size > MAX_BYTES:
            raise _bad(path, "larger than 20 MB; this cannot be a camera file")
        return path.read_bytes()
    except FileNotFoundError:
        raise _bad(path, "there is no such camera file") from None
    except OSError as error:
        raise GtvalError(f"cannot read {path}: {error.strerror or error}") from error


def _parsed(path: Path, text: str) -> dict[str, Any]:
    """What a YAML or XML file says: OpenCV's own by its parser, others by a YAML library."""
    if not text.lstrip().startswith("<") and "opencv-matrix" not in text:
        return _parsed_yaml(path, text)
    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        found = _plain(storage.root())
    except (cv2.error, SystemError) as error:
        # A storage that was not opened has no message of its own.
        said = str(error).splitlines()[0] if isinstance(error, cv2.error) else ""
        said = said if said and "<class" not in said else "not what OpenCV writes"
        raise _bad(path, f"not a camera file: {said}") from None
    if not isinstance(found, dict):
        raise _bad(path, "not a camera file: nothing is named in it")
    return found


def _parsed_yaml(path: Path, text: str) -> dict[str, Any]:
    import yaml  # noqa: PLC0415  (OpenCV's and Bouguet's files do without)

    # OpenCV writes '%YAML:1.0', which is no YAML.
    text = re.sub(r"\A\s*%YAML[^\n]*\n", "", text)
    try:
        found = yaml.safe_load(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        said = getattr(error, "problem", None) or "it is no YAML"
        line = None if mark is None else mark.line + 1
        raise InputError([Problem(path, f"not a camera file: {said}", line)]) from None
    if not isinstance(found, dict):
        raise _bad(path, "not a camera file: nothing is named in it")
    return {str(key): _as_read(value) for key, value in found.items()}


def _as_read(value: Any) -> Any:
    """Values as OpenCV's parser gives them: dicts, lists, strings and floats."""
    if isinstance(value, dict):
        return {str(key): _as_read(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_as_read(one) for one in value]
    if isinstance(value, str):
        try:
            return float(value)  # '1e-3' is a string in YAML 1.1
        except ValueError:
            return value
    return float(value) if isinstance(value, int | float) else None


def _plain(node: Any) -> Any:
    """A node as dict, list, str or float; None for any other."""
    if node.isMap():
        return {key: _plain(node.getNode(key)) for key in node.keys()}  # noqa: SIM118  (no dict)
    if node.isSeq():
        return [_plain(node.at(i)) for i in range(node.size())]
    if node.isString():
        return node.string()
    return node.real() if node.isInt() or node.isReal() else None


def _numbers(path: Path, value: Any, field: str, counts: Sequence[int]) -> Array:
    """The numbers of a matrix or a list, of one of the allowed lengths."""
    if isinstance(value, dict):
        value = value.get("data")
    if not isinstance(value, list):
        raise _bad(path, "the camera file lacks this", field)
    if any(isinstance(row, list) for row in value):
        value = [one for row in value for one in (row if isinstance(row, list) else [row])]
    numbers = np.array([one if isinstance(one, float) else np.nan for one in value])
    if len(numbers) not in counts or not np.isfinite(numbers).all():
        wanted = " or ".join(str(n) for n in counts)
        lost = np.flatnonzero(~np.isfinite(numbers))
        got = f"number {lost[0] + 1} is none" if len(lost) else f"got {len(numbers)}"
        raise _bad(path, f"expected {wanted} finite numbers, {got}", field)
    return numbers


def _whole(path: Path, value: Any, field: str) -> int:
    if value is None:
        raise _bad(path, "the camera file lacks this; add it, in pixels", field)
    if not isinstance(value, float) or value <= 0:
        raise _bad(path, "expected a positive whole number", field)
    return int(value)


def _lens(path: Path, values: Array, field: str) -> Array:
    """(8,) coefficients of Brown's lens or the rational one; others are zero or an error."""
    padded = np.zeros(max(14, len(values)))
    padded[: len(values)] = values
    for first, last, what in (
        (8, 12, "a lens with a thin prism"),
        (12, 14, "a lens with a tilted sensor"),
    ):
        if padded[first:last].any():
            raise _bad(path, f"coefficients of {what}; {_BROWN}", field)
    return padded[:8]


def _is_fisheye(node: Mapping[str, Any]) -> bool:
    """Whether a file says that its lens is Kannala and Brandt's."""
    said = [
        str(value).lower()
        for key, value in node.items()
        if isinstance(value, str) and _TELLS_LENS.search(key.lower())
    ]
    flags = [value for key, value in node.items() if "fisheye" in key.lower()]
    return any(one in _FISHEYE_LENSES for one in said) or any(
        one not in (None, 0.0, "", "false", "False") for one in flags
    )


def _no_other_lens(path: Path, node: Mapping[str, Any], where: str = "") -> None:
    """Raise where a file says that its lens, or camera, is another one than Brown's."""
    for key, model in node.items():
        if not isinstance(model, str) or not _TELLS_LENS.search(key.lower()):
            continue
        what = next(
            (said for name, said in _OTHER_LENSES.items() if model.lower().startswith(name)), None
        )
        if what is not None:
            raise _bad(path, f"the coefficients of {what}; {_BROWN}", where + key, model)
    if node.get("xi") not in (None, 0.0, ""):
        said = f"the coefficients of an omnidirectional camera; {_BROWN}"
        raise _bad(path, said, where + "xi", str(node["xi"]))


def _made(path: Path, name: str, size: tuple[int, int], parameters: Array) -> Camera:
    try:
        return Camera(name, size, parameters)
    except GtvalError as error:
        raise _bad(path, str(error)) from None


def _read_opencv(path: Path, root: Mapping[str, Any]) -> Camera:
    field, lens_field = (next((key for key in keys if key in root), keys[0]) for keys in _KEYS)
    _no_other_lens(path, root)
    if "M2" in root:
        raise _bad(path, "a file of two cameras; give each camera its own", "M2")
    K = _numbers(path, root.get(field), field, (9,)).reshape(3, 3)
    _check_matrix(path, K, field)
    fisheye = _is_fisheye(root)
    counts = (4,) if fisheye else (4, 5, 8, 12, 14)
    lens = _numbers(path, root.get(lens_field), lens_field, counts)
    if len(lens) == 4 and not fisheye and not _says_pinhole(root):
        raise _bad(path, _FOUR, lens_field)
    width, height = (_whole(path, root.get(key), key) for key in ("image_width", "image_height"))
    name = root.get("camera_name")
    focal = [K[0, 0], K[1, 1], K[0, 2], K[1, 2]]
    parameters = (
        fisheye_parameters(np.array(focal), lens)
        if fisheye
        else rational_parameters(np.array(focal), _lens(path, lens, lens_field))
    )
    shown = name if isinstance(name, str) else path.stem
    camera = _made(path, shown, (width, height), parameters)
    field = "parameter_covariance"
    if field not in root:
        return camera
    return replace(camera, covariance=_numbers(path, root[field], field, (81,)).reshape(9, 9))


def _says_pinhole(root: Mapping[str, Any]) -> bool:
    """Whether a file says that its lens is Brown's: by a word, or as no fisheye lens."""
    models = {str(root.get(key)).lower() for key in ("distortion_model", "model_type")}
    return bool(models & _PINHOLE_LENSES) or any("fisheye" in key.lower() for key in root)


def _check_matrix(path: Path, K: Array, field: str) -> None:
    """Raise for a camera matrix that is none, or is one of square or slanted pixels."""
    if abs(K[0, 1]) > 1e-9 * K[0, 0]:
        raise _bad(path, "a skew is not supported", field, f"{K[0, 1]:g}")
    if np.abs(K[[1, 2, 2], [0, 0, 1]]).max() > 1e-9 or abs(K[2, 2] - 1) > 1e-9:
        raise _bad(path, "expected a camera matrix: fx 0 cx, 0 fy cy, 0 0 1", field)


def _read_ros(path: Path, root: Mapping[str, Any]) -> Camera:
    _no_other_lens(path, root)
    model = root["distortion_model"]
    if model not in _PINHOLE_LENSES | _FISHEYE_LENSES | _RATIONAL_LENSES:
        wanted = "expected 'plumb_bob', 'rational_polynomial' or 'equidistant'"
        raise _bad(path, wanted, "distortion_model", model)
    return _read_opencv(path, root)


def _as_filed(path: Path, root: Mapping[str, Any]) -> Mapping[str, Any]:
    """A message of ROS (CameraInfo) with the names that camera files have; these as they are."""
    for key in ("binning_x", "binning_y"):
        if root.get(key) not in (None, 0.0, 1.0):
            said = "the images are binned, and the camera matrix is that of the whole sensor"
            raise _bad(path, said, key, f"{root[key]:g}" if isinstance(root[key], float) else "")
    names = {"image_width": "width", "image_height": "height", "K": "k", "D": "d"}
    more = {name: root[key] for name, key in names.items() if name not in root and key in root}
    return {**root, **more}


def _read_kalibr(path: Path, root: Mapping[str, Any], name: str | None = None) -> list[Camera]:
    named = sorted(
        (key for key in root if re.fullmatch(r"cam\d+", key)), key=lambda key: int(key[3:])
    )
    wanted = [field for field in named if name == field] or named
    return [_kalibr_camera(path, field, root[field]) for field in wanted]


def _kalibr_camera(path: Path, field: str, node: Any) -> Camera:
    """One camera of a chain; or one by itself, as the data sets of EuRoC have it."""
    within = f"{field}." if field else ""
    if not isinstance(node, dict):
        raise _bad(path, "expected the parameters of a camera", field)
    _no_other_lens(path, node, within)
    model, lens_model = node.get("camera_model"), str(node.get("distortion_model") or "").lower()
    if model != "pinhole":
        raise _bad(path, "expected pinhole", f"{within}camera_model", str(model or ""))
    known = _PINHOLE_LENSES | _FISHEYE_LENSES
    if lens_model not in known | _NO_LENS:
        wanted = " or ".join(sorted(known))
        raise _bad(path, f"expected {wanted}", f"{within}distortion_model", lens_model)
    focal = _numbers(path, node.get("intrinsics"), f"{within}intrinsics", (4,))
    size = _numbers(path, node.get("resolution"), f"{within}resolution", (2,))
    parameters = np.concatenate([focal, np.zeros(5)])
    if lens_model not in _NO_LENS:
        key = "distortion_coeffs" if field else "distortion_coefficients"
        values = _numbers(path, node.get(key), within + key, (4, 5))
        if lens_model in _FISHEYE_LENSES:
            parameters = fisheye_parameters(focal, values[:4])
        else:
            parameters = rational_parameters(focal, _lens(path, values, within + key))
    return _made(path, field or path.stem, (int(size[0]), int(size[1])), parameters)


def _read_camodocal(path: Path, root: Mapping[str, Any]) -> Camera:
    """A camera of camodocal, as VINS and others have it."""
    _no_other_lens(path, root)
    if str(root.get("model_type")).upper() != "PINHOLE":
        raise _bad(path, "expected PINHOLE", "model_type", str(root.get("model_type")))
    groups = (
        ("projection_parameters", ("fx", "fy", "cx", "cy")),
        ("distortion_parameters", ("k1", "k2", "p1", "p2")),
    )
    values = [
        _numbers(path, [(root.get(group) or {}).get(key)], f"{group}.{key}", (1,))
        for group, keys in groups
        for key in keys
    ]
    size = [_whole(path, root.get(key), key) for key in ("image_width", "image_height")]
    name = root.get("camera_name")
    shown = name if isinstance(name, str) else path.stem
    return _made(path, shown, (size[0], size[1]), np.concatenate([*values, [0.0]]))


def _read_bouguet(path: Path, data: bytes) -> Camera:
    from scipy.io import loadmat  # noqa: PLC0415  (only this format needs it)

    try:
        stream: Any = io.BytesIO(data)
        found = loadmat(stream)
    except Exception as error:  # noqa: BLE001  (scipy raises many kinds for broken files)
        raise _bad(path, f"not a MATLAB file: {error}") from None
    if "fc_left" in found or "om" in found:
        raise _bad(path, "a file of two cameras; give each camera its own Calib_Results.mat")
    if np.size(found.get("kc", ())) == 4:
        raise _bad(path, f"the coefficients of the toolbox's fisheye lens; {_BROWN}", "kc")
    values = {}
    for key, count in (("fc", 2), ("cc", 2), ("kc", 5), ("nx", 1), ("ny", 1)):
        if key not in found or np.size(found[key]) != count:
            raise _bad(path, f"expected {count} numbers", key)
        values[key] = np.ravel(found[key]).astype(float)
    if "alpha_c" in found and np.any(np.abs(found["alpha_c"]) > 1e-12):
        raise _bad(path, "a skew is not supported", "alpha_c")
    covariance = np.zeros((9, 9))
    if all(np.size(found.get(f"{k}_error", ())) == n for k, n in (("fc", 2), ("cc", 2), ("kc", 5))):
        # The toolbox states about three standard deviations.
        errors = np.concatenate([np.ravel(found[f"{k}_error"]) for k in ("fc", "cc", "kc")])
        covariance = np.diag((errors.astype(float) / 3) ** 2)
    parameters = np.concatenate([values["fc"], values["cc"], values["kc"]])
    size = int(values["nx"][0]), int(values["ny"][0])
    return Camera(path.stem, size, parameters, covariance)
